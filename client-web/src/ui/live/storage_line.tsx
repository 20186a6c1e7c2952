// What has become of the session's history on disk, where that is worth a word.

import { useComputed } from "@preact/signals";
import type { JSX } from "preact";
import { live } from "../store";

export function StorageLine(): JSX.Element | null {
  const news = live.storage.value;
  const reason = useComputed(() => live.session.value?.storage.reason ?? undefined).value;
  const isKnown = useComputed(() => live.session.value !== undefined).value;
  if (!isKnown || news === "fine") return null;
  switch (news) {
    case "behind":
      return (
        <p class="storage" role="status" data-storage={news} data-testid="storage">
          The disk is behind: the last seconds of cutting are not saved yet.
        </p>
      );
    case "failed":
      return (
        <p class="storage" role="alert" data-storage={news} data-testid="storage">
          <strong>Not saved{reason === undefined ? "." : `: ${reason}.`}</strong> Nothing is cut until the disk takes it again.
        </p>
      );
    case "ephemeral":
      return (
        <p class="storage" data-storage={news} data-testid="storage">
          Kept in memory only: this session ends with its server.
        </p>
      );
  }
}
