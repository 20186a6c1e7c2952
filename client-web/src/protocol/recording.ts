// Recordings of a session: files that other programs read.

import * as v from "valibot";

export type RecordingState = "recording" | "ended" | "interrupted" | "failed";

export interface Recording {
  readonly id: string;
  readonly state: RecordingState;
  /** Why it has ended, if it has. */
  readonly reason?: string | null | undefined;
  readonly bytes: number;
  readonly ticks: number;
  /** Ticks that found no room on their way to the file. */
  readonly dropped: number;
  /** Whether its file goes when the server ends. */
  readonly is_temporary: boolean;
}

const recording = v.object({
  id: v.string(),
  state: v.picklist(["recording", "ended", "interrupted", "failed"]),
  reason: v.nullish(v.string()),
  bytes: v.number(),
  ticks: v.number(),
  dropped: v.number(),
  is_temporary: v.boolean(),
}) satisfies v.GenericSchema<unknown, Recording>;

export const recordingsSchema: v.GenericSchema<unknown, Recording[]> = v.array(recording);
