import { describe, expect, it } from "vitest";
import { Channel, CHANNELS } from "../protocol/telemetry";
import { History } from "./history";
import { tableOf } from "./plot_table";

describe("the table of what plots show", () => {
  const history = new History();
  const values = new Float32Array(10_000 * CHANNELS);
  for (let n = 0; n < 10_000; n += 1) {
    values[n * CHANNELS + Channel.tool_position_m] = n / 1000;
    values[n * CHANNELS + Channel.rtt_s] = n === 4001 ? Number.NaN : 0.1;
  }
  history.append({ sequence: 0, tool: 1, period_us: 4000, dropped: 0, first_time_s: 20, values });
  const columns = [
    { name: "tool_position_x_mm", term: { channel: Channel.tool_position_m, factor: 1000, offset: -5 } },
    { name: "round_trip_ms", term: { channel: Channel.rtt_s, factor: 1000, offset: 0 } },
  ];

  it("has the units in its head, and a row for every sample on show", () => {
    const [head, ...rows] = tableOf(history, columns, { from_s: 36, to_s: 36.02 }).join("").trim().split("\r\n");
    expect(head).toBe("time_s,tool_position_x_mm,round_trip_ms");
    expect(rows).toEqual([
      "36.000000,3995,100", "36.004000,3996,", "36.008000,3997,100", "36.012000,3998,100", "36.016000,3999,100", "36.020000,4000,100",
    ]);
  });

  it("loses no row between its pieces", () => {
    const pieces = tableOf(history, columns, { from_s: 0, to_s: 100 });
    expect(pieces.length).toBeGreaterThan(2);
    const rows = pieces.join("").trim().split("\r\n").slice(1);
    expect(rows.map((row) => Math.round(5 + Number(row.split(",")[1])))).toEqual(Array.from({ length: 10_000 }, (_, n) => n));
  });
});
