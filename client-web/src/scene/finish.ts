// When the last frame is finished: drawing goes on after the page has asked for it, and no command may wait for that.

/** Between two looks, ms: a few per frame of a machine that is slow enough to be looked at. */
const LOOK_EVERY_MS = 4;

export class Finish {
  readonly #context: WebGL2RenderingContext;
  readonly #onFinish: (duration_ms: number) => void;
  #fence: WebGLSync | null = null;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #began_ms = 0;

  constructor(context: WebGL2RenderingContext, onFinish: (duration_ms: number) => void) {
    this.#context = context;
    this.#onFinish = onFinish;
  }

  /** Whether a frame is still being drawn. */
  get isAhead(): boolean {
    return this.#fence !== null;
  }

  /** To be called when all commands of a frame are given that began at `began_ms`. */
  awaitFrame(began_ms: number): void {
    this.#forget();
    this.#began_ms = began_ms;
    this.#fence = this.#context.fenceSync(this.#context.SYNC_GPU_COMMANDS_COMPLETE, 0);
    this.#context.flush();
    this.#timer = setTimeout(this.#look, LOOK_EVERY_MS);
  }

  dispose(): void {
    this.#forget();
  }

  readonly #look = (): void => {
    if (this.#fence === null) return;
    const context = this.#context;
    // A lost context has no fences any more; whatever it was drawing is over.
    if (!context.isContextLost() && context.getSyncParameter(this.#fence, context.SYNC_STATUS) !== context.SIGNALED) {
      this.#timer = setTimeout(this.#look, LOOK_EVERY_MS);
      return;
    }
    this.#forget();
    this.#onFinish(performance.now() - this.#began_ms);
  };

  #forget(): void {
    clearTimeout(this.#timer);
    this.#context.deleteSync(this.#fence);
    this.#fence = null;
  }
}
