// The pages of the dashboard. A page is an entry here and a component; the shell does the rest.

import { signal, type ReadonlySignal } from "@preact/signals";
import type { ComponentType } from "preact";
import { later } from "./later";
import { LivePage } from "./live/live_page";

export interface Page {
  /** Stands in the address: `#/live`. */
  readonly path: string;
  readonly title: string;
  readonly component: ComponentType;
}

export const PAGES: readonly Page[] = [
  { path: "live", title: "Live", component: LivePage },
  { path: "sessions", title: "Sessions", component: later(async () => (await import("./sessions/sessions_page")).SessionsPage) },
  { path: "recording", title: "Recording", component: later(async () => (await import("./recording/recording_page")).RecordingPage) },
  { path: "experiment", title: "Experiment", component: later(async () => (await import("./experiment/experiment_page")).ExperimentPage) },
  { path: "stability", title: "Stability", component: later(async () => (await import("./stability/stability_page")).StabilityPage) },
  { path: "robot", title: "Robot", component: later(async () => (await import("./robot/robot_page")).RobotPage) },
  { path: "latency", title: "Latency", component: later(async () => (await import("./latency/latency_page")).LatencyPage) },
];

const current = signal(pageInAddress());
export const currentPage: ReadonlySignal<Page> = current;

export function followAddress(): void {
  addEventListener("hashchange", () => {
    current.value = pageInAddress();
  });
}

/** The address of a page, with the session that is on show. */
export function addressOf(page: Page): string {
  const query = location.hash.split("?").at(1);
  return `#/${page.path}${query === undefined ? "" : `?${query}`}`;
}

function pageInAddress(): Page {
  const path = location.hash.replace(/^#\//, "").split("?")[0];
  return PAGES.find((page) => page.path === path) ?? PAGES[0];
}
