// The clay and the tools of a recording at the moment on show.

import { effect, useComputed, useSignal, useSignalEffect } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { Channel } from "../../protocol/telemetry";
import type { ClayView } from "../../scene/view";
import type { Film } from "../../state/film";
import { ClayFeed } from "../clay_feed";
import { fixed } from "../format";
import { onFrame } from "../frame";
import { arrowScale } from "../live/arrow_scale";
import { ArrowKey, coloursOf, followSize, loadClayView, looks } from "../live/clay_panel";
import { blockOf, length } from "../live/moment";
import { pictureQuality } from "../picture_quality";
import { DRAWN, SceneCanvas, type Standing } from "../scene_canvas";
import { isDark } from "../theme";
import { othersOf, poseOf, vectorOf } from "./pose";
import { remarkOf } from "./words";

/** The name under which the greatest forces are asked for, so that arrows keep their scale. */
const SCALE = "scale";
const FORCES = [Channel.tool_force_n, Channel.felt_force_n].flatMap((channel) => [channel, channel + 1, channel + 2]);

export function FilmScene({ film, tool }: { readonly film: Film; readonly tool: number }): JSX.Element {
  const view = useSignal<ClayView | undefined>(undefined);
  const standing = useSignal<Standing>(DRAWN);
  const trouble = useSignal<string | undefined>(undefined);
  const triangles = useSignal(0);
  const panel = useRef<HTMLElement>(null);
  const feed = useRef<ClayFeed | undefined>(undefined);
  feed.current ??= new ClayFeed(pictureQuality() === "plain" ? "half" : "full", (says) => { trouble.value = says; });
  film.onBricks = (bytes) => feed.current?.send(bytes);
  useEffect(() => () => {
    film.onBricks = () => undefined;
    feed.current?.end();
    feed.current = undefined;
  }, []);

  useEffect(() => {
    if (panel.current !== null) view.value?.setColours(coloursOf(panel.current), isDark.value);
  }, [isDark.value, view.value]);

  const lasts_s = useComputed(() => film.facts.value?.lasts_s ?? 0).value;
  useEffect(() => film.plot(SCALE, { tool, channels: FORCES, from_s: 0, to_s: lasts_s + 1, columns: 1 }), [tool, lasts_s]);
  const mm_per_n = useComputed(() => {
    const drawn = film.plots.value.get(SCALE);
    const greatest = (drawn?.envelopes ?? []).map((envelope) => Math.max(Math.abs(envelope[0]), Math.abs(envelope[1]))).filter(Number.isFinite);
    return greatest.length === 0 ? 10 : arrowScale(...greatest);
  });
  const shape = useComputed(() => JSON.stringify(film.moment.value?.settings?.shape)).value;
  const toolShape = useComputed(() => JSON.stringify(film.moment.value?.settings?.tool)).value;
  useEffect(() => {
    const settings = film.moment.peek()?.settings;
    if (settings === undefined || settings === null) return;
    view.value?.setBlock(blockOf(settings.shape));
    view.value?.setTool(settings.tool);
  }, [shape, toolShape, view.value]);
  useSignalEffect(() => {
    const moment = film.moment.value;
    if (moment === undefined) return;
    view.value?.setPose(poseOf(moment, tool), mm_per_n.value);
    view.value?.setOthers(othersOf(moment, tool));
  });

  const moment = film.moment.value;
  const remark = moment === undefined ? undefined : remarkOf(moment);
  return (
    <section class="panel clay" aria-label="Clay" ref={panel} data-known={moment?.clay !== null} data-testid="reel-clay" data-hash={moment?.clay?.hash} data-triangles={triangles.value}>
      <SceneCanvas
        test="clay"
        label="The clay at the moment on show, with the tools and the forces on them. Arrow keys move the view, with shift they turn it"
        load={loadClayView}
        run={(created, canvas) => {
          const ends = [
            feed.current?.watch((update) => created.applyClay(update)),
            followSize(canvas, created),
            onFrame((now_ms) => {
              created.draw(now_ms);
              triangles.value = created.triangles;
            }),
            effect(() => {
              // Another view knows nothing of the moment yet.
              const shown = film.moment.value;
              if (shown !== undefined) created.setPose(poseOf(shown, tool), mm_per_n.value);
            }),
          ];
          return () => {
            for (const end of ends) end?.();
          };
        }}
        view={view}
        standing={standing}
      />
      <Forces film={film} tool={tool} />
      <div class="looks" role="group" aria-label="Look from">
        {looks.map((look) => (
          <button key={look} type="button" onClick={() => view.peek()?.look(look)}>{look}</button>
        ))}
      </div>
      {remark !== undefined && <p class="remark" data-level={remark.level} role="status" data-testid="reel-remark">{remark.text}</p>}
      {trouble.value !== undefined && <p class="remark" data-level="error" role="alert">{trouble.value}</p>}
      <div class="scale"><ArrowKey mm_per_n={mm_per_n.value} /></div>
    </section>
  );
}

/** The forces of the moment, as lengths. */
function Forces({ film, tool: number }: { readonly film: Film; readonly tool: number }): JSX.Element {
  const tool = film.moment.value?.tools.find((one) => one.tool === number);
  const force = (channel: number): string => {
    const vector = tool === undefined ? undefined : vectorOf(tool, channel);
    return fixed(vector === undefined ? undefined : length(vector), 2);
  };
  return (
    <dl class="forces" aria-label="Forces at this moment">
      <div class="hand"><dt>hand</dt><dd data-testid="hand-force">{force(Channel.hand_force_n)}<small> N</small></dd></div>
      <div class="felt"><dt>felt</dt><dd data-testid="felt-force">{force(Channel.felt_force_n)}<small> N</small></dd></div>
      <div class="tool"><dt>on the tool</dt><dd data-testid="tool-force">{force(Channel.tool_force_n)}<small> N</small></dd></div>
    </dl>
  );
}
