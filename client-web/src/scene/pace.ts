// How finely to draw: as finely as the screen can show while frames keep up, coarser where the graphics card is slow.

/** Frames that are averaged before anything is changed, or as many as come in this time, ms. */
const FRAMES = 24;
const LONG_ENOUGH_MS = 1200;

/**
 * Durations of a frame, ms: above `tooSlow` it is drawn coarser, aiming at `wanted`; below `plenty` there is room for
 * more pixels.
 */
export interface PaceLimits {
  readonly tooSlow_ms: number;
  readonly wanted_ms: number;
  readonly plenty_ms: number;
}

/** From frame to frame: a longer one misses the display's next turn. */
export const DISPLAY: PaceLimits = { tooSlow_ms: 22, wanted_ms: 19, plenty_ms: 17.5 };
/**
 * From the first command to the last pixel, where the processor draws: a little less than half of one core's time at
 * twelve frames a second. Most of it goes into the clay's vertices, which coarser pixels spare nothing of.
 */
export const PROCESSOR: PaceLimits = { tooSlow_ms: 45, wanted_ms: 38, plenty_ms: 26 };

/** A pause this long is a hidden page or a scene at rest, not a slow frame, ms. */
const PAUSE_MS = 2500;
export const COARSEST = 0.4;

export class Pace {
  /** Share of the screen's own resolution, coarsest … 1. */
  scale: number;
  #last_ms: number | undefined;
  #sum_ms = 0;
  #frames = 0;
  /** Rises each time that finer drawing turned out too slow, so that it is tried less and less often. */
  #patience = 1;
  #calm = 0;

  readonly #coarsest: number;
  readonly #limits: PaceLimits;

  constructor(scale: number, coarsest: number, limits: PaceLimits) {
    this.scale = Math.max(scale, coarsest);
    this.#coarsest = coarsest;
    this.#limits = limits;
  }

  /** Takes the moment of a drawn frame in; returns whether the scale changed. */
  add(now_ms: number): boolean {
    const last_ms = this.#last_ms;
    this.#last_ms = now_ms;
    if (last_ms === undefined || PAUSE_MS < now_ms - last_ms) return false;
    return this.take(now_ms - last_ms);
  }

  /** Takes the duration of a frame in; returns whether the scale changed. */
  take(duration_ms: number): boolean {
    this.#sum_ms += duration_ms;
    this.#frames += 1;
    if (this.#frames < FRAMES && this.#sum_ms < LONG_ENOUGH_MS) return false;
    const mean_ms = this.#sum_ms / this.#frames;
    this.#sum_ms = 0;
    this.#frames = 0;
    return this.#adapt(mean_ms);
  }

  #adapt(mean_ms: number): boolean {
    const { tooSlow_ms, wanted_ms, plenty_ms } = this.#limits;
    if (tooSlow_ms < mean_ms && this.#coarsest < this.scale) {
      this.scale = Math.max(this.scale * Math.max(Math.sqrt(wanted_ms / mean_ms), 0.7), this.#coarsest);
      this.#patience = Math.min(this.#patience * 2, 64);
      this.#calm = 0;
      return true;
    }
    if (plenty_ms < mean_ms || 1 <= this.scale) return false;
    this.#calm += 1;
    if (this.#calm < this.#patience) return false;
    this.#calm = 0;
    this.scale = Math.min(this.scale * 1.15, 1);
    return true;
  }
}
