import { describe, expect, it } from "vitest";
import type { FromFilm, ToFilm } from "../film/port";
import type { FilmFacts, FilmMoment } from "../protocol/film";
import { Film, type FilmPort } from "./film";

class FakePort implements FilmPort {
  readonly posted: ToFilm[] = [];
  hasEnded = false;
  onMessage: (message: FromFilm) => void = () => undefined;

  post(message: ToFilm): void {
    this.posted.push(message);
  }

  end(): void {
    this.hasEnded = true;
  }

  get seeks(): number[] {
    return this.posted.flatMap((message) => (message.type === "seek" ? [message.at_s] : []));
  }

  /** Answers the newest wish. */
  answer(): void {
    const asked_s = this.seeks.at(-1) ?? Number.NaN;
    this.onMessage({ type: "moment", moment: momentAt(asked_s), asked_s });
  }
}

const momentAt = (at_s: number): FilmMoment => ({ at_s, tick: 0, is_full: false, clay: null, lost: null, tools: [], settings: null });

const facts = (lasts_s: number, marks: FilmFacts["marks"] = []): FilmFacts => ({
  session: "demo", lasts_s, ticks: 1000 * lasts_s, dropped: 0, bytes: 1, hashes: 1, hash: null, differs_s: null,
  end: "whole", reason: null, tools: [true], marks, gaps: [], column_s: 0.001, keyframe_s: 4, keyframe_bytes: 1,
});

const mark = (at_s: number): FilmFacts["marks"][number] => ({ at_s, level: "info", text: "something" });

function opened(lasts_s = 10): { film: Film; port: FakePort } {
  const port = new FakePort();
  const film = new Film(port, { kind: "file", file: new Blob() }, false);
  port.onMessage({ type: "facts", facts: facts(lasts_s), size: 1, isRead: true });
  return { film, port };
}

describe("a recording on show", () => {
  it("shows its first moment as soon as there is one", () => {
    const { film, port } = opened();
    expect(port.seeks).toEqual([0]);
    port.answer();
    expect(film.moment.value?.at_s).toBe(0);
  });

  it("goes nowhere beyond its ends", () => {
    const { film, port } = opened();
    film.seek(-3);
    film.seek(11);
    film.step(-0.5);
    expect(port.seeks.slice(1)).toEqual([0, 10, 9.5]);
  });

  it("plays in its own time, and twice as fast in half of it", () => {
    const { film, port } = opened();
    port.answer();
    film.play();
    let now_ms = 5000;
    const frame = (): void => {
      film.tick(now_ms);
      now_ms += 100;
      port.answer();
    };
    for (let n = 0; n < 11; n += 1) frame();
    expect(film.wished_s.value).toBeCloseTo(1, 9);
    film.setSpeed(2);
    for (let n = 0; n < 10; n += 1) frame();
    expect(film.wished_s.value).toBeCloseTo(3, 9);
    film.pause();
    for (let n = 0; n < 10; n += 1) frame();
    expect(film.wished_s.value).toBeCloseTo(3, 9);
  });

  it("waits for a reader that is behind, and skips nothing", () => {
    const { film, port } = opened();
    port.answer();
    film.play();
    film.tick(0);
    film.tick(100);
    expect(port.seeks.at(-1)).toBeCloseTo(0.1, 9);
    // No answer yet.
    for (let now_ms = 200; now_ms <= 5000; now_ms += 100) film.tick(now_ms);
    expect(film.wished_s.value).toBeCloseTo(0.1, 9);
    port.answer();
    film.tick(5100);
    expect(film.wished_s.value).toBeCloseTo(0.2, 9);
  });

  it("ends at its end, and plays from the beginning again", () => {
    const { film, port } = opened(1);
    port.answer();
    film.play();
    for (let now_ms = 0; now_ms < 2000; now_ms += 100) {
      film.tick(now_ms);
      port.answer();
    }
    expect(film.isPlaying.value).toBe(false);
    expect(film.wished_s.value).toBe(1);
    film.play();
    expect(film.wished_s.value).toBe(0);
  });

  it("steps from mark to mark", () => {
    const { film, port } = opened();
    port.onMessage({ type: "facts", facts: facts(10, [mark(2), mark(5)]), size: 1, isRead: false });
    port.onMessage({ type: "facts", facts: facts(10, [mark(7)]), size: 1, isRead: true });
    const places = (["after", "after", "after", "after", "before", "before", "before", "before"] as const).map((direction) => {
      film.toMark(direction);
      return film.wished_s.value;
    });
    expect(places).toEqual([2, 5, 7, 10, 7, 5, 2, 0]);
  });

  it("says what is wrong and stops playing", () => {
    const { film, port } = opened();
    film.play();
    port.onMessage({ type: "trouble", says: "the server does not answer" });
    expect([film.trouble.value, film.isPlaying.value]).toEqual(["the server does not answer", false]);
    film.end();
    expect(port.hasEnded).toBe(true);
  });
});
