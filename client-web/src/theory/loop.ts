// The loop of [KHMH03] under a round trip, as far as the page draws it itself: the server gives margins, which do not
// depend on the round trip; what the loop does at that of the slider is found here, by the module. SI units, rad/s.

import { ModuleRefusal } from "../protocol/instance";
import type { DelayedScheme, GainCurve, MathematicsModule, Outlook } from "../protocol/mathematics";
import type { TransferFunction } from "../protocol/theory";

export interface LoopParts {
  readonly g_h: TransferFunction;
  readonly c_h1: TransferFunction;
  /** N per m. */
  readonly t_h: readonly number[];
  readonly position_ratio: number;
  readonly force_ratio: number;
  readonly clay_damping_n_s_per_m: number;
  readonly clay_stiffness_n_per_m: number;
}

/** A motion that grows by itself. */
export interface Growth {
  /** Of its envelope, 1/s. */
  readonly rate_per_s: number;
  /** 0: it grows without swinging. */
  readonly frequency_hz: number;
  /** Gain of the path that the delay is in, at this frequency. */
  readonly gain: number;
}

/** A loop that can be asked what it does at any round trip. */
export interface DelayedLoop {
  /**
   * The greatest gain of the path that the delay is in, over all frequencies; the motion that grows fastest, if one
   * does.
   */
  outlook: (scheme: DelayedScheme, round_trip_s: number) => { readonly peakGain: number; readonly growth: Growth | undefined };
  /** The loop gain: the loop loses its stability where this passes -1. */
  curve: (scheme: DelayedScheme, round_trip_s: number) => GainCurve;
}

/** Nothing where the parts make no loop: then the server has more to say about it. */
export function loopOf(module: MathematicsModule, parts: LoopParts): DelayedLoop | undefined {
  const list = (coefficients: readonly number[]): number[] => [coefficients.length, ...coefficients];
  const numbers = [
    ...list(parts.g_h.numerator), ...list(parts.g_h.denominator), ...list(parts.c_h1.numerator), ...list(parts.c_h1.denominator),
    ...list(parts.t_h), parts.position_ratio, parts.force_ratio, parts.clay_damping_n_s_per_m, parts.clay_stiffness_n_per_m,
  ];
  // The module looks at one loop at a time, and there may be others.
  const asked = <T>(question: () => T): T => {
    module.setLoop(numbers);
    return question();
  };
  try {
    asked(() => undefined);
  } catch (error) {
    if (error instanceof ModuleRefusal) return undefined;
    throw error;
  }
  return {
    outlook: (scheme, round_trip_s) => readable(asked(() => module.outlook(scheme, round_trip_s))),
    curve: (scheme, round_trip_s) => asked(() => module.curve(scheme, round_trip_s)),
  };
}

function readable({ peak_gain, rate_per_s, frequency_hz, gain_there }: Outlook): ReturnType<DelayedLoop["outlook"]> {
  return { peakGain: peak_gain, growth: Number.isNaN(rate_per_s) ? undefined : { rate_per_s, frequency_hz, gain: gain_there } };
}
