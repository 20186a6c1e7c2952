// A figure on the page: it follows its content, its size and the theme.

import { useSignalEffect, type ReadonlySignal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { Figure, type FigureContent, type FigurePoint } from "../plots/figure";
import { isDark } from "./theme";

interface FigureViewProps {
  readonly content: ReadonlySignal<FigureContent | undefined>;
  /** What the figure shows, for who does not see it. */
  readonly label: string;
  readonly test: string;
  readonly onPointer?: (at: FigurePoint | undefined) => void;
}

export function FigureView({ content, label, test, onPointer }: FigureViewProps): JSX.Element {
  const host = useRef<HTMLDivElement>(null);
  const figure = useRef<Figure | undefined>(undefined);
  useEffect(() => {
    const element = host.current;
    if (element === null) return undefined;
    const created = new Figure(element, onPointer);
    figure.current = created;
    const now = content.peek();
    if (now !== undefined) created.show(now);
    const observer = new ResizeObserver(() => created.resize(element.clientWidth, element.clientHeight));
    observer.observe(element);
    return () => {
      observer.disconnect();
      created.dispose();
      figure.current = undefined;
    };
  }, []);
  useSignalEffect(() => {
    const now = content.value;
    if (now !== undefined) figure.current?.show(now);
  });
  // The style sheet has followed the theme by the time that effects run; a canvas has to be told.
  useEffect(() => figure.current?.recolour(), [isDark.value]);
  return <div class="figure" ref={host} role="img" aria-label={label} data-testid={test} />;
}
