import { describe, expect, it } from "vitest";
import { sessionTime, TICKS_S, timeAxis, valueText } from "./time_axis";

describe("the axis of time", () => {
  it("counts back from now while plots follow", () => {
    expect(timeAxis([-10, -8, -2, 0], "before now", 10)).toEqual(["", "−8 s", "−2 s", "now"]);
    expect(timeAxis([-1.5, -1, -0.5, 0], "before now", 2)).toEqual(["−1.5 s", "−1.0 s", "−0.5 s", "now"]);
    expect(timeAxis([-240, -120], "before now", 300)).toEqual(["−4:00", "−2:00"]);
  });

  it("is the session's time once they are held", () => {
    expect(timeAxis([60, 65], "session", 10)).toEqual(["1:00", "1:05"]);
    expect(timeAxis([65.24, 65.26], "session", 0.1)).toEqual(["1:05.24", "1:05.26"]);
    expect(timeAxis([-5, 0], "session", 10)).toEqual(["", "0:00"]);
  });

  it("writes every tick as what it is: two of them are never alike", () => {
    for (const step_s of TICKS_S) {
      for (const clock of ["session", "before now"] as const) {
        const ticks = Array.from({ length: 5 }, (_, n) => (n - 5) * step_s + (clock === "session" ? 3600 : 0));
        expect(new Set(timeAxis(ticks, clock, 6 * step_s)).size).toBe(5);
      }
    }
  });

  it("carries a rounded second into the minute", () => {
    expect(sessionTime(59.999, 1)).toBe("1:00.0");
    expect(sessionTime(3599.9, 0)).toBe("1:00:00");
  });

  it("has a true minus sign beside it", () => {
    expect([-0.25, 0.30000000000000004, -1200].map(valueText)).toEqual(["−0.25", "0.3", "−1200"]);
  });
});
