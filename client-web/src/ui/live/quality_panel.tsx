// How good the connection is and how the loop keeps up, in numbers.

import { useComputed } from "@preact/signals";
import type { JSX } from "preact";
import { count, duration, fixed, significant } from "../format";
import { live } from "../store";

interface Cell {
  readonly label: string;
  readonly text: string;
  readonly unit?: string;
  readonly title: string;
  readonly grade?: "good" | "warn" | "bad";
  readonly wide?: boolean;
  readonly test?: string;
}

const MM3_PER_M3 = 1e9;

export function QualityPanel(): JSX.Element {
  const cells = useComputed(cellsNow);
  return (
    <section class="panel quality" aria-label="Connection, loop and clay">
      <dl>
        {cells.value.map(({ label, text, unit, title, grade, wide, test }) => (
          <div key={label} class={wide === true ? "wide" : ""} data-grade={grade} title={title}>
            <dt>{label}</dt>
            <dd data-testid={test}>{text}{unit !== undefined && <small> {unit}</small>}</dd>
          </div>
        ))}
      </dl>
    </section>
  );
}

function cellsNow(): Cell[] {
  const session = live.session.value;
  if (session === undefined) return [];
  const { loop, clay, coordination_m } = session;
  const isCopied = session.scheme === "replica";
  const quality = live.quality.value;
  const loss = quality.loss === undefined ? undefined : 100 * quality.loss;
  const removed = clay.initial_units === 0 ? 0 : (100 * clay.removed_units) / clay.initial_units;
  const p50 = duration(loop.rtt_s.p50);
  const p99 = duration(loop.rtt_s.p99);
  const tick = duration(loop.tick_s.p99);
  return [
    { label: "RTT, median", ...p50, title: "round trip handle to server and back, median of the last seconds", test: "rtt-p50" },
    { label: "RTT, p99", ...p99, title: "one round trip in a hundred takes longer", test: "rtt-p99" },
    {
      label: "lost", text: fixed(loss, loss !== undefined && loss < 10 ? 2 : 1), unit: "%",
      title: `packets from handles that never came, last seconds; ${count(loop.lost)} in all, ${count(loop.duplicates)} came twice, ${count(loop.reordered)} out of order, ${count(loop.unheard)} that no holder of a tool wrote`,
      grade: loss === undefined || loss < 0.5 ? "good" : loss < 10 ? "warn" : "bad", test: "loss",
    },
    { label: "packets up", text: fixed(loop.packets_up_per_s, 0), unit: "/s", title: "frames from handles" },
    { label: "packets down", text: fixed(loop.packets_down_per_s, 0), unit: "/s", title: "frames to handles" },
    {
      label: "age, p99", ...duration(loop.age_s.p99),
      title: `age of the newest frame when a tick used it; median ${duration(loop.age_s.p50).text} ${duration(loop.age_s.p50).unit}`,
    },
    {
      label: "late ticks", text: fixed(quality.latePerS, 1), unit: "/s",
      title: `ticks of the last seconds that began more than a whole tick late; ${count(loop.late_ticks)} of ${count(loop.ticks)} in all`,
      grade: quality.latePerS < 1 ? "good" : quality.latePerS < 20 ? "warn" : "bad",
    },
    {
      label: "tick, p99", ...tick,
      title: `time a tick takes to compute; greatest ${duration(loop.tick_s.max).text} ${duration(loop.tick_s.max).unit}`,
    },
    {
      label: "link energy", text: significant(loop.energy_j * 1000), unit: "mJ",
      title: isCopied
        ? "energy that entered at both ends less what left; the copy answers the hand by itself, so this need not stay above zero"
        : "energy that entered the link at both ends less what left it; below zero the link has made energy",
      grade: loop.energy_j < -1e-6 && !isCopied ? "bad" : "good",
    },
    {
      label: "coordination", text: fixed(coordination_m * 1000, 2), unit: "mm",
      title: "distance between the tool and where the handle would have it",
      grade: coordination_m < 0.001 ? "good" : coordination_m < 0.005 ? "warn" : "bad", test: "coordination",
    },
    {
      label: "removed", text: fixed(clay.removed_volume_m3 * MM3_PER_M3 / 1000, 2), unit: "cm³",
      title: `${fixed(removed, 2)} %: ${count(clay.removed_units)} of ${count(clay.initial_units)} units of ${significant(clay.unit_volume_m3 * MM3_PER_M3)} mm³`,
      test: "removed",
    },
    {
      label: "remaining", text: fixed(clay.remaining_volume_m3 * MM3_PER_M3 / 1000, 2), unit: "cm³",
      title: `clay hash ${clay.hash}, block ${clay.epoch}`, test: "remaining",
    },
    {
      label: "scheduler", text: loop.scheduler, wide: true,
      title: `what the operating system granted the ${fixed(loop.rate_hz, 0)} Hz thread: ${loop.scheduler}`,
    },
  ];
}
