// What lies over the picture while a tool is held: here a drag moves the hand.

import { type Signal, useComputed, useSignalEffect } from "@preact/signals";
import type { JSX } from "preact";
import { useRef } from "preact/hooks";
import type { ClayView } from "../../../scene/view";
import { live, operating, past } from "../../store";
import { isViewed } from "./operator";

export function HandScene({ view }: { readonly view: Signal<ClayView | undefined> }): JSX.Element {
  const element = useRef<HTMLDivElement>(null);
  const isHeld = useComputed(() => operating.standing.value.name === "in");
  const isPast = useComputed(() => past.moment.value.name !== "now");
  // Hands on a picture of another moment would reach into one that nobody sees.
  const isActive = useComputed(() => isHeld.value && !isViewed.value && !isPast.value);
  useSignalEffect(() => {
    if (!isHeld.value || isPast.value) return undefined;
    let end: (() => void) | undefined;
    let isOver = false;
    import("./hands").then(({ bindHands }) => {
      if (!isOver && element.current !== null) end = bindHands(element.current, () => view.peek());
    }, () => live.report("error", "the part of the page that moves a hand did not load: load the page anew"));
    return () => {
      isOver = true;
      end?.();
    };
  });
  const grasp = useComputed(() => operating.hand.value?.state.grasp);
  return (
    <div
      ref={element}
      class="hand-scene"
      data-testid="scene"
      data-active={isActive.value}
      data-grasp={isHeld.value ? grasp.value : undefined}
      tabIndex={isHeld.value && !isPast.value ? 0 : -1}
      role="application"
      aria-label="The hand. Hold space and press arrows to move it, page up and page down to lift it, C for the clutch, escape to let go"
      aria-hidden={!isHeld.value}
    />
  );
}
