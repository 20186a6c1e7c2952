// Waiting for conditions, never for time: a test goes on as soon as it can, and says what it waited for when it cannot.

/** Between two looks at a condition, ms. */
const LOOK_EVERY_MS = 40;

/** What `look` gives as soon as that is neither undefined nor false. Throws after `deadline_s`. */
export async function until<T>(
  what: string,
  look: () => Promise<T | undefined | false> | T | undefined | false,
  deadline_s = 90,
): Promise<T> {
  const end_ms = performance.now() + deadline_s * 1000;
  let last: unknown;
  for (;;) {
    const found = await look();
    if (found !== undefined && found !== false) return found;
    last = found;
    if (end_ms < performance.now()) throw new Error(`waited ${deadline_s} s in vain until ${what} (last look: ${String(last)})`);
    await new Promise((resume) => setTimeout(resume, LOOK_EVERY_MS));
  }
}
