// A canvas with a 3-D view in it, and what is said in its place while there is no picture.
//
// The browser takes a canvas its drawing context away when the graphics driver starts anew or too many pages draw, and
// gives it back when it can; what the graphics card held is gone by then. So the view goes with its context, and
// another one is made of what the page knows.

import { type Signal, useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import type { Sight } from "../scene/sight";

/** Any view of the scene/ folder. */
interface View {
  readonly sight: Sight | undefined;
  dispose(): void;
}

export type Standing =
  | { readonly name: "drawn" }
  /** The browser has taken the drawing context away. */
  | { readonly name: "lost" }
  | { readonly name: "missing"; readonly reason: string };

export const DRAWN: Standing = { name: "drawn" };
const LOST: Standing = { name: "lost" };

/** Throws where nothing can be drawn. `sight` is that of the view before. */
export type Make<V extends View> = (canvas: HTMLCanvasElement, sight: Sight | undefined) => V;

interface SceneCanvasProps<V extends View> {
  readonly test: string;
  readonly label: string;
  /** Brings what makes a view: most of what this page is made of, and nothing else waits for it. */
  readonly load: () => Promise<Make<V>>;
  /** What goes on with a view for as long as it is there; returns what ends that. */
  readonly run: (view: V, canvas: HTMLCanvasElement) => () => void;
  /** Set to the view that there is. */
  readonly view: Signal<V | undefined>;
  readonly standing: Signal<Standing>;
}

export function SceneCanvas<V extends View>({ test, label, load, run, view, standing }: SceneCanvasProps<V>): JSX.Element {
  const element = useRef<HTMLCanvasElement>(null);
  const sight = useRef<Sight | undefined>(undefined);
  /** Counts canvases: a context that never comes back leaves its canvas for good. */
  const canvases = useSignal(0);

  useEffect(() => {
    const canvas = element.current;
    if (canvas === null) return undefined;
    let end = (): void => undefined;
    let isGone = false;
    const begin = async (): Promise<void> => {
      try {
        const make = await load();
        if (isGone) return;
        const created = make(canvas, sight.current);
        const stop = run(created, canvas);
        end = () => {
          end = () => undefined;
          sight.current = created.sight;
          view.value = undefined;
          stop();
          created.dispose();
        };
        view.value = created;
        standing.value = DRAWN;
      } catch (error) {
        standing.value = { name: "missing", reason: error instanceof Error ? error.message : String(error) };
      }
    };
    const onRestored = (): void => void begin();
    const onLost = (event: Event): void => {
      // Or the browser would never give it back.
      event.preventDefault();
      standing.value = LOST;
      end();
    };
    canvas.addEventListener("webglcontextlost", onLost);
    canvas.addEventListener("webglcontextrestored", onRestored);
    void begin();
    return () => {
      isGone = true;
      canvas.removeEventListener("webglcontextlost", onLost);
      canvas.removeEventListener("webglcontextrestored", onRestored);
      end();
    };
  }, [canvases.value]);

  const { value } = standing;
  return (
    <>
      <canvas key={canvases.value} ref={element} role="img" tabIndex={0} aria-label={label} data-testid={test} />
      {value.name === "missing" && <p class="missing">No 3-D picture here: {value.reason}</p>}
      {value.name === "lost" && (
        <div class="missing" role="alert" data-testid={`${test}-lost`}>
          <strong>No picture: the browser has taken the graphics context away.</strong>
          <p>It comes back by itself as soon as the browser gives it back, mostly within seconds. The session goes on meanwhile.</p>
          <button type="button" onClick={() => { canvases.value += 1; }}>Draw anew now</button>
        </div>
      )}
    </>
  );
}
