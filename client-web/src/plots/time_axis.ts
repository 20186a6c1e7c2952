// How moments are written along a plot: as seconds before now while it follows, as the session's own time once it is
// held.

export type Clock = "session" | "before now";

/** From tick to tick, s: what reads well as decimals and, above, as minutes. */
export const TICKS_S = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120];

/** A label for each of the ticks, s, of an axis `span_s` long. */
export function timeAxis(splits: readonly number[], clock: Clock, span_s: number): string[] {
  const step_s = 1 < splits.length ? splits[1] - splits[0] : 1;
  const places = step_s < 0.099 ? 2 : step_s < 0.99 ? 1 : 0;
  if (clock === "session") return splits.map((time_s) => sessionTime(time_s, places));
  return splits.map((time_s) => {
    if (Math.abs(time_s) < 1e-9) return "now";
    // At the very edge a label would be cut.
    if (time_s < -0.999 * span_s) return "";
    return 90 <= span_s ? `−${sessionTime(-time_s, 0)}` : `${time_s.toFixed(places).replace("-", "−")} s`;
  });
}

/** A moment as `1:05.20`, or `1:00:05`. */
export function sessionTime(time_s: number, places: number): string {
  if (time_s < 0) return "";
  const scale = 10 ** places;
  const whole = Math.round(time_s * scale);
  const rest = (whole % (60 * scale)) / scale;
  const minutes = Math.floor(whole / (60 * scale));
  const seconds = rest.toFixed(places).padStart(places === 0 ? 2 : places + 3, "0");
  return minutes < 60 ? `${minutes}:${seconds}` : `${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, "0")}:${seconds}`;
}

/** A value at a tick of the other axis, with a true minus sign. */
export function valueText(value: number): string {
  return String(Number(value.toPrecision(6))).replace("-", "−");
}
