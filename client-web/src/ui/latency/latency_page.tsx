// The Latency page: what delay, jitter and loss do to the clay under every scheme, as heatmaps.

import { useComputed, useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect } from "preact/hooks";
import type { LatencyCell, LatencyTable, Profile } from "../../protocol/latency";
import { Choice } from "../choice";
import { tables } from "../store";
import { Details } from "./details";
import { jittersOf, layOut, profilesOf, type Slice } from "./grid";
import { Heatmap } from "./heatmap";
import { MEASURES } from "./measures";
import { WallTable } from "./wall_table";
import "../style/theory.css";

export function LatencyPage(): JSX.Element {
  useEffect(() => void tables.look(), []);
  const over = useSignal(false);
  const state = tables.state.value;
  const take = (files: FileList | null | undefined): void => {
    over.value = false;
    const file = files?.item(0);
    if (file !== null && file !== undefined) void file.text().then((text) => tables.read(text, file.name));
  };
  return (
    <div
      class="page latency"
      data-over={over.value}
      data-table={state.name}
      onDragOver={(event) => {
        event.preventDefault();
        over.value = true;
      }}
      onDragLeave={() => { over.value = false; }}
      onDrop={(event) => {
        event.preventDefault();
        take(event.dataTransfer?.files);
      }}
    >
      {tables.refusal.value !== undefined && <p class="panel note refusal" role="alert" data-testid="table-refusal">{tables.refusal.value}</p>}
      {state.name === "shown" && 0 < state.table.cells.length
        ? <Table table={state.table} origin={state.origin} onFiles={take} />
        : <Nothing reason={state.name === "none" ? state.reason : state.name === "shown" ? `The table of ${state.origin} has no cells.` : undefined} onFiles={take} />}
    </div>
  );
}

interface FilesProps {
  readonly onFiles: (files: FileList | null) => void;
}

function Nothing({ reason, onFiles }: FilesProps & { readonly reason: string | undefined }): JSX.Element {
  return (
    <section class="panel nothing" aria-label="No table" data-testid="no-table">
      <h2>{reason === undefined ? "Looking for the table …" : "No table yet"}</h2>
      {reason !== undefined && (
        <>
          <p>{reason}</p>
          <p>Make one, which takes less than a minute, and drop it here:</p>
          <pre><code>target/release/teleclay-latency --quick --json latency.json</code></pre>
          <FileChoice onFiles={onFiles} />
        </>
      )}
    </section>
  );
}

function FileChoice({ onFiles }: FilesProps): JSX.Element {
  return (
    <label class="button file">
      Open a table …
      <input type="file" accept=".json,application/json" onChange={({ currentTarget }) => onFiles(currentTarget.files)} data-testid="table-file" />
    </label>
  );
}

const PROFILE_WORDS: Record<Profile, { readonly text: string; readonly title: string }> = {
  iid: { text: "even", title: "packets are lost independently of one another" },
  bursts: { text: "bursts", title: "losses come in bursts" },
  outage: { text: "outage", title: "the line is dead for 200 ms once" },
  second_writer: { text: "second writer", title: "somebody else cuts the same clay" },
};

interface TableProps extends FilesProps {
  readonly table: LatencyTable;
  readonly origin: string;
}

function Table({ table, origin, onFiles }: TableProps): JSX.Element {
  const key = useSignal(MEASURES[0].key);
  const wanted = useSignal<Slice | undefined>(undefined);
  const chosen = useSignal<LatencyCell | undefined>(undefined);
  const pointed = useSignal<LatencyCell | undefined>(undefined);
  const measure = useComputed(() => MEASURES.find((each) => each.key === key.value) ?? MEASURES[0]);
  const profiles = profilesOf(table);
  const profile = wanted.value !== undefined && profiles.includes(wanted.value.profile) ? wanted.value.profile : profiles[0];
  const jitters = jittersOf(table, profile);
  const jitter_ratio = wanted.value !== undefined && jitters.includes(wanted.value.jitter_ratio) ? wanted.value.jitter_ratio : jitters[0];
  const { delays_s, losses, grids } = layOut(table, { profile, jitter_ratio });
  const seeds = grids.flatMap(({ rows }) => rows.flat()).find((cell) => cell !== undefined)?.seeds;
  return (
    <>
      <section class="panel choose" aria-label="What is shown">
        <label class="choice">
          <span>measure</span>
          <select value={key.value} onChange={({ currentTarget }) => { key.value = currentTarget.value; }} data-testid="measure">
            {MEASURES.map(({ key: each, name }) => <option key={each} value={each}>{name}</option>)}
          </select>
        </label>
        <span class="choice">
          <span>line</span>
          <Choice
            name="profile"
            label="What the line does"
            options={profiles.map((value) => ({ value, ...PROFILE_WORDS[value] }))}
            value={profile}
            onChoose={(value) => { wanted.value = { profile: value, jitter_ratio }; }}
          />
        </span>
        <span class="choice">
          <span>jitter σ/delay</span>
          <Choice
            name="jitter"
            label="Jitter over delay"
            options={jitters.map((value) => ({ value: String(value), text: String(value) }))}
            value={String(jitter_ratio)}
            onChoose={(value) => { wanted.value = { profile, jitter_ratio: Number(value) }; }}
          />
        </span>
        <span class="spacer" />
        <span class="faint" data-testid="origin">{origin}{seeds === undefined ? "" : `, ${seeds} ${seeds === 1 ? "seed" : "seeds"} a cell`}</span>
        <FileChoice onFiles={onFiles} />
        <p class="says">
          {measure.value.name}, {measure.value.unit}: {measure.value.says}.
          <span class="ramp-key"><span>{measure.value.good}</span><i class="ramp back" aria-hidden="true" /><span>{measure.value.bad} {measure.value.unit}</span></span>
          <span>✕ not stable for every seed</span>
        </p>
      </section>
      <div class="maps">
        {grids.map((grid) => (
          <Heatmap
            key={grid.scheme}
            grid={grid}
            delays_s={delays_s}
            losses={losses}
            measure={measure.value}
            chosen={chosen.value}
            onChoose={(cell) => { chosen.value = cell; }}
            onPoint={(cell) => { pointed.value = cell; }}
          />
        ))}
        <Details cell={pointed.value ?? chosen.value} />
        <WallTable rows={table.wall} />
      </div>
    </>
  );
}
