// A server's end of a WebSocket, RFC 6455, as far as a test needs it: whole messages, no extensions.

import { createHash } from "node:crypto";
import type { IncomingMessage } from "node:http";
import type { Duplex } from "node:stream";

const MAGIC = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";
const [TEXT, BINARY, CLOSE] = [1, 2, 8];

export interface SocketListener {
  onText(text: string): void;
  onBinary(bytes: Buffer): void;
  /** It has ended, which is told once. */
  onEnd(): void;
}

export class ServerSocket {
  readonly #stream: Duplex;
  #waiting = Buffer.alloc(0);

  constructor(request: IncomingMessage, stream: Duplex, subprotocol: string) {
    this.#stream = stream;
    const accept = createHash("sha1").update(`${request.headers["sec-websocket-key"] ?? ""}${MAGIC}`).digest("base64");
    const lines = ["HTTP/1.1 101 Switching Protocols", "upgrade: websocket", "connection: upgrade", `sec-websocket-accept: ${accept}`, `sec-websocket-protocol: ${subprotocol}`];
    stream.write(`${lines.join("\r\n")}\r\n\r\n`);
  }

  listen(listener: SocketListener): void {
    let hasEnded = false;
    const end = (): void => {
      if (!hasEnded) listener.onEnd();
      hasEnded = true;
    };
    this.#stream.on("data", (bytes: Buffer) => {
      this.#waiting = Buffer.concat([this.#waiting, bytes]);
      for (let message = this.#next(); message !== undefined; message = this.#next()) {
        if (message.code === TEXT) listener.onText(message.payload.toString());
        else if (message.code === BINARY) listener.onBinary(message.payload);
        else if (message.code === CLOSE) this.end();
      }
    });
    this.#stream.on("close", end);
    this.#stream.on("error", end);
  }

  send(message: string | Buffer): void {
    const payload = typeof message === "string" ? Buffer.from(message) : message;
    const head = payload.length < 126 ? [payload.length] : [126, payload.length >> 8, payload.length & 255];
    if (0xffff < payload.length) throw new Error("too long for this stand-in");
    if (this.#stream.writable) this.#stream.write(Buffer.concat([Buffer.from([0x80 | (typeof message === "string" ? TEXT : BINARY), ...head]), payload]));
  }

  end(): void {
    this.#stream.destroy();
  }

  /** The first whole message of what came; nothing while there is none. */
  #next(): { readonly code: number; readonly payload: Buffer } | undefined {
    const bytes = this.#waiting;
    if (bytes.length < 6) return undefined;
    const short = bytes[1] & 127;
    if (short === 127) throw new Error("too long for this stand-in");
    const at = short === 126 ? 4 : 2;
    const length = short === 126 ? bytes.readUInt16BE(2) : short;
    const end = at + 4 + length;
    if (bytes.length < end) return undefined;
    const mask = bytes.subarray(at, at + 4);
    const payload = Buffer.from(bytes.subarray(at + 4, end).map((byte, n) => byte ^ mask[n % 4]));
    this.#waiting = bytes.subarray(end);
    return { code: bytes[0] & 15, payload };
  }
}
