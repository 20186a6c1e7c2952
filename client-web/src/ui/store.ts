// The one connection of this page, and the clay worker that it feeds.

import { gridOf } from "../clay/past_mesh";
import { Live } from "../state/live";
import { Operating } from "../state/operating";
import { Past } from "../state/past";
import { Recordings } from "../state/recordings";
import { Sessions } from "../state/sessions";
import { Tables } from "../state/tables";
import { Theory } from "../state/theory";
import { TimeLine } from "../state/time_line";
import { browser } from "./browser";
import { ClayFeed } from "./clay_feed";
import { makeHand } from "./hand_feed";
import { blockOf } from "./live/moment";
import { readPast } from "./past_feed";
import { pictureQuality } from "./picture_quality";

export const live = new Live(browser);
export const sessions = new Sessions(browser, live);
export const recordings = new Recordings(browser, live);
export const timeLine = new TimeLine(browser, live);
export const past = new Past(
  browser,
  (at_s) => {
    const id = live.session.peek()?.id;
    return id === undefined ? undefined : live.api.clayPath(id, "glb", at_s);
  },
  async (bytes) => {
    const clay = live.session.peek()?.clay;
    if (clay === undefined) throw new Error("there is no session");
    return readPast(bytes, gridOf(blockOf(clay.shape).size_m, clay.voxel_size_m));
  },
);
export const operating = new Operating(browser, makeHand, (says) => live.report("warning", says));
export const theory = new Theory(browser);
/** The published table; a page that was built without it shows what a server or a file gives. */
const published = import.meta.glob<string>("../../../docs/latency/table.json", { query: "?url", import: "default", eager: true });
export const tables = new Tables(browser, Object.values(published).at(0));
export const clayFeed = new ClayFeed(pictureQuality() === "plain" ? "half" : "full", (says) => live.report("error", says));

/** Starts the connection: the address may name a session, as in `#/live?session=demo`. */
export function start(): void {
  live.onBricks = (bytes) => clayFeed.send(bytes);
  live.open(sessionInAddress());
  addEventListener("hashchange", () => {
    const wanted = sessionInAddress();
    if (wanted !== undefined && wanted !== live.session.peek()?.id && live.connection.sessions.peek().includes(wanted)) show(wanted);
  });
  // A page that comes back to the front, or a network that does, need not wait for the next try.
  addEventListener("online", () => live.connection.retryNow());
  document.addEventListener("visibilitychange", () => {
    if (!document.hidden) live.connection.retryNow();
  });
}

/** Shows another session, and says so in the address, so that it can be passed on. */
export function openSession(session: string): void {
  const [page] = location.hash.split("?");
  history.replaceState(null, "", `${page === "" ? "#/live" : page}?session=${encodeURIComponent(session)}`);
  show(session);
}

/** Where a session is shown: the address of a link. */
export function addressOfSession(session: string): string {
  const words = new URLSearchParams(location.hash.split("?").at(1));
  words.set("session", session);
  return `#/live?${words.toString()}`;
}

/** Where a recording is shown: the address of a link. */
export function addressOfRecording(session: string, recording: string): string {
  return `#/recording?${new URLSearchParams({ session, recording }).toString()}`;
}

function show(session: string): void {
  past.backToNow();
  live.open(session);
}

function sessionInAddress(): string | undefined {
  return wordInAddress("session");
}

/** What the address says beside the page: `1` for `operate` in `#/live?session=demo&operate=1`. */
export function wordInAddress(word: string): string | undefined {
  const query = location.hash.split("?").at(1);
  return query === undefined ? undefined : (new URLSearchParams(query).get(word) ?? undefined);
}
