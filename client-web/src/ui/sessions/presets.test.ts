import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { fakeSession } from "../../state/fake_session";
import { bodyOf, PRESETS } from "./presets";
import { fault, operatorsOf } from "./words";

interface Schema {
  readonly $ref?: string;
  readonly type?: string | readonly string[];
  readonly enum?: readonly unknown[];
  readonly pattern?: string;
  readonly minimum?: number;
  readonly maximum?: number;
  readonly required?: readonly string[];
  readonly properties?: Readonly<Record<string, Schema>>;
  readonly additionalProperties?: boolean;
  readonly items?: Schema;
  readonly minItems?: number;
  readonly maxItems?: number;
  readonly oneOf?: readonly Schema[];
}

const { components: { schemas } } = JSON.parse(readFileSync(new URL("../../../openapi.json", import.meta.url), "utf8")) as {
  components: { schemas: Record<string, Schema> };
};

/** What the server's own description has against a value. */
function faultsOf(schema: Schema, value: unknown, path = ""): string[] {
  if (schema.$ref !== undefined) return faultsOf(schemas[schema.$ref.replace("#/components/schemas/", "")], value, path);
  if (schema.oneOf !== undefined) {
    const each = schema.oneOf.map((one) => faultsOf(one, value, path));
    return each.some((faults) => faults.length === 0) ? [] : each.flat();
  }
  const faults: string[] = [];
  const unless = (holds: boolean, wanted: string): void => {
    if (!holds) faults.push(`${path}: ${JSON.stringify(value)}, wanted ${wanted}`);
  };
  if (schema.enum !== undefined) unless(schema.enum.includes(value), schema.enum.join());
  if (typeof value === "number") {
    unless(schema.type === "number" || (schema.type === "integer" && Number.isInteger(value)), String(schema.type));
    unless((schema.minimum ?? -Infinity) <= value && value <= (schema.maximum ?? Infinity), `${schema.minimum} to ${schema.maximum}`);
  } else if (typeof value === "string") {
    unless(schema.type === "string" && new RegExp(schema.pattern ?? "").test(value), `${String(schema.type)} ${schema.pattern}`);
  } else if (Array.isArray(value)) {
    unless(schema.type === "array" && (schema.minItems ?? 0) <= value.length && value.length <= (schema.maxItems ?? Infinity), "another list");
    for (const [n, item] of value.entries()) faults.push(...faultsOf(schema.items ?? {}, item, `${path}/${n}`));
  } else {
    const fields = value as Record<string, unknown>;
    unless(schema.type === "object" && (schema.required ?? []).every((name) => name in fields), `${String(schema.type)} with ${schema.required?.join()}`);
    for (const [name, field] of Object.entries(fields)) {
      const known = schema.properties?.[name];
      if (known === undefined) unless(false, `no field ${name}`);
      else faults.push(...faultsOf(known, field, `${path}/${name}`));
    }
  }
  return faults;
}

describe("the presets", () => {
  it("are what the server takes, by its own description", () => {
    expect(PRESETS.length).toBeGreaterThan(3);
    for (const preset of PRESETS) expect(faultsOf(schemas["NewSession"], bodyOf(preset, preset.name)), preset.name).toEqual([]);
    // The check itself notices what is wrong.
    for (const wrong of [{}, { id: "A" }, { id: "a", tools: 9 }, { id: "a", shape: 1 }, { id: "a", clay: { shape: { kind: "cone" } } }]) {
      expect(faultsOf(schemas["NewSession"], wrong), JSON.stringify(wrong)).not.toEqual([]);
    }
  });

  it("are called by different names, each free of charge", () => {
    for (const of of ["name", "title", "says"] as const) expect(new Set(PRESETS.map((preset) => preset[of])).size).toBe(PRESETS.length);
    for (const { name } of PRESETS) expect(fault(name, [])).toBeUndefined();
  });

  it("have no more voxels along an axis than the server takes", () => {
    for (const { body: { clay } } of PRESETS) {
      if (clay?.shape?.kind !== "block") continue;
      // 1024, and half a millimetre where nothing is said: proto/src/http/clay.rs.
      for (const length_m of clay.shape.size_m ?? []) expect(length_m / (clay.voxel_size_m ?? 5e-4)).toBeLessThanOrEqual(1024);
    }
  });
});

describe("a session of the list", () => {
  it("says who holds its tools, who has gone, and how many wait", () => {
    const [tool] = fakeSession().tools;
    const tools = [
      { ...tool, id: 1, operator: "Ada", connected: true }, { ...tool, id: 2, operator: "Bob", connected: false },
      { ...tool, id: 3, operator: "", connected: false },
    ];
    expect(operatorsOf(fakeSession({ tools }))).toEqual({ names: "Ada, Bob (gone)", free: 1 });
    expect(operatorsOf(fakeSession({ tools: [] }))).toEqual({ names: "", free: 0 });
  });

  it("keeps its name to itself, damaged or not", () => {
    const damaged = { id: "old", state: "damaged", storage: { ...fakeSession().storage, state: "failed" } } as const;
    const entries = [fakeSession({ id: "demo" }), damaged];
    expect(fault("demo", entries)).toBe("there is a session demo already");
    expect(fault("old", entries)).toBe("there is a session old already");
    expect(fault("new", entries)).toBeUndefined();
  });
});
