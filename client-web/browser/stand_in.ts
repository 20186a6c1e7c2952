// A server's outside, for what a page does with a tool: it serves the built page and a session of one tool, and grants,
// refuses and takes away by the rules of tools and stops. What only a server can answer is tested against a real one.

import { readFileSync } from "node:fs";
import { createServer, type IncomingMessage, type Server, type ServerResponse } from "node:http";
import { extname, join, resolve } from "node:path";
import * as v from "valibot";
import { bytesOf, recordedStroke } from "../src/protocol/built_hand";
import type { Session, ToolState } from "../src/protocol/session";
import { fakeSession } from "../src/state/fake_session";
import { StandInLoop } from "./stand_in_loop";
import { ServerSocket } from "./stand_in_socket";

/** The page that is served. */
export const DASHBOARD = resolve(process.env["TELECLAY_DASHBOARD_DIR"] ?? join(import.meta.dirname, "../dist"));
const TYPES: Readonly<Record<string, string>> = {
  ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".wasm": "application/wasm", ".svg": "image/svg+xml", ".json": "application/json",
};
const STATE_EVERY_MS = 200;
const HANDLE_FRAMES = 3;
const HOME_M: [number, number, number] = [0.064, 0.032, 0.0384];
const KEY_BYTES = 32;
const [A_TOOL] = fakeSession().tools;

const textSchema = v.looseObject({ type: v.string(), operator: v.optional(v.string()), nonce: v.optional(v.number()), telemetry: v.optional(v.string()) });
type Text = v.InferOutput<typeof textSchema>;
const bodySchema = v.object({ operator: v.optional(v.string(), ""), reason: v.optional(v.string(), "") });
const grantSchema = v.looseObject({ lease: v.number(), parameters: v.looseObject({ revision: v.number() }) });

export class StandIn {
  session: Session = fakeSession({ state: "idle", tools: [{ ...A_TOOL, operator: "", connected: false, home_m: HOME_M, position_m: HOME_M }] });
  /** What hands have asked. */
  readonly asked: Text[] = [];
  /** Messages of frames that hands have sent. */
  frames = 0;
  /** A silent loop is one whose frames do not come through. */
  isSilent = false;
  /** What a grant says of the loop, where that is something else than was recorded. */
  parameters: Record<string, unknown> = {};
  readonly #server: Server;
  readonly #watchers = new Set<ServerSocket>();
  readonly #timer: NodeJS.Timeout;
  #holder: { readonly socket: ServerSocket; readonly loop: StandInLoop } | undefined;
  #lease = 0;

  private constructor(server: Server) {
    this.#server = server;
    server.on("request", (request, response) => void this.#answer(request, response));
    server.on("upgrade", (request, stream) => this.#open(new ServerSocket(request, stream, "teleclay.v1")));
    this.#timer = setInterval(() => this.#tell(), STATE_EVERY_MS);
  }

  static async start(): Promise<StandIn> {
    const server = createServer();
    await new Promise<void>((done) => server.listen(0, "127.0.0.1", done));
    return new StandIn(server);
  }

  get url(): string {
    const address = this.#server.address();
    if (address === null || typeof address === "string") throw new Error("nobody listens");
    return `http://127.0.0.1:${address.port}`;
  }

  get tool(): ToolState {
    return this.session.tools[0];
  }

  /** Where the tool of whoever holds it is, m. */
  get tool_m(): readonly number[] | undefined {
    return this.#holder?.loop.position_m;
  }

  change(session: Partial<Session>, tool: Partial<ToolState> = {}): void {
    this.session = { ...this.session, ...session, tools: [{ ...this.tool, ...tool }] };
    this.#tell();
  }

  /** The line of whoever holds the tool breaks. */
  cut(): void {
    this.#holder?.socket.end();
    this.#free();
  }

  end(): void {
    clearInterval(this.#timer);
    this.#server.closeAllConnections();
    this.#server.close();
  }

  #farewell(reason: string): void {
    this.#holder?.socket.send(JSON.stringify({ type: "farewell", reason }));
    this.#free();
  }

  #free(): void {
    this.#holder = undefined;
    this.change({ state: this.session.state === "stopped" ? "stopped" : "idle" }, { operator: "", connected: false, requests: [] });
  }

  #tell(): void {
    for (const watcher of this.#watchers) watcher.send(JSON.stringify({ type: "state", session: this.session }));
  }

  async #answer(request: IncomingMessage, response: ServerResponse): Promise<void> {
    const { pathname } = new URL(request.url ?? "/", this.url);
    if (!pathname.startsWith("/api/")) {
      const name = pathname === "/" ? "index.html" : pathname;
      try {
        const file = readFileSync(join(DASHBOARD, name));
        response.writeHead(200, { "content-type": TYPES[extname(name)] }).end(file);
      } catch {
        response.writeHead(404).end();
      }
      return;
    }
    let body = "";
    for await (const part of request) body += String(part);
    const [status, answer] = this.#ask(`${request.method ?? ""} ${pathname.slice("/api/v1".length)}`, v.parse(bodySchema, JSON.parse(body === "" ? "{}" : body)));
    response.writeHead(status, { "content-type": status < 400 ? "application/json" : "application/problem+json" }).end(JSON.stringify(answer));
  }

  #ask(call: string, { operator, reason }: v.InferOutput<typeof bodySchema>): [number, unknown] {
    switch (call) {
      case "GET /sessions": return [200, [this.session]];
      case "GET /sessions/demo/recordings": return [200, []];
      case "GET /sessions/demo/history": return [200, { strokes: [], from_s: 0, to_s: 0 }];
      case "POST /sessions/demo/stop":
        this.change({ state: "stopped", stop: { by: "the token's bearer", reason } });
        this.#farewell(`stopped by the token's bearer: ${reason}`);
        break;
      case "POST /sessions/demo/stop/clear": this.change({ state: "idle", stop: null }); break;
      case "POST /sessions/demo/tools/1/request": this.change({}, { requests: [...this.tool.requests, operator] }); break;
      case "POST /sessions/demo/tools/1/deny": case "POST /sessions/demo/tools/1/withdraw":
        this.change({}, { requests: this.tool.requests.filter((each) => each !== operator) });
        break;
      case "POST /sessions/demo/tools/1/grant":
        this.#farewell(`handed over to ${operator}`);
        this.change({}, { reserved_for: operator });
        break;
      default: return [404, { type: "about:blank", title: "unknown", status: 404, detail: `there is no ${call}` }];
    }
    return [200, this.session];
  }

  #open(socket: ServerSocket): void {
    socket.listen({
      onText: (text) => this.#onText(socket, v.parse(textSchema, JSON.parse(text))),
      onBinary: (bytes) => this.#onFrames(socket, bytes),
      onEnd: () => {
        this.#watchers.delete(socket);
        if (this.#holder?.socket === socket) this.#free();
      },
    });
    socket.send(JSON.stringify({ type: "hello", protocol: 1, session: "demo", server_version: "0" }));
  }

  #onFrames(socket: ServerSocket, bytes: Buffer): void {
    if (bytes[3] !== HANDLE_FRAMES || this.#holder?.socket !== socket) return;
    this.frames += 1;
    if (!this.isSilent) socket.send(this.#holder.loop.answer(bytes));
  }

  #onText(socket: ServerSocket, message: Text): void {
    switch (message.type) {
      case "subscribe":
        if (message.telemetry === "on") this.#watchers.add(socket);
        this.#tell();
        break;
      case "ping": socket.send(JSON.stringify({ type: "pong", nonce: message.nonce })); break;
      case "join":
        this.asked.push(message);
        socket.send(JSON.stringify(this.#join(socket, message.operator ?? "")));
        break;
      default:
        this.asked.push(message);
        if (message.type !== "leave") return;
        if (this.#holder?.socket === socket) this.#free();
        socket.send(JSON.stringify({ type: "left" }));
    }
  }

  #join(socket: ServerSocket, operator: string): unknown {
    const refused = (code: string, reason: string, holder?: string): unknown => ({ type: "refused", code, reason, holder });
    const { operator: holder, reserved_for } = this.tool;
    if (this.session.stop !== null) return refused("stopped", `the session is stopped: ${this.session.stop.reason}`);
    if (holder !== "" && holder !== operator) return refused("no_free_tool", `${holder} holds the tool`, holder);
    if (reserved_for !== null && reserved_for !== operator) return refused("reserved", `the tool is kept for ${reserved_for}`, reserved_for);
    const { keys, granted } = recordedStroke();
    this.#lease += 1;
    this.#holder = { socket, loop: new StandInLoop(bytesOf(keys).subarray(KEY_BYTES), HOME_M) };
    this.change({ state: "running" }, { operator, connected: true, reserved_for: null });
    const recorded = v.parse(grantSchema, JSON.parse(granted));
    // A session counts a revision for every lease; by that a handle knows that it is the same one, later.
    const parameters = { ...recorded.parameters, ...this.parameters, revision: recorded.parameters.revision + this.#lease };
    return { type: "granted", keys, granted: { ...recorded, parameters, lease: this.#lease } };
  }
}
