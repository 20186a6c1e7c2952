// A step of the tour, beside what it is about.

import { useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useLayoutEffect, useRef } from "preact/hooks";
import { useFrame } from "../frame";
import { type Box, GAP_PX, placeOf, type Step, STEPS } from "./steps";
import "../style/tour.css";

interface CardProps {
  readonly step: Step;
  /** Another step is wanted; nothing: none any more. */
  readonly onGo: (step: Step | undefined) => void;
  /** Somebody asked for it, so the keys may go to it. */
  readonly isAsked: boolean;
}

const targetOf = (step: Step): Element | null => document.querySelector(step.target);
/** The steps about what is on the page. */
const there = (): Step[] => STEPS.filter((step) => targetOf(step) !== null);

export const firstStep = (): Step | undefined => there().at(0);

const px = (length: number): string => `${length}px`;

export function Card({ step, onGo, isAsked }: CardProps): JSX.Element {
  const card = useRef<HTMLDivElement>(null);
  const box = useSignal<Box | undefined>(undefined);
  const steps = there();
  const n = steps.indexOf(step);
  const isLast = n === steps.length - 1;
  const go = (by: number): void => {
    if (0 <= n + by) onGo(steps.at(n + by));
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
          if (event.key === "Escape") onGo(undefined);
        }}
      >
        <header>
          <h2 id="tour-title">{step.title}</h2>
          <span class="faint">{n + 1} of {steps.length}</span>
          <button type="button" class="mini" onClick={() => onGo(undefined)} aria-label="End the tour" data-testid="tour-end">✕</button>
        </header>
        <p id="tour-text" aria-live="polite">{step.text}</p>
        <footer>
          {0 < n && <button type="button" onClick={() => go(-1)}>Back</button>}
          <button type="button" class="primary" onClick={() => go(1)} data-testid="tour-next">{isLast ? "Done" : "Next"}</button>
        </footer>
      </div>
    </>
  );
}
