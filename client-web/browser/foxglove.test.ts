// The Foxglove protocol as its own client speaks it, and the messages as Foxglove's own reader reads them. Neither
// knows anything of this project.

import { parse } from "@foxglove/rosmsg";
import { MessageReader, MessageWriter } from "@foxglove/rosmsg2-serialization";
import { type Channel, FoxgloveClient, type Service } from "@foxglove/ws-protocol";
import { afterAll, beforeAll, describe, expect, it } from "vitest";
import WebSocket from "ws";
import { Teleclay } from "./processes";
import { until } from "./until";

/** How long the wrench is listened to, s; a run by hand listens longer. */
const SECONDS = Number(process.env["TELECLAY_FOXGLOVE_SECONDS"] ?? "2");

/** What is asked for on the wrench, and what comes on everything else. */
const RATE_HZ = 125;
const OTHERS_HZ = 20;

interface Read {
  readonly topic: string;
  readonly timeNs: bigint;
  readonly message: unknown;
}

/** A client, what it was told there is, and what it has read. */
class Visitor {
  readonly channels = new Map<string, Channel>();
  readonly services = new Map<string, Service>();
  readonly read: Read[] = [];
  readonly words: string[] = [];
  readonly #client: FoxgloveClient;
  readonly #readers = new Map<number, { topic: string; reader: MessageReader }>();
  readonly #answers = new Map<number, (answer: unknown) => void>();
  #calls = 0;

  constructor(url: string, protocol: string) {
    // @ts-expect-error ws describes a second argument of send() otherwise; the client gives none.
    this.#client = new FoxgloveClient({ ws: new WebSocket(url, [protocol]) });
    this.#client.on("error", (error) => this.words.push(error.message));
    this.#client.on("status", (status) => this.words.push(status.message));
    this.#client.on("advertise", (channels) => {
      for (const channel of channels) this.channels.set(channel.topic, channel);
    });
    this.#client.on("unadvertise", (gone) => {
      for (const [topic, { id }] of this.channels) if (gone.includes(id)) this.channels.delete(topic);
    });
    this.#client.on("advertiseServices", (services) => {
      for (const service of services) this.services.set(service.name, service);
    });
    this.#client.on("message", ({ subscriptionId, timestamp, data }) => {
      const known = this.#readers.get(subscriptionId);
      if (known === undefined) throw new Error(`nobody subscribed as ${subscriptionId}`);
      this.read.push({ topic: known.topic, timeNs: timestamp, message: known.reader.readMessage(data) });
    });
    this.#client.on("serviceCallResponse", ({ serviceId, callId, data }) => {
      const response = [...this.services.values()].find(({ id }) => id === serviceId)?.response;
      this.#answers.get(callId)?.(new MessageReader(parse(response?.schema ?? "", { ros2: true })).readMessage(data));
    });
    this.#client.on("serviceCallFailure", ({ callId, message }) => this.#answers.get(callId)?.(message));
  }

  subscribe(topic: string): void {
    const channel = this.channels.get(topic);
    if (channel === undefined) throw new Error(`${topic} is not offered`);
    const reader = new MessageReader(parse(channel.schema, { ros2: true }));
    this.#readers.set(this.#client.subscribe(channel.id), { topic, reader });
  }

  setRate(topic: string, hz: number): void {
    this.#client.setParameters([{ name: `teleclay.rate_hz.${topic}`, value: hz }]);
  }

  async call(name: string, request: unknown): Promise<unknown> {
    const service = this.services.get(name);
    if (service?.request === undefined) throw new Error(`${name} is not offered`);
    const { encoding, schema } = service.request;
    const data = new MessageWriter(parse(schema, { ros2: true })).writeMessage(request);
    const callId = (this.#calls += 1);
    return new Promise((resume) => {
      this.#answers.set(callId, resume);
      this.#client.sendServiceCallRequest({ serviceId: service.id, callId, encoding, data: new DataView(data.buffer, data.byteOffset, data.byteLength) });
    });
  }

  of(topic: string): Read[] {
    return this.read.filter((read) => read.topic === topic);
  }

  close(): void {
    this.#client.close();
  }
}

describe("Foxglove's own client", () => {
  const tool = "/teleclay/demo/tool_1";
  let teleclay: Teleclay;
  let visitor: Visitor;

  beforeAll(async () => {
    teleclay = await Teleclay.onFreePorts();
    await teleclay.startServer();
    teleclay.startHandle();
    const url = `${teleclay.url.replace("http", "ws")}/foxglove?rate_hz=${OTHERS_HZ}`;
    visitor = new Visitor(url, FoxgloveClient.SUPPORTED_SUBPROTOCOL);
    await until("the demo session is offered", () => visitor.services.has("/teleclay/demo/set_scheme"));
  });

  afterAll(async () => {
    visitor.close();
    await teleclay.end();
  });

  it("reads every schema, and every topic has messages that fit it", async () => {
    for (const { schema, schemaEncoding } of visitor.channels.values()) {
      expect(schemaEncoding).toBe("ros2msg");
      expect(parse(schema, { ros2: true }).length).toBeGreaterThan(0);
    }
    const topics = [...visitor.channels.keys()].filter((topic) => topic.startsWith(tool) || !topic.startsWith("/teleclay/"));
    expect(topics.length).toBeGreaterThanOrEqual(12);
    for (const topic of [...topics, "/teleclay/demo/settings"]) visitor.subscribe(topic);
    await until("every topic has told something", () => topics.every((topic) => visitor.of(topic).length > 0));
  });

  it(`gets a wrench ${RATE_HZ} times a second while the hand cuts, and the others as they are`, async () => {
    const topic = `${tool}/felt_wrench`;
    visitor.setRate(topic, RATE_HZ);
    visitor.read.splice(0);
    await until("so much was heard", () => spanS(visitor.of(topic)) >= SECONDS, 10 * SECONDS + 60);
    const heard = visitor.of(topic);
    // The first one may be of the rate before.
    expect(Math.abs((heard.length - 2) / spanS(heard.slice(1)) - RATE_HZ)).toBeLessThan(0.02 * RATE_HZ);
    const pose = visitor.of(`${tool}/tool_pose`);
    expect(Math.abs((pose.length - 1) / spanS(pose) - OTHERS_HZ)).toBeLessThan(0.05 * OTHERS_HZ);
    expect(heard[0]?.message).toMatchObject({ header: { frame_id: "teleclay/demo/handle_1" }, wrench: { torque: { x: 0, y: 0, z: 0 } } });
    expect(visitor.words).toEqual([]);
  });

  it("sees what the interface shows", async () => {
    await until("the tool is where the interface says", async () => {
      const shown = (await teleclay.session()).tools[0];
      const told = visitor.of(`${tool}/tool_pose`).at(-1)?.message;
      if (told === undefined) return false;
      const [x, y, z] = positionIn(told);
      return Math.hypot(x - shown.position_m[0], y - shown.position_m[1], z - shown.position_m[2]) < 0.005;
    });
    expect(visitor.of(`${tool}/link`).at(-1)?.message).toMatchObject({ connected: true });
  });

  it("changes a session by its services, and is told of it", async () => {
    expect(await visitor.call("/teleclay/demo/set_scheme", { scheme: "wave" })).toMatchObject({ success: true });
    expect((await teleclay.session()).scheme).toBe("wave");
    await until("the settings say so", () => (
      visitor.of("/teleclay/demo/settings").some(({ message }) => asText(message).includes(String.raw`\"scheme\":\"wave\"`))
    ));
    expect(await visitor.call("/teleclay/demo/set_scheme", { scheme: "waves" })).toMatchObject({ success: false });
    expect(await visitor.call("/teleclay/demo/pause", { data: true })).toMatchObject({ success: true });
    expect((await teleclay.session()).state).toBe("paused");
    const { epoch } = (await teleclay.session()).clay;
    expect(await visitor.call("/teleclay/demo/reset_clay", {})).toMatchObject({ success: true });
    expect((await teleclay.session()).clay.epoch).toBe(epoch + 1);
  });
});

/** From the first to the last, s. */
function spanS(read: readonly Read[]): number {
  const last = read.at(-1);
  return last === undefined ? 0 : Number(last.timeNs - read[0].timeNs) * 1e-9;
}

function positionIn(message: unknown): [number, number, number] {
  const numbers = /"position":\{"x":([-\d.e]+),"y":([-\d.e]+),"z":([-\d.e]+)\}/.exec(asText(message));
  if (numbers === null) throw new Error(`${asText(message)} is no pose`);
  return [Number(numbers[1]), Number(numbers[2]), Number(numbers[3])];
}

/** As JSON, which has no large integers. */
function asText(message: unknown): string {
  return JSON.stringify(message, (_, value: unknown) => (typeof value === "bigint" ? value.toString() : value));
}
