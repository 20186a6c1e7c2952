// A world for tests: time stands still until it is told to pass, and the server says what the test says.

import type { Answer, Loaded, Platform, Socket, SocketEvents, Upload } from "./platform";

interface Timer {
  readonly at_ms: number;
  readonly run: () => void;
}

export class FakeSocket implements Socket {
  readonly path: string;
  readonly events: SocketEvents;
  readonly sent: string[] = [];
  closed = false;

  constructor(path: string, events: SocketEvents) {
    this.path = path;
    this.events = events;
  }

  send(text: string): void {
    this.sent.push(text);
  }

  close(): void {
    this.closed = true;
  }
}

export class FakePlatform implements Platform {
  readonly sockets: FakeSocket[] = [];
  readonly requests: { method: string; path: string; body: unknown }[] = [];
  /** What the server answers; throws when there is none. */
  answer: (method: string, path: string, body: unknown) => Answer | Promise<Answer> = () => {
    throw new Error("nobody answers");
  };
  readonly puts: { path: string; upload: Upload }[] = [];
  /** Files that were asked for, with the say of who asked: it gives up by aborting that. */
  readonly loads: { path: string; signal: AbortSignal }[] = [];
  /** The file at a path; throws when nobody answers. */
  file: (path: string) => Loaded | Promise<Loaded> = () => {
    throw new Error("nobody answers");
  };
  #time_ms = 0;
  #timers: Timer[] = [];

  get lastSocket(): FakeSocket {
    const socket = this.sockets.at(-1);
    if (socket === undefined) throw new Error("no socket was opened");
    return socket;
  }

  now_ms(): number {
    return this.#time_ms;
  }

  random(): number {
    return 0.5;
  }

  after(delay_ms: number, run: () => void): () => void {
    const timer = { at_ms: this.#time_ms + delay_ms, run };
    this.#timers.push(timer);
    return () => {
      this.#timers = this.#timers.filter((other) => other !== timer);
    };
  }

  connect(path: string, _subprotocol: string, events: SocketEvents): Socket {
    const socket = new FakeSocket(path, events);
    this.sockets.push(socket);
    return socket;
  }

  async request(method: string, path: string, body?: unknown): Promise<Answer> {
    this.requests.push({ method, path, body });
    return this.answer(method, path, body);
  }

  async put(path: string, upload: Upload): Promise<Answer> {
    this.puts.push({ path, upload });
    return this.answer("PUT", path, undefined);
  }

  async load(path: string, signal: AbortSignal): Promise<Loaded> {
    this.loads.push({ path, signal });
    const loaded = await this.file(path);
    signal.throwIfAborted();
    return loaded;
  }

  /** The page is too busy to run any timer for a while; afterwards each that is due runs once. */
  async sleep(duration_ms: number): Promise<void> {
    this.#time_ms += duration_ms;
    await this.pass(0);
  }

  /** Lets time pass, timer by timer, and lets answers arrive in between. */
  async pass(duration_ms: number): Promise<void> {
    const end_ms = this.#time_ms + duration_ms;
    await settled();
    for (;;) {
      const next = this.#timers.filter(({ at_ms }) => at_ms <= end_ms).sort((a, b) => a.at_ms - b.at_ms).at(0);
      if (next === undefined) break;
      this.#timers = this.#timers.filter((timer) => timer !== next);
      this.#time_ms = Math.max(this.#time_ms, next.at_ms);
      next.run();
      await settled();
    }
    this.#time_ms = end_ms;
  }
}

/** Lets everything run that only waits for its turn. */
export async function settled(): Promise<void> {
  for (let turn = 0; turn < 12; turn += 1) await Promise.resolve();
}
