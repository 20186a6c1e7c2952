// The worker that is the hand: it has the socket and the loop, and no thread of the page can hold it up. Where the page
// is isolated it sleeps on a cell of shared memory to a fraction of a millisecond; elsewhere timers wake it, which
// browsers hold to 4 ms and, for a page that is not seen, to a second. The module makes the ticks that are owed either
// way.

import address from "../../generated/hand.wasm?url";
import { type HandModule, handModuleFrom } from "../protocol/hand_module";
import { HandLoop, type Line } from "./loop";
import type { FromHand, ToHand } from "./port";

/** What the page says before the module is there waits for it, in its order. */
const loading = handModuleFrom(fetch(address)).then(start);
loading.catch((error: unknown) => {
  post({ type: "trouble", says: `there is no hand, as its module did not load: ${error instanceof Error ? error.message : String(error)}` });
});

self.onmessage = ({ data }: MessageEvent<ToHand>): void => {
  loading.then((loop) => loop.take(data), () => undefined);
};

function start(module: HandModule): HandLoop {
  const loop: HandLoop = new HandLoop(module, {
    now: () => performance.now(),
    began_epoch_ms: performance.timeOrigin,
    how: crossOriginIsolated ? "precise" : "timers",
    connect: (url, subprotocols) => connect(url, subprotocols, loop),
    post,
  });
  if (crossOriginIsolated) wakePrecisely(loop);
  else wakeByTimers(loop);
  return loop;
}

/** Sleeps, wakes, and lets messages and sockets have their turn before it sleeps again. */
function wakePrecisely(loop: HandLoop): void {
  const cell = new Int32Array(new SharedArrayBuffer(4));
  const { port1, port2 } = new MessageChannel();
  let wait_ms: number | undefined = 0;
  port1.onmessage = (): void => {
    if (wait_ms !== undefined && 0 < wait_ms) Atomics.wait(cell, 0, 0, wait_ms);
    wait_ms = loop.wake();
    if (wait_ms !== undefined) port2.postMessage(null);
  };
  port2.postMessage(null);
}

function wakeByTimers(loop: HandLoop): void {
  const wait_ms = loop.wake();
  if (wait_ms !== undefined) setTimeout(wakeByTimers, wait_ms, loop);
}

function connect(url: string, subprotocols: readonly string[], loop: HandLoop): Line {
  const socket = new WebSocket(url, [...subprotocols]);
  socket.binaryType = "arraybuffer";
  socket.onopen = (): void => loop.onOpen();
  socket.onmessage = ({ data }: MessageEvent<string | ArrayBuffer>): void => {
    if (typeof data === "string") loop.onText(data);
    else loop.onBinary(data);
  };
  socket.onclose = ({ code, reason }): void => loop.onClose(code, reason);
  return {
    send: (message) => {
      if (socket.readyState === WebSocket.OPEN) socket.send(message);
    },
    waiting: () => socket.bufferedAmount,
    close: () => {
      socket.onopen = null;
      socket.onmessage = null;
      socket.onclose = null;
      socket.close();
    },
  };
}

function post(message: FromHand): void {
  self.postMessage(message, { transfer: message.type === "binary" ? [message.bytes] : [] });
}
