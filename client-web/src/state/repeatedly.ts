// Something that is looked at again and again.

import type { Platform } from "./platform";

/** Looks at once, and `pause_ms` after each look; returns what ends that. */
export function repeatedly(platform: Platform, pause_ms: number, look: () => Promise<void>): () => void {
  let cancel = (): void => undefined;
  let goesOn = true;
  const turn = async (): Promise<void> => {
    await look();
    if (goesOn) cancel = platform.after(pause_ms, () => void turn());
  };
  void turn();
  return () => {
    goesOn = false;
    cancel();
  };
}
