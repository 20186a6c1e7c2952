// What crosses between the page and the worker that reads a recording.

import type { FilmFacts, FilmMoment } from "../protocol/film";

/** Where a recording is: on the server, with what a request has to show, or a file of whoever sits at the page. */
export type Place =
  | { readonly kind: "server"; readonly url: string; readonly headers: Readonly<Record<string, string>> }
  | { readonly kind: "file"; readonly file: Blob };

export interface Plot {
  readonly tool: number;
  readonly channels: readonly number[];
  readonly from_s: number;
  readonly to_s: number;
  readonly columns: number;
}

export type ToFilm =
  /** Comes first of all, once. `grows`: it may not be at its end yet. */
  | { readonly type: "open"; readonly place: Place; readonly grows: boolean }
  /** Only the newest counts. */
  | { readonly type: "seek"; readonly at_s: number }
  /** Likewise, by name. */
  | { readonly type: "plot"; readonly name: string; readonly plot: Plot }
  /** Reads on where a file has grown; `grows`: it may grow more. */
  | { readonly type: "more"; readonly grows: boolean };

export type FromFilm =
  | { readonly type: "facts"; readonly facts: FilmFacts; readonly size: number | undefined; readonly isRead: boolean }
  | { readonly type: "moment"; readonly moment: FilmMoment; readonly asked_s: number }
  | { readonly type: "bricks"; readonly bytes: ArrayBuffer }
  /** By channel, as it was asked for: the least and the greatest of each column. */
  | { readonly type: "plot"; readonly name: string; readonly plot: Plot; readonly envelopes: readonly Float32Array<ArrayBuffer>[] }
  /** In a sentence without its full stop. */
  | { readonly type: "trouble"; readonly says: string };
