// Reads a recording from front to back, and shows moments of it meanwhile: what somebody waits for comes first.

import type { FilmModule } from "../protocol/film_module";
import type { FromFilm, Plot, ToFilm } from "./port";
import type { Source } from "./source";

/** While it is read, what is known is told so often, ms. */
const TELL_MS = 200;
/** On a long way a newer wish is heard so often, ms. */
const BREATHE_MS = 20;

export interface Hall {
  readonly module: Pick<FilmModule, "push" | "seek" | "give" | "facts" | "moment" | "envelope" | "bricks">;
  readonly source: Source;
  readonly post: (message: FromFilm) => void;
  readonly now_ms: () => number;
  /** Lets messages that wait come in. */
  readonly breathe: () => Promise<void>;
}

export class Projector {
  readonly #hall: Hall;
  #grows: boolean;
  #wished_s: number | undefined;
  readonly #plots = new Map<string, Plot>();
  /** Bytes that the module has. */
  #read = 0;
  #isRead = false;
  #told_ms = Number.NEGATIVE_INFINITY;
  #marks = 0;
  #isRunning = false;

  constructor(hall: Hall, grows: boolean) {
    this.#hall = hall;
    this.#grows = grows;
  }

  take(message: Exclude<ToFilm, { type: "open" }>): void {
    if (message.type === "seek") this.#wished_s = message.at_s;
    else if (message.type === "plot") this.#plots.set(message.name, message.plot);
    else {
      this.#isRead = false;
      this.#grows = message.grows;
    }
    void this.run();
  }

  /** Goes on until there is nothing to do. */
  async run(): Promise<void> {
    if (this.#isRunning) return;
    this.#isRunning = true;
    while (await this.#step()) await this.#hall.breathe();
    this.#isRunning = false;
  }

  async #step(): Promise<boolean> {
    try {
      if (this.#wished_s !== undefined) await this.#show(this.#wished_s);
      else if (0 < this.#plots.size) this.#plot();
      else if (!this.#isRead) await this.#readOn();
      else return false;
    } catch (error) {
      // A wish that cannot be answered is over, and so is reading.
      if (this.#wished_s === undefined) this.#isRead = true;
      this.#wished_s = undefined;
      this.#tell();
      this.#hall.post({ type: "trouble", says: error instanceof Error ? error.message : String(error) });
    }
    return true;
  }

  async #show(at_s: number): Promise<void> {
    const { module, source, post, breathe, now_ms } = this.#hall;
    let want = module.seek(at_s);
    let breathed_ms = now_ms();
    while (want !== undefined) {
      const bytes = await source.exactly(want.offset, want.length);
      if (BREATHE_MS <= now_ms() - breathed_ms) {
        await breathe();
        breathed_ms = now_ms();
      }
      // Somebody wants to be elsewhere by now; what was read for the way counts.
      want = this.#wished_s === at_s ? module.give(bytes) : undefined;
    }
    if (this.#wished_s !== at_s) return;
    this.#wished_s = undefined;
    for (const bytes of module.bricks()) post({ type: "bricks", bytes });
    post({ type: "moment", moment: module.moment(), asked_s: at_s });
  }

  #plot(): void {
    const { module, post } = this.#hall;
    for (const [name, plot] of this.#plots) {
      const envelopes = plot.channels.map((channel) => module.envelope(plot.tool, channel, plot.from_s, plot.to_s, plot.columns));
      post({ type: "plot", name, plot, envelopes });
    }
    this.#plots.clear();
  }

  async #readOn(): Promise<void> {
    const { module, source, now_ms } = this.#hall;
    const piece = await source.from(this.#read);
    const isEnd = piece.length === 0;
    if (!isEnd || !this.#grows) {
      this.#read += piece.length;
      module.push(piece);
    }
    this.#isRead = isEnd;
    if (isEnd || TELL_MS <= now_ms() - this.#told_ms) this.#tell();
  }

  #tell(): void {
    const { module, source, post, now_ms } = this.#hall;
    this.#told_ms = now_ms();
    const facts = module.facts(this.#marks);
    this.#marks += facts.marks.length;
    post({ type: "facts", facts, size: source.size, isRead: this.#isRead });
  }
}
