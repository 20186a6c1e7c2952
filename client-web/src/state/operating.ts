// The tool that this page holds: the conversation about it, what the worker tells of the loop, and what the person has
// set. The worker is made when somebody operates, and ends when nobody does.

import { batch, computed, signal, type ReadonlySignal } from "@preact/signals-core";
import type { FromHand, Pace } from "../hand/port";
import type { HandState } from "../protocol/hand_module";
import type { DeviceDescription } from "../protocol/operate";
import type { Triple } from "../protocol/theory";
import { Conversation, type HandPort, type Standing } from "./conversation";
import type { Platform } from "./platform";
import { Rising, TickRate } from "./hand_watch";

/** Makes a worker; what it tells goes to `onMessage`. */
export type MakeHand = (onMessage: (message: FromHand) => void) => HandPort;

export interface HandSettings {
  /** Handle motion per motion of the pointer. */
  readonly motion: number;
  readonly locked: readonly [boolean, boolean, boolean];
  /** Let go where more is felt, N; nothing: the limits of the loop alone. */
  readonly limit_n: number | undefined;
}

export const FIRST_SETTINGS: HandSettings = { motion: 1, locked: [false, false, false], limit_n: undefined };

/** Why the hand is held no longer, though the tool still is. */
export type LetGo =
  | { readonly kind: "limit"; readonly felt_n: number }
  /** The page was out of sight, where no browser tells a pointer. */
  | { readonly kind: "hidden" }
  /** The loop stood still for so long that nothing may go on by itself. */
  | { readonly kind: "gap" }
  | { readonly kind: "lease" }
  /** The loop was made anew, and its handle stands at its home. */
  | { readonly kind: "anew" };

export interface Hand {
  readonly state: HandState;
  readonly pace: Pace;
  /** Ticks a second in the worker; nothing before there is a second to count. */
  readonly rate_hz: number | undefined;
  /** The device's own law changed what the loop commanded, within the last second. */
  readonly isGuarded: boolean;
  readonly isUnsent: boolean;
}

/** A loop that nobody came back to ends: it would cost a core for nothing. */
const KEPT_MS = 60_000;
const OUT: Standing = { name: "out", because: undefined };

export class Operating {
  readonly #platform: Platform;
  readonly #make: MakeHand;
  readonly #report: (text: string) => void;
  readonly #standing = signal<Standing>(OUT);
  readonly #hand = signal<Hand | undefined>(undefined);
  readonly #settings = signal<HandSettings>(FIRST_SETTINGS);
  readonly #letGo = signal<LetGo | undefined>(undefined);
  #conversation: Conversation | undefined;
  #port: HandPort | undefined;
  #session: string | undefined;
  #rate = new TickRate();
  #guarded = new Rising();
  #unsent = new Rising();
  #gaps = 0;
  #forget: () => void = () => undefined;
  /** Whoever moves the hand is told that it is held no longer. */
  onLetGo: (() => void) | undefined;

  /** The tool that is held, if one is. */
  readonly tool: ReadonlySignal<number | undefined> = computed(() => {
    const standing = this.#standing.value;
    return standing.name === "in" || standing.name === "again" ? standing.tool : undefined;
  });

  constructor(platform: Platform, make: MakeHand, report: (text: string) => void) {
    this.#platform = platform;
    this.#make = make;
    this.#report = report;
  }

  get standing(): ReadonlySignal<Standing> {
    return this.#standing;
  }

  get hand(): ReadonlySignal<Hand | undefined> {
    return this.#hand;
  }

  get settings(): ReadonlySignal<HandSettings> {
    return this.#settings;
  }

  get letGo(): ReadonlySignal<LetGo | undefined> {
    return this.#letGo;
  }

  /** Takes a tool of a session. */
  operate(session: string, name: string, device: DeviceDescription): void {
    if (this.#standing.peek().name !== "out") return;
    this.#forget();
    if (this.#conversation?.hasEnded !== false || this.#session !== session) this.#beginWorker();
    this.#session = session;
    this.#letGo.value = undefined;
    this.#conversation?.begin({ session, name, device, motion: this.#settings.peek().motion });
  }

  /** Gives the tool back. */
  release(): void {
    this.#forget();
    this.#conversation?.leave();
  }

  /** The page shows another session, or goes. */
  leaveUnless(session: string | undefined): void {
    if (session !== this.#session) this.release();
  }

  set(change: Partial<HandSettings>): void {
    const before = this.#settings.peek();
    const settings = { ...before, ...change };
    this.#settings.value = settings;
    if (settings.motion !== before.motion) this.#port?.post({ type: "motion", motion: settings.motion });
    if (settings.locked !== before.locked) this.#port?.post({ type: "lock", axes: settings.locked });
    if (settings.limit_n !== before.limit_n) this.#port?.post({ type: "limit", felt_n: settings.limit_n });
  }

  hold(): void {
    if (this.#standing.peek().name !== "in") return;
    this.#letGo.value = undefined;
    this.#port?.post({ type: "hold" });
  }

  open(): void {
    this.#port?.post({ type: "release" });
  }

  clutch(): void {
    this.#port?.post({ type: "clutch" });
  }

  /** Where the pointer was, m, at a time since the epoch. */
  tell(at_epoch_ms: number, position_m: Triple): void {
    if (this.#standing.peek().name === "in") this.#port?.post({ type: "sample", at_epoch_ms, position_m });
  }

  /** Lets go, and says why until somebody takes hold anew. */
  letGoFor(because: LetGo): void {
    this.#port?.post({ type: "release" });
    this.#letGo.value = because;
    this.onLetGo?.();
  }

  #beginWorker(): void {
    this.#conversation?.leave();
    this.#rate = new TickRate();
    this.#guarded = new Rising();
    this.#unsent = new Rising();
    this.#gaps = 0;
    const port = this.#make((message) => {
      if (port === this.#port) this.#take(message);
    });
    this.#port = port;
    this.#conversation = new Conversation(this.#platform, port, {
      onStanding: (standing) => {
        if (port === this.#port) this.#onStanding(standing);
      },
      onBegun: () => this.#onBegun(port),
      onTrouble: this.#report,
    });
  }

  #take(message: FromHand): void {
    batch(() => {
      if (message.type === "state") this.#onState(message.state, message.pace);
      if (message.type === "limited") this.letGoFor({ kind: "limit", felt_n: message.felt_n });
      this.#conversation?.take(message);
    });
  }

  #onState(state: HandState, pace: Pace): void {
    const now_ms = this.#platform.now_ms();
    this.#hand.value = {
      state,
      pace,
      rate_hz: this.#rate.add(state.counts.ticks, now_ms),
      isGuarded: this.#guarded.add(state.counts.guarded, now_ms),
      isUnsent: this.#unsent.add(pace.unsent, now_ms),
    };
    const { gaps } = state.counts;
    const isNew = this.#gaps < gaps;
    this.#gaps = gaps;
    if (isNew && this.#letGo.peek()?.kind !== "hidden") this.letGoFor({ kind: "gap" });
  }

  #onStanding(standing: Standing): void {
    const before = this.#standing.peek().name;
    batch(() => {
      this.#standing.value = standing;
      // What no line took while there was none was held up by nothing.
      if (standing.name === "in" && before !== "in") this.#unsent = new Rising();
      if (standing.name === "again" && before === "in") this.letGoFor({ kind: "lease" });
      if (standing.name === "out" || standing.name === "leaving") {
        this.onLetGo?.();
        this.#letGo.value = undefined;
      }
      if (standing.name === "out") this.#hand.value = undefined;
    });
    if (standing.name === "out" && this.#conversation?.hasEnded === false) {
      this.#forget = this.#platform.after(KEPT_MS, () => {
        this.#conversation?.leave();
      });
    }
  }

  #onBegun(port: HandPort): void {
    this.#tellSettings(port);
    // What somebody held meanwhile was the loop before.
    if (port === this.#port && this.#standing.peek().name === "in") this.letGoFor({ kind: "anew" });
  }

  #tellSettings(port: HandPort): void {
    const { locked, limit_n, motion } = this.#settings.peek();
    port.post({ type: "lock", axes: locked });
    port.post({ type: "limit", felt_n: limit_n });
    port.post({ type: "motion", motion });
  }
}
