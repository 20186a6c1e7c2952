// One animation frame loop for the whole page.

import { useEffect } from "preact/hooks";

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
  if (running) requestAnimationFrame(tick);
}
