// A recording on show: how far it is read, the moment that is wished and the one that is there, and the clock that
// plays it.

import { batch, signal, type ReadonlySignal } from "@preact/signals-core";
import type { FromFilm, Place, Plot, ToFilm } from "../film/port";
import type { FilmFacts, FilmMoment, Mark } from "../protocol/film";

/** Times as fast as it was. */
export const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8] as const;
export type Speed = (typeof SPEEDS)[number];

/** The worker that reads it, and the one that makes meshes. */
export interface FilmPort {
  post(message: ToFilm): void;
  onMessage: (message: FromFilm) => void;
  /** Gives memory and threads back. */
  end(): void;
}

/** Curves of a plot, by channel: least and greatest of each column. */
export interface Drawn {
  readonly plot: Plot;
  readonly envelopes: readonly Float32Array[];
}

export class Film {
  readonly #port: FilmPort;
  readonly #facts = signal<FilmFacts | undefined>(undefined);
  readonly #size = signal<number | undefined>(undefined);
  readonly #isRead = signal(false);
  readonly #moment = signal<FilmMoment | undefined>(undefined);
  readonly #wished_s = signal(0);
  readonly #trouble = signal<string | undefined>(undefined);
  readonly #marks = signal<readonly Mark[]>([]);
  readonly #isPlaying = signal(false);
  readonly #speed = signal<Speed>(1);
  readonly #plots = signal<ReadonlyMap<string, Drawn>>(new Map());
  #grows: boolean;
  /** Asked for, and not there yet. */
  #asked_s: number | undefined;
  #ticked_ms: number | undefined;
  /** Bricks for whoever draws them. */
  onBricks: (bytes: ArrayBuffer) => void = () => undefined;

  constructor(port: FilmPort, place: Place, grows: boolean) {
    this.#port = port;
    this.#grows = grows;
    port.onMessage = (message) => batch(() => this.#take(message));
    port.post({ type: "open", place, grows });
  }

  /** Nothing before the first of it is read. */
  get facts(): ReadonlySignal<FilmFacts | undefined> {
    return this.#facts;
  }

  /** Bytes of the file, where they are known. */
  get size(): ReadonlySignal<number | undefined> {
    return this.#size;
  }

  /** Whether all that is there is read. */
  get isRead(): ReadonlySignal<boolean> {
    return this.#isRead;
  }

  /** What happened, in its order. */
  get marks(): ReadonlySignal<readonly Mark[]> {
    return this.#marks;
  }

  /** The moment that is shown. */
  get moment(): ReadonlySignal<FilmMoment | undefined> {
    return this.#moment;
  }

  /** The moment that is wished, s: where the slider stands. */
  get wished_s(): ReadonlySignal<number> {
    return this.#wished_s;
  }

  /** Why something cannot be shown, in a sentence without its full stop. */
  get trouble(): ReadonlySignal<string | undefined> {
    return this.#trouble;
  }

  get isPlaying(): ReadonlySignal<boolean> {
    return this.#isPlaying;
  }

  get speed(): ReadonlySignal<Speed> {
    return this.#speed;
  }

  /** By name, as they were asked for last. */
  get plots(): ReadonlySignal<ReadonlyMap<string, Drawn>> {
    return this.#plots;
  }

  get lasts_s(): number {
    return this.#facts.peek()?.lasts_s ?? 0;
  }

  seek(at_s: number): void {
    this.#wished_s.value = Math.min(Math.max(at_s, 0), this.lasts_s);
    this.#ask();
  }

  /** Earlier or later. */
  step(by_s: number): void {
    this.seek(this.#wished_s.peek() + by_s);
  }

  /** To the mark before or after the moment; to the ends where there is none. */
  toMark(direction: "before" | "after"): void {
    const at_s = this.#wished_s.peek();
    const places = this.#marks.peek().map((mark) => mark.at_s);
    const isBefore = direction === "before";
    const found = isBefore ? places.filter((place) => place < at_s - 1e-6).at(-1) : places.find((place) => at_s + 1e-6 < place);
    this.seek(found ?? (isBefore ? 0 : this.lasts_s));
  }

  /** From the beginning where it is at its end. */
  play(): void {
    if (this.lasts_s <= this.#wished_s.peek()) this.seek(0);
    this.#ticked_ms = undefined;
    this.#isPlaying.value = true;
  }

  pause(): void {
    this.#isPlaying.value = false;
  }

  setSpeed(speed: Speed): void {
    this.#speed.value = speed;
  }

  /** To be called before each frame. */
  tick(now_ms: number): void {
    const before_ms = this.#ticked_ms;
    this.#ticked_ms = now_ms;
    if (!this.#isPlaying.peek() || before_ms === undefined) return;
    // Where reading cannot keep up, time waits for it: nothing is left out.
    if (this.#asked_s !== undefined) return;
    const to_s = this.#wished_s.peek() + (this.#speed.peek() * Math.min(now_ms - before_ms, LONGEST_FRAME_MS)) / 1000;
    this.seek(to_s);
    if (this.lasts_s <= to_s && this.#isRead.peek()) this.pause();
  }

  plot(name: string, plot: Plot): void {
    this.#port.post({ type: "plot", name, plot });
  }

  /** Reads on where the file has grown. */
  more(grows: boolean): void {
    this.#grows = grows;
    this.#isRead.value = false;
    this.#port.post({ type: "more", grows });
  }

  /** Whether the file was still written when it was asked for. */
  get grows(): boolean {
    return this.#grows;
  }

  end(): void {
    this.pause();
    this.#port.onMessage = () => undefined;
    this.#port.end();
  }

  #ask(): void {
    const at_s = this.#wished_s.peek();
    this.#asked_s = at_s;
    this.#port.post({ type: "seek", at_s });
  }

  #take(message: FromFilm): void {
    switch (message.type) {
      case "facts": {
        const isFirst = this.#facts.peek() === undefined && 0 < message.facts.ticks;
        if (0 < message.facts.marks.length) this.#marks.value = [...this.#marks.peek(), ...message.facts.marks];
        if (0 < message.facts.ticks || message.isRead) this.#facts.value = message.facts;
        this.#size.value = message.size;
        this.#isRead.value = message.isRead;
        if (isFirst) this.#ask();
        break;
      }
      case "moment":
        this.#moment.value = message.moment;
        if (this.#asked_s === message.asked_s) this.#asked_s = undefined;
        break;
      case "bricks":
        this.onBricks(message.bytes);
        break;
      case "plot":
        this.#plots.value = new Map(this.#plots.peek()).set(message.name, { plot: message.plot, envelopes: message.envelopes });
        break;
      case "trouble":
        this.#trouble.value = message.says;
        this.#asked_s = undefined;
        this.pause();
        break;
    }
  }
}

/** A page that was out of sight goes on where it was, ms. */
const LONGEST_FRAME_MS = 250;
