// What the loop in this page does, in numbers.

import { useComputed, useSignal } from "@preact/signals";
import type { JSX } from "preact";
import type { Hand } from "../../../state/operating";
import { duration, fixed } from "../../format";
import { useFrame } from "../../frame";
import { live, operating } from "../../store";
import { graspWords } from "./words";

/** Numbers that change faster cannot be read, ms. */
const READABLE_MS = 120;

export function HandReadings(): JSX.Element | null {
  const shown = useSignal<Hand | undefined>(operating.hand.peek());
  const last_ms = useSignal(0);
  useFrame((now_ms) => {
    if (now_ms - last_ms.peek() < READABLE_MS) return;
    last_ms.value = now_ms;
    shown.value = operating.hand.peek();
  });
  const grasp = useComputed(() => operating.hand.value?.state.grasp);
  if (shown.value === undefined) return null;
  const { state, pace, rate_hz } = shown.value;
  const trip = duration(state.round_trip_s);
  return (
    <dl class="readings">
      <div class="wide"><dt>hand</dt><dd data-testid="grasp" data-grasp={grasp.value}>{grasp.value === undefined ? "" : graspWords(grasp.value)}</dd></div>
      <div title={`ticks a second in the page's worker, woken by ${pace.how === "precise" ? "exact sleeps" : "the browser's timers"}, at most ${pace.most_ticks} ticks at once`}>
        <dt>loop</dt><dd><span data-testid="loop-rate">{fixed(rate_hz, 0)}</span><small> /s</small></dd>
      </div>
      <div title="round trip from this hand to the server and back"><dt>round trip</dt><dd>{trip.text}<small> {trip.unit}</small></dd></div>
      <div title="height of the tool above the ground"><dt>height</dt><dd data-testid="tool-height">{fixed(1000 * state.tool_m[2], 1)}<small> mm</small></dd></div>
      {state.clay_hash !== undefined && <ClayHash state={state} hash={state.clay_hash} />}
    </dl>
  );
}

function ClayHash({ state, hash }: { readonly state: Hand["state"]; readonly hash: string }): JSX.Element {
  const clay = useComputed(() => live.session.value?.clay);
  const isSameBlock = clay.value?.epoch === state.clay_epoch;
  const verdict = clay.value === undefined
    ? undefined
    : isSameBlock ? (hash === clay.value.hash ? "same" : "differs") : "another block";
  return (
    <div class="wide" title="hash of the hand's copy of the clay, beside that of the server's; while somebody cuts, one is a little ahead of the other">
      <dt>copy of the clay</dt>
      <dd><code data-testid="clay-hash">{hash}</code>{verdict !== undefined && <small data-testid="clay-verdict" data-verdict={verdict}> {verdict}</small>}</dd>
    </div>
  );
}
