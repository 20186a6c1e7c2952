// The robot in 3-D, following the live handle or the sliders.

import { useSignal, useSignalEffect } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { Channel } from "../../protocol/telemetry";
import { RobotView, type RobotViewColours } from "../../scene/robot_view";
import { onFrame } from "../frame";
import { DRAWN, type Make, SceneCanvas, type Standing } from "../scene_canvas";
import { live, theory } from "../store";
import { isDark } from "../theme";
import { byHandle_m, geometry, platformAt, pose, shown, source } from "./model";

const TRAIL_S = 6;
const TRAIL_STEP_S = 0.02;

export function RobotPicture(): JSX.Element {
  const view = useSignal<RobotView | undefined>(undefined);
  const standing = useSignal<Standing>(DRAWN);
  const sight = useRef<HTMLDivElement>(null);
  useSignalEffect(() => {
    if (pose.value !== undefined) view.value?.setPose(pose.value);
  });
  useSignalEffect(() => {
    const { answer } = theory.workspace.asked.value;
    view.value?.setWorkspace(answer === undefined ? undefined : {
      low_m: answer.region_m[0], high_m: answer.region_m[1], cells: answer.cells, dexterity: answer.dexterity,
    });
    view.value?.showWorkspace(shown.value);
  });
  // The style sheet has followed the theme by the time that effects run; a canvas has to be told.
  useEffect(() => {
    if (sight.current !== null) view.value?.setColours(coloursOf(sight.current));
  }, [isDark.value, view.value]);
  return (
    <>
      <SceneCanvas
        test="robot"
        label="The robot's three arms and its platform. Arrow keys move the view, with shift they turn it"
        load={load}
        run={run}
        view={view}
        standing={standing}
      />
      <div class="looks" ref={sight}><button type="button" onClick={() => view.peek()?.reset(reach())}>whole robot</button></div>
    </>
  );
}

const load = (): Promise<Make<RobotView>> => Promise.resolve((canvas, sight) => new RobotView(canvas, sight));

/** Follows the size of the frame, and the handle. */
function run(view: RobotView, canvas: HTMLCanvasElement): () => void {
  const frame = canvas.parentElement ?? canvas;
  const observer = new ResizeObserver(() => {
    view.resize(frame.clientWidth, frame.clientHeight, devicePixelRatio);
    if (view.sight === undefined) view.reset(reach());
  });
  observer.observe(frame);
  const end = onFrame((now_ms) => {
    followHandle(view, now_ms);
    view.draw(now_ms);
  });
  return () => {
    end();
    observer.disconnect();
  };
}

const reach = (): number => geometry.peek().upper_link_m + geometry.peek().lower_link_m;

/** Puts the platform where the handle is now, and draws where it has been. */
function followHandle(view: RobotView, now_ms: number): void {
  if (source.peek() !== "live" || live.history.isEmpty) {
    view.setTrail([]);
    return;
  }
  const time_s = live.momentAt(now_ms);
  byHandle_m.value = platformAt(live.history.vectorAt(Channel.handle_position_m, time_s));
  const path = live.history.path(Channel.handle_position_m, time_s, TRAIL_S, TRAIL_STEP_S);
  const trail: number[] = [];
  for (let n = 0; n + 2 < path.length; n += 3) trail.push(...platformAt([path[n], path[n + 1], path[n + 2]]));
  view.setTrail(trail);
}

function coloursOf(element: Element): RobotViewColours {
  const style = getComputedStyle(element);
  const colour = (name: string): string => style.getPropertyValue(name).trim();
  return {
    background: colour("--sky"),
    ground: colour("--ground"),
    line: colour("--ground-line"),
    text: colour("--text-faint"),
    arms: [colour("--hand"), colour("--felt"), colour("--tool")],
    short: colour("--bad"),
    trail: colour("--hand"),
    ramp: [colour("--ramp-0"), colour("--ramp-1"), colour("--ramp-2"), colour("--ramp-3")],
  };
}
