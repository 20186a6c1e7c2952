// How the hand is set, and how it is moved.

import type { JSX } from "preact";
import { operating } from "../../store";
import { linear, power } from "../../slider_scale";
import { within } from "../../number/entry";
import { ValueField } from "../../value_field";
import { isLatched, isViewed, pad, rumbleFull_n } from "./operator";

const AXES = ["x", "y", "z"] as const;
/** What the loop's own limits leave of more is little. */
const MOST_LIMIT_N = 20;
const MOTION = { least: 0.05, most: 4 };

export function HandSettings(): JSX.Element {
  const { motion, locked, limit_n } = operating.settings.value;
  const lock = (axis: number): void => {
    const [x, y, z] = locked.map((was, n) => (n === axis ? !was : was));
    operating.set({ locked: [x, y, z] });
  };
  return (
    <>
      <p class="how"><span><b>Drag</b> on the picture to hold and move the hand.</span></p>
      <div class="checks">
        <Check test="view-only" is={isViewed.value} set={(to) => { isViewed.value = to; }} title="while this is on, drags turn the view and move no hand">drags turn the view</Check>
        <Check test="latch" is={isLatched.value} set={(to) => { isLatched.value = to; }} title="for space and for the gamepad's button: one press holds, the next lets go">keep hold</Check>
      </div>
      <details class="set">
        <summary>Wheel, keys, fingers, gamepad</summary>
        <ul class="how">
          <li>The view turns by the <b>middle button</b> or <b>two fingers</b>.</li>
          <li>The <b>wheel</b> lifts, the <b>right button</b> beside the left one is the clutch: the hand moves without the handle.</li>
          <li>Two <b>fingers</b> that part lift, and hold the hand meanwhile.</li>
          <li><b>Space</b> held and <b>arrows</b>; <b>Page Up</b> and <b>Down</b> lift, <b>C</b> is the clutch, shift is slow, escape lets go.</li>
          <li>
            {pad.value === undefined ? "A gamepad, once one of its buttons is pressed: " : "The gamepad: "}
            lowest button held, left stick about where it took hold, right stick on, triggers lift.
          </li>
        </ul>
      </details>
      <details class="set">
        <summary>How the hand is set</summary>
        <ValueField
          name="hand-motion"
          label="motion"
          unit="×"
          factor={1}
          scale={power(MOTION.most, 2)}
          value={motion}
          check={within(MOTION.least, MOTION.most)}
          onWish={(to) => operating.set({ motion: to })}
          title="handle motion for the pointer's; at 1 the tool stays under the pointer. Another scale lets go and takes hold anew"
        />
        <ValueField
          name="hand-limit"
          label="let go at"
          unit="N"
          factor={1}
          scale={linear(MOST_LIMIT_N)}
          value={limit_n ?? 0}
          check={within(0, MOST_LIMIT_N)}
          onWish={(to) => operating.set({ limit_n: to === 0 ? undefined : to })}
          title="lets go of the hand once so much is felt; 0: the loop's own limits alone"
        />
        {pad.value !== undefined && (
          <ValueField
            name="hand-rumble"
            label="rumble"
            unit="N"
            factor={1}
            scale={linear(MOST_LIMIT_N)}
            value={rumbleFull_n.value}
            check={within(0, MOST_LIMIT_N)}
            onWish={(to) => { rumbleFull_n.value = to; }}
            title="felt force at which the gamepad rumbles as much as it can; 0: it does not. A rumble says how strong a force is, and not where to"
          />
        )}
        <div class="checks" role="group" aria-label="Axes held fast">
          <span>hold fast</span>
          {AXES.map((axis, n) => <Check key={axis} test={`lock-${axis}`} is={locked[n]} set={() => lock(n)} title={`the handle does not move along ${axis}, from the next grip on`}>{axis}</Check>)}
        </div>
      </details>
    </>
  );
}

interface CheckProps {
  readonly test: string;
  readonly is: boolean;
  readonly set: (to: boolean) => void;
  readonly title: string;
  readonly children: string;
}

function Check({ test, is, set, title, children }: CheckProps): JSX.Element {
  return (
    <label class="check" title={title}>
      <input type="checkbox" checked={is} onChange={({ currentTarget }) => set(currentTarget.checked)} data-testid={test} /> {children}
    </label>
  );
}
