// Light or dark: as the system says, until somebody chooses.

import { computed, effect, signal, type ReadonlySignal } from "@preact/signals";

const CHOICES = ["auto", "light", "dark"] as const;
export type ThemeChoice = (typeof CHOICES)[number];
const KEY = "teleclay.theme";

const system = matchMedia("(prefers-color-scheme: dark)");
const systemIsDark = signal(system.matches);
const choice = signal<ThemeChoice>(remembered());

export const themeChoice: ReadonlySignal<ThemeChoice> = choice;
export const isDark: ReadonlySignal<boolean> = computed(() =>
  choice.value === "auto" ? systemIsDark.value : choice.value === "dark");

export function nextTheme(): void {
  choice.value = CHOICES[(CHOICES.indexOf(choice.value) + 1) % CHOICES.length];
}

/** Keeps the page in the chosen theme. */
export function followTheme(): void {
  system.addEventListener("change", ({ matches }) => {
    systemIsDark.value = matches;
  });
  effect(() => {
    document.documentElement.dataset["theme"] = isDark.value ? "dark" : "light";
    remember(choice.value);
  });
}

/** A page without storage, such as one in a private window, starts over each time. */
function remembered(): ThemeChoice {
  try {
    const stored = localStorage.getItem(KEY);
    return CHOICES.find((known) => known === stored) ?? "auto";
  } catch {
    return "auto";
  }
}

function remember(value: ThemeChoice): void {
  try {
    localStorage.setItem(KEY, value);
  } catch {
    // The choice holds for as long as the page does.
  }
}
