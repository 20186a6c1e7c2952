// The hand's worker, seen from the page: made when somebody operates, and nothing of it is loaded before.

import type { FromHand, ToHand } from "../hand/port";
import { SUBPROTOCOL } from "../protocol/text";
import type { HandPort } from "../state/conversation";
import { API } from "../state/connection";
import { token } from "./token";

export function makeHand(onMessage: (message: FromHand) => void): HandPort {
  const worker = new Worker(new URL("../hand/worker.ts", import.meta.url), { type: "module" });
  worker.onmessage = ({ data }: MessageEvent<FromHand>) => onMessage(data);
  worker.onerror = ({ message }) => onMessage({ type: "trouble", says: `the hand's worker did not start: ${message}` });
  const post = (message: ToHand): void => worker.postMessage(message);
  return {
    connect: (session) => {
      const url = new URL(`${API}/sessions/${encodeURIComponent(session)}/stream`, document.baseURI);
      url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
      // A worker cannot set headers either: the token goes beside the subprotocol.
      const bearer = token.peek();
      post({ type: "connect", url: url.href, subprotocols: bearer === undefined ? [SUBPROTOCOL] : [SUBPROTOCOL, `bearer.${bearer}`] });
    },
    post,
    end: () => worker.terminate(),
  };
}
