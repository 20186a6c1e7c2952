// One animation frame loop for the whole page.

import { useEffect } from "preact/hooks";
import { processorDraws } from "../scene/quality";

/**
 * Where the processor draws, the page leaves most of it to whatever else runs there, perhaps the loop itself: frames
 * come this far apart, ms, and everything that moves does so in one of them.
 */
const SPARING_MS = 80;

const callbacks = new Set<(now_ms: number) => void>();
let running = false;

/** Calls `draw` before each display frame for as long as the component lives. */
export function useFrame(draw: (now_ms: number) => void): void {
  useEffect(() => onFrame(draw), []);
}

/** Calls `draw` before each display frame; returns what ends that. */
export function onFrame(draw: (now_ms: number) => void): () => void {
  callbacks.add(draw);
  if (!running) {
    running = true;
    requestAnimationFrame(tick);
  }
  return () => callbacks.delete(draw);
}

function tick(now_ms: number): void {
  for (const draw of callbacks) draw(now_ms);
  running = 0 < callbacks.size;
  if (!running) return;
  if (processorDraws()) setTimeout(() => requestAnimationFrame(tick), SPARING_MS);
  else requestAnimationFrame(tick);
}
