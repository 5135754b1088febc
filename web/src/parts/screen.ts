// What kind of screen the page has, by the conditions that the styles have too.
import { signal, type ReadonlySignal } from "@preact/signals";

function matches(condition: string): ReadonlySignal<boolean> {
  const query = matchMedia(condition);
  const now = signal(query.matches);
  query.addEventListener("change", () => (now.value = query.matches));
  return now;
}

/** Phones, and tablets held upright: the panel is a sheet below, chips are short. */
export const isSmall = matches("(max-width: 760px), (max-width: 1000px) and (orientation: portrait)");
/** A phone held across, or a page that is zoomed in. */
export const isLow = matches("(max-height: 520px)");
