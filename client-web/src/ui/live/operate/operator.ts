// Who sits at this page, and what they may do about tools: take, give back, ask, hand over, stop.

import { computed, effect, signal, type ReadonlySignal } from "@preact/signals";
import { processorDraws } from "../../../scene/quality";
import { type Outcome, refusalOf } from "../../../state/api";
import { Asking } from "../../../state/asking";
import { type Me, toolRows, type ToolRow } from "../../../state/manners";
import { live, operating, wordInAddress } from "../../store";

const KEY = "teleclay.operator";
/** Nobody has to say who they are. */
export const NOBODY = "guest";
/** As the server counts. */
export const LONGEST_NAME = 64;
/** Where the processor draws as well, the page's own thread is told of a pointer half as often. */
const RATES_HZ = { card: 60, processor: 30 };

const typed = signal(remembered());
const asking = new Asking();
const answer = signal<string | undefined>(undefined);

/** As it stands in its field. */
export const operatorName: ReadonlySignal<string> = typed;
export const me: ReadonlySignal<Me> = computed(() => ({ name: name(), tool: operating.tool.value }));
export const rows: ReadonlySignal<readonly ToolRow[]> = computed(() => {
  const session = live.session.value;
  return session === undefined ? [] : toolRows(session, me.value);
});
/** What became of the last thing that was asked of the server, where that is worth saying. */
export const said: ReadonlySignal<string | undefined> = answer;
/** Pointers move the view, and not the hand. */
export const isViewed = signal(false);
/** One press holds, the next lets go. */
export const isLatched = signal(false);
/** The gamepad that is plugged in, if one is. */
export const pad = signal<string | undefined>(undefined);
/** Force at which a gamepad rumbles as much as it can, N; 0 for no rumble. */
export const rumbleFull_n = signal(4);

/** A page without storage starts over each time. */
function remembered(): string {
  try {
    return localStorage.getItem(KEY) ?? "";
  } catch {
    return "";
  }
}

export function setName(next: string): void {
  typed.value = next.slice(0, LONGEST_NAME);
  try {
    localStorage.setItem(KEY, typed.value);
  } catch {
    // The name holds for as long as the page does.
  }
}

export function takeTool(): void {
  const session = live.session.peek();
  if (session === undefined || operating.standing.peek().name !== "out") return;
  answer.value = undefined;
  asking.forget();
  const device = matchMedia("(pointer: coarse)").matches ? "finger on a page" : "mouse on a page";
  const rate_hz = processorDraws() ? RATES_HZ.processor : RATES_HZ.card;
  operating.operate(session.id, name(), { name: device, axes: session.axes, force_n: 0, rate_hz, measures_force: false });
}

export async function ask(tool: number): Promise<void> {
  asking.ask(tool);
  if (!await tell((session) => live.api.request(session, tool, name()))) asking.forget();
}

export async function withdraw(tool: number): Promise<void> {
  asking.forget();
  await tell((session) => live.api.withdraw(session, tool, name()));
}

export async function handOver(tool: number, operator: string): Promise<void> {
  await tell((session) => live.api.grant(session, tool, operator));
}

export async function deny(tool: number, operator: string): Promise<void> {
  await tell((session) => live.api.deny(session, tool, operator));
}

/** The hand here lets go at once, whatever becomes of the request. */
export async function stop(): Promise<void> {
  operating.open();
  operating.onLetGo?.();
  const isDone = await tell((session) => live.api.stop(session, name(), "stopped on the page"));
  if (!isDone) answer.value = `The stop did not reach the session: ${answer.value ?? "no answer"}. The hand on this page has let go.`;
}

export async function clearStop(): Promise<void> {
  await tell((session) => live.api.clearStop(session, name()));
}

/** What goes on while nobody presses anything; called once. */
export function followOperator(): void {
  effect(() => operating.leaveUnless(live.session.value?.id));
  effect(() => {
    if (operating.tool.value !== undefined) live.showTool(operating.tool.value);
  });
  effect(() => {
    switch (asking.look(rows.value)) {
      case "given": takeTool(); break;
      case "gone": answer.value = "The tool that was asked for is no longer held by whoever was asked."; break;
      case "ended": answer.value = "The request has ended: it was denied, or nobody answered in time."; break;
      case undefined: break;
    }
  });
  let isWanted = wordInAddress("operate") === "1";
  effect(() => {
    if (!isWanted || !live.isCurrent.value || live.session.value === undefined) return;
    isWanted = false;
    takeTool();
  });
  addEventListener("pagehide", () => operating.release());
}

function name(): string {
  const words = typed.value.trim().replace(/ +/gu, " ");
  return words === "" ? NOBODY : words;
}

/** Whether it was done; why not is said. */
async function tell(what: (session: string) => Promise<Outcome>): Promise<boolean> {
  const session = live.session.peek();
  if (session === undefined) return false;
  const outcome = await what(session.id);
  answer.value = refusalOf(outcome);
  live.adopt(outcome);
  return outcome.kind === "done";
}
