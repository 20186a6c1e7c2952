// The browser as state/ wants to see it: sockets, requests, timers.

import { saidIn } from "../state/api";
import type { Answer, Loaded, Platform, Socket, SocketEvents, Upload } from "../state/platform";
import { token } from "./token";

/** A request that takes longer has failed, unless it is known to be long: the server answers in milliseconds. */
const REQUEST_MS = 5000;

export const browser: Platform = {
  now_ms: () => performance.now(),
  random: () => Math.random(),
  after: (delay_ms, run) => {
    const timer = setTimeout(run, delay_ms);
    return () => clearTimeout(timer);
  },
  connect,
  request,
  put,
  load,
};

function connect(path: string, subprotocol: string, events: SocketEvents): Socket {
  const url = new URL(path, document.baseURI);
  url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
  // A page cannot set headers here: the token goes beside the subprotocol.
  const bearer = token.peek();
  const socket = new WebSocket(url, bearer === undefined ? subprotocol : [subprotocol, `bearer.${bearer}`]);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => events.onOpen();
  socket.onclose = ({ code, reason }) => events.onClose({ code, reason });
  socket.onmessage = ({ data }: MessageEvent<string | ArrayBuffer>) => {
    if (typeof data === "string") events.onText(data);
    else events.onBinary(data);
  };
  return {
    send: (text) => {
      if (socket.readyState === WebSocket.OPEN) socket.send(text);
    },
    close: () => socket.close(),
  };
}

async function request(method: "GET" | "POST" | "PATCH" | "DELETE", path: string, body?: unknown, patience_ms = REQUEST_MS): Promise<Answer> {
  const response = await fetch(new URL(path, document.baseURI), {
    method,
    signal: AbortSignal.timeout(patience_ms),
    headers: { ...authorization(), ...(body === undefined ? {} : { "content-type": "application/json" }) },
    ...(body === undefined ? {} : { body: JSON.stringify(body) }),
  });
  return { status: response.status, body: await response.text() };
}

async function put(path: string, { bytes, type }: Upload, patience_ms: number): Promise<Answer> {
  const response = await fetch(new URL(path, document.baseURI), {
    method: "PUT",
    signal: AbortSignal.timeout(patience_ms),
    headers: { ...authorization(), "content-type": type },
    body: bytes,
  });
  return { status: response.status, body: await response.text() };
}

async function load(path: string, signal: AbortSignal): Promise<Loaded> {
  const response = await fetch(new URL(path, document.baseURI), { signal, headers: authorization() });
  return { status: response.status, bytes: await response.arrayBuffer() };
}

export function authorization(): Record<string, string> {
  const bearer = token.peek();
  return bearer === undefined ? {} : { authorization: `Bearer ${bearer}` };
}

/** A file of the server's, for whoever sits at the page; the reason in words where it cannot be had. */
export async function fetchFile(path: string): Promise<Blob | string> {
  try {
    const response = await fetch(new URL(path, document.baseURI), { headers: authorization() });
    return response.ok ? await response.blob() : saidIn({ status: response.status, body: await response.text() }).detail;
  } catch {
    return "the server does not answer";
  }
}
