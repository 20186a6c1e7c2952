// The Recording page: a recording of the server's, or a file from this machine, at any moment of it.

import { signal, useComputed, useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect } from "preact/hooks";
import type { Place } from "../../film/port";
import type { Recording } from "../../protocol/recording";
import { decodeRecordings } from "../../protocol/text";
import { saidIn } from "../../state/api";
import { Film } from "../../state/film";
import { authorization, browser } from "../browser";
import { FilmFeed } from "../film_feed";
import { clock, dataSize, fixed } from "../format";
import { addressOfRecording, live, wordInAddress } from "../store";
import { FilmBar } from "./film_bar";
import { FilmPlots } from "./film_plots";
import { FilmScene } from "./film_scene";
import { remarksOf } from "./words";
import "../style/recording.css";

/** What is on show, and what it is called. */
interface Shown {
  readonly film: Film;
  readonly title: string;
  /** Counts what was opened: another one has a view of its own. */
  readonly number: number;
  /** Reads on where the recording goes on; nothing for a file. */
  readonly readOn: (() => void) | undefined;
}

const shown = signal<Shown | undefined>(undefined);
/** Why nothing is opened. */
const refusal = signal<string | undefined>(undefined);
let opened = 0;
/** Counts what was asked for. */
let asked = 0;

function show(place: Place, grows: boolean, title: string, readOn?: (film: Film) => void): void {
  shown.peek()?.film.end();
  opened += 1;
  const film = new Film(new FilmFeed(), place, grows);
  shown.value = { film, title, number: opened, readOn: readOn === undefined ? undefined : () => readOn(film) };
}

function close(): void {
  asked += 1;
  shown.peek()?.film.end();
  shown.value = undefined;
}

/** The recordings of a session, or why there is no list. */
async function recordingsOf(session: string): Promise<readonly Recording[] | string> {
  try {
    const answer = await browser.request("GET", live.api.recordingsPath(session));
    return answer.status === 200 ? decodeRecordings(answer.body) : saidIn(answer).detail;
  } catch {
    return "the server does not answer";
  }
}

async function openRecording(session: string, recording: string): Promise<void> {
  close();
  refusal.value = undefined;
  const goesOn = async (): Promise<boolean | string> => {
    const list = await recordingsOf(session);
    if (typeof list === "string") return list;
    const found = list.find(({ id }) => id === recording);
    return found === undefined ? `session ${session} has no recording ${recording}` : found.state === "recording";
  };
  asked += 1;
  const number = asked;
  const grows = await goesOn();
  // Somebody has left, or wants another one by now.
  if (number !== asked) return;
  if (typeof grows === "string") {
    refusal.value = grows;
    return;
  }
  const url = new URL(live.api.recordingFile(session, recording), document.baseURI).href;
  show({ kind: "server", url, headers: authorization() }, grows, `${session} · ${recording}`, (film) => {
    void goesOn().then((still) => film.more(still === true));
  });
}

export function RecordingPage(): JSX.Element {
  useEffect(() => {
    const follow = (): void => {
      const [session, recording] = [wordInAddress("session"), wordInAddress("recording")];
      if (session !== undefined && recording !== undefined) void openRecording(session, recording);
    };
    follow();
    addEventListener("hashchange", follow);
    return () => {
      removeEventListener("hashchange", follow);
      close();
    };
  }, []);
  const now = shown.value;
  return (
    <div class="reel" data-testid="recording" data-state={stateOf(now?.film)} data-at-s={now?.film.moment.value?.at_s} data-tick={now?.film.moment.value?.tick ?? undefined}>
      {now === undefined ? <Choice /> : <Opened key={now.number} shown={now} />}
    </div>
  );
}

function stateOf(film: Film | undefined): string {
  if (film === undefined) return "none";
  if (film.trouble.value !== undefined) return "trouble";
  return film.isRead.value ? "read" : "reading";
}

function Opened({ shown: { film, title, readOn } }: { readonly shown: Shown }): JSX.Element {
  const tools = useComputed(() => (film.facts.value?.tools ?? []).flatMap((isThere, slot) => (isThere ? [slot + 1] : []))).value;
  const wanted = useSignal<number | undefined>(undefined);
  const tool = wanted.value ?? tools.at(0) ?? 1;
  return (
    <>
      <FilmScene film={film} tool={tool} />
      <FilmBar film={film} />
      <FilmPlots film={film} tool={tool} />
      <aside class="panel reel-side" aria-label="This recording">
        <h2>{title}</h2>
        <Progress film={film} />
        {1 < tools.length && (
          <label class="choice">
            <span>tool</span>
            <select value={String(tool)} onChange={({ currentTarget }) => { wanted.value = Number(currentTarget.value); }} data-testid="reel-tool">
              {tools.map((number) => <option key={number} value={String(number)}>{holderOf(film, number)}</option>)}
            </select>
          </label>
        )}
        <Remarks film={film} />
        {film.grows && readOn !== undefined && film.isRead.value && (
          <button type="button" onClick={readOn} data-testid="reel-more">Read what has come since</button>
        )}
        <ClayHash film={film} />
        <Events film={film} />
        <div class="pair">
          <OpenFile />
          <a class="button" href="#/recording" onClick={close}>Others</a>
        </div>
      </aside>
    </>
  );
}

function holderOf(film: Film, number: number): string {
  const holder = film.moment.value?.tools.find(({ tool }) => tool === number)?.holder;
  return typeof holder === "string" ? `${number}, ${holder}` : String(number);
}

/** How far it is read. */
function Progress({ film }: { readonly film: Film }): JSX.Element {
  const facts = film.facts.value;
  const size = film.size.value;
  const read = facts?.bytes ?? 0;
  return (
    <div class="progress" role="status" data-testid="reel-progress">
      {film.isRead.value || film.trouble.value !== undefined
        ? <span>{fixed(facts?.lasts_s ?? 0, 1)} s, {dataSize(read)}, {facts?.ticks ?? 0} ticks</span>
        : <span>is read: {dataSize(read)}{size === undefined ? "" : ` of ${dataSize(size)}`}</span>}
      {!film.isRead.value && size !== undefined && film.trouble.value === undefined && <progress max={size} value={read} aria-label="Read so far" />}
    </div>
  );
}

function Remarks({ film }: { readonly film: Film }): JSX.Element {
  const facts = film.facts.value;
  const remarks = facts === undefined ? [] : remarksOf(facts, { isRead: film.isRead.value, goesOn: film.grows });
  return (
    <>
      {film.trouble.value !== undefined && <p class="refusal" role="alert" data-testid="reel-trouble">{film.trouble.value}.</p>}
      <ul class="remarks" data-testid="reel-remarks">
        {remarks.map(({ level, text }) => <li key={text} data-level={level}>{text}</li>)}
      </ul>
    </>
  );
}

/** The clay of the moment, and whether what the recording tells of its clay comes out of its cuts. */
function ClayHash({ film }: { readonly film: Film }): JSX.Element | null {
  const facts = film.facts.value;
  const hash = film.moment.value?.clay?.hash;
  if (facts === undefined || facts.hashes === 0) return null;
  return (
    <p class="hash" title={`${facts.hashes} hashes of the clay were compared with what the recorded cuts make`}>
      clay <code data-testid="clay-hash">{hash ?? "unknown"}</code> <strong data-testid="clay-same">{facts.differs_s === null ? "same" : "differs"}</strong>
      <span class="faint">, {facts.hashes} compared</span>
    </p>
  );
}

/** What happened, the one before the moment marked. */
function Events({ film }: { readonly film: Film }): JSX.Element | null {
  const marks = film.marks.value;
  const current = useComputed(() => film.marks.value.findLastIndex(({ at_s }) => at_s <= film.wished_s.value + 1e-9)).value;
  if (marks.length === 0) return null;
  return (
    <section aria-label="What happened">
      <h3>What happened</h3>
      <ol class="happened" data-testid="reel-events">
        {marks.slice(-MOST_EVENTS).map(({ at_s, level, text }, n) => (
          <li key={`${at_s} ${text}`} data-level={level} aria-current={n + Math.max(marks.length - MOST_EVENTS, 0) === current ? "true" : undefined}>
            <button type="button" onClick={() => film.seek(at_s)}><span class="faint">{clock(at_s)}</span> {text}</button>
          </li>
        ))}
      </ol>
    </section>
  );
}

/** A longer list helps nobody; the line has them all. */
const MOST_EVENTS = 500;

function OpenFile(): JSX.Element {
  return (
    <label class="button file">
      Open a file …
      <input
        type="file"
        accept=".mcap"
        class="hidden"
        data-testid="reel-file"
        onChange={({ currentTarget }) => {
          const file = currentTarget.files?.[0];
          if (file === undefined) return;
          refusal.value = undefined;
          show({ kind: "file", file }, false, file.name);
          currentTarget.value = "";
        }}
      />
    </label>
  );
}

/** What there is to be opened. */
function Choice(): JSX.Element {
  const session = useComputed(() => live.session.value?.id).value;
  const list = useSignal<readonly Recording[] | undefined>(undefined);
  const because = useSignal<string | undefined>(undefined);
  useEffect(() => {
    list.value = undefined;
    because.value = undefined;
    if (session === undefined) return;
    void recordingsOf(session).then((found) => {
      if (typeof found === "string") because.value = found;
      else list.value = found;
    });
  }, [session]);
  const found = list.value;
  return (
    <section class="panel reel-choice" aria-label="Recordings">
      <h2>Look at a recording</h2>
      {refusal.value !== undefined && <p class="refusal" role="alert" data-testid="reel-refusal">{refusal.value}.</p>}
      {because.value !== undefined && <p class="refusal" role="alert">{because.value}.</p>}
      {found !== undefined && (found.length === 0
        ? <p class="faint">Session {session} has no recording. <em>Record</em> on the Live page begins one.</p>
        : (
          <ul>
            {found.map(({ id, ticks, bytes, state }) => (
              <li key={id}>
                <a href={addressOfRecording(session ?? "", id)} data-testid={`open-${id}`}>{id}</a>
                <span class="faint"> {fixed(ticks / 1000, 1)} s, {dataSize(bytes)}{state === "recording" ? ", goes on" : ""}</span>
              </li>
            ))}
          </ul>
        ))}
      <p class="faint">A file that was saved here or on another machine can be opened too; it stays on this one.</p>
      <div class="pair"><OpenFile /></div>
    </section>
  );
}
