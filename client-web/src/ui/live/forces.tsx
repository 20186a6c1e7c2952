// What the hand feels, beside what the clay does to the tool: on a good connection the same.

import { useComputed, useSignal } from "@preact/signals";
import type { JSX } from "preact";
import type { Vector } from "../../protocol/session";
import { Channel } from "../../protocol/telemetry";
import { fixed } from "../format";
import { useFrame } from "../frame";
import { live, operating } from "../store";
import { length } from "./moment";

/** Numbers that change faster cannot be read, ms. */
const READABLE_MS = 120;
/** Least force for which a difference in per cent says something, N. */
const LEAST_N = 0.05;

interface Reading {
  readonly hand_n: number;
  readonly felt_n: number;
  readonly tool_n: number;
  /** Length of the difference of the two vectors. */
  readonly apart_n: number;
}

export function Forces(): JSX.Element {
  const reading = useSignal<Reading | undefined>(undefined);
  const last_ms = useSignal(0);
  useFrame((now_ms) => {
    if (now_ms - last_ms.peek() < READABLE_MS) return;
    last_ms.value = now_ms;
    reading.value = read();
  });
  /** Only a copy of the clay can hide a force. */
  const hidden_n = useComputed(() => {
    const hidden = live.session.value?.scheme === "replica" ? live.tool.value?.hidden_force_n : undefined;
    return hidden === undefined ? undefined : length(hidden);
  });
  const { hand_n, felt_n, tool_n, apart_n } = reading.value ?? {};
  const share = tool_n !== undefined && apart_n !== undefined && LEAST_N < tool_n ? (100 * apart_n) / tool_n : undefined;
  return (
    <dl class="forces" aria-label="Forces now">
      <div class="hand"><dt>hand</dt><dd data-testid="hand-force">{fixed(hand_n, 2)}<small> N</small></dd></div>
      <div class="felt"><dt>felt</dt><dd data-testid="felt-force">{fixed(felt_n, 2)}<small> N</small></dd></div>
      <div class="tool"><dt>on the tool</dt><dd data-testid="tool-force">{fixed(tool_n, 2)}<small> N</small></dd></div>
      {hidden_n.value === undefined
        ? (
          <div class="apart" title="felt less the force on the tool, as vectors; in per cent of the latter">
            <dt>apart</dt>
            <dd>{fixed(apart_n, 2)}<small> N{share === undefined ? "" : ` · ${fixed(share, 0)} %`}</small></dd>
          </div>
        )
        : (
          <div class="apart" title="felt force less what the server's own clay would have answered to the same motion, at the same time">
            <dt>hidden by the copy</dt>
            <dd data-testid="hidden-force">{fixed(hidden_n.value, 2)}<small> N</small></dd>
          </div>
        )}
    </dl>
  );
}

/** Of a tool that this page holds, hand and felt force are those of its own loop. */
function read(): Reading | undefined {
  const { history } = live;
  const own = live.tool.peek()?.id === operating.tool.peek() ? operating.hand.peek()?.state : undefined;
  if (history.isEmpty && own === undefined) return undefined;
  const told = (channel: number): Vector => (history.isEmpty ? [0, 0, 0] : history.latestVector(channel));
  const tool = told(Channel.tool_force_n);
  const hand = own?.hand_force_n ?? told(Channel.hand_force_n);
  const felt = own?.felt_force_n ?? told(Channel.felt_force_n);
  return {
    hand_n: length(hand),
    felt_n: length(felt),
    tool_n: length(tool),
    apart_n: length([felt[0] - tool[0], felt[1] - tool[1], felt[2] - tool[2]]),
  };
}
