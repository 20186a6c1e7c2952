// The clay in 3-D, with what belongs to the picture over it: forces in numbers, the arrows' scale, where to look from.

import { useSignal, useSignalEffect, useComputed, type Signal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { Channel } from "../../protocol/telemetry";
import { ClayView, type Look, type ViewColours } from "../../scene/view";
import { onFrame } from "../frame";
import { wantedQuality } from "../picture_quality";
import { clayFeed, live } from "../store";
import { isDark } from "../theme";
import { arrowScale } from "./arrow_scale";
import { Forces } from "./forces";
import { blockOf, othersOf, poseOf } from "./moment";
import { SituationCard } from "./situation";

const TRAIL_S = 4;
const TRAIL_STEP_S = 0.012;

export function ClayPanel(): JSX.Element {
  const canvas = useRef<HTMLCanvasElement>(null);
  const view = useRef<ClayView | undefined>(undefined);
  const missing = useSignal<string | undefined>(undefined);
  const mm_per_n = useSignal(10);
  const drawn = useSignal({ frames_per_s: 0, triangles: 0, resolution: 1, others: 0 });

  useEffect(() => {
    if (canvas.current === null) return undefined;
    let created: ClayView;
    try {
      created = new ClayView(canvas.current, wantedQuality());
    } catch (error) {
      missing.value = error instanceof Error ? error.message : String(error);
      return undefined;
    }
    view.current = created;
    const ends = [
      clayFeed.watch((update) => created.applyClay(update)),
      followSize(canvas.current, created),
      followLoop(created, mm_per_n, drawn),
    ];
    return () => {
      for (const end of ends) end();
      view.current = undefined;
      created.dispose();
    };
  }, []);
  // The style sheet has followed the theme by the time that effects run; a canvas has to be told.
  useEffect(() => {
    if (canvas.current !== null) view.current?.setColours(coloursOf(canvas.current), isDark.value);
  }, [isDark.value]);
  const tool = useComputed(() => live.session.value?.tool);
  const block = useComputed(() => live.session.value?.clay.shape);
  useSignalEffect(() => {
    if (tool.value !== undefined) view.current?.setTool(tool.value);
  });
  useSignalEffect(() => {
    if (block.value !== undefined) view.current?.setBlock(blockOf(block.value));
  });

  return (
    <section class="panel clay" aria-label="Clay">
      <canvas
        ref={canvas}
        role="img"
        tabIndex={0}
        aria-label="The clay as it is being cut, with the tool and the forces on it. Arrow keys move the view, with shift they turn it"
        data-testid="clay"
      />
      {missing.value !== undefined && <p class="missing">No 3-D picture here: {missing.value}</p>}
      <Forces />
      <SituationCard />
      <div class="looks" role="group" aria-label="Look from">
        {looks.map((look) => (
          <button key={look} type="button" onClick={() => view.current?.look(look)}>{look}</button>
        ))}
      </div>
      <div class="scale">
        <ArrowKey mm_per_n={mm_per_n.value} />
        <span class="faint" data-testid="drawn" data-frames={drawn.value.frames_per_s} data-triangles={drawn.value.triangles} data-others={drawn.value.others}>
          {drawn.value.frames_per_s} fps{drawn.value.resolution < 0.99 ? ` at ${Math.round(drawn.value.resolution * 100)} %` : ""}
        </span>
      </div>
    </section>
  );
}

const looks: readonly Look[] = ["corner", "front", "side", "top"];

/** What the arrows' length means. */
function ArrowKey({ mm_per_n }: { mm_per_n: number }): JSX.Element {
  const newtons = 10 / mm_per_n;
  return (
    <span class="key">
      <i class="arrow tool" aria-hidden="true" /> on the tool
      <i class="arrow felt" aria-hidden="true" /> felt
      <span class="faint">10 mm = {newtons < 1 ? newtons.toPrecision(1) : newtons.toFixed(0)} N</span>
    </span>
  );
}

function followSize(canvas: HTMLCanvasElement, view: ClayView): () => void {
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
  let second = 0;
  let frames = 0;
  return onFrame((now_ms) => {
    const session = live.session.peek();
    const tool = live.tool.peek();
    const { history } = live;
    const time_s = live.momentAt(now_ms);
    const shows = session !== undefined && tool !== undefined && (tool.connected || tool.operator !== "");
    const wanted_s = shows ? time_s : undefined;
    if (wanted_s !== shown_s) {
      shown_s = wanted_s;
      mm_per_n.value = arrowScale(history.greatest(Channel.tool_force_n, 10), history.greatest(Channel.felt_force_n, 10));
      view.setPose(shows ? poseOf(session, tool, history, time_s) : undefined, mm_per_n.value);
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

function coloursOf(element: Element): ViewColours {
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
