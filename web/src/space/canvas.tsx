// The 3-D view as a part of the page: draws again when the scene, the size or the theme changes.
import { effect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { colours } from "../parts/theme";
import { spaceView, type SpaceScene, type SpaceShown, type SpaceView } from "./view";

export interface SpaceCanvasProps {
  scene: SpaceScene;
  shown?: Partial<SpaceShown>;
  /** What a screen reader says of it: what it shows, and its keys. */
  label: string;
  /** Gets the view, for buttons that turn it. */
  onView?: (view: SpaceView) => void;
}

/** Colours are those of style/space.css: `--space-ink`, `--space-c0` … */
const colour = (name: string) => getComputedStyle(document.documentElement).getPropertyValue(`--space-${name}`).trim();

export function SpaceCanvas({ scene, shown, label, onView }: SpaceCanvasProps) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const view = useRef<SpaceView | null>(null);
  useEffect(() => {
    const element = canvas.current!;
    const made = spaceView(element, colour);
    view.current = made;
    onView?.(made);
    const observer = new ResizeObserver(() => made.draw());
    observer.observe(element);
    const stop = effect(() => {
      colours.value; // The theme.
      made.draw();
    });
    return () => {
      observer.disconnect();
      stop();
      made.release();
    };
  }, []);
  useEffect(() => view.current?.show(scene, shown), [scene, shown]);
  return <canvas class="space-canvas" ref={canvas} tabIndex={0} role="application" aria-label={label} />;
}
