// A tour of *Live* for who sees it for the first time. It stands beside the page and takes nothing from it: every
// control goes on working, and nothing waits for the tour.

import { signal, useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useLayoutEffect, useRef } from "preact/hooks";
import { useFrame } from "../frame";
import { live } from "../store";
import { type Box, GAP_PX, placeOf, type Step, STEPS } from "./steps";

const KEY = "teleclay.tour";
const SEEN = "seen";

/** The step on show; nothing while there is no tour. */
const current = signal<Step | undefined>(undefined);
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

const targetOf = (step: Step): Element | null => document.querySelector(step.target);
const there = (): Step[] => STEPS.filter((step) => targetOf(step) !== null);

function close(): void {
  current.value = undefined;
  remember();
}

export function TourButton(): JSX.Element {
  const toggle = (): void => {
    isAsked = true;
    if (current.peek() === undefined) current.value = there().at(0);
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
    if (hasSession && (isInAddress() || isFirstVisit())) current.value = there().at(0);
  }, [hasSession]);
  useEffect(() => () => { current.value = undefined; }, []);
  const step = current.value;
  return step === undefined ? null : <Card key={step.target} step={step} />;
}

const px = (length: number): string => `${length}px`;

function Card({ step }: { step: Step }): JSX.Element {
  const card = useRef<HTMLDivElement>(null);
  const box = useSignal<Box | undefined>(undefined);
  const steps = there();
  const n = steps.indexOf(step);
  const isLast = n === steps.length - 1;
  const go = (by: number): void => {
    const next = steps.at(n + by);
    if (n + by < 0) return;
    if (next === undefined) close();
    else current.value = next;
  };

  useLayoutEffect(() => {
    const target = targetOf(step);
    const isCalm = matchMedia("(prefers-reduced-motion: reduce)").matches;
    target?.scrollIntoView({ block: "nearest", behavior: isCalm ? "instant" : "smooth" });
  }, []);
  // Wherever it goes, and whatever moves it: a banner, a scroll, another size of the window.
  useFrame(() => {
    const rect = targetOf(step)?.getBoundingClientRect();
    if (rect === undefined) return;
    const { left, top, width, height } = rect;
    const before = box.peek();
    if (before?.left === left && before.top === top && before.width === width && before.height === height) return;
    box.value = { left, top, width, height };
  });
  useEffect(() => {
    if (isAsked) card.current?.querySelector<HTMLElement>("[data-testid='tour-next']")?.focus();
  }, []);

  const at = box.value;
  const size = { width: Math.min(320, innerWidth - 2 * GAP_PX), height: card.current?.offsetHeight ?? 132 };
  const place = at === undefined ? { left: 0, top: 0 } : placeOf(at, size, { width: innerWidth, height: innerHeight });
  return (
    <>
      {at !== undefined && <div class="tour-ring" aria-hidden="true" style={{ left: px(at.left), top: px(at.top), width: px(at.width), height: px(at.height) }} />}
      <div
        class="tour"
        role="dialog"
        aria-labelledby="tour-title"
        aria-describedby="tour-text"
        data-testid="tour"
        data-target={step.target}
        ref={card}
        style={{ left: px(place.left), top: px(place.top), width: px(size.width) }}
        onKeyDown={(event) => {
          if (event.key === "Escape") close();
        }}
      >
        <header>
          <h2 id="tour-title">{step.title}</h2>
          <span class="faint">{n + 1} of {steps.length}</span>
          <button type="button" class="mini" onClick={close} aria-label="End the tour" data-testid="tour-end">✕</button>
        </header>
        <p id="tour-text" aria-live="polite">{step.text}</p>
        <footer>
          {0 < n && <button type="button" onClick={() => { isAsked = true; go(-1); }}>Back</button>}
          <button type="button" class="primary" onClick={() => { isAsked = true; go(1); }} data-testid="tour-next">{isLast ? "Done" : "Next"}</button>
        </footer>
      </div>
    </>
  );
}
