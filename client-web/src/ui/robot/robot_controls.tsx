// Which robot, and who moves it.

import type { JSX } from "preact";
import type { RobotGeometry } from "../../protocol/theory";
import { Choice } from "../choice";
import { fixed, significant } from "../format";
import { within } from "../number/entry";
import { problemIn } from "../number/refusal";
import type { SliderScale } from "../slider_scale";
import { theory } from "../store";
import { ValueField } from "../value_field";
import { byHand_m, geometry, position_m, shown, source, travel } from "./model";

type Length = "base_radius_m" | "platform_radius_m" | "upper_link_m" | "lower_link_m";
const LENGTHS: readonly { readonly name: Length; readonly label: string; readonly title: string }[] = [
  { name: "base_radius_m", label: "base r_b", title: "from the centre of the base to the joints" },
  { name: "platform_radius_m", label: "plate r_p", title: "from the centre of the platform to the rods" },
  { name: "upper_link_m", label: "upper l_1", title: "the actuated links" },
  { name: "lower_link_m", label: "rods l_2", title: "the follower rods" },
];
const AXES = ["x", "y", "z"] as const;
/** What the server may find at fault, as people see it here. */
const FIELDS = {
  ...Object.fromEntries(LENGTHS.map(({ name, label }) => [`/geometry/${name}`, { label, unit: "mm", factor: 1000 }])),
  "/position_m": { label: "position", unit: "mm", factor: 1000 },
};

export function RobotControls(): JSX.Element {
  return (
    <section class="panel controls" aria-label="Settings">
      <div class="group">
        <header>
          <h2>Moved by</h2>
          <Choice
            name="source"
            label="What moves the platform"
            options={[
              { value: "live", text: "live handle", title: "the handle of the session on show" },
              { value: "hand", text: "sliders", title: "the sliders below" },
            ]}
            value={source.value}
            onChoose={(value) => {
              if (value === "hand") byHand_m.value = position_m.peek();
              source.value = value;
            }}
          />
        </header>
        {source.value === "live"
          ? <ValueField name="travel" label="travel" unit="plate/hand" title="the platform's travel over the handle's" factor={1} scale={range(0.1, 2)} value={travel.value} check={within(0.01, 10)} onWish={(value) => { travel.value = value; }} />
          : AXES.map((name, axis) => (
            <ValueField
              key={name}
              name={`position-${name}`}
              label={name}
              unit="mm"
              factor={1000}
              scale={axis === 2 ? range(-0.3, 0.3) : range(-0.2, 0.2)}
              value={byHand_m.value[axis]}
              check={within(-10, 10)}
              onWish={(value) => {
                const [x, y, z] = byHand_m.value;
                byHand_m.value = axis === 0 ? [value, y, z] : axis === 1 ? [x, value, z] : [x, y, value];
              }}
            />
          ))}
      </div>
      <div class="group">
        <header>
          <h2>Workspace</h2>
          <Choice
            name="shown"
            label="How the workspace is drawn"
            options={[
              { value: "slice", text: "slice", title: "at the height of the platform" },
              { value: "hull", text: "hull", title: "its outermost cells" },
              { value: "nothing", text: "off" },
            ]}
            value={shown.value}
            onChoose={(value) => { shown.value = value; }}
          />
        </header>
        <Reach />
      </div>
      <div class="group">
        <h2>Robot</h2>
        {LENGTHS.map(({ name, label, title }) => (
          <ValueField
            key={name}
            name={name}
            label={label}
            title={title}
            unit="mm"
            factor={1000}
            scale={range(0.01, 0.4)}
            value={geometry.value[name]}
            check={within(name === "base_radius_m" || name === "platform_radius_m" ? 0 : 1e-3, 100)}
            onWish={(value) => {
              const next: RobotGeometry = { ...geometry.value, [name]: value };
              geometry.value = next;
            }}
          />
        ))}
      </div>
    </section>
  );
}

function Reach(): JSX.Element {
  const { answer, phase, problem } = theory.workspace.asked.value;
  if (phase === "refused") return <p class="refusal" role="alert">{problem === undefined ? "" : problemIn(FIELDS, problem)}</p>;
  if (answer === undefined) return <p class="faint">{phase === "away" ? "The server does not answer." : "Mapping …"}</p>;
  return (
    <p class="faint" data-testid="reach" aria-busy={phase === "asking"}>
      {fixed(answer.reachable_volume_m3 * 1000, 2)} dm³ on this branch; mean dexterity {significant(answer.mean_dexterity ?? undefined)},
      where 1 moves alike in all directions.
    </p>
  );
}

function range(least: number, greatest: number): SliderScale {
  return {
    toShare: (value) => Math.min(Math.max((value - least) / (greatest - least), 0), 1),
    toValue: (share) => Math.round(1000 * (least + share * (greatest - least))) / 1000,
  };
}
