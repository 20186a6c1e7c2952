// The clay in 3-D, with what belongs to the picture over it: forces in numbers, the arrows' scale, where to look from.

import { effect, useSignal, useSignalEffect, useComputed, type Signal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import type { HandState } from "../../protocol/hand_module";
import { Channel } from "../../protocol/telemetry";
import type { ClayView, Look, ViewColours } from "../../scene/view";
import { onFrame } from "../frame";
import { wantedQuality } from "../picture_quality";
import { DRAWN, type Make, SceneCanvas, type Standing } from "../scene_canvas";
import { clayFeed, live, operating, past } from "../store";
import { isDark } from "../theme";
import { arrowScale } from "./arrow_scale";
import { Forces } from "./forces";
import { blockOf, length, othersOf, poseOf, poseOfHand } from "./moment";
import { HandScene } from "./operate/hand_scene";
import { PastCard } from "./past_card";
import { SituationCard } from "./situation";

const TRAIL_S = 4;
const TRAIL_STEP_S = 0.012;

export function ClayPanel(): JSX.Element {
  const view = useSignal<ClayView | undefined>(undefined);
  const standing = useSignal<Standing>(DRAWN);
  const mm_per_n = useSignal(10);
  const drawn = useSignal({ frames_per_s: 0, triangles: 0, resolution: 1, others: 0 });
  const panel = useRef<HTMLElement>(null);

  // The style sheet has followed the theme by the time that effects run; a canvas has to be told.
  useEffect(() => {
    if (panel.current !== null) view.value?.setColours(coloursOf(panel.current), isDark.value);
  }, [isDark.value, view.value]);
  const tool = useComputed(() => live.session.value?.tool);
  const block = useComputed(() => live.session.value?.clay.shape);
  useSignalEffect(() => {
    if (tool.value !== undefined) view.value?.setTool(tool.value);
  });
  useSignalEffect(() => {
    if (block.value !== undefined) view.value?.setBlock(blockOf(block.value));
  });

  return (
    <section class="panel clay" aria-label="Clay" ref={panel} data-past={past.clay.value !== undefined}>
      <SceneCanvas
        test="clay"
        label="The clay as it is being cut, with the tool and the forces on it. Arrow keys move the view, with shift they turn it"
        load={loadClayView}
        run={(created, canvas) => {
          const ends = [
            clayFeed.watch((update) => created.applyClay(update)),
            followSize(canvas, created),
            followLoop(created, mm_per_n, drawn),
            effect(() => created.setPast(past.clay.value)),
          ];
          return () => {
            for (const end of ends) end();
          };
        }}
        view={view}
        standing={standing}
      />
      <HandScene view={view} />
      <Forces />
      {past.moment.value.name === "now" ? <SituationCard /> : <PastCard />}
      <div class="looks" role="group" aria-label="Look from">
        {looks.map((look) => (
          <button key={look} type="button" onClick={() => view.peek()?.look(look)}>{look}</button>
        ))}
      </div>
      <div class="scale">
        <ArrowKey mm_per_n={mm_per_n.value} />
        <span class="faint" data-testid="drawn" data-frames={standing.value.name === "drawn" ? drawn.value.frames_per_s : 0} data-triangles={drawn.value.triangles} data-others={drawn.value.others}>
          {paceOf(standing.value, drawn.value)}
        </span>
      </div>
    </section>
  );
}

export async function loadClayView(): Promise<Make<ClayView>> {
  const { ClayView } = await import("../../scene/view");
  return (canvas, sight) => new ClayView(canvas, wantedQuality(), sight);
}

export const looks: readonly Look[] = ["corner", "front", "side", "top"];

/** How often the picture is drawn, or why it is not. */
function paceOf(standing: Standing, { frames_per_s, resolution }: { frames_per_s: number; resolution: number }): string {
  if (standing.name === "lost") return "no picture: graphics context lost";
  if (standing.name === "missing") return "no picture";
  return `${frames_per_s} fps${resolution < 0.99 ? ` at ${Math.round(resolution * 100)} %` : ""}`;
}

/** What the arrows' length means. */
export function ArrowKey({ mm_per_n }: { mm_per_n: number }): JSX.Element {
  const newtons = 10 / mm_per_n;
  return (
    <span class="key">
      <i class="arrow tool" aria-hidden="true" /> on the tool
      <i class="arrow felt" aria-hidden="true" /> felt
      <span class="faint">10 mm = {newtons < 1 ? newtons.toPrecision(1) : newtons.toFixed(0)} N</span>
    </span>
  );
}

export function followSize(canvas: HTMLCanvasElement, view: ClayView): () => void {
  const frame = canvas.parentElement ?? canvas;
  const observer = new ResizeObserver(() => {
    const { clientWidth, clientHeight } = frame;
    view.resize(clientWidth, clientHeight, devicePixelRatio);
  });
  observer.observe(frame);
  return () => observer.disconnect();
}

/** Shows each new moment, at most once per display frame. */
function followLoop(
  view: ClayView,
  mm_per_n: Signal<number>,
  drawn: Signal<{ frames_per_s: number; triangles: number; resolution: number; others: number }>,
): () => void {
  /** The moment on show; nothing while there is no tool to show. */
  let shown_s: number | undefined = Number.NaN;
  let shownHand: HandState | undefined;
  /** Greatest force of late in this page's own loop, N: it is ahead of telemetry. */
  let felt_n = 0;
  let second = 0;
  let frames = 0;
  return onFrame((now_ms) => {
    const session = live.session.peek();
    const tool = live.tool.peek();
    const { history } = live;
    const time_s = live.momentAt(now_ms);
    const shows = session !== undefined && tool !== undefined && (tool.connected || tool.operator !== "");
    const wanted_s = shows ? time_s : undefined;
    const hand = tool !== undefined && tool.id === operating.tool.peek() ? operating.hand.peek()?.state : undefined;
    if (wanted_s !== shown_s || hand !== shownHand) {
      shown_s = wanted_s;
      shownHand = hand;
      felt_n = Math.max(0.99 * felt_n, hand === undefined ? 0 : length(hand.felt_force_n));
      mm_per_n.value = arrowScale(history.greatest(Channel.tool_force_n, 10), history.greatest(Channel.felt_force_n, 10), felt_n);
      const pose = shows ? poseOf(session, tool, history, time_s) : undefined;
      view.setPose(shows && pose !== undefined && hand !== undefined ? poseOfHand(session, tool, hand, pose.toolForce_n) : pose, mm_per_n.value);
      view.setOthers(shows ? othersOf(session, tool, (id) => live.historyOf(id), time_s) : []);
      view.setTrail(shows ? history.path(Channel.tool_position_m, time_s, TRAIL_S, TRAIL_STEP_S) : []);
    }
    if (view.draw(now_ms)) frames += 1;
    if (Math.floor(now_ms / 1000) !== second) {
      second = Math.floor(now_ms / 1000);
      drawn.value = { frames_per_s: frames, triangles: view.triangles, resolution: view.resolution, others: view.others };
      frames = 0;
    }
  });
}

export function coloursOf(element: Element): ViewColours {
  const style = getComputedStyle(element);
  const colour = (name: string): string => style.getPropertyValue(name).trim();
  return {
    background: colour("--sky"),
    ground: colour("--ground"),
    line: colour("--ground-line"),
    text: colour("--text-faint"),
    hand: colour("--hand"),
    felt: colour("--felt"),
    tool: colour("--tool"),
  };
}
