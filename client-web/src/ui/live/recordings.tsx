// A session as a file for other programs: one that goes on, and those there are.

import { useComputed, useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect } from "preact/hooks";
import type { Recording, RecordingState } from "../../protocol/recording";
import { fetchFile } from "../browser";
import { downloadFile } from "../download";
import { fixed } from "../format";
import { addressOfRecording, live, recordings } from "../store";

/** Ticks a second. */
const TICKS_PER_S = 1000;

const SAYS: Record<RecordingState, string> = {
  recording: "goes on",
  ended: "whole",
  interrupted: "its server ended; all but the last second is there",
  failed: "broken off",
};

export function Recordings(): JSX.Element {
  useEffect(() => recordings.watch(), []);
  const id = useComputed(() => live.session.value?.id).value;
  const running = recordings.running.value;
  const off = id === undefined || recordings.isBusy.value;
  const others = (recordings.list.value ?? []).filter(({ state }) => state !== "recording");
  return (
    <section class="group recordings" aria-label="Recordings" data-testid="recordings" data-running={running !== undefined} data-count={recordings.list.value?.length}>
      <div class="record">
        {running === undefined ? (
          <button type="button" disabled={off} onClick={() => void recordings.start()} title="motion, force, cuts, settings and clay of every tick, as an MCAP file" data-testid="record">
            <span class="dot" aria-hidden="true">●</span> Record
          </button>
        ) : (
          <button type="button" disabled={off} onClick={() => void recordings.end(running.id)} title="the file is whole then" data-testid="record-end">
            ■ End recording
          </button>
        )}
        {running !== undefined && <span role="status" data-testid="record-says">{amountOf(running)}</span>}
      </div>
      {recordings.refusal.value !== undefined && <p class="refusal" role="alert" data-testid="record-refusal">{recordings.refusal.value}</p>}
      {0 < others.length && (
        <details>
          <summary>{others.length === 1 ? "one recording" : `${others.length} recordings`}</summary>
          <ul>
            {others.map((recording) => <Row key={recording.id} session={id} recording={recording} />)}
          </ul>
        </details>
      )}
    </section>
  );
}

function Row({ session, recording }: { readonly session: string | undefined; readonly recording: Recording }): JSX.Element {
  const { id, state, reason } = recording;
  const isAsked = useSignal(false);
  const says = [SAYS[state], reason ?? "", recording.is_temporary ? "goes with its server" : ""].filter((word) => word !== "").join("; ");
  return (
    <li data-state={state} data-testid={`recording-${id}`}>
      <span title={says}>
        <strong>{id}</strong> <span class="faint">{amountOf(recording)}{state === "ended" ? "" : `, ${says}`}</span>
      </span>
      <span class="pair" role="group" aria-label={`Recording ${id}`}>
        {session !== undefined && <a class="button" href={addressOfRecording(session, id)} title="look at any moment of it" data-testid={`show-${id}`}>Show</a>}
        <button type="button" onClick={() => void save(session, id)} title="for Foxglove, PlotJuggler, Python" data-testid={`save-${id}`}>MCAP</button>
        {isAsked.value ? (
          <button type="button" class="danger" disabled={recordings.isBusy.value} onClick={() => void recordings.remove(id)} data-testid={`remove-now-${id}`}>Delete now</button>
        ) : (
          <button type="button" onClick={() => (isAsked.value = true)} title="asks once more" data-testid={`remove-${id}`}>Delete</button>
        )}
      </span>
    </li>
  );
}

function amountOf({ ticks, bytes, dropped }: Recording): string {
  const lost = dropped === 0 ? "" : `, ${dropped} ticks lost`;
  return `${fixed(ticks / TICKS_PER_S, 1)} s, ${fixed(bytes / 1e6, 1)} MB${lost}`;
}

/** A link could not show the server a token. */
async function save(session: string | undefined, recording: string): Promise<void> {
  if (session === undefined) return;
  const file = await fetchFile(live.api.recordingFile(session, recording));
  if (typeof file === "string") live.report("error", `no recording: ${file}`);
  else downloadFile(`${session}-${recording}.mcap`, file);
}
