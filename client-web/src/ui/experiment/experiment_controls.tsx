// What to cut, with what handle, and how hard the hand pushes.

import type { JSX } from "preact";
import { Choice } from "../choice";
import { type Check, within } from "../number/entry";
import type { Named } from "../number/refusal";
import { say } from "../number/typed";
import { NumberInput } from "../number_input";
import { decades } from "../slider_scale";
import { theory } from "../store";
import { ValueField } from "../value_field";
import { change, MOST_RANGES, PAPER, request, settings, withoutRange, withRange } from "./model";

/** Beyond, the server takes no edge. */
const FARTHEST_M = 10;

/** What the server may find at fault, as people see it here. */
export const FIELDS: Readonly<Record<string, Named>> = {
  "/hand_force_n": { label: "force f_h", unit: "N", factor: 1 },
  "/virtual_mass_kg": { label: "mass M", unit: "kg", factor: 1 },
  "/virtual_damping_n_s_per_m": { label: "damp. B", unit: "N·s/m", factor: 1 },
  "/position_ratio": { label: "A_h1", unit: "tool/hand", factor: 1 },
  "/force_ratio": { label: "A_h2", unit: "clay/hand", factor: 1 },
  "/edges_m": { label: "edges", unit: "cm", factor: 100 },
  "/clay_damping_n_s_per_m": { label: "clay B_i", unit: "N·s/m", factor: 1 },
};

export function ExperimentControls(): JSX.Element {
  const asking = theory.cutting.asked.value.phase === "asking";
  const now = settings.value;
  return (
    <section class="panel controls" aria-label="Settings">
      <div class="group go">
        <button type="button" class="primary" disabled={asking} onClick={() => theory.cutting.ask(request.value)} data-testid="run">
          {asking ? "Running …" : "▶ Run"}
        </button>
        <button type="button" disabled={now === PAPER} onClick={() => { settings.value = PAPER; }} title="Fig. 7: 3–6, 6–9, 9–12 cm">
          The paper's
        </button>
      </div>
      <div class="group">
        <header>
          <h2>Hand</h2>
          <Choice
            name="hand_force_at"
            label="Where the force is constant"
            options={[
              { value: "sensor", text: "at the sensor", title: "the force at the sensor is constant: the theory's assumption" },
              { value: "muscles", text: "in the muscles", title: "the muscles push evenly, and the arm takes its share, (16)" },
            ]}
            value={now.hand_force_at}
            onChoose={(hand_force_at) => change({ hand_force_at })}
          />
        </header>
        <ValueField name="hand_force_n" label="force f_h" unit="N" factor={1} scale={decades(0.1, 20)} value={now.hand_force_n} check={within(1e-3, 100)} onWish={(hand_force_n) => change({ hand_force_n })} />
      </div>
      <div class="group">
        <h2>Handle, C_h1 = 1 / (M s² + B s)</h2>
        <ValueField name="virtual_mass_kg" label="mass M" unit="kg" factor={1} scale={decades(0.05, 10)} value={now.virtual_mass_kg} check={within(1e-3, 1e3)} onWish={(virtual_mass_kg) => change({ virtual_mass_kg })} />
        <ValueField name="virtual_damping_n_s_per_m" label="damp. B" unit="N·s/m" factor={1} scale={decades(0.5, 200)} value={now.virtual_damping_n_s_per_m} check={within(0, 1e5)} onWish={(virtual_damping_n_s_per_m) => change({ virtual_damping_n_s_per_m })} />
        <ValueField name="position_ratio" label="A_h1" unit="tool/hand" factor={1} scale={decades(0.1, 10)} value={now.position_ratio} check={within(1e-3, 1e3)} onWish={(position_ratio) => change({ position_ratio })} />
        <ValueField name="force_ratio" label="−A_h2" unit="clay/hand" factor={1} scale={decades(0.1, 10)} value={now.force_ratio} check={within(1e-3, 1e3)} onWish={(force_ratio) => change({ force_ratio })} />
      </div>
      <Ranges />
    </section>
  );
}

function Ranges(): JSX.Element {
  const { edges_m: edges, clay_damping_n_s_per_m: clay } = settings.value;
  const setEdge = (n: number, value: number): void => change({ edges_m: edges.with(n, value) });
  const setClay = (n: number, value: number): void => change({ clay_damping_n_s_per_m: clay.with(n, value) });
  return (
    <div class="group ranges">
      <header>
        <h2>Ranges</h2>
        <span class="pair" role="group" aria-label="How many ranges">
          <button type="button" disabled={clay.length === 1} aria-label="One range fewer" onClick={() => { settings.value = withoutRange(settings.value); }}>−</button>
          <button type="button" disabled={MOST_RANGES <= clay.length} aria-label="One range more" onClick={() => { settings.value = withRange(settings.value); }}>+</button>
        </span>
      </header>
      <table>
        <thead><tr><th scope="col">from, cm</th><th scope="col">to, cm</th><th scope="col">clay B_i, N·s/m</th></tr></thead>
        <tbody>
          {clay.map((damping, n) => (
            <tr key={n}>
              <td>
                {n === 0
                  ? <NumberInput name="edge-0" label="first edge, cm" value={edges[0]} unit="cm" factor={100} check={between(Number.NEGATIVE_INFINITY, edges[1])} onWish={(value) => setEdge(0, value)} />
                  : <span class="faint">{Number((100 * edges[n]).toPrecision(6))}</span>}
              </td>
              <td>
                <NumberInput name={`edge-${n + 1}`} label={`end of range ${n + 1}, cm`} value={edges[n + 1]} unit="cm" factor={100} check={between(edges[n], edges[n + 2] ?? Number.POSITIVE_INFINITY)} onWish={(value) => setEdge(n + 1, value)} />
              </td>
              <td>
                <NumberInput name={`clay-${n}`} label={`clay damping of range ${n + 1}`} value={damping} unit="N·s/m" factor={1} check={within(0, 1e6)} onWish={(value) => setClay(n, value)} />
              </td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

/** An edge lies above the one before it and below the next. */
function between(last_m: number, next_m: number): Check {
  return (edge_m, unit) => {
    if (edge_m <= last_m) return `${say(edge_m, unit)} is not above ${say(last_m, unit)}, the edge before it`;
    if (next_m <= edge_m) return `${say(edge_m, unit)} is not below ${say(next_m, unit)}, the next edge`;
    return within(-FARTHEST_M, FARTHEST_M)(edge_m, unit);
  };
}
