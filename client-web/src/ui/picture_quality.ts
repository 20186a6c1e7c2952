// How finely the clay is drawn here: as the machine allows, unless the address says otherwise.

import { processorDraws, type Quality } from "../scene/quality";

/** `#/live?picture=fine` draws all there is on any machine, for pictures; `picture=plain` spares one. */
export function wantedQuality(): Quality | undefined {
  const wanted = new URLSearchParams(location.hash.split("?").at(1)).get("picture");
  return wanted === "fine" || wanted === "plain" ? wanted : undefined;
}

export function pictureQuality(): Quality {
  return wantedQuality() ?? (processorDraws() ? "plain" : "fine");
}
