// Every margin of the loop, with what it is compared with; (33) and (34) each on its own.

import type { ReadonlySignal } from "@preact/signals";
import type { JSX } from "preact";
import type { DelayVerdict, LoopAnswer } from "../../protocol/theory";
import { milliseconds, type SchemeVerdict, type Verdict } from "../../theory/verdict";
import { DASH, fixed, significant } from "../format";
import { theory } from "../store";

interface Row {
  readonly test: string;
  readonly name: JSX.Element | string;
  readonly value: string;
  readonly says: string;
  readonly grade: "good" | "bad" | "plain";
}

export function Margins({ verdict }: { verdict: ReadonlySignal<Verdict | undefined> }): JSX.Element {
  const { answer } = theory.loop.asked.value;
  const schemes = verdict.value?.schemes ?? [];
  const rows = answer === undefined ? [] : [...schemes.map(delayRow), ...loopRows(answer)];
  return (
    <section class="panel margins" aria-label="Margins">
      <table>
        <caption class="hidden">Margins</caption>
        <tbody>
          {rows.map(({ test, name, value, says, grade }) => (
            <tr key={test} data-testid={test} data-grade={grade}>
              <th scope="row">{name}</th>
              <td class="value">{value}</td>
              <td class="says">{says}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </section>
  );
}

const VERDICTS: Record<DelayVerdict, string> = {
  unbounded: "none: stable at every delay",
  finite: "",
  unstable_without_delay: "none: unstable without delay",
  unstable_admittance: "none: the handle's copies part",
};

function delayRow({ scheme, verdict, margin_s, isStable }: SchemeVerdict): Row {
  const name = scheme === "position_force" ? "position–force" : "force exchange";
  return {
    test: `margin-${scheme}`,
    name: <><i class={`dash ${scheme}`} aria-hidden="true" /> delay margin, {name}</>,
    value: verdict === "finite" ? milliseconds(margin_s) : verdict === "unbounded" ? "∞" : DASH,
    says: verdict === "finite" ? (isStable ? "round trip that it bears" : "round trip that it bears; now it has more") : VERDICTS[verdict],
    grade: isStable ? "good" : "bad",
  };
}

function loopRows(answer: LoopAnswer): Row[] {
  const { gain_margin_increase: more, gain_margin_decrease: less, phase_margin: phase } = answer;
  const slowest = answer.closed_loop_poles.reduce<readonly [number, number] | undefined>((last, pole) =>
    last === undefined || last[0] < pole[0] ? pole : last, undefined);
  return [
    {
      test: "exact",
      name: "(33) least |1 + L|, exact",
      value: answer.nyquist_min_distance === null ? DASH : fixed(answer.nyquist_min_distance, 3),
      says: answer.stable_without_delay
        ? `stable without delay${answer.nyquist_min_omega_rad_s === null ? "" : `; nearest at ${significant(answer.nyquist_min_omega_rad_s)} rad/s`}`
        : "unstable without delay: the curve is on the wrong side of −1",
      grade: answer.stable_without_delay ? "good" : "bad",
    },
    {
      test: "sufficient",
      name: "(34) greatest |L|, only sufficient",
      value: answer.small_gain_peak === null ? "∞" : significant(answer.small_gain_peak),
      says: answer.small_gain_holds ? "below 1: stable whatever the phase" : "not below 1: says nothing either way",
      grade: answer.small_gain_holds ? "good" : "plain",
    },
    {
      test: "gain-margin",
      name: "gain margin",
      value: [more === null ? undefined : `×${significant(more.factor)}`, less === null ? undefined : `×${significant(less.factor)}`]
        .filter((text) => text !== undefined).join(", ") || "∞",
      says: more === null && less === null ? "no factor on the gain makes it lose its stability" : "factor on the loop gain at which stability is lost",
      grade: "plain",
    },
    {
      test: "phase-margin",
      name: "phase margin",
      value: phase === null ? "∞" : `${fixed((phase.phase_rad * 180) / Math.PI, 1)}°`,
      says: phase === null ? "the gain never passes 1" : `at ${significant(phase.omega_rad_s)} rad/s`,
      grade: "plain",
    },
    {
      test: "slowest-pole",
      name: "rightmost pole",
      value: slowest === undefined ? DASH : `${significant(slowest[0])}${slowest[1] === 0 ? "" : ` ± ${significant(Math.abs(slowest[1]))} j`}`,
      says: "rad/s, without delay",
      grade: "plain",
    },
    ...(answer.improper_compensators.length === 0 ? [] : [{
      test: "improper",
      name: "cannot be built",
      value: answer.improper_compensators.map((name) => name.toUpperCase().replace("_", "")).join(", "),
      says: "would have to differentiate: give C_h1 a steeper roll-off",
      grade: "bad" as const,
    }]),
  ];
}
