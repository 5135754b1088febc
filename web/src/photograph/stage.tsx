// The photograph with everything over it: clicks, drags and keys.
import { useSignalEffect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { Viewport, type PointerHandler, type ViewportPointer } from "../parts/viewport";
import { type Point, motionInPicture, toScreen } from "../parts/transform";
import { photographTexts as texts } from "../texts/photograph";
import { HAND_PX, drawHand, layers, pointed } from "./draw";
import { Chips } from "./chips";
import {
  acceptSnap, addMeasured, addsMark, aim, apply, byKeys, hovered, inHand, marks, measured, move, nextMark, pending, picture, placeOf, proposeSnap,
  sameHandle, selected, showsKeys, snapTo, snapped, tool, view, viewport, type Handle,
} from "./store";

/** How near a press must be to a point to take it, px: fingers are wider. */
const NEAR_PX = 14;
const NEAR_FINGER_PX = 30;
/** How far an arrow key pans where nothing is selected, px; with Shift a tenth. */
const PAN_PX = 40;

export function handles(): { handle: Handle; at: Point }[] {
  const all: { handle: Handle; at: Point }[] = marks.value.map(({ name, at }) => ({ handle: { kind: "mark", name }, at }));
  for (const m of measured.value) {
    m.points.forEach((at, index) => all.push({ handle: { kind: "measurement", name: m.name, index }, at }));
  }
  return all;
}

function near(pointer: ViewportPointer): Handle | null {
  const t = viewport.transform.value;
  const away = (at: Point) => {
    const [x, y] = toScreen(t, at);
    return Math.hypot(x - pointer.screen[0], y - pointer.screen[1]);
  };
  const limit = pointer.touch ? NEAR_FINGER_PX : NEAR_PX;
  let best: { handle: Handle; px: number } | null = null;
  for (const { handle, at } of handles()) {
    const px = away(at);
    if (px < limit && (!best || px < best.px)) best = { handle, px };
  }
  return best?.handle ?? null;
}

/** While marks are placed, a press this near to one means it and not the next one, px. */
const SAME_PX = 4;

/** Whether a press is on a point, not only near it. */
function isOn(pointer: ViewportPointer, handle: Handle | null, within = (pointer.touch ? NEAR_FINGER_PX : NEAR_PX) / 2): boolean {
  const at = handle && placeOf(handle);
  if (!at) return false;
  const [x, y] = toScreen(viewport.transform.value, at);
  return Math.hypot(x - pointer.screen[0], y - pointer.screen[1]) < within;
}

/** What is dragged, and from where; a finger moves the selected point from wherever it is put down. */
let held: { handle: Handle; from: Point } | null = null;

const handler: PointerHandler = {
  down(pointer) {
    // While marks are placed or something is measured, a press beside a point means a new one; a finger that moves still moves it.
    const close = near(pointer);
    const places = tool.value !== "marks" || nextMark.value !== null;
    const handle = (places && !isOn(pointer, close) ? null : close) ?? (pointer.touch && !places ? selected.value : null);
    const from = handle && placeOf(handle);
    held = handle && from ? { handle, from } : null;
    if (handle && close && !pending.value.length) selected.value = close;
    return !!held;
  },
  move(pointer, first) {
    if (!held) return;
    const t = viewport.transform.value;
    const [du, dv] = motionInPicture(t, pointer.screen[0] - first.screen[0], pointer.screen[1] - first.screen[1]);
    void move(held.handle, [held.from[0] + du, held.from[1] + dv], true);
  },
  up() {
    const now = inHand();
    if (held && now) {
      const { handle } = held;
      void move(handle, now.at, false).then(() => proposeSnap(handle));
    }
    held = null;
  },
  cancel() {
    const now = inHand();
    if (held && now) void move(held.handle, now.at, false);
    held = null;
  },
  click(pointer) {
    if (!view.value?.photo) return;
    const close = near(pointer);
    if (tool.value !== "marks") {
      const last = pending.value.at(-1);
      // Only what may have any number of points ends with a second press on its last one: a length may be shorter than a finger.
      const isOpen = ["polyline", "area"].includes(tool.value) && 1 < pending.value.length;
      const isLast = isOpen && last && Math.hypot(last[0] - pointer.at[0], last[1] - pointer.at[1]) * viewport.transform.value.scale < NEAR_PX;
      void addMeasured(pointer.at, !!isLast);
    } else if (close && (!nextMark.value || isOn(pointer, close, SAME_PX))) selected.value = close;
    else if (nextMark.value) void place(nextMark.value, pointer.at);
    else selected.value = null;
  },
  hover(pointer) {
    hovered.value = pointer && inPhotograph(pointer.at) ? pointer.at : null;
    if (pointer) byKeys.value = false;
  },
};

function inPhotograph([u, v]: Point): boolean {
  const shown = view.value?.photo;
  return !!shown && -0.5 <= u && u <= shown.width_px - 0.5 && -0.5 <= v && v <= shown.height_px - 0.5;
}

/** Places a mark and selects it. */
async function place(name: string, at: Point) {
  if (!inPhotograph(at)) return;
  const handle: Handle = { kind: "mark", name };
  if (!(await move(handle, at, false))) return;
  selected.value = handle;
  await proposeSnap(handle);
}

function step(by: number): boolean {
  const all = handles();
  const now = all.findIndex(({ handle }) => sameHandle(handle, selected.value));
  const next = now < 0 ? (by < 0 ? all.length - 1 : 0) : now + by;
  const found = all[next];
  selected.value = found?.handle ?? null;
  if (found) viewport.reveal(found.at);
  return !!found;
}

function nudge(event: KeyboardEvent): boolean {
  const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
  if (!by) return false;
  const at = selected.value && placeOf(selected.value);
  if (!at || !selected.value) {
    const px = event.shiftKey ? PAN_PX / 10 : PAN_PX;
    viewport.pan(-px * by[0]!, -px * by[1]!);
    return true;
  }
  const px = event.shiftKey ? 0.1 : 1;
  const turned = motionInPicture({ ...viewport.transform.value, scale: 1 }, by[0]! * px, by[1]! * px);
  viewport.reveal(at);
  // Still under the hand, so that many presses are one step back; the release of the key puts it down.
  void move(selected.value, [at[0] + turned[0], at[1] + turned[1]], true);
  return true;
}

function released(event: KeyboardEvent) {
  const now = inHand();
  if (event.key.startsWith("Arrow") && now && !held) void move(now.handle, now.at, false);
}

export function removeSelected() {
  const handle = selected.value;
  if (handle?.kind === "mark") void apply({ kind: "remove_point", name: handle.name });
  else if (handle) void apply({ kind: "remove_measurement", name: handle.name }, "measure");
}

/** Leaves, one thing a time. */
export function leave() {
  if (snapped.value) snapped.value = null;
  else if (pending.value.length) pending.value = [];
  else if (tool.value !== "marks") tool.value = "marks";
  else if (addsMark.value) addsMark.value = false;
  else selected.value = null;
}

function enter() {
  byKeys.value = true;
  const at = aim.value;
  if (snapped.value) void acceptSnap();
  else if (pending.value.length && ["polyline", "area"].includes(tool.value)) void addMeasured([0, 0], true);
  else if (tool.value !== "marks" && at) void addMeasured(at);
  else if (nextMark.value && at) void place(nextMark.value, at);
}

function key(event: KeyboardEvent) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  byKeys.value = true;
  const digit = /^[1-9]$/.test(event.key) ? marks.value[Number(event.key) - 1] : undefined;
  if (digit) {
    selected.value = { kind: "mark", name: digit.name };
    viewport.reveal(digit.at);
  } else if (event.key === "Tab") {
    if (!handles().length || !step(event.shiftKey ? -1 : 1)) return;
  } else if (nudge(event)) {
    // Moved.
  } else if (event.key === "Enter") enter();
  else if (event.key === "Escape") leave();
  else if (event.key === "Delete" || event.key === "Backspace") removeSelected();
  else if (event.key === "+" || event.key === "=") viewport.zoom(1.25);
  else if (event.key === "-") viewport.zoom(0.8);
  else if (event.key === "0") viewport.fit();
  else if (event.key === "?") showsKeys.value = true;
  else if (event.key.toLowerCase() === "s" && selected.value) {
    snapTo.value ??= "corner";
    void proposeSnap(selected.value);
  } else return;
  event.preventDefault();
}

/** What follows the pointer: a small canvas that goes with it, so that nothing else is drawn again for a move. */
function Hand() {
  const canvas = useRef<HTMLCanvasElement>(null);
  useSignalEffect(() => {
    const element = canvas.current!;
    const at = pointed.value;
    element.hidden = !at;
    if (!at) return;
    const side = Math.round(2 * HAND_PX * devicePixelRatio);
    if (element.width !== side) [element.width, element.height] = [side, side];
    const [left, top] = toScreen(viewport.transform.value, at).map((x) => Math.round(x) - HAND_PX) as [number, number];
    element.style.transform = `translate(${left}px, ${top}px)`;
    const context = element.getContext("2d")!;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, side, side);
    const ratio = side / (2 * HAND_PX);
    context.setTransform(ratio, 0, 0, ratio, -ratio * left, -ratio * top);
    drawHand(context, viewport, at);
  });
  return <canvas class="hand" ref={canvas} hidden style={{ width: `${2 * HAND_PX}px`, height: `${2 * HAND_PX}px` }} />;
}

export function Stage() {
  useEffect(() => {
    document.addEventListener("keyup", released);
    return () => document.removeEventListener("keyup", released);
  }, []);
  const shown = view.value?.photo;
  return (
    <Viewport state={viewport} picture={picture} layers={layers} handler={handler} onKeyDown={key} label={shown ? texts.stage(shown.name) : texts.noStage}>
      <Hand />
      <Chips />
    </Viewport>
  );
}
