// Which tab is open, and the actions that it puts into the bar at the top.
import { effect, signal } from "@preact/signals";
import { render } from "preact";
import { useEffect } from "preact/hooks";

export const TAB_NAMES = ["photograph", "live", "rig", "whisker"] as const;
export type TabName = (typeof TAB_NAMES)[number];

function named(hash: string): TabName {
  return TAB_NAMES.find((name) => `#${name}` === hash) ?? "photograph";
}

/** The tab that is open; the address remembers it. */
export const tab = signal<TabName>(named(location.hash));
addEventListener("hashchange", () => (tab.value = named(location.hash)));
effect(() => {
  if (named(location.hash) !== tab.value) history.replaceState(null, "", `#${tab.value}`);
});

/** Where actions go. */
export const actionsPlace = signal<HTMLElement | null>(null);

/** Puts a tab's actions into the bar at the top: a tree of its own, for a portal would bring React's meaning of `onChange` with it. */
export function Actions({ children }: { children: preact.ComponentChildren }) {
  const place = actionsPlace.value;
  useEffect(() => {
    if (place) render(<>{children}</>, place);
  });
  useEffect(() => () => {
    if (place) render(null, place);
  }, [place]);
  return null;
}
