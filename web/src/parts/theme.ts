// The theme's colours for canvases, read again when the system's setting changes.
import { signal } from "@preact/signals";

const NAMES = ["ground", "panel", "line", "text", "quiet", "accent", "good", "warn", "bad", "grey", "stage"] as const;
export type Colours = Record<(typeof NAMES)[number], string>;

function read(): Colours {
  const style = getComputedStyle(document.documentElement);
  return Object.fromEntries(NAMES.map((name) => [name, style.getPropertyValue(`--${name}`).trim()])) as Colours;
}

/** Read it inside an effect or a draw function: what depends on it is drawn again. */
export const colours = signal<Colours>(read());
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => (colours.value = read()));
