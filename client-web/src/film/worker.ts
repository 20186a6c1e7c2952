// The worker that reads a recording: the module does, and the page's own thread only shows it.

import address from "../../generated/film.wasm?url";
import { filmModuleFrom } from "../protocol/film_module";
import { decodeProblem } from "../protocol/text";
import type { FromFilm, Place, ToFilm } from "./port";
import { Projector } from "./projector";
import { type Part, type ReadPart, Source } from "./source";

/** A server that has enough large answers under way is asked again, so often and this far apart, ms. */
const BUSY = 503;
const BUSY_TRIES = 20;
const BUSY_MS = 300;
const PARTIAL = 206;
const BEYOND = 416;

let projector: Promise<Projector> | undefined;

self.onmessage = ({ data }: MessageEvent<ToFilm>): void => {
  if (data.type === "open") {
    projector = begin(data.place, data.grows);
    projector.then((begun) => begun.run(), (error: unknown) => post({ type: "trouble", says: `recordings cannot be shown, as the page's module did not load: ${error instanceof Error ? error.message : String(error)}` }));
  } else projector?.then((begun) => begun.take(data), () => undefined);
};

async function begin(place: Place, grows: boolean): Promise<Projector> {
  const module = await filmModuleFrom(fetch(address));
  const source = new Source(place.kind === "file" ? partsOf(place.file) : partsAt(place.url, place.headers));
  const breathe = (): Promise<void> => new Promise((resume) => { setTimeout(resume, 0); });
  return new Projector({ module, source, post, now_ms: () => performance.now(), breathe }, grows);
}

function partsOf(file: Blob): ReadPart {
  return async (offset, length) => ({
    bytes: new Uint8Array(await file.slice(offset, offset + length).arrayBuffer()),
    size: file.size,
  });
}

function partsAt(url: string, headers: Readonly<Record<string, string>>): ReadPart {
  /** Somebody between here and the server sent the whole file: the browser keeps it. */
  let whole: ReadPart | undefined;
  const ask = async (offset: number, length: number, tries: number): Promise<Part> => {
    if (whole !== undefined) return whole(offset, length);
    const response = await fetch(url, { headers: { ...headers, range: `bytes=${offset}-${offset + length - 1}` }, cache: "no-store" });
    const size = Number(/\/(\d+)$/.exec(response.headers.get("content-range") ?? "")?.[1] ?? Number.NaN);
    if (response.status === PARTIAL) return { bytes: new Uint8Array(await response.arrayBuffer()), size };
    if (response.status === BEYOND) return { bytes: new Uint8Array(), size };
    if (response.ok) {
      whole = partsOf(await response.blob());
      return whole(offset, length);
    }
    const says = await response.text();
    if (response.status === BUSY && 0 < tries) {
      await new Promise((resume) => { setTimeout(resume, BUSY_MS); });
      return ask(offset, length, tries - 1);
    }
    throw new Error(decodeProblem(says)?.detail ?? `the server answered ${response.status} without saying why`);
  };
  return async (offset, length) => {
    try {
      return await ask(offset, length, BUSY_TRIES);
    } catch (error) {
      throw error instanceof TypeError ? new Error("the server does not answer") : error;
    }
  };
}

function post(message: FromFilm): void {
  const owned = message.type === "bricks" ? [message.bytes] : message.type === "plot" ? message.envelopes.map(({ buffer }) => buffer) : [];
  self.postMessage(message, { transfer: owned });
}
