// The one connection of this page, and the clay worker that it feeds.

import { Live } from "../state/live";
import { Tables } from "../state/tables";
import { Theory } from "../state/theory";
import { browser } from "./browser";
import { ClayFeed } from "./clay_feed";
import { pictureQuality } from "./picture_quality";

export const live = new Live(browser);
export const theory = new Theory(browser);
/** The published table; a page that was built without it shows what a server or a file gives. */
const published = import.meta.glob<string>("../../../docs/latency/table.json", { query: "?url", import: "default", eager: true });
export const tables = new Tables(browser, Object.values(published).at(0));
export const clayFeed = new ClayFeed(pictureQuality() === "plain" ? "half" : "full", (says) => live.report("error", says));

/** Starts the connection: the address may name a session, as in `#/live?session=demo`. */
export function start(): void {
  live.onBricks = (bytes) => clayFeed.send(bytes);
  live.open(sessionInAddress());
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
  live.open(session);
}

function sessionInAddress(): string | undefined {
  const query = location.hash.split("?").at(1);
  return query === undefined ? undefined : (new URLSearchParams(query).get("session") ?? undefined);
}
