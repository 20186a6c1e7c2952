// What crosses between the page and the hand's worker. The worker has the socket, so that a page whose thread is busy
// costs the loop nothing; what is slow, texts and whatever is no frame, it only hands through.

import type { HandDevice, HandState } from "../protocol/hand_module";
import type { Triple } from "../protocol/theory";

export interface Granted {
  /** 64 bytes: the handle's key, then the server's. */
  readonly keys: ArrayBuffer;
  readonly granted: string;
}

export type ToHand =
  | { readonly type: "connect"; readonly url: string; readonly subprotocols: readonly string[] }
  /** Closes the socket; to the hand the server has gone. */
  | { readonly type: "disconnect" }
  /** A text for the server. */
  | { readonly type: "text"; readonly text: string }
  | ({ readonly type: "begin"; readonly device: HandDevice } & Granted)
  | ({ readonly type: "renew" } & Granted)
  | { readonly type: "parameters"; readonly json: string }
  | { readonly type: "snapshot"; readonly description: string; readonly bricks: readonly ArrayBuffer[] }
  /** The pointer was there at a time since the epoch: page and worker count from different moments. */
  | { readonly type: "sample"; readonly at_epoch_ms: number; readonly position_m: Triple }
  | { readonly type: "lock"; readonly axes: readonly [boolean, boolean, boolean] }
  | { readonly type: "motion"; readonly motion: number }
  /** Lets go once so much is felt; nothing: however much it is. */
  | { readonly type: "limit"; readonly felt_n: number | undefined }
  | { readonly type: "hold" | "release" | "clutch" | "leave" };

export type FromHand =
  | { readonly type: "open" }
  | { readonly type: "state"; readonly state: HandState; readonly pace: Pace }
  /** What came and is no frame. */
  | { readonly type: "text"; readonly text: string }
  | { readonly type: "binary"; readonly bytes: ArrayBuffer }
  | { readonly type: "closed"; readonly code: number; readonly reason: string }
  /** What was asked for, or what came, was not taken; a sentence without its full stop. */
  | { readonly type: "refused"; readonly of: ToHand["type"] | "wake"; readonly says: string }
  /** So much was felt, and the hand was let go of. */
  | { readonly type: "limited"; readonly felt_n: number }
  /** The hand has ended, likewise. */
  | { readonly type: "trouble"; readonly says: string };

/** How the worker wakes, and what that costs. */
export interface Pace {
  readonly how: "precise" | "timers";
  /** Most ticks of one wake since the last state. */
  readonly most_ticks: number;
  /** Messages that a socket which was full did not take. */
  readonly unsent: number;
}
