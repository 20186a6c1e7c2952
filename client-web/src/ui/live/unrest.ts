// How restless a hand is: what a loop that feeds itself shows first. SI units.

/** Longer than a swing of the loop, shorter than a stroke. */
const WINDOW_S = 0.4;
/** Fewer windows make no median. */
const LEAST_WINDOWS = 4;

/**
 * How far a vector swings about its own mean within a window, root mean square; of the median window, so that the few
 * in which a stroke turns round do not count. `points` are x, y, z one after the other, `step_s` apart. Nothing when
 * they are too few.
 */
export function swingOf(points: readonly number[], step_s: number): number | undefined {
  const count = Math.floor(points.length / 3);
  const window = Math.round(WINDOW_S / step_s);
  const swings: number[] = [];
  for (let from = 0; from + window <= count; from += Math.ceil(window / 2)) swings.push(swingWithin(points, from, window));
  if (swings.length < LEAST_WINDOWS) return undefined;
  swings.sort((a, b) => a - b);
  return swings[Math.floor(swings.length / 2)];
}

function swingWithin(points: readonly number[], from: number, window: number): number {
  let sum = 0;
  for (let axis = 0; axis < 3; axis += 1) {
    let [mean, square] = [0, 0];
    for (let n = from; n < from + window; n += 1) mean += points[3 * n + axis] / window;
    for (let n = from; n < from + window; n += 1) square += (points[3 * n + axis] - mean) ** 2 / window;
    sum += square;
  }
  return Math.sqrt(sum);
}
