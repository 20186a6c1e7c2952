// The real server and the real handle, as processes of their own on ports of their own.

import { type ChildProcess, execFileSync, spawn } from "node:child_process";
import { existsSync, mkdtempSync, readdirSync, readFileSync, rmSync, statSync, writeFileSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join, resolve, sep } from "node:path";
import { decodeSession } from "../src/protocol/text";
import type { Session, SessionPatch } from "../src/protocol/session";
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

  /** What it has taken of processors so far, s. */
  get cpu_s(): number {
    const text = readFileSync(`/proc/${this.#child.pid ?? 0}/stat`, "utf8");
    // After the name, which may hold anything: user and system time are the 12th and 13th field, in ticks of 10 ms.
    const fields = text.slice(text.lastIndexOf(")") + 2).split(" ");
    return (Number(fields[11]) + Number(fields[12])) / 100;
  }

  get said(): string {
    return `${this.#name} said:\n${this.#lines.join("\n")}`;
  }

  get ended(): Promise<void> {
    return this.#ended;
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
  readonly #handles: Program[] = [];

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

  /** `token`: what whoever comes has to show. */
  async startServer(token?: string): Promise<void> {
    const flags = ["--listen", this.#listen, "--zenoh-listen", this.#zenoh, "--data-dir", this.#data];
    if (token !== undefined) {
      const config = join(this.#data, "server.toml");
      writeFileSync(config, `token = "${token}"\n`);
      flags.push("--config", config);
    }
    const server = new Program("teleclay-server", flags);
    this.#server = server;
    await until("the server is ready", async () => {
      if (!server.isRunning) throw new Error(server.said);
      return (await fetch(`${this.url}/readyz`).catch(() => undefined))?.ok;
    });
  }

  /**
   * A simulated hand that cuts in the demo session, or whatever `wish` says. Several may hold on at once, each to its
   * own tool.
   */
  startHandle(...wish: readonly string[]): void {
    const parameters = wish.length === 0 ? ["--session", SESSION, "--intent", "cutting"] : wish;
    this.#handles.push(new Program("teleclay-handle", ["--connect", this.#zenoh, "--device", "simulated", ...parameters]));
  }

  /** What the server has taken of processors so far, s. */
  get serverCpu_s(): number {
    if (this.#server === undefined) throw new Error("there is no server");
    return this.#server.cpu_s;
  }

  /** The link of an invite to the demo session, as it is printed. */
  invite(role: string): string {
    const words = ["invite", SESSION, "--role", role, "--data-dir", this.#data];
    const printed = execFileSync(join(BINARIES, "teleclay-server"), words, { encoding: "utf8", env: withoutSettings(process.env) });
    const link = /https?:\/\/\S+/.exec(printed)?.[0];
    if (link === undefined) throw new Error(`an invite has a link, and this came: ${printed}`);
    return link;
  }

  async killServer(): Promise<void> {
    await this.#server?.kill();
  }

  async killHandles(): Promise<void> {
    await Promise.all(this.#handles.splice(0).map((handle) => handle.kill()));
  }

  /** Makes another session. */
  async create(session: object): Promise<void> {
    await this.ask("sessions", session);
  }

  /** A call of the theory, asked by the test itself: the answer as it comes. */
  async ask(path: string, question: unknown): Promise<string> {
    const answer = await fetch(`${this.url}/api/v1/${path}`, {
      method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(question),
    });
    const text = await answer.text();
    if (!answer.ok) throw new Error(`${path} answered ${answer.status}: ${text}`);
    return text;
  }

  async session(name = SESSION): Promise<Session> {
    return decodeSession(await (await fetch(`${this.url}/api/v1/sessions/${name}`)).text());
  }

  /** Changes a session. */
  async patch(name: string, change: SessionPatch): Promise<void> {
    const answer = await fetch(`${this.url}/api/v1/sessions/${name}`, {
      method: "PATCH", headers: { "content-type": "application/json" }, body: JSON.stringify(change),
    });
    if (!answer.ok) throw new Error(`the change of ${name} was answered ${answer.status}: ${await answer.text()}`);
  }

  /** Does to the files of a session what a bad disk does: every one of them is turned inside out. */
  damage(session: string): void {
    const files = readdirSync(this.#data, { recursive: true, encoding: "utf8" })
      .filter((path) => path.split(sep).includes(session)).map((path) => join(this.#data, path)).filter((path) => statSync(path).isFile());
    if (files.length === 0) throw new Error(`${this.#data} has no files of ${session}`);
    for (const file of files) writeFileSync(file, readFileSync(file).map((byte) => ~byte));
  }

  /** Everything ends; nothing is left behind. */
  async end(): Promise<void> {
    await this.killHandles();
    await this.killServer();
    rmSync(this.#data, { recursive: true, force: true });
  }

  get said(): string {
    return [this.#server?.said, ...this.#handles.map(({ said }) => said)].join("\n");
  }
}

/** A table of the latency program's quick kind, made anew: the path of its file. */
export async function makeLatencyTable(): Promise<string> {
  const file = join(mkdtempSync(join(tmpdir(), "teleclay-latency-")), "latency.json");
  const program = new Program("teleclay-latency", ["--quick", "--json", file]);
  await program.ended;
  if (!existsSync(file)) throw new Error(program.said);
  return file;
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
