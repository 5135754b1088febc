// What lies over the photograph: grid, axes, ghost, marks, measurements, what would happen next. What follows the pointer is drawn by itself
// (`drawHand`): nothing else has to be drawn again for it.
import { computed } from "@preact/signals";
import { type Curve, trace } from "../parts/curve";
import { colours } from "../parts/theme";
import { drawLoupe } from "../parts/loupe";
import { type Point, type Transform, type ViewportState, toScreen } from "../parts/transform";
import type { DrawLayer } from "../parts/viewport";
import {
  aim, held, isAlike, lensLines, lineOf, marks, measured, moved, nextMark, pending, picture, placeOf, sameHandle, selected, snapped, tool, view, type Handle,
} from "./store";
import { placed } from "./chips";
import { FONT, labels, type Label } from "./labels";

type Measured = (typeof measured.value)[number];
type Context = CanvasRenderingContext2D | OffscreenCanvasRenderingContext2D;

// On photographs, of any theme: bright lines with a dark rim.
const GRID = "#7fd6ff";
const GHOST = "#ffb03b";
const MARK = "#ff6a5e";
const MEASURE = "#ffe36b";
/** Of the marked horizon. */
const HORIZON = "#ffffff";
const RIM = "rgb(0 0 0 / 55%)";
const AXES: Record<string, string> = { x: "#ff5c5c", y: "#52dd6f", z: "#6fa8ff" };
/** Lines of a pixel are drawn several times as fast as wider ones. */
const THIN = 1;

/** Whether there is something to draw over. */
const isShown = computed(() => !!view.value?.photo && !!picture.value);

/** From below: outlines of what is measured, what moves with a point in the hand, values. Only the middle one is drawn again with each move. */
export const layers: readonly DrawLayer[] = [outlines, draw, values].map((layer) => (context, state) => {
  context.lineJoin = "round";
  context.lineCap = "round";
  if (isShown.value) layer(context, state);
});

function draw(context: CanvasRenderingContext2D, state: ViewportState) {
  const t = state.transform.value;
  const now = view.value!;
  context.globalAlpha = now.is_old ? 0.45 : 1;
  const overlay = now.overlay;
  if (overlay) {
    manyLines(context, t, overlay.grid, GRID);
    if (overlay.ghost) ghost(context, t, overlay.ghost);
    lines(context, t, overlay.horizon, GRID, THIN, [2, 6]);
    manyLines(context, t, overlay.ellipses, MARK);
    for (const axis of overlay.axes) {
      lines(context, t, [axis.points], AXES[axis.name] ?? GRID, 3.5);
      const end = axis.points.at(-1);
      if (end) label(context, axis.name, toScreen(t, end), AXES[axis.name] ?? GRID, 6, -8);
    }
  }
  context.globalAlpha = 1;
  if (now.advice && tool.value === "marks" && !held.value) advice(context, toScreen(t, [now.advice.u_px, now.advice.v_px]));
  measured.value.filter(({ name }) => name === heldName.value).forEach((m) => outline(context, t, m, chosen.value));
  distances(context, t);
  allMarks(context, t);
  written(context, labels.value.filter(({ name }) => name === heldName.value));
  marked(context, t);
  underway(context, t);
  proposal(context, t);
}

/** How far what is drawn at the pointer reaches from it, px. */
export const HAND_PX = 200;

/** Where the pointer does something: where the hand has a point, or where one would be placed. */
export const pointed = computed((): Point | null => {
  if (moved.value) return moved.value.at;
  return nextMark.value || tool.value !== "marks" ? aim.value : null;
});

/** Draws what follows the pointer: the point in the hand or the mark that would be placed, and the loupe. */
export function drawHand(context: CanvasRenderingContext2D, state: ViewportState, at: Point) {
  const t = state.transform.value;
  const hand = moved.value;
  const screen = toScreen(t, at);
  context.lineJoin = "round";
  context.lineCap = "round";
  if (hand?.handle.kind === "mark") mark(context, screen, hand.handle.name, true);
  else if (hand) ring(context, screen, 8, "#ffffff");
  else if (nextMark.value) {
    cross(context, screen, 3, 10, MARK);
    label(context, nextMark.value, screen, "#ffffff", 14, -10);
  }
  if (picture.value) drawLoupe(context, picture.value, t, at, screen, state.size.value, hand ? "#ffffff" : MARK);
}

function pathOf(t: Transform, curve: Curve): Path2D {
  const path = new Path2D();
  trace(path, t, curve);
  return path;
}

/** Strokes each curve by itself, without round ends: strokes of straight lines are many times as fast as those of what holds several. */
function lines(context: Context, t: Transform, curves: readonly Curve[], colour: string, width: number, dash: number[] = []) {
  const paths = curves.map((curve) => pathOf(t, curve));
  context.lineCap = "butt";
  context.setLineDash(dash);
  context.strokeStyle = RIM;
  context.lineWidth = width + 1.6;
  paths.forEach((path) => context.stroke(path));
  context.strokeStyle = colour;
  context.lineWidth = width;
  paths.forEach((path) => context.stroke(path));
  context.setLineDash([]);
  context.lineCap = "round";
}

/** Many long lines: their rims are thin lines too, on one side. */
function manyLines(context: Context, t: Transform, curves: readonly Curve[], colour: string, dash: number[] = []) {
  context.lineCap = "butt";
  context.setLineDash(dash);
  context.lineWidth = THIN;
  const all = curves.filter((curve) => 1 < curve.length).map((curve) => {
    const [from, to] = [curve[0], curve.at(-1)].map((at) => toScreen(t, at as unknown as Point)) as [Point, Point];
    const isSteep = Math.abs(to[0] - from[0]) < Math.abs(to[1] - from[1]);
    return { path: pathOf(t, curve), aside: isSteep ? [THIN, 0] as const : [0, THIN] as const };
  });
  context.strokeStyle = RIM;
  for (const { path, aside: [dx, dy] } of all) {
    context.translate(dx, dy);
    context.stroke(path);
    context.translate(-dx, -dy);
  }
  context.strokeStyle = colour;
  all.forEach(({ path }) => context.stroke(path));
  context.setLineDash([]);
  context.lineCap = "round";
}

/** The second pose's grid: thinner, and without a rim. */
function ghost(context: Context, t: Transform, curves: readonly Curve[]) {
  context.lineCap = "butt";
  context.setLineDash([5, 6]);
  context.strokeStyle = GHOST;
  context.lineWidth = THIN;
  curves.forEach((curve) => context.stroke(pathOf(t, curve)));
  context.setLineDash([]);
  context.lineCap = "round";
}

function label(context: Context, text: string, [x, y]: Point, colour: string, dx = 12, dy = -12) {
  context.font = FONT;
  context.lineWidth = 4;
  context.strokeStyle = "rgb(0 0 0 / 80%)";
  context.strokeText(text, x + dx, y + dy);
  context.fillStyle = colour;
  context.fillText(text, x + dx, y + dy);
}

/** A sentence on a dark plate, so that it is read on any photograph. */
function plate(context: Context, text: string, [x, y]: Point, width: number, colour: string) {
  context.font = FONT;
  context.fillStyle = "rgb(15 18 22 / 82%)";
  context.beginPath();
  context.roundRect(x - width / 2, y - 12, width, 24, 5);
  context.fill();
  context.fillStyle = colour;
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText(text, x, y + 1);
  context.textAlign = "start";
  context.textBaseline = "alphabetic";
}

function ring(context: Context, [x, y]: Point, radius: number, colour: string, width = 2) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.strokeStyle = RIM;
  context.lineWidth = width + 2;
  context.stroke();
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.stroke();
}

function cross(context: Context, [x, y]: Point, inner: number, outer: number, colour: string) {
  context.beginPath();
  for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]] as const) {
    context.moveTo(x + inner * dx, y + inner * dy);
    context.lineTo(x + outer * dx, y + outer * dy);
  }
  context.strokeStyle = RIM;
  context.lineWidth = 3.5;
  context.stroke();
  context.strokeStyle = colour;
  context.lineWidth = 1.5;
  context.stroke();
}

/** Boards have hundreds of points: beyond so many they are small and without names. */
const MANY = 24;

function allMarks(context: Context, t: Transform) {
  const many = MANY < marks.value.length;
  for (const { name, at, is_suspect, residual_px } of marks.value) {
    const handle: Handle = { kind: "mark", name };
    // That in the hand is drawn where the hand has it.
    if (sameHandle(held.value, handle)) continue;
    const screen = toScreen(t, at);
    const isSelected = sameHandle(selected.value, handle);
    if (many && !isSelected && !is_suspect) {
      ring(context, screen, 3, MARK, 1.5);
      continue;
    }
    if (is_suspect) ring(context, screen, 15, colours.value.bad, 2);
    const off = is_suspect && residual_px != null ? ` ${residual_px.toFixed(1)} px` : "";
    mark(context, screen, name + off, isSelected);
  }
}

function mark(context: Context, at: Point, words: string, isSelected: boolean) {
  const colour = isSelected ? "#ffffff" : MARK;
  ring(context, at, isSelected ? 11 : 9, colour, isSelected ? 2.5 : 2);
  cross(context, at, 2, 7, colour);
  label(context, words, at, "#ffffff", 14, -10);
}

function distances(context: Context, t: Transform) {
  const now = view.value!;
  if (tool.value !== "marks") return;
  const at = (name: string) => marks.value.find((mark) => mark.name === name)?.at;
  const typed = now.distances.map((d) => [at(d.a), at(d.b)] as const);
  const curves = typed.filter(([a, b]) => a && b).map(([a, b]) => [a!, b!]);
  manyLines(context, t, curves, "#ffffff", [2, 4]);
  context.strokeStyle = "#ffffff";
  context.lineWidth = THIN;
  for (const { x, y, leads } of placed.value) {
    if (!leads) continue;
    context.beginPath();
    context.moveTo(...leads);
    context.lineTo(x, y);
    context.stroke();
  }
}

/** The measurement whose point is being moved: it is drawn with what moves. */
const heldName = computed(() => (held.value?.kind === "measurement" ? held.value.name : null));
const chosen = computed(() => (selected.value?.kind === "measurement" ? selected.value : null));

/** What stays while a point is in the hand. What is measured may have another value; its outline is that of its points. */
let staying: Measured[] = [];
const stays = computed(() => {
  const now = measured.value.filter(({ name }) => name !== heldName.value);
  if (!isAlike(now.map(({ points }) => points), staying.map(({ points }) => points))) staying = now;
  return staying;
});

function outlines(context: Context, state: ViewportState) {
  const t = state.transform.value;
  stays.value.forEach((m) => outline(context, t, m, chosen.value));
}

function outline(context: Context, t: Transform, m: Measured, chosen: Handle | null) {
  const closed = m.what === "area" ? [...m.points, m.points[0]!] : m.points;
  if (m.what === "area") {
    context.beginPath();
    trace(context, t, closed);
    context.fillStyle = "rgb(255 227 107 / 18%)";
    context.fill();
  }
  lines(context, t, [closed], MEASURE, 2.5);
  m.points.forEach((point, index) => {
    const isSelected = sameHandle(chosen, { kind: "measurement", name: m.name, index });
    ring(context, toScreen(t, point), isSelected ? 8 : 5, isSelected ? "#ffffff" : MEASURE);
  });
}

/** Whether newer values than those shown are on their way. */
const isOfBefore = computed(() => !!view.value?.is_measuring && !held.value);

/** What was measured, with its interval, over everything else. */
function values(context: Context) {
  written(context, labels.value.filter(({ name }) => name !== heldName.value));
}

function written(context: Context, all: Label[]) {
  context.globalAlpha = isOfBefore.value ? 0.7 : 1;
  context.strokeStyle = MEASURE;
  context.lineWidth = THIN;
  for (const { at, leads } of all) {
    if (!leads) continue;
    context.beginPath();
    context.moveTo(...leads);
    context.lineTo(...at);
    context.stroke();
  }
  for (const { text, at, width } of all) plate(context, text, at, width, MEASURE);
  context.globalAlpha = 1;
}

function advice(context: Context, at: Point) {
  context.setLineDash([4, 4]);
  ring(context, at, 12, "#7dff9b", 2);
  context.setLineDash([]);
  cross(context, at, 0, 5, "#7dff9b");
}

/** Lines that were marked for the lens. */
function marked(context: Context, t: Transform) {
  if (!lensLines.value.length || (tool.value !== "marks" && !lineOf(tool.value))) return;
  for (const { direction, ends } of lensLines.value) {
    const colour = direction === "horizon" ? HORIZON : AXES[{ up: "z", along: "y", across: "x" }[direction]]!;
    lines(context, t, [ends as Curve], colour, 2);
    ends.forEach((end) => ring(context, toScreen(t, end as Point), 5, colour));
  }
}

/** A measurement that is not complete, up to the pointer. */
function underway(context: Context, t: Transform) {
  if (!pending.value.length) return;
  const at = aim.value;
  lines(context, t, [at ? [...pending.value, at] : pending.value], MEASURE, 2, [6, 4]);
  pending.value.forEach((point) => ring(context, toScreen(t, point), 5, MEASURE));
}

function proposal(context: Context, t: Transform) {
  const one = snapped.value;
  if (!one) return;
  const to: Point = [one.found.u_px, one.found.v_px];
  const from = placeOf(one.handle);
  if (from) lines(context, t, [[from, to]], "#7dff9b", 2);
  ring(context, toScreen(t, to), 9, "#7dff9b", 2);
  cross(context, toScreen(t, to), 2, 14, "#7dff9b");
}
