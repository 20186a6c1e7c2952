// Numbers as an instrument shows them: a fixed number of places, a true minus sign, a dash where there is nothing.

export const DASH = "–";

/** With `places` after the point. */
export function fixed(value: number | undefined, places: number): string {
  if (value === undefined || !Number.isFinite(value)) return DASH;
  const text = value.toFixed(places);
  // A rounded −0.00 is 0.00.
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

/** Three digits that matter, for quantities that range over decades. */
export function significant(value: number | undefined, digits = 3): string {
  if (value === undefined || !Number.isFinite(value)) return DASH;
  if (value === 0) return "0";
  const places = digits - 1 - Math.floor(Math.log10(Math.abs(value)));
  return fixed(value, Math.min(Math.max(places, 0), 6));
}

/** Seconds in the unit that suits them. */
export function duration(seconds: number | undefined): { text: string; unit: string } {
  if (seconds === undefined || !Number.isFinite(seconds)) return { text: DASH, unit: "ms" };
  if (seconds < 1e-3) return { text: significant(seconds * 1e6), unit: "µs" };
  if (seconds < 1) return { text: significant(seconds * 1e3), unit: "ms" };
  return { text: significant(seconds), unit: "s" };
}

/** What something takes on a disk: `"1.23 MB"`, of a thousand thousand bytes. */
export function dataSize(bytes: number): string {
  if (bytes < 1000) return `${count(bytes)} B`;
  for (const [unit, size] of [["kB", 1e3], ["MB", 1e6], ["GB", 1e9]] as const) {
    // 999.6 of one unit would be shown as 1000 of them, and is 1.00 of the next.
    if (bytes < 999.5 * size) return `${significant(Math.max(bytes / size, 1))} ${unit}`;
  }
  return `${significant(bytes / 1e12)} TB`;
}

/** A moment of a session as a clock shows it, to the second: `1:05`, `1:00:05`. */
export function clock(time_s: number): string {
  const [hours, minutes, seconds] = [Math.floor(time_s / 3600), Math.floor(time_s / 60) % 60, Math.floor(time_s) % 60];
  const two = (n: number): string => String(n).padStart(2, "0");
  return hours === 0 ? `${minutes}:${two(seconds)}` : `${hours}:${two(minutes)}:${two(seconds)}`;
}

/** Thousands apart, so that 1234567 can be read. */
export function count(value: number): string {
  return Math.round(value).toLocaleString("en").replaceAll(",", " ");
}

/** A setting as it stands in its field: no more digits than it has. */
export function plain(value: number): string {
  if (value !== 0 && (Math.abs(value) < 1e-3 || 1e6 <= Math.abs(value))) {
    return value.toExponential(3).replace(/\.?0+e/, "e").replace("e+", "e");
  }
  return String(Number(value.toPrecision(6)));
}
