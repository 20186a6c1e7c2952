// A number that a person typed into a field of some unit: read when it has one meaning, and otherwise refused with a
// reason.

import { isUnit, perUnit } from "./units";

/** How a field shows a quantity. */
export interface Unit {
  readonly unit: string;
  /** Shown value per SI value: 1000 for milliseconds. */
  readonly factor: number;
}

export type Typed =
  /** `unit` is the one that was written, or the field's. */
  | { readonly kind: "number"; readonly si: number; readonly unit: Unit }
  | { readonly kind: "refused"; readonly reason: string };

/** Reads what stands in a field. */
export function readTyped(text: string, ofField: Unit): Typed {
  const plain = plainText(text);
  const quoted = `“${text.trim()}”`;
  if (plain === "") return refused("a number is missing");
  if (/^[+-]?\s*(∞|inf(inity)?|nan)\b|^[+-]?\s*∞/i.test(plain)) return refused(`${quoted} is not a finite number`);
  const parts: Partial<Record<string, string>> | undefined = NUMBER.exec(plain)?.groups;
  const { sign = "", mantissa = "", e, ten, unit: written } = parts ?? {};
  const read = readMantissa(mantissa);
  if (read.kind === "none") return refused(`${quoted} is not a number`);
  if (read.kind === "two") {
    const rest = plain.slice(plain.indexOf(mantissa) + mantissa.length);
    const [either, or] = [read.either, read.or].map((digits) => `${sign}${digits}${rest}`);
    return refused(`${quoted} could mean ${either} or ${or}: write ${either} or ${or}`);
  }
  const unit = readUnit(written, ofField);
  if (unit === undefined) return refused(isUnit(ofField.unit) ? `${quoted} is not in ${ofField.unit}` : `${quoted} is more than a number`);
  const value = Number(`${sign}${read.digits}e${e ?? ten ?? "0"}`);
  if (!Number.isFinite(value)) return refused(`${quoted} is too large`);
  // Twelve digits: what a field shows and what is typed stay the same number on their way through the unit.
  return { kind: "number", si: Number((value / unit.factor).toPrecision(12)), unit };
}

/** A value with its unit, as a person would write it: `3000 ms`. A ratio has no unit worth saying. */
export function say(si: number, { unit, factor }: Unit): string {
  return isUnit(unit) ? `${sayBare(si, factor)} ${unit}` : sayBare(si, factor);
}

/** That a value lies outside of a range, all of it in one unit: `3000 ms is not from 0 to 2000 ms`. */
export function outOfRange(si: number, least: number, greatest: number, unit: Unit): string {
  return `${say(si, unit)} is not from ${sayBare(least, unit.factor)} to ${say(greatest, unit)}`;
}

function sayBare(si: number, factor: number): string {
  const value = Number((si * factor).toPrecision(12));
  const size = Math.abs(value);
  const text = value !== 0 && (size < 1e-4 || 1e7 <= size) ? value.toExponential().replace("e+", "e") : String(value);
  return text.replaceAll("-", "−");
}

const refused = (reason: string): Typed => ({ kind: "refused", reason });

/** Sign, digits with what separates them, a power of ten as 2e5 or 2·10^5, and the rest. */
const NUMBER = /^(?<sign>[+-]?)\s*(?<mantissa>(?:\d|[.,](?=\d))(?:[\d.,']|\s(?=\d))*)(?:e(?<e>[+-]?\d+)|\s*[·×*x]\s*10\s*\^\s*(?<ten>[+-]?\d+))?\s*(?<unit>[^\d\s.,'+-]\D*)?$/i;

type Mantissa =
  | { readonly kind: "one"; readonly digits: string }
  | { readonly kind: "two"; readonly either: string; readonly or: string }
  | { readonly kind: "none" };

/**
 * Digits with one meaning. Spaces and apostrophes part thousands; a point or comma parts them where it comes twice, or
 * before the other one.
 */
function readMantissa(text: string): Mantissa {
  if (/^\d+$/.test(text)) return one(text);
  if (/^\d*[.,]\d*$/.test(text)) return text.includes(",") ? decimalComma(text) : one(text);
  const decimal: string | undefined = /([.,])\d*$/.exec(text)?.[1];
  for (const thousands of [" ", "'", ",", "."]) {
    if (!text.includes(thousands)) continue;
    // The same sign cannot do both, but for one that only parts thousands.
    const parted = (point: string): boolean =>
      new RegExp(`^\\d{1,3}(${escaped(thousands)}\\d{3})+${point === "" ? "" : `${escaped(point)}\\d*`}$`).test(text);
    if (parted("")) return one(text.replaceAll(thousands, ""));
    if (decimal !== undefined && decimal !== thousands && parted(decimal)) return one(text.replaceAll(thousands, "").replace(decimal, "."));
  }
  return { kind: "none" };
}

/** One comma. Three digits behind it, and one to three before it, may as well be thousands. */
function decimalComma(text: string): Mantissa {
  const decimal = text.replace(",", ".");
  if (!/^[1-9]\d{0,2},\d{3}$/.test(text)) return one(decimal);
  return { kind: "two", either: String(Number(decimal)), or: text.replace(",", "") };
}

const one = (digits: string): Mantissa => ({ kind: "one", digits });
const escaped = (sign: string): string => (sign === "." ? "\\." : sign);

function readUnit(written: string | undefined, ofField: Unit): Unit | undefined {
  if (written === undefined || written === ofField.unit) return ofField;
  const si = perUnit(written, ofField.unit);
  if (si === undefined) return undefined;
  return { unit: written, factor: 1 / si };
}

/** Digits, signs and spaces as ASCII has them; marks that nobody sees are gone. */
function plainText(text: string): string {
  return text
    .replaceAll(/[\u200b-\u200f\u202a-\u202e\u2060-\u2069\ufeff]/g, "")
    .replaceAll(/[\uff01-\uff5e]/g, (wide) => String.fromCharCode(wide.charCodeAt(0) - 0xfee0))
    .replaceAll(/[\u2010-\u2015\u2212\ufe63]/g, "-")
    .replaceAll(/[\u2018\u2019\u02bc]/g, "'")
    .replaceAll(/10([⁺⁻]?[⁰¹²³⁴-⁹]+)/g, (_, power: string) => `10^${Array.from(power, (digit) => RAISED[digit]).join("")}`)
    .replaceAll(/\s/g, " ")
    .trim();
}

const RAISED: Readonly<Record<string, string>> = {
  "⁺": "+", "⁻": "-", "⁰": "0", "¹": "1", "²": "2", "³": "3", "⁴": "4", "⁵": "5", "⁶": "6", "⁷": "7", "⁸": "8", "⁹": "9",
};
