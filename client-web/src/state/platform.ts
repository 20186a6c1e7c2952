// What state/ needs of the world, as arguments: clock, timers, chance, sockets, requests. The page gives the browser's,
// tests give their own.

export interface SocketEvents {
  onOpen(): void;
  onText(text: string): void;
  onBinary(bytes: ArrayBuffer): void;
  /** Once, whether the socket was ever open or not. */
  onClose(end: SocketEnd): void;
}

/** How a socket ended: RFC 6455's code, and what the other end said of it. */
export interface SocketEnd {
  readonly code: number;
  readonly reason: string;
}

export interface Socket {
  send(text: string): void;
  close(): void;
}

export interface Answer {
  readonly status: number;
  readonly body: string;
}

/** A file's bytes, or what the server says instead. */
export interface Loaded {
  readonly status: number;
  readonly bytes: ArrayBuffer;
}

/** A file for the server, and its media type. */
export interface Upload {
  readonly bytes: Blob;
  readonly type: string;
}

export interface Platform {
  /** Time that never goes back, ms. */
  now_ms(): number;
  /** Runs something later; returns what calls it off. */
  after(delay_ms: number, run: () => void): () => void;
  /** 0 ≤ x < 1. */
  random(): number;
  /** Opens a socket at a path of the server. */
  connect(path: string, subprotocol: string, events: SocketEvents): Socket;
  /** Rejects when nobody answers, or not within `patience_ms`. */
  request(method: "GET" | "POST" | "PATCH" | "DELETE", path: string, body?: unknown, patience_ms?: number): Promise<Answer>;
  /** Puts a file at a path of the server. Rejects as `request` does. */
  put(path: string, upload: Upload, patience_ms: number): Promise<Answer>;
  /** Rejects when nobody answers, or once `signal` is aborted. */
  load(path: string, signal: AbortSignal): Promise<Loaded>;
}
