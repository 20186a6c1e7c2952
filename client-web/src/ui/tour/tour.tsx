// A tour of *Live* for who sees it for the first time. It stands beside the page and takes nothing from it: every
// control goes on working, and nothing waits for the tour, which is loaded when it is shown.

import { signal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect } from "preact/hooks";
import { live } from "../store";
import type * as card from "./card";
import type { Step } from "./steps";

const KEY = "teleclay.tour";
const SEEN = "seen";

type Parts = typeof card;

/** The step on show; nothing while there is no tour. */
const current = signal<{ readonly step: Step; readonly parts: Parts } | undefined>(undefined);
/** Somebody asked for it, so the keys may go to it. */
let isAsked = false;

/** `#/live?tour=1` shows the tour again, once. */
function isInAddress(): boolean {
  const [page, query] = location.hash.split("?");
  const words = new URLSearchParams(query);
  if (words.get("tour") !== "1") return false;
  words.delete("tour");
  history.replaceState(null, "", words.size === 0 ? page : `${page}?${words.toString()}`);
  return true;
}

function isFirstVisit(): boolean {
  try {
    return localStorage.getItem(KEY) !== SEEN;
  } catch {
    // A page that can keep nothing would show it each time.
    return false;
  }
}

function remember(): void {
  try {
    localStorage.setItem(KEY, SEEN);
  } catch {
    // Then the next visit is a first one, too.
  }
}

/** A tour that does not load is none: it is missed by nobody who works. */
async function begin(): Promise<void> {
  try {
    const parts = await import("./card");
    const step = parts.firstStep();
    current.value = step === undefined ? undefined : { step, parts };
  } catch (error) {
    if (isAsked) live.report("warning", `the tour did not load: ${error instanceof Error ? error.message : String(error)}`);
  }
}

function close(): void {
  current.value = undefined;
  remember();
}

export function TourButton(): JSX.Element {
  const toggle = (): void => {
    isAsked = true;
    if (current.peek() === undefined) void begin();
    else close();
  };
  return (
    <button type="button" class="icon" onClick={toggle} aria-label="Tour of this page" title="tour of this page" aria-expanded={current.value !== undefined} data-testid="tour-button">?</button>
  );
}

/** On *Live* while it is there; begins by itself on a first visit, once there is something to see. */
export function Tour(): JSX.Element | null {
  const hasSession = live.session.value !== undefined;
  useEffect(() => {
    if (hasSession && (isInAddress() || isFirstVisit())) void begin();
  }, [hasSession]);
  useEffect(() => () => { current.value = undefined; }, []);
  if (current.value === undefined) return null;
  const { step, parts } = current.value;
  const go = (next: Step | undefined): void => {
    isAsked = true;
    if (next === undefined) close();
    else current.value = { step: next, parts };
  };
  return <parts.Card key={step.target} step={step} onGo={go} isAsked={isAsked} />;
}
