// Canvases one over the other: the picture is drawn once per zoom, and each layer over it whenever a signal that it reads changes.
// The wheel and pinching zoom; two fingers, the middle button, or a drag with the space bar held pan; everything else is the caller's.
import { effect, signal, type ReadonlySignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { drawPicture, type Picture } from "./picture";
import { toPicture, type Point, type ViewportState } from "./transform";

export interface ViewportPointer {
  /** Pixel of the picture. */
  at: Point;
  /** Pixel of the viewport. */
  screen: Point;
  touch: boolean;
  shift: boolean;
}

/** What presses mean. `down` answers whether it takes the drag; otherwise the drag pans. A press that did not move ends in `click`. */
export interface PointerHandler {
  down?(pointer: ViewportPointer): boolean;
  move?(pointer: ViewportPointer, from: ViewportPointer): void;
  up?(pointer: ViewportPointer): void;
  cancel?(): void;
  click?(pointer: ViewportPointer): void;
  hover?(pointer: ViewportPointer | null): void;
}

export type DrawLayer = (context: CanvasRenderingContext2D, state: ViewportState) => void;

export interface ViewportProps {
  state: ViewportState;
  picture: ReadonlySignal<Picture | null>;
  /** The layers over the picture, from below, each of which draws in pixels of the viewport. */
  layers: readonly DrawLayer[];
  handler?: PointerHandler;
  onKeyDown?: (event: KeyboardEvent) => void;
  /** What a screen reader says of it. */
  label: string;
  /** Placed over the canvases. */
  children?: preact.ComponentChildren;
}

/** A press that moves less is a click, px. */
const CLICK_PX = 4;

export function Viewport(props: ViewportProps) {
  const box = useRef<HTMLDivElement>(null);
  const below = useRef<HTMLCanvasElement>(null);
  const above = useRef<(HTMLCanvasElement | null)[]>([]);
  const latest = useRef(props);
  latest.current = props;

  useEffect(() => {
    const { state, picture } = latest.current;
    const element = box.current!;
    const ratio = signal(devicePixelRatio);
    const observer = new ResizeObserver(() => {
      ratio.value = devicePixelRatio;
      state.resized(element.clientWidth, element.clientHeight);
    });
    observer.observe(element);
    state.resized(element.clientWidth, element.clientHeight);
    const stops = [
      effect(() => {
        const context = cleared(below.current!, state, ratio.value);
        if (context && picture.value) drawPicture(context, picture.value, state.transform.value, ratio.value);
      }),
      ...latest.current.layers.map((_, i) => effect(() => {
        const context = cleared(above.current[i]!, state, ratio.value);
        if (context) latest.current.layers[i]!(context, state);
      })),
      presses(element, () => latest.current),
    ];
    return () => {
      observer.disconnect();
      stops.forEach((stop) => stop());
    };
  }, [props.state]);

  return (
    <div class="viewport" ref={box} tabIndex={0} role="application" aria-label={props.label} onKeyDown={(event) => latest.current.onKeyDown?.(event)}>
      <canvas ref={below} />
      {props.layers.map((_, i) => <canvas key={i} ref={(canvas) => void (above.current[i] = canvas)} />)}
      <div class="over">{props.children}</div>
    </div>
  );
}

function cleared(canvas: HTMLCanvasElement, state: ViewportState, ratio: number): CanvasRenderingContext2D | null {
  const { width, height } = state.size.value;
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
  const context = canvas.getContext("2d");
  context?.setTransform(1, 0, 0, 1, 0, 0);
  context?.clearRect(0, 0, w, h);
  context?.setTransform(ratio, 0, 0, ratio, 0, 0);
  return w && h ? context : null;
}

/** Listens to pointers, the wheel and the space bar; answers how to stop. */
function presses(element: HTMLElement, now: () => ViewportProps): () => void {
  const down = new Map<number, Point>();
  let mode: "none" | "drag" | "pan" | "pinch" = "none";
  let first: ViewportPointer | null = null;
  let isClick = false;
  let isSpace = false;
  // Asking for it lays out the page: while something is pressed it stays where it was.
  let edge = element.getBoundingClientRect();
  const screenOf = (event: PointerEvent | WheelEvent): Point => {
    if (down.size === 0) edge = element.getBoundingClientRect();
    return [event.clientX - edge.left, event.clientY - edge.top];
  };
  const pointerOf = (event: PointerEvent): ViewportPointer => {
    const screen = screenOf(event);
    return { screen, at: toPicture(now().state.transform.value, screen), touch: event.pointerType === "touch", shift: event.shiftKey };
  };
  const isOverlay = (event: Event) => !(event.target instanceof HTMLCanvasElement) && event.target !== element;

  const onDown = (event: PointerEvent) => {
    if (isOverlay(event)) return;
    const pointer = pointerOf(event);
    down.set(event.pointerId, pointer.screen);
    element.setPointerCapture(event.pointerId);
    if (down.size === 2) {
      if (mode === "drag") now().handler?.cancel?.();
      [mode, isClick] = ["pinch", false];
      return;
    }
    if (down.size !== 1) return;
    [first, isClick] = [pointer, event.button === 0 && !isSpace];
    const pans = event.button === 1 || isSpace || event.button === 2;
    mode = !pans && now().handler?.down?.(pointer) ? "drag" : "pan";
    // Browsers keep moves until the next frame; a drag has them as they happen, where the browser tells.
    if (mode === "drag") element.addEventListener("pointerrawupdate", onMove as EventListener);
    if (event.button === 1) event.preventDefault();
  };
  const onMove = (event: PointerEvent) => {
    const last = down.get(event.pointerId);
    const pointer = pointerOf(event);
    if (!last) {
      if (event.pointerType !== "touch") now().handler?.hover?.(isOverlay(event) ? null : pointer);
      return;
    }
    const [x, y] = pointer.screen;
    // What was told raw is told again with the frame.
    if (x === last[0] && y === last[1]) return;
    if (mode === "pinch") pinched(event.pointerId, pointer.screen);
    down.set(event.pointerId, pointer.screen);
    if (!first || mode === "pinch") return;
    if (isClick && Math.hypot(x - first.screen[0], y - first.screen[1]) < CLICK_PX) return;
    if (isClick && mode === "pan") now().state.pan(x - first.screen[0], y - first.screen[1]);
    else if (mode === "pan") now().state.pan(x - last[0], y - last[1]);
    isClick = false;
    if (mode === "drag") now().handler?.move?.(pointer, first);
  };
  const pinched = (id: number, [x, y]: Point) => {
    const other = [...down.entries()].find(([key]) => key !== id)?.[1];
    const last = down.get(id);
    if (!other || !last) return;
    const apart = (p: Point) => Math.hypot(p[0] - other[0], p[1] - other[1]);
    const { state } = now();
    state.zoom(apart([x, y]) / Math.max(1, apart(last)), (last[0] + other[0]) / 2, (last[1] + other[1]) / 2);
    state.pan((x - last[0]) / 2, (y - last[1]) / 2);
  };
  const onUp = (event: PointerEvent) => {
    if (!down.delete(event.pointerId) || 0 < down.size) return;
    element.removeEventListener("pointerrawupdate", onMove as EventListener);
    const pointer = pointerOf(event);
    const { handler } = now();
    if (mode === "drag") handler?.up?.(pointer);
    if (isClick && mode !== "pinch") handler?.click?.(pointer);
    [mode, first, isClick] = ["none", null, false];
  };
  const onCancel = (event: PointerEvent) => {
    down.delete(event.pointerId);
    if (mode === "drag") now().handler?.cancel?.();
    if (down.size !== 0) return;
    element.removeEventListener("pointerrawupdate", onMove as EventListener);
    [mode, first, isClick] = ["none", null, false];
  };
  const onWheel = (event: WheelEvent) => {
    event.preventDefault();
    const [x, y] = screenOf(event);
    const lines = event.deltaMode === 1 ? 16 : 1;
    now().state.zoom(Math.exp(-0.0015 * lines * event.deltaY), x, y);
  };
  const onLeave = () => now().handler?.hover?.(null);
  const onSpace = (event: KeyboardEvent) => {
    if (event.key !== " " || event.target !== element) return;
    isSpace = event.type === "keydown";
    element.style.cursor = isSpace ? "grab" : "";
    event.preventDefault();
  };
  const onMenu = (event: Event) => event.preventDefault();
  const listeners: [keyof HTMLElementEventMap, (event: never) => void][] = [
    ["pointerdown", onDown], ["pointermove", onMove], ["pointerup", onUp], ["pointercancel", onCancel],
    ["pointerleave", onLeave], ["wheel", onWheel], ["keydown", onSpace], ["keyup", onSpace], ["contextmenu", onMenu],
  ];
  listeners.forEach(([name, listener]) => element.addEventListener(name, listener as EventListener, { passive: false }));
  return () => listeners.forEach(([name, listener]) => element.removeEventListener(name, listener as EventListener));
}
