// What a problem's detail says in a form that programs may read: proto/SPEC.md, section 5.

/** A number of the request's and the range it should have kept to, SI. */
export interface OutOfRange {
  readonly got: number;
  readonly least: number;
  readonly greatest: number;
}

const FORM = /^(\S+) is not a number from (\S+) to (\S+)$/;

/** The range in a detail; nothing when it says something else. */
export function outOfRangeIn(detail: string): OutOfRange | undefined {
  const [got, least, greatest] = (FORM.exec(detail)?.slice(1) ?? []).map(Number);
  return [got, least, greatest].every(Number.isFinite) ? { got, least, greatest } : undefined;
}
