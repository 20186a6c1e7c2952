// The real server and the real handle, as processes of their own on ports of their own.

import { type ChildProcess, spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { decodeProblem, decodeSession } from "../src/protocol/text";
import type { Session } from "../src/protocol/session";
import { until } from "./until";

const BINARIES = resolve(process.env["TELECLAY_BIN_DIR"] ?? join(import.meta.dirname, "../../target/release"));
const SESSION = "demo";
/** What a process said last, for the report of a failed test. */
const LINES_KEPT = 40;

class Program {
  readonly #name: string;
  readonly #child: ChildProcess;
  readonly #lines: string[] = [];
  readonly #ended: Promise<void>;

  constructor(name: string, parameters: readonly string[]) {
    this.#name = name;
    this.#child = spawn(join(BINARIES, name), parameters, {
      stdio: ["ignore", "pipe", "pipe"],
      env: withoutSettings(process.env),
    });
    this.#ended = new Promise((resume) => {
      this.#child.once("exit", () => resume());
      this.#child.once("error", (error) => {
        this.#keep(`${name} did not start: ${error.message}`);
        resume();
      });
    });
    for (const stream of [this.#child.stdout, this.#child.stderr]) {
      stream?.setEncoding("utf8").on("data", (text: string) => this.#keep(text));
    }
  }

  get isRunning(): boolean {
    return this.#child.exitCode === null && this.#child.signalCode === null && this.#child.pid !== undefined;
  }

  get said(): string {
    return `${this.#name} said:\n${this.#lines.join("\n")}`;
  }

  async kill(): Promise<void> {
    if (this.isRunning) this.#child.kill("SIGKILL");
    await this.#ended;
  }

  #keep(text: string): void {
    this.#lines.push(...text.split("\n").filter((line) => line !== ""));
    this.#lines.splice(0, this.#lines.length - LINES_KEPT);
  }
}

/** A server with one session, and a simulated hand that cuts. */
export class Teleclay {
  readonly url: string;
  readonly #listen: string;
  readonly #zenoh: string;
  readonly #data = mkdtempSync(join(tmpdir(), "teleclay-browser-"));
  #server: Program | undefined;
  #handle: Program | undefined;

  private constructor(http: number, zenoh: number) {
    this.#listen = `127.0.0.1:${http}`;
    this.#zenoh = `tcp/127.0.0.1:${zenoh}`;
    this.url = `http://${this.#listen}`;
  }

  static async onFreePorts(): Promise<Teleclay> {
    // Slow state takes the port after the control's.
    const [http] = await freePorts(1);
    const [zenoh] = await freePorts(2);
    return new Teleclay(http, zenoh);
  }

  async startServer(): Promise<void> {
    const server = new Program("teleclay-server", ["--listen", this.#listen, "--zenoh-listen", this.#zenoh, "--data-dir", this.#data]);
    this.#server = server;
    await until("the server is ready", async () => {
      if (!server.isRunning) throw new Error(server.said);
      return (await fetch(`${this.url}/readyz`).catch(() => undefined))?.ok;
    });
  }

  startHandle(): void {
    this.#handle = new Program("teleclay-handle", ["--connect", this.#zenoh, "--session", SESSION, "--device", "simulated", "--intent", "cutting"]);
  }

  async killServer(): Promise<void> {
    await this.#server?.kill();
  }

  async killHandle(): Promise<void> {
    await this.#handle?.kill();
  }

  async session(): Promise<Session> {
    return decodeSession(await (await fetch(`${this.url}/api/v1/sessions/${SESSION}`)).text());
  }

  /** What the server says against a scheme, in its own words; nothing when it takes it. */
  async refusalOfScheme(scheme: string): Promise<string | undefined> {
    const answer = await fetch(`${this.url}/api/v1/sessions/${SESSION}`, {
      method: "PATCH",
      headers: { "content-type": "application/json" },
      body: JSON.stringify({ scheme }),
    });
    return answer.ok ? undefined : decodeProblem(await answer.text())?.detail;
  }

  /** Everything ends; nothing is left behind. */
  async end(): Promise<void> {
    await this.killHandle();
    await this.killServer();
    rmSync(this.#data, { recursive: true, force: true });
  }

  get said(): string {
    return [this.#server?.said, this.#handle?.said].join("\n");
  }
}

/** The programs take settings from the environment: what is meant for the tests must not reach them. */
function withoutSettings(environment: NodeJS.ProcessEnv): NodeJS.ProcessEnv {
  return Object.fromEntries(Object.entries(environment).filter(([name]) => !name.startsWith("TELECLAY_")));
}

/** The first of `count` ports in a row that nobody listens on. */
async function freePorts(count: number): Promise<[number]> {
  for (;;) {
    const first = await listenBriefly(0);
    if (first === undefined) continue;
    let all = true;
    for (let n = 1; n < count; n += 1) all = (await listenBriefly(first + n)) !== undefined && all;
    if (all) return [first];
  }
}

function listenBriefly(port: number): Promise<number | undefined> {
  return new Promise((resume) => {
    const server = createServer();
    server.once("error", () => resume(undefined));
    server.listen(port, "127.0.0.1", () => {
      const address = server.address();
      server.close(() => resume(address !== null && typeof address === "object" ? address.port : undefined));
    });
  });
}
