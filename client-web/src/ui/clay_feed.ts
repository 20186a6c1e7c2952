// The clay worker, seen from the page. It outlives the view, so that leaving the page and coming back loses no clay.

import type { ClayUpdate, Detail, Meshes, ToWorker } from "../clay/port";

export class ClayFeed {
  readonly #worker = new Worker(new URL("../clay/worker.ts", import.meta.url), { type: "module" });
  #onMeshes: ((update: Meshes) => void) | undefined;

  constructor(detail: Detail, onTrouble: (says: string) => void) {
    this.#worker.onmessage = ({ data }: MessageEvent<ClayUpdate>) => {
      if (data.type === "trouble") onTrouble(data.says);
      else this.#onMeshes?.(data);
    };
    this.#post({ type: "detail", detail });
  }

  /** Passes a brick message on; its bytes are the worker's from here on. */
  send(bytes: ArrayBuffer): void {
    this.#post({ type: "bricks", bytes }, [bytes]);
  }

  /** Sends all meshes to `onMeshes`, and every change from here on. Returns what ends that. */
  watch(onMeshes: (update: Meshes) => void): () => void {
    this.#onMeshes = onMeshes;
    this.#post({ type: "everything" });
    return () => {
      if (this.#onMeshes === onMeshes) this.#onMeshes = undefined;
    };
  }

  /** Gives the worker's memory back. */
  end(): void {
    this.#onMeshes = undefined;
    this.#worker.terminate();
  }

  #post(message: ToWorker, owned: Transferable[] = []): void {
    this.#worker.postMessage(message, owned);
  }
}
