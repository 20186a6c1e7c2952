// The clay as a file, and a file as clay.

import { useComputed, useSignal } from "@preact/signals";
import type { JSX } from "preact";
import type { ClayFormat } from "../../state/api";
import { fetchFile } from "../browser";
import { downloadFile } from "../download";
import { live } from "../store";
import { meshRefusal, meshTypeOf, MESH_ENDINGS } from "./mesh_file";

const FORMATS: readonly { readonly format: ClayFormat; readonly says: string }[] = [
  { format: "stl", says: "the clay's surface now, in millimetres" },
  { format: "3mf", says: "the clay's surface now, for a printer" },
  { format: "glb", says: "the clay's surface now, for pictures: glTF, in metres" },
];

export function ClayFiles(): JSX.Element {
  const id = useComputed(() => live.session.value?.id).value;
  const refusal = useSignal<string | undefined>(undefined);
  const isBusy = useSignal(false);
  const take = async (input: HTMLInputElement): Promise<void> => {
    const file = input.files?.[0];
    // The same file again is a change, too.
    input.value = "";
    if (file === undefined || id === undefined) return;
    isBusy.value = true;
    refusal.value = await shape(id, file);
    isBusy.value = false;
  };
  return (
    <section class="group files" aria-label="Clay as a file">
      <span class="trio" role="group" aria-label="Save the clay as">
        {FORMATS.map(({ format, says }) => (
          <button key={format} type="button" disabled={id === undefined} onClick={() => void save(id, format)} title={says} data-testid={format}>
            {format.toUpperCase()}
          </button>
        ))}
      </span>
      <label class="button file" data-busy={isBusy.value} title="a closed mesh, STL or 3MF, becomes the block: made to fit, in place of the clay that is there">
        {isBusy.value ? "Importing …" : "Import…"}
        <input type="file" accept={MESH_ENDINGS} disabled={isBusy.value} onChange={({ currentTarget }) => void take(currentTarget)} data-testid="import-clay" />
      </label>
      {refusal.value !== undefined && <p class="refusal" role="alert" data-testid="import-refusal">{refusal.value}</p>}
    </section>
  );
}

/** Returns why the file did not become clay; nothing when it did. */
async function shape(id: string, file: File): Promise<string | undefined> {
  const type = meshTypeOf(file.name);
  if (type === undefined) return `${file.name} is neither STL nor 3MF`;
  const outcome = await live.api.shape(id, { bytes: file, type });
  live.adopt(outcome);
  if (outcome.kind === "problem") return meshRefusal(file.name, outcome.problem);
  if (outcome.kind === "away") return `${file.name}: the server did not answer`;
  live.report("info", `the clay is ${file.name} now`);
  return undefined;
}

/** A link could not show the server a token. */
async function save(id: string | undefined, format: ClayFormat): Promise<void> {
  if (id === undefined) return;
  const file = await fetchFile(live.api.clayPath(id, format));
  if (typeof file === "string") live.report("error", `no ${format.toUpperCase()}: ${file}`);
  else downloadFile(`${id}.${format}`, file);
}
