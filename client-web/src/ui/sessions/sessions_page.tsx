// The Sessions page: every session that the server has, and what can be done with one.

import { useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect } from "preact/hooks";
import { freeName } from "../../protocol/name";
import { isDamaged, type SessionEntry } from "../../protocol/session";
import { Dialog } from "../dialog";
import { sessions } from "../store";
import { NameField } from "./name_field";
import { NewSession } from "./new_session";
import { DamagedRow, SessionRow } from "./session_row";
import { fault } from "./words";
import "../style/sessions.css";
import "../style/theory.css";

type Question = { readonly name: "none" } | { readonly name: "delete" | "duplicate"; readonly id: string };
const NONE: Question = { name: "none" };

export function SessionsPage(): JSX.Element {
  useEffect(() => sessions.watch(), []);
  const question = useSignal<Question>(NONE);
  const made = useSignal<string | undefined>(undefined);
  const { entries } = sessions;
  const { value } = question;
  const asked = value.name === "none" ? undefined : entries.find(({ id }) => id === value.id);
  const close = (): void => {
    question.value = NONE;
  };
  return (
    <div class="page sessions" data-testid="sessions" data-known={sessions.state.value.name}>
      <section class="panel list" aria-label="Sessions">
        <header>
          <h2>Sessions</h2>
          <Standing />
        </header>
        {0 < entries.length && (
          <table class="data">
            <thead>
              <tr>
                <th scope="col">name</th>
                <th scope="col">state</th>
                <th scope="col">scheme</th>
                <th scope="col">operators</th>
                <th scope="col" class="number">clay removed</th>
                <th scope="col" class="number">on disk</th>
                <th scope="col">storage</th>
                <th scope="col"><span class="hidden">what can be done</span></th>
              </tr>
            </thead>
            <tbody>
              {entries.map((entry) => {
                const onDelete = (): void => {
                  question.value = { name: "delete", id: entry.id };
                };
                if (isDamaged(entry)) return <DamagedRow key={entry.id} session={entry} onDelete={onDelete} />;
                return (
                  <SessionRow
                    key={entry.id}
                    session={entry}
                    isNew={entry.id === made.value}
                    onDelete={onDelete}
                    onDuplicate={() => { question.value = { name: "duplicate", id: entry.id }; }}
                  />
                );
              })}
            </tbody>
          </table>
        )}
      </section>
      <NewSession onMade={(id) => { made.value = id; }} />
      {value.name === "delete" && asked !== undefined && <DeleteDialog entry={asked} onClose={close} />}
      {value.name === "duplicate" && asked !== undefined && (
        <DuplicateDialog of={asked.id} onClose={close} onMade={(id) => { made.value = id; }} />
      )}
    </div>
  );
}

/** What there is to say where the list says nothing, or nothing new. */
function Standing(): JSX.Element | null {
  const state = sessions.state.value;
  if (state.name === "looking") return <span class="faint" role="status">looking …</span>;
  if (state.name === "away") {
    return <span class="refusal" role="alert">{state.entries.length === 0 ? "No list" : "This list is old"}: {state.because}.</span>;
  }
  if (0 < state.entries.length) return null;
  return <span class="faint" role="status">There is none yet. Make the first one here.</span>;
}

function DeleteDialog({ entry, onClose }: { readonly entry: SessionEntry; readonly onClose: () => void }): JSX.Element {
  const refusal = useSignal<string | undefined>(undefined);
  const isBusy = useSignal(false);
  const working = isDamaged(entry) ? [] : entry.tools.filter(({ connected }) => connected).map(({ operator }) => operator);
  const remove = async (): Promise<void> => {
    isBusy.value = true;
    refusal.value = await sessions.remove(entry.id);
    isBusy.value = false;
    if (refusal.value === undefined) onClose();
  };
  return (
    <Dialog title={`Delete ${entry.id}?`} test="delete-dialog" onClose={onClose}>
      <p>
        {isDamaged(entry)
          ? "What is left of its files goes with it, and cannot be brought back."
          : "Its clay and its history are gone for good, on disk too."}
      </p>
      {0 < working.length && (
        <p class="warning">{working.join(" and ")} {working.length === 1 ? "works" : "work"} in it now, and will be sent away.</p>
      )}
      {refusal.value !== undefined && <p class="refusal" role="alert">Not deleted: {refusal.value}.</p>}
      <p class="answers">
        <button type="button" autofocus onClick={onClose} data-testid="keep">Keep it</button>
        <button type="button" class="danger" disabled={isBusy.value} onClick={() => void remove()} data-testid="delete-now">Delete</button>
      </p>
    </Dialog>
  );
}

interface DuplicateProps {
  readonly of: string;
  readonly onClose: () => void;
  readonly onMade: (id: string) => void;
}

function DuplicateDialog({ of, onClose, onMade }: DuplicateProps): JSX.Element {
  const { entries } = sessions;
  const name = useSignal(freeName(`${of}-copy`, entries.map(({ id }) => id)));
  const refusal = useSignal<string | undefined>(undefined);
  const isBusy = useSignal(false);
  const wrong = isBusy.value ? undefined : fault(name.value, entries);
  const duplicate = async (event: Event): Promise<void> => {
    event.preventDefault();
    if (wrong !== undefined || isBusy.value) return;
    isBusy.value = true;
    refusal.value = await sessions.duplicate(of, name.value);
    if (refusal.value === undefined) {
      onMade(name.value);
      onClose();
    }
    isBusy.value = false;
  };
  return (
    <Dialog title={`Duplicate ${of}`} test="duplicate-dialog" onClose={onClose}>
      <form onSubmit={(event) => void duplicate(event)}>
        <p>Another session with the same clay and settings, as they are now. What is cut in one stays in that one.</p>
        <NameField id="copy-name" value={name.value} fault={wrong} onType={(text) => { name.value = text; }} />
        {refusal.value !== undefined && <p class="refusal" role="alert">Not duplicated: {refusal.value}.</p>}
        <p class="answers">
          <button type="button" onClick={onClose}>Cancel</button>
          <button type="submit" class="primary" disabled={wrong !== undefined || isBusy.value} data-testid="duplicate-now">Duplicate</button>
        </p>
      </form>
    </Dialog>
  );
}
