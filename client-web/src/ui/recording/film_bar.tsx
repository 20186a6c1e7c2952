// The time line of a recording: a slider with what happened on it, and the clock that plays.

import { useComputed } from "@preact/signals";
import type { JSX } from "preact";
import { useRef } from "preact/hooks";
import { sessionTime } from "../../plots/time_axis";
import { type Film, SPEEDS } from "../../state/film";
import { useFrame } from "../frame";
import { shareOf } from "../live/time_line_model";

/** What an arrow key moves by, with shift and without, s. */
const FINE_S = 0.01;
const STEP_S = 0.1;
const PAGE_S = 5;
/** Marks closer than this share of the line are one to the eye. */
const APART = 0.004;

/** Takes a key pressed on the time line or beside it; returns whether it was one of its own. */
export function takeKey(film: Film, { key, shiftKey, ctrlKey, altKey, metaKey }: KeyboardEvent): boolean {
  if (ctrlKey || altKey || metaKey) return false;
  const step_s = shiftKey ? FINE_S : STEP_S;
  switch (key) {
    case "ArrowLeft": case "ArrowDown": film.step(-step_s); break;
    case "ArrowRight": case "ArrowUp": film.step(step_s); break;
    case "PageDown": film.step(-PAGE_S); break;
    case "PageUp": film.step(PAGE_S); break;
    case "Home": film.seek(0); break;
    case "End": film.seek(film.lasts_s); break;
    case "[": film.toMark("before"); break;
    case "]": film.toMark("after"); break;
    case " ": toggle(film); break;
    default: return false;
  }
  return true;
}

export function FilmBar({ film }: { readonly film: Film }): JSX.Element {
  useFrame((now_ms) => film.tick(now_ms));
  const slider = useRef<HTMLInputElement>(null);
  const lasts_s = useComputed(() => film.facts.value?.lasts_s ?? 0).value;
  const at_s = film.wished_s.value;
  const isPlaying = film.isPlaying.value;
  return (
    <section
      class="panel reel-bar"
      aria-label="Time line"
      onKeyDown={(event) => {
        // A button, a list: they have keys of their own.
        if (event.target !== slider.current || !takeKey(film, event)) return;
        event.preventDefault();
      }}
    >
      <button type="button" class="play" onClick={() => toggle(film)} disabled={lasts_s === 0} title={isPlaying ? "pause (space)" : "play (space)"} data-testid="reel-play" aria-pressed={isPlaying}>
        <i class={isPlaying ? "sign hold" : "sign go"} aria-hidden="true" /> {isPlaying ? "Pause" : "Play"}
      </button>
      <div class="reel-line">
        <Gaps film={film} />
        <input
          ref={slider}
          type="range"
          min={0}
          max={lasts_s}
          step={0.001}
          value={at_s}
          disabled={lasts_s === 0}
          aria-label="Moment on show"
          aria-valuetext={`${sessionTime(at_s, 3)} of ${sessionTime(lasts_s, 3)}`}
          title="arrows 0.1 s, with shift 0.01 s; page up and down 5 s; [ and ] from mark to mark; space plays"
          onInput={({ currentTarget }) => film.seek(Number(currentTarget.value))}
          data-testid="reel-time"
        />
        <Marks film={film} />
      </div>
      <span class="clock" data-testid="reel-clock">{sessionTime(at_s, 3)} <span class="faint">/ {sessionTime(lasts_s, 1)}</span></span>
      <label class="choice">
        <span>speed</span>
        <select value={String(film.speed.value)} onChange={({ currentTarget }) => film.setSpeed(SPEEDS.find((speed) => speed === Number(currentTarget.value)) ?? 1)} data-testid="reel-speed">
          {SPEEDS.map((speed) => <option key={speed} value={String(speed)}>{speed}×</option>)}
        </select>
      </label>
    </section>
  );
}

function toggle(film: Film): void {
  if (film.isPlaying.peek()) film.pause();
  else film.play();
}

/** What happened, where it happened; a press goes there. */
function Marks({ film }: { readonly film: Film }): JSX.Element {
  const lasts_s = film.facts.value?.lasts_s ?? 0;
  let last = Number.NEGATIVE_INFINITY;
  const apart = film.marks.value.filter(({ at_s }) => {
    const share = shareOf(at_s, { from_s: 0, to_s: lasts_s });
    if (share - last < APART) return false;
    last = share;
    return true;
  });
  return (
    <div class="reel-marks" data-testid="reel-marks" data-count={film.marks.value.length} aria-hidden="true">
      {apart.map(({ at_s, level, text }) => (
        <i key={at_s} data-level={level} title={`${sessionTime(at_s, 3)}: ${text}`} style={{ left: `${100 * shareOf(at_s, { from_s: 0, to_s: lasts_s })}%` }} onClick={() => film.seek(at_s)} />
      ))}
    </div>
  );
}

/** Where the clay is unknown. */
function Gaps({ film }: { readonly film: Film }): JSX.Element {
  const facts = film.facts.value;
  const span = { from_s: 0, to_s: facts?.lasts_s ?? 0 };
  return (
    <div class="reel-gaps" aria-hidden="true">
      {(facts?.gaps ?? []).map(({ from_s, to_s }) => {
        const [left, right] = [shareOf(from_s, span), shareOf(to_s ?? span.to_s, span)];
        return <i key={from_s} style={{ left: `${100 * left}%`, width: `${100 * (right - left)}%` }} title="its clay is unknown here" />;
      })}
    </div>
  );
}
