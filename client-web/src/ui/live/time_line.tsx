// What was cut when and by whom: undo and redo, and a line of strokes along which one can look back.

import { useComputed, useSignal, useSignalEffect, type ReadonlySignal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import type { Stroke, Strokes } from "../../protocol/strokes";
import { clock, fixed } from "../format";
import { live, past, timeLine } from "../store";
import { StorageLine } from "./storage_line";
import { cuttingAt, type Lane, lanesOf, type Mark, shareOf, ticksOf, timeAfter, timeAt } from "./time_line_model";

const CM3_PER_M3 = 1e6;
/** Nearer to the end of the line than this is now, px: the end itself is hard to meet. */
const NOW_PX = 4;

export function TimeLine(): JSX.Element {
  useEffect(() => timeLine.watch(), []);
  // A moment of another block is none of this line.
  useSignalEffect(() => {
    const moment = past.moment.value;
    const strokes = timeLine.strokes.value;
    if (moment.name !== "now" && strokes !== undefined && moment.at_s < strokes.from_s) past.backToNow();
  });
  const strokes = timeLine.strokes.value;
  const undone = strokes?.strokes.filter((stroke) => stroke.undone).length;
  return (
    <section
      class="panel timeline"
      aria-label="Time line"
      data-testid="time-line"
      data-strokes={strokes?.strokes.length}
      data-undone={undone}
      data-moment={past.moment.value.name}
    >
      <UndoRedo />
      <Line strokes={timeLine.strokes} />
      {timeLine.refusal.value !== undefined && <p class="refusal" role="alert" data-testid="undo-refusal">{timeLine.refusal.value}</p>}
      <StorageLine />
    </section>
  );
}

/** Of the tool on show where there are several: nobody takes back what another has cut. */
function UndoRedo(): JSX.Element {
  const several = useComputed(() => 1 < (live.session.value?.tools.length ?? 0)).value;
  const tool = useComputed(() => live.tool.value?.id).value;
  const operator = useComputed(() => live.tool.value?.operator ?? "").value;
  const which = several && tool !== undefined ? { tool } : {};
  const own = timeLine.strokes.value?.strokes.filter((stroke) => !several || stroke.tool === tool);
  const off = !live.isCurrent.value || timeLine.isBusy.value;
  const whose = several ? ` of ${operator === "" ? `tool ${tool ?? ""}` : operator}` : "";
  const change = async (does: () => Promise<boolean>): Promise<void> => {
    // What follows is to be seen.
    if (await does()) past.backToNow();
  };
  return (
    <div class="pair undo" role="group" aria-label="Undo and redo">
      <button
        type="button"
        disabled={off || own?.every(({ undone }) => undone) === true}
        onClick={() => void change(() => timeLine.undo(which))}
        title={`take back the last stroke${whose}`}
        data-testid="undo"
      >
        <span aria-hidden="true">↶ </span>Undo
      </button>
      <button
        type="button"
        disabled={off || own?.some(({ undone }) => undone) === false}
        onClick={() => void change(() => timeLine.redo(which))}
        title={`cut again what was taken back last${whose}`}
        data-testid="redo"
      >
        <span aria-hidden="true">↷ </span>Redo
      </button>
    </div>
  );
}

function Line({ strokes }: { readonly strokes: ReadonlySignal<Strokes | undefined> }): JSX.Element {
  const track = useRef<HTMLDivElement>(null);
  const width_px = useSignal(600);
  useEffect(() => {
    const element = track.current;
    if (element === null) return undefined;
    const observer = new ResizeObserver(() => {
      width_px.value = element.clientWidth;
    });
    observer.observe(element);
    return () => observer.disconnect();
  }, []);
  const lanes = useComputed(() => (strokes.value === undefined ? [] : lanesOf(strokes.value, width_px.value))).value;
  const { value } = strokes;
  const moment = past.moment.value;
  const at_s = moment.name === "now" ? value?.to_s : moment.at_s;
  const go = (time_s: number): void => {
    if (value === undefined || value.to_s <= time_s) past.backToNow();
    else past.show(time_s);
  };
  const point = (event: PointerEvent): void => {
    const box = track.current?.getBoundingClientRect();
    if (value === undefined || box === undefined) return;
    go(box.right - NOW_PX <= event.clientX ? value.to_s : timeAt((event.clientX - box.left) / box.width, value));
  };
  const press = (event: KeyboardEvent): void => {
    if (value === undefined || at_s === undefined) return;
    if (event.key === "Escape") past.backToNow();
    else {
      const time_s = timeAfter(event.key, at_s, value);
      if (time_s === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
      go(time_s);
    }
    event.preventDefault();
  };
  const share = value === undefined || at_s === undefined ? 1 : shareOf(at_s, value);
  return (
    <div class="line" data-lanes={lanes.length}>
      <div class="names" aria-hidden="true">
        {lanes.map((lane) => <span key={lane.tool} title={lane.operators.join(", ")}>{lane.operators.at(-1)}</span>)}
      </div>
      <div
        class="track"
        ref={track}
        role="slider"
        tabIndex={0}
        aria-label="Moment on show"
        aria-valuemin={value?.from_s ?? 0}
        aria-valuemax={value?.to_s ?? 0}
        aria-valuenow={at_s ?? 0}
        aria-valuetext={moment.name === "now" ? "now" : wordsOf(moment.at_s, value?.strokes ?? [])}
        aria-disabled={value === undefined}
        onPointerDown={(event) => {
          if (event.button !== 0) return;
          event.currentTarget.setPointerCapture(event.pointerId);
          point(event);
        }}
        onPointerMove={(event) => {
          if (event.currentTarget.hasPointerCapture(event.pointerId)) point(event);
        }}
        onKeyDown={press}
      >
        {lanes.length === 0
          ? <p class="faint">{value === undefined ? "" : "nothing has been cut yet"}</p>
          : lanes.map((lane) => <LaneView key={lane.tool} lane={lane} />)}
        {moment.name !== "now" && <i class="veil" style={{ left: `${100 * share}%` }} />}
        <i class="thumb" style={{ left: `${100 * share}%` }} />
      </div>
      <div class="ticks" aria-hidden="true">
        {value !== undefined && ticksOf(value, width_px.value).map((time_s) => (
          <span key={time_s} style={{ left: `${100 * shareOf(time_s, value)}%` }}>{clock(time_s)}</span>
        ))}
      </div>
    </div>
  );
}

function LaneView({ lane }: { readonly lane: Lane }): JSX.Element {
  return (
    <div class="lane">
      {lane.marks.map((mark) => (
        <i
          key={mark.strokes[0].number}
          class="mark"
          style={{ left: `${100 * mark.left}%`, width: `${100 * mark.width}%` }}
          title={titleOf(mark)}
          data-undone={mark.isUndone}
          data-testid={`stroke-${mark.strokes[0].number}`}
        />
      ))}
    </div>
  );
}

function titleOf({ strokes, from_s, to_s, isUndone }: Mark): string {
  const removed_cm3 = CM3_PER_M3 * strokes.reduce((sum, { removed_volume_m3 }) => sum + removed_volume_m3, 0);
  const operators = [...new Set(strokes.map(({ operator }) => operator))].join(", ");
  const [first, last] = [strokes[0], strokes[strokes.length - 1]];
  const which = strokes.length === 1 ? `stroke ${first.number}` : `${strokes.length} strokes, ${first.number} to ${last.number}`;
  return `${which} · ${operators} · ${fixed(from_s, 1)} to ${fixed(to_s, 1)} s · ${fixed(removed_cm3, 2)} cm³${isUndone ? " · undone" : ""}`;
}

function wordsOf(at_s: number, strokes: readonly Stroke[]): string {
  return [`${fixed(at_s, 1)} s`, cuttingAt(at_s, strokes)].filter((part) => part !== undefined).join(", ");
}
