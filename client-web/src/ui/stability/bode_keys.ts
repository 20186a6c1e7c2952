// The cursor of the Bode diagram by keys, as the pointer moves it.

/** Of a decade: a press, and one with shift. */
const STEP = 1 / 20;
const FINE_STEP = 1 / 200;

/** What the keys do, in the words of the page's help. */
export const BODE_KEYS = "left and right arrow move the cursor along the frequency, with shift finely, page up and down by a decade, " +
  "home and end go to the lowest and the highest frequency, escape takes the cursor away";

interface Key {
  readonly key: string;
  readonly shiftKey: boolean;
}

/** Where the cursor is after a key, rad/s; `undefined` for nowhere, `"other"` where the key is not one of its. */
export function cursorAfter({ key, shiftKey }: Key, at: number | undefined, [least, most]: readonly [number, number]): number | undefined | "other" {
  const by = (decades: number): number => {
    // Without a cursor it begins in the middle.
    const from = at ?? Math.sqrt(least * most);
    return Math.min(Math.max(at === undefined ? from : from * 10 ** decades, least), most);
  };
  const step = shiftKey ? FINE_STEP : STEP;
  switch (key) {
    case "ArrowLeft": return by(-step);
    case "ArrowRight": return by(step);
    case "PageUp": return by(-1);
    case "PageDown": return by(1);
    case "Home": return least;
    case "End": return most;
    case "Escape": return undefined;
    default: return "other";
  }
}
