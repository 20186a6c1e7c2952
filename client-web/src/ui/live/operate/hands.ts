// Hands on the picture: what the browser tells of pointers, keys, wheels and gamepads, for as long as a tool is held.
// Loaded when somebody operates.

import { Drag, type Touch } from "../../../hand/drag";
import { Grip } from "../../../hand/grip";
import { headingOf, Keys } from "../../../hand/keys";
import { rumbleOf, Stick } from "../../../hand/stick";
import type { ClayView } from "../../../scene/view";
import { live, operating } from "../../store";
import { isLatched, pad, rumbleFull_n } from "./operator";

/** The hand is told of this often, ms: a page that draws more seldom still tells. */
const TELL_MS = 16;
/** Lift for each pixel that a wheel turns, m: a notch is about a hundred. */
const WHEEL_M = 0.00002;
const LINE_PX = 16;
/** A rumble outlasts the time to the next by so much that none is heard to end, ms. */
const RUMBLE_MS = 120;

/** Binds everything to the element that lies over the picture; returns what ends that. */
export function bindHands(element: HTMLElement, view: () => ClayView | undefined): () => void {
  const grip = new Grip({
    hold: () => operating.hold(),
    open: () => operating.open(),
    clutch: () => operating.clutch(),
    tell: (at_ms, place_m) => operating.tell(at_ms, place_m),
  });
  const drag = new Drag(grip, {
    rayAt: (x, y) => view()?.aim.rayAt(x, y) ?? { from_m: [0, 0, 1], along: [0, 0, -1] },
    turn: (x, y) => view()?.aim.turn(x, y),
  }, () => ({ height_m: operating.hand.peek()?.state.tool_m[2] ?? 0, ratio: live.session.peek()?.position_ratio ?? 1 }));
  grip.onLift = (lift_m) => drag.onLift(lift_m);
  const keys = new Keys(grip);
  const stick = new Stick(grip);
  const forget = (): void => {
    grip.forget();
    drag.forget();
  };
  operating.onLetGo = forget;
  // Whoever pressed the button goes on by keys; whoever types somewhere is left alone.
  const focused = document.activeElement;
  if (focused === document.body || focused?.matches("[data-testid=operate]") === true) element.focus({ preventScroll: true });

  const tick = (): void => {
    const now_ms = epoch(performance.now());
    const heading = headingOf(...(view()?.aim.away() ?? [0, 1]));
    keys.isLatched = stick.isLatched = isLatched.peek();
    const state = operating.hand.peek()?.state;
    if (state !== undefined) grip.stretch([state.hand_m[0] - state.handle_m[0], state.hand_m[1] - state.handle_m[1], state.hand_m[2] - state.handle_m[2]]);
    keys.tick(now_ms, heading);
    const gamepad = padThere();
    if ((gamepad?.id ?? undefined) !== pad.peek()) {
      pad.value = gamepad?.id;
      if (gamepad === undefined) stick.gone();
    }
    if (gamepad !== undefined) {
      stick.read({ axes: gamepad.axes, buttons: gamepad.buttons.map(({ value }) => value) }, now_ms, heading);
      rumble(gamepad, grip.by === "gamepad" ? Math.hypot(...(state?.felt_force_n ?? [0])) : 0);
    }
    grip.tick(now_ms);
  };
  const timer = setInterval(tick, TELL_MS);

  const ends = [
    ...pointers(element, drag),
    on(element, "wheel", (event) => {
      event.preventDefault();
      const pixels = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY : event.deltaY * LINE_PX;
      grip.lift(-pixels * WHEEL_M, epoch(event.timeStamp));
    }),
    on(element, "keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (keys.press(event.code, { isRepeat: event.repeat, shift: event.shiftKey })) event.preventDefault();
    }),
    on(element, "keyup", (event) => keys.lift(event.code, event.shiftKey)),
    on(element, "blur", () => keys.blur()),
  ];
  const onHidden = (): void => {
    if (!document.hidden || grip.by === undefined) return;
    operating.letGoFor({ kind: "hidden" });
  };
  const onBlur = (): void => {
    if (grip.by !== undefined) grip.letGo(grip.by);
    drag.forget();
  };
  document.addEventListener("visibilitychange", onHidden);
  addEventListener("blur", onBlur);
  return () => {
    clearInterval(timer);
    if (grip.by !== undefined) grip.letGo(grip.by);
    if (operating.onLetGo === forget) operating.onLetGo = undefined;
    for (const end of ends) end();
    document.removeEventListener("visibilitychange", onHidden);
    removeEventListener("blur", onBlur);
    pad.value = undefined;
  };
}

function pointers(element: HTMLElement, drag: Drag): (() => void)[] {
  const touchOf = (event: PointerEvent): Touch => {
    const { left, top } = element.getBoundingClientRect();
    return {
      id: event.pointerId,
      kind: event.pointerType === "touch" || event.pointerType === "pen" ? event.pointerType : "mouse",
      x: event.clientX - left,
      y: event.clientY - top,
      at_ms: epoch(event.timeStamp),
      buttons: event.buttons,
    };
  };
  return [
    on(element, "pointerdown", (event) => {
      // Neither a text selection nor the middle button's own scrolling.
      event.preventDefault();
      element.focus();
      element.setPointerCapture(event.pointerId);
      drag.down(touchOf(event));
    }),
    on(element, "pointermove", (event) => {
      // Browsers give these, as gamepads, to pages that come encrypted or from this machine.
      const all = "getCoalescedEvents" in event ? event.getCoalescedEvents() : [];
      for (const each of all.length === 0 ? [event] : all) drag.move(touchOf(each));
    }),
    ...(["pointerup", "pointercancel", "lostpointercapture"] as const).map((name) => on(element, name, (event) => drag.up(event.pointerId))),
    on(element, "contextmenu", (event) => event.preventDefault()),
  ];
}

function on<K extends keyof HTMLElementEventMap>(element: HTMLElement, name: K, take: (event: HTMLElementEventMap[K]) => void): () => void {
  element.addEventListener(name, take, { passive: false });
  return () => element.removeEventListener(name, take);
}

/** The first gamepad whose sticks and buttons are where every game expects them. */
function padThere(): Gamepad | undefined {
  if (!("getGamepads" in navigator)) return undefined;
  return navigator.getGamepads().find((each) => each?.connected === true && each.mapping === "standard") ?? undefined;
}

let rumbling_ms = 0;

function rumble(gamepad: Gamepad, felt_n: number): void {
  const full_n = rumbleFull_n.peek();
  const strength = full_n === 0 ? 0 : rumbleOf(felt_n, full_n);
  const now_ms = performance.now();
  if (strength === 0 || !("vibrationActuator" in gamepad) || now_ms < rumbling_ms + RUMBLE_MS / 2) return;
  rumbling_ms = now_ms;
  // Some gamepads have no motor.
  gamepad.vibrationActuator.playEffect("dual-rumble", { duration: RUMBLE_MS, strongMagnitude: strength, weakMagnitude: strength / 2 }).catch(() => undefined);
}

/** Since the epoch, ms: the worker counts from another moment than the page. */
function epoch(since_ms: number): number {
  return performance.timeOrigin + since_ms;
}
