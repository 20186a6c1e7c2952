// One session of the list: what it is, and what can be done with it.

import type { JSX } from "preact";
import type { DamagedSession, Session, Storage } from "../../protocol/session";
import { dataSize, fixed } from "../format";
import { schemeName } from "../scheme_words";
import { addressOfSession, live } from "../store";
import { operatorsOf, STORAGE_WORDS } from "./words";

const CM3_PER_M3 = 1e6;

interface RowProps<Entry> {
  readonly session: Entry;
  readonly onDelete: () => void;
}

export function SessionRow({ session, onDelete, onDuplicate, isNew }: RowProps<Session> & {
  readonly onDuplicate: () => void;
  /** Made a moment ago at this page. */
  readonly isNew: boolean;
}): JSX.Element {
  const { id, state, scheme, clay, storage } = session;
  const { names, free } = operatorsOf(session);
  const share = clay.initial_units === 0 ? 0 : (100 * clay.removed_units) / clay.initial_units;
  return (
    <tr data-testid={`session-${id}`} data-state={state} data-new={isNew}>
      <th scope="row">
        <a href={addressOfSession(id)}>{id}</a>
        {live.session.value?.id === id && <small>on show</small>}
      </th>
      <td data-label="state"><span class="badge" data-state={state}>{state}</span></td>
      <td data-label="scheme">{schemeName(scheme)}</td>
      <td data-label="operators" class="operators">
        {names === "" ? <span class="faint">nobody</span> : names}
        {0 < free && names !== "" && <small> · {free} free</small>}
      </td>
      <td data-label="removed" class="number" title={`${fixed(share, 2)} % of the block`}>
        {fixed(clay.removed_volume_m3 * CM3_PER_M3, 2)} <small>cm³</small>
      </td>
      <td data-label="on disk" class="number">{storage.state === "ephemeral" ? <span class="faint">–</span> : dataSize(storage.bytes)}</td>
      <td data-label="storage"><StorageWord {...storage} /></td>
      <td class="acts">
        <a class="button" href={addressOfSession(id)} data-testid="open">Open</a>
        <button type="button" onClick={onDuplicate} aria-label={`Duplicate ${id}`} data-testid="duplicate">Duplicate…</button>
        <button type="button" onClick={onDelete} aria-label={`Delete ${id}`} data-testid="delete">Delete…</button>
      </td>
    </tr>
  );
}

/** A session whose files cannot be read: told why, and can be deleted. */
export function DamagedRow({ session, onDelete }: RowProps<DamagedSession>): JSX.Element {
  const { id, storage } = session;
  return (
    <tr data-testid={`session-${id}`} data-state="damaged">
      <th scope="row">{id}</th>
      <td data-label="state"><span class="badge" data-state="fault">damaged</span></td>
      <td colSpan={3} class="reason">{storage.reason ?? "its files cannot be read"}</td>
      <td data-label="on disk" class="number">{dataSize(storage.bytes)}</td>
      <td data-label="storage"><span class="storage-word" data-storage="failed">unreadable</span></td>
      <td class="acts">
        <button type="button" onClick={onDelete} aria-label={`Delete ${id}`} data-testid="delete">Delete…</button>
      </td>
    </tr>
  );
}

function StorageWord({ state, reason }: Storage): JSX.Element {
  return (
    <span class="storage-word" data-storage={state} title={reason ?? undefined}>
      {STORAGE_WORDS[state]}{reason !== null && <small>{reason}</small>}
    </span>
  );
}
