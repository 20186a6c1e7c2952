// The worker that reads a recording, seen from the page. There is one for each recording that is opened.

import type { FromFilm, ToFilm } from "../film/port";
import type { FilmPort } from "../state/film";

export class FilmFeed implements FilmPort {
  readonly #worker = new Worker(new URL("../film/worker.ts", import.meta.url), { type: "module" });
  onMessage: (message: FromFilm) => void = () => undefined;

  constructor() {
    this.#worker.onmessage = ({ data }: MessageEvent<FromFilm>) => this.onMessage(data);
    // Also when its own file cannot be had.
    this.#worker.onerror = () => this.onMessage({ type: "trouble", says: "the page's worker did not start" });
  }

  post(message: ToFilm): void {
    this.#worker.postMessage(message);
  }

  end(): void {
    this.#worker.terminate();
  }
}
