// What the page shows to the server where that asks for it: it comes with an invite's link, or from whoever sits here.

import { signal, type ReadonlySignal } from "@preact/signals";

/** Kept for as long as the tab lives, and in no other tab. */
const KEY = "teleclay-token";

const shown = signal<string | undefined>(undefined);
export const token: ReadonlySignal<string | undefined> = shown;

/** Takes the token out of the address, where it would be seen, and passed on with the link; or the one of before. */
export function takeToken(): void {
  const [page] = location.hash.split("?");
  const words = new URLSearchParams(location.hash.split("?").at(1) ?? "");
  const invited = words.get("token");
  if (invited !== null) {
    words.delete("token");
    const rest = words.toString();
    history.replaceState(null, "", `${page}${rest === "" ? "" : `?${rest}`}`);
    showToken(invited);
    return;
  }
  shown.value = sessionStorage.getItem(KEY) ?? undefined;
}

export function showToken(next: string): void {
  sessionStorage.setItem(KEY, next);
  shown.value = next;
}
