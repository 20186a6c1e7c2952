// The Robot page: the three arms moving with the live handle, its joint angles on every branch, where it reaches, and
// how far it is from where it cannot move.

import { useComputed, useSignal, useSignalEffect } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect } from "preact/hooks";
import type { Branch, Triple } from "../../protocol/theory";
import { BRANCHES, poseAt } from "../../theory/robot";
import { DASH, fixed, significant } from "../format";
import { useFrame } from "../frame";
import { loadMathematics, mathematics, mathematicsMissing } from "../mathematics";
import { live, theory } from "../store";
import { branch, geometry, pose, position_m, source, workspaceQuestion } from "./model";
import { RobotControls } from "./robot_controls";
import { RobotPicture } from "./robot_picture";
import { outOfReach, refusalOf, standingOf, type Standing } from "./words";
import "../style/theory.css";

/** Numbers that change faster cannot be read, and the server is asked no more often, ms. */
const READABLE_MS = 250;

export function RobotPage(): JSX.Element {
  useEffect(() => void loadMathematics(), []);
  const settled = useSignal<Triple>(position_m.peek());
  const last_ms = useSignal(0);
  useFrame((now_ms) => {
    if (now_ms - last_ms.peek() < READABLE_MS) return;
    last_ms.value = now_ms;
    const now = position_m.peek();
    if (now.some((at, axis) => at !== settled.peek()[axis])) settled.value = now;
  });
  useSignalEffect(() => {
    // Beyond its reach there is nothing to ask, and a browser would log each refusal as an error.
    const module = mathematics.value;
    if (module === undefined || 0 < (poseAt(module, geometry.value, settled.value, branch.value)?.short.length ?? 0)) return;
    theory.inverse.ask({ geometry: geometry.value, position_m: settled.value });
    theory.jacobian.ask({ geometry: geometry.value, position_m: settled.value, branch: branch.value });
  });
  useSignalEffect(() => theory.workspace.ask(workspaceQuestion.value));
  return (
    <div class="page robot">
      <section class="panel picture" aria-label="The robot">
        <RobotPicture />
        <Joints />
        <Ramp />
      </section>
      <Posture />
      <Branches />
      <RobotControls />
    </div>
  );
}

const ARM_COLOURS = ["--hand", "--felt", "--tool"] as const;

/** The joint angles that are drawn, over the picture. */
function Joints(): JSX.Element {
  const shown = useSignal<readonly (number | undefined)[]>([]);
  const last_ms = useSignal(0);
  useFrame((now_ms) => {
    if (now_ms - last_ms.peek() < 120) return;
    last_ms.value = now_ms;
    shown.value = pose.peek()?.arms.map(({ bend }) => bend?.joint_rad) ?? [];
  });
  return (
    <dl class="forces" aria-label="Joint angles">
      {ARM_COLOURS.map((colour, j) => (
        <div key={colour}>
          <dt>arm {j + 1}, ρ<sub>{j + 1}</sub></dt>
          <dd style={{ color: `var(${shown.value.at(j) === undefined ? "--bad" : colour})` }} data-testid={`joint-${j + 1}`}>
            {shown.value.length === 0 ? DASH : shown.value.at(j) === undefined ? "too short" : `${fixed(degrees(shown.value.at(j)), 1)}°`}
          </dd>
        </div>
      ))}
      <div class="apart"><dt>platform x, y, z</dt><dd>{position_m.value.map((at) => fixed(at * 1000, 0)).join(", ")} <small>mm</small></dd></div>
    </dl>
  );
}

/** What the slice's colours mean. */
function Ramp(): JSX.Element {
  const held = useComputed(() => live.tool.value?.connected ?? false);
  return (
    <div class="scale">
      <span class="key"><i class="ramp" aria-hidden="true" /> <span class="faint">workspace: singular → moves alike in all directions</span></span>
      {source.value === "live" && !held.value && <span>nobody holds the handle: the platform rests</span>}
    </div>
  );
}

function Posture(): JSX.Element {
  const { phase, answer, problem } = theory.jacobian.asked.value;
  const short = useComputed(() => pose.value?.short ?? []);
  const standing: Standing = mathematicsMissing.value !== undefined
    ? { grade: "bad", text: mathematicsMissing.value }
    : 0 < short.value.length
    ? { grade: "bad", text: outOfReach(short.value) }
    : phase === "refused" && problem !== undefined
    ? { grade: "bad", text: refusalOf(problem) }
    : phase === "away" ? { grade: "warn", text: "The server does not answer." }
      : answer === undefined ? { grade: "good", text: "Asking the server …" } : standingOf(answer);
  const current = phase === "refused" || 0 < short.value.length ? undefined : answer;
  return (
    <section class="panel posture" aria-label="Posture" data-grade={standing.grade}>
      <p class="headline" data-testid="posture" role={standing.grade === "bad" ? "alert" : undefined}>{standing.text}</p>
      <dl>
        <Measure name="condition number of J" value={current?.condition_number} share={current === undefined ? undefined : 1 / current.condition_number} test="condition" title="greatest over least singular value; 1 is best" />
        {[0, 1, 2].map((j) => (
          <Measure key={j} name={`arm ${j + 1} from stretched`} value={current?.serial_measures[j]} share={current?.serial_measures[j]} test={`serial-${j + 1}`} title="|cos| between the rod and the way the elbow moves: 0 is singular, det B_r = 0" />
        ))}
        <Measure name="rods from one plane" value={current?.parallel_measure} share={current?.parallel_measure} test="parallel" title="volume that the rods span as unit vectors: 0 is singular, det K_r = 0" />
      </dl>
    </section>
  );
}

interface MeasureProps {
  readonly name: string;
  readonly title: string;
  readonly test: string;
  readonly value: number | undefined;
  /** 0 … 1. */
  readonly share: number | undefined;
}

function Measure({ name, title, test, value, share }: MeasureProps): JSX.Element {
  return (
    <div title={title}>
      <dt>{name}</dt>
      <dd data-testid={test}>{significant(value)}</dd>
      <i class="meter" aria-hidden="true"><i style={{ width: `${100 * (share ?? 0)}%` }} data-near={share !== undefined && share < 0.15} /></i>
    </div>
  );
}

/** All eight solutions; one of them is drawn. */
function Branches(): JSX.Element {
  const { answer, phase } = theory.inverse.asked.value;
  const isShort = useComputed(() => 0 < (pose.value?.short.length ?? 0));
  const rows = phase === "refused" || isShort.value ? undefined : answer?.branches;
  return (
    <section class="panel branches" aria-label="Branches">
      <header><h2>Eight ways to bend</h2><span class="faint">signs K_j of (10)–(12)</span></header>
      <table class="data">
        <thead><tr><th scope="col">K</th>{[1, 2, 3].map((j) => <th key={j} scope="col">ρ<sub>{j}</sub></th>)}</tr></thead>
        <tbody data-testid="branches">
          {BRANCHES.map((signs, n) => (
            <tr key={nameOf(signs)} aria-current={isSame(signs, branch.value)}>
              <th scope="row">
                <label>
                  <input type="radio" name="branch" value={nameOf(signs)} checked={isSame(signs, branch.value)} onChange={() => { branch.value = signs; }} />
                  {nameOf(signs)}
                </label>
              </th>
              {[0, 1, 2].map((j) => <td key={j}>{rows === undefined ? DASH : `${fixed(degrees(rows.at(n)?.joints_rad[j]), 1)}°`}</td>)}
            </tr>
          ))}
        </tbody>
      </table>
    </section>
  );
}

const nameOf = (signs: Branch): string => signs.map((sign) => (sign === 1 ? "+" : "−")).join(" ");
const isSame = (a: Branch, b: Branch): boolean => a.every((sign, j) => sign === b[j]);

function degrees(radians: number | undefined): number | undefined {
  return radians === undefined ? undefined : (radians * 180) / Math.PI;
}
