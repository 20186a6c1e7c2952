// What is being typed into a field of a number, and what becomes of it on Enter or on leaving.

import { type Signal, useSignal } from "@preact/signals";
import { plain } from "../format";
import { outOfRange, readTyped, type Unit } from "./typed";

/** Why a value, SI, is not taken, told in `unit`; nothing when it is. */
export type Check = (si: number, unit: Unit) => string | undefined;

/** From `least` to `greatest`, SI, both included. */
export function within(least: number, greatest: number): Check {
  return (si, unit) => (least <= si && si <= greatest ? undefined : outOfRange(si, least, greatest, unit));
}

export interface Entry {
  /** What stands in the field. */
  readonly text: string;
  /** Why what was typed last is not taken. */
  readonly reason: Signal<string | undefined>;
  /** The unit that was typed last, or the field's. */
  readonly unit: Signal<Unit>;
  /** Takes a value that was not typed. */
  wish(si: number): void;
  /** For the text field. */
  readonly handlers: {
    onInput(event: { readonly currentTarget: HTMLInputElement }): void;
    onBlur(): void;
    onKeyDown(event: { readonly key: string }): void;
  };
}

export interface EntryOptions {
  /** SI; nothing while it is not known. */
  readonly value: number | undefined;
  readonly ofField: Unit;
  readonly check: Check | undefined;
  /** Takes the new value, in SI units. */
  readonly onWish: (si: number) => void;
}

export function useEntry({ value, ofField, check, onWish }: EntryOptions): Entry {
  /** Nothing while nobody types. */
  const typed = useSignal<string | undefined>(undefined);
  const reason = useSignal<string | undefined>(undefined);
  const unit = useSignal(ofField);
  const shown = value === undefined ? "" : plain(value * ofField.factor);

  const take = (si: number, as: Unit): void => {
    unit.value = as;
    reason.value = check?.(si, as);
    if (reason.value === undefined) onWish(si);
  };
  const commit = (): void => {
    const text = typed.value;
    typed.value = undefined;
    if (text === undefined) return;
    if (text === shown) {
      reason.value = undefined;
      return;
    }
    const read = readTyped(text, ofField);
    if (read.kind === "refused") reason.value = read.reason;
    else take(read.si, read.unit);
  };
  return {
    text: typed.value ?? shown,
    reason,
    unit,
    wish: (si) => take(si, ofField),
    handlers: {
      onInput: ({ currentTarget }) => {
        typed.value = currentTarget.value;
      },
      onBlur: commit,
      onKeyDown: ({ key }) => {
        if (key === "Enter") commit();
        if (key === "Escape") typed.value = undefined;
      },
    },
  };
}
