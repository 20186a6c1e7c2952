// What a loop does at a round trip, and why, in plain words: the server's margins put together with the motion that
// grows.

import type { DelayedScheme } from "../protocol/mathematics";
import type { DelayVerdict, LoopAnswer } from "../protocol/theory";
import type { DelayedLoop, Growth } from "./loop";

export interface SchemeVerdict {
  readonly scheme: DelayedScheme;
  readonly verdict: DelayVerdict;
  /** The round trip it bears, s; nothing unless the verdict is `finite`. */
  readonly margin_s: number | undefined;
  readonly isStable: boolean;
  readonly growth: Growth | undefined;
  /** Greatest gain of the path that the delay is in, over all frequencies. */
  readonly peakGain: number;
  /** A clause without a full stop, such as "position–force is past its margin of 85 ms: …". */
  readonly says: string;
  readonly because: string;
}

export interface Verdict {
  /** One plain sentence. */
  readonly headline: string;
  readonly schemes: readonly [SchemeVerdict, SchemeVerdict];
}

type Margins = Pick<LoopAnswer,
  "stable_without_delay" | "delay_margin_force_exchange_s" | "delay_verdict_force_exchange" |
  "delay_margin_position_force_s" | "delay_verdict_position_force">;

const NAMES: Record<DelayedScheme, string> = { position_force: "position–force", force_exchange: "force exchange" };

export function verdictOf(answer: Margins, loop: DelayedLoop, round_trip_s: number): Verdict {
  const position = schemeVerdict("position_force", answer, loop, round_trip_s);
  const force = schemeVerdict("force_exchange", answer, loop, round_trip_s);
  const headline = answer.stable_without_delay
    ? `At ${milliseconds(round_trip_s)} ${position.says}; ${force.says}.`
    : `Even without delay the loop is unstable${motion(loop.outlook("position_force", 0).growth)}.`;
  return { headline, schemes: [position, force] };
}

function schemeVerdict(scheme: DelayedScheme, answer: Margins, loop: DelayedLoop, round_trip_s: number): SchemeVerdict {
  const verdict = answer[`delay_verdict_${scheme}`];
  const margin_s = answer[`delay_margin_${scheme}_s`] ?? undefined;
  const isStable = verdict === "unbounded" || (margin_s !== undefined && round_trip_s < margin_s);
  const { peakGain, growth: grows } = loop.outlook(scheme, round_trip_s);
  const growth = isStable ? undefined : grows;
  return {
    scheme, verdict, margin_s, isStable, growth, peakGain,
    says: `${NAMES[scheme]} ${sayingOf(verdict, margin_s, isStable, growth)}`,
    because: reasonOf(scheme, verdict, isStable, peakGain, growth?.gain),
  };
}

function sayingOf(verdict: DelayVerdict, margin_s: number | undefined, isStable: boolean, growth: Growth | undefined): string {
  switch (verdict) {
    case "unbounded": return "is stable at every delay";
    case "unstable_without_delay": return `is unstable with or without it${motion(growth)}`;
    case "unstable_admittance": return `lets its two copies of the handle part as soon as there is any delay${motion(growth)}`;
    case "finite":
      return isStable
        ? `is within its margin of ${milliseconds(margin_s)} and settles`
        : `is past its margin of ${milliseconds(margin_s)}${motion(growth)}`;
  }
}

function reasonOf(
  scheme: DelayedScheme, verdict: DelayVerdict, isStable: boolean, peakGain: number, gainThere: number | undefined,
): string {
  const path = scheme === "position_force"
    ? "position goes forward, force comes back, and all of the clay's answer is late"
    : "each side answers its own force at once, and only the other side's is late";
  switch (verdict) {
    case "unstable_without_delay": return "The loop gain circles −1: handle, arm and clay feed one another even at once.";
    case "unstable_admittance": return "Each side moves a copy of the handle, and nothing that crosses the network holds the difference between the two.";
    case "unbounded":
      return `${capital(path)}; round that way the gain stays ${peakGain < 1 ? "below 1" : "small enough"} (at most ${gainText(peakGain)}), so ` +
        `no delay can make a swing feed itself.${scheme === "force_exchange" ? " What delay costs here is coordination: hand and tool drift apart." : ""}`;
    case "finite":
      return isStable
        ? `${capital(path)}; round that way the gain reaches ${gainText(peakGain)}, so there is a delay at which a swing comes back turned by half and feeds itself.`
        : `${capital(path)}: it comes back turned by half a swing or more, and round that way the gain is ` +
          `${gainThere === undefined ? "above 1" : gainText(gainThere)}, so each swing feeds the next.`;
  }
}

/** What grows, as the rest of a sentence; nothing where it grows too slowly to be seen. */
function motion(growth: Growth | undefined): string {
  if (growth === undefined) return "";
  const doubling_s = Math.LN2 / growth.rate_per_s;
  const doubling = doubling_s < 1 ? milliseconds(Number(doubling_s.toPrecision(2))) : `${doubling_s.toPrecision(2)} s`;
  if (growth.frequency_hz < 1e-3) return `: the loop runs away, twice as far every ${doubling}`;
  return `: the loop oscillates at ${growth.frequency_hz.toPrecision(2)} Hz and grows, twice as wide every ${doubling}`;
}

export function milliseconds(seconds: number | undefined): string {
  if (seconds === undefined) return "–";
  const ms = 1000 * seconds;
  return `${Number(ms.toPrecision(ms < 1000 ? 3 : 4))} ms`;
}

const capital = (text: string): string => text.charAt(0).toUpperCase() + text.slice(1);

/** A path that rings for ever has no greatest gain. */
const gainText = (gain: number): string => (Number.isFinite(gain) ? gain.toFixed(2) : "∞");
