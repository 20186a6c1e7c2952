// One animation frame loop for the whole page.

import { useEffect } from "preact/hooks";
import { processorDraws } from "../scene/quality";
import { rest } from "../scene/rest";

/**
 * Where the processor draws, the page leaves much of it to whatever else runs there, perhaps the loop itself: frames
 * come no closer than this, wait for the rest after a 3-D picture, though not longer than that, and everything that
 * moves does so in one of them, ms.
 */
const LEAST_MS = 60;
const MOST_MS = 160;
const LOOK_EVERY_MS = 8;

const callbacks = new Set<(now_ms: number) => void>();
let running = false;
let last_ms = 0;

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
  last_ms = performance.now();
  for (const draw of callbacks) draw(now_ms);
  running = 0 < callbacks.size;
  if (!running) return;
  if (processorDraws()) setTimeout(awaitTurn, LOOK_EVERY_MS);
  else requestAnimationFrame(tick);
}

function awaitTurn(): void {
  const now_ms = performance.now();
  const passed_ms = now_ms - last_ms;
  if (MOST_MS <= passed_ms || (LEAST_MS <= passed_ms && rest.isOver(now_ms))) requestAnimationFrame(tick);
  else setTimeout(awaitTurn, LOOK_EVERY_MS);
}
