// New state that keeps the old one's objects wherever nothing changed, so that who shows a part is not woken by the
// rest.

/** `next`, with every part that equals its counterpart in `previous` replaced by it. */
export function sharing<T>(previous: unknown, next: T): T {
  if (isSame(previous, next)) return previous;
  if (isObject(previous) && isObject(next)) replaceEqual(previous, next);
  return next;
}

function replaceEqual(previous: Record<string, unknown>, next: Record<string, unknown>): void {
  for (const key of Object.keys(next)) next[key] = sharing(previous[key], next[key]);
}

/** Deep equality of plain data; then `previous` may stand for `next`. */
function isSame<T>(previous: unknown, next: T): previous is T {
  if (Object.is(previous, next)) return true;
  if (!isObject(previous) || !isObject(next)) return false;
  const keys = Object.keys(next);
  return keys.length === Object.keys(previous).length && Array.isArray(previous) === Array.isArray(next) &&
    keys.every((key) => key in previous && isSame(previous[key], next[key]));
}

function isObject(value: unknown): value is Record<string, unknown> {
  return typeof value === "object" && value !== null;
}
