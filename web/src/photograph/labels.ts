// Where the values of measurements are written: beside what they measure, so that no label hides another, a mark, or the length itself; a thin line leads
// from a label that lies farther away. Where there is no room at this zoom a label is left out: the table has it, and zooming in makes room.
import { computed } from "@preact/signals";
import { type Point, toScreen } from "../parts/transform";
import { held, marks, measured, picture, sameHandle, selected, view, viewport } from "./store";

export const FONT = '600 14px system-ui, "DejaVu Sans", sans-serif';
/** Height of a label, and how far it stays from what it must not hide, px. */
const HEIGHT = 24;
const PAD = 7;
const APART = 4;
const MARK_PX = 13;

export interface Box {
  x: number;
  y: number;
  width: number;
  height: number;
}

export interface Label {
  name: string;
  text: string;
  /** Middle of the label. */
  at: Point;
  width: number;
  /** What it belongs to; none where it lies beside it. */
  leads: Point | null;
}

const widths = new Map<string, number>();
let pen: OffscreenCanvasRenderingContext2D | null = null;

/** Width of a text in the font of labels, px. */
export function widthOf(text: string): number {
  const known = widths.get(text);
  if (known !== undefined) return known;
  pen ??= new OffscreenCanvas(1, 1).getContext("2d");
  if (!pen) return 8 * text.length;
  pen.font = FONT;
  const width = pen.measureText(text).width;
  // While something is dragged every move has words of its own.
  if (2000 < widths.size) widths.clear();
  widths.set(text, width);
  return width;
}

/** Whether a box and a piece of a line meet, by the slabs of the box. */
function crosses(box: Box, [ax, ay]: Point, [bx, by]: Point): boolean {
  let [first, last] = [0, 1];
  for (const [from, to, least, most] of [[ax, bx, box.x, box.x + box.width], [ay, by, box.y, box.y + box.height]] as const) {
    const along = to - from;
    if (along === 0) {
      if (from < least || most < from) return false;
      continue;
    }
    const [t0, t1] = [(least - from) / along, (most - from) / along];
    first = Math.max(first, Math.min(t0, t1));
    last = Math.min(last, Math.max(t0, t1));
  }
  return first <= last;
}

export function overlap(a: Box, b: Box, apart = APART): boolean {
  return a.x < b.x + b.width + apart && b.x < a.x + a.width + apart && a.y < b.y + b.height + apart && b.y < a.y + a.height + apart;
}

function middle(points: Point[], what: string): Point {
  if (what === "polyline") return points[Math.floor(points.length / 2)]!;
  const n = points.length;
  return [points.reduce((sum, [x]) => sum + x, 0) / n, points.reduce((sum, [, y]) => sum + y, 0) / n];
}

/** How many of the places looked at lie beside what is measured. */
const BESIDE = 8;

/** Directions in which a place is looked for, the one across the length first; then farther away. */
function* spots(points: Point[], from: Point, width: number): Generator<Point> {
  const [a, b] = [points[0]!, points.at(-1)!];
  const long = Math.hypot(b[0] - a[0], b[1] - a[1]);
  const across: Point = long < 1 ? [0, 1] : [-(b[1] - a[1]) / long, (b[0] - a[0]) / long];
  const up = 0 < across[1] ? -1 : 1;
  const first = Math.atan2(up * across[1], up * across[0]);
  for (const ring of [0, 22, 44, 66, 96, 132, 176]) {
    for (const turn of [0, Math.PI, Math.PI / 4, -Math.PI / 4, (3 * Math.PI) / 4, (-3 * Math.PI) / 4, Math.PI / 2, -Math.PI / 2]) {
      const [c, s] = [Math.cos(first + turn), Math.sin(first + turn)];
      // As far as the label's edge needs in this direction, and the ring besides.
      const away = Math.min((width / 2 + 8) / Math.max(Math.abs(c), 0.01), (HEIGHT / 2 + 8) / Math.max(Math.abs(s), 0.01)) + ring;
      yield [from[0] + away * c, from[1] + away * s];
    }
  }
}

const boxOf = ([x, y]: Point, width: number): Box => ({ x: x - width / 2, y: y - HEIGHT / 2, width, height: HEIGHT });

/** Where labels were before something was taken into the hand: while it is held they stay there, and their words follow. */
let before: Label[] = [];

const hasView = computed(() => view.value !== null);

/** Labels as they are drawn. */
export const labels = computed((): Label[] => {
  if (!picture.value || !hasView.value) return [];
  if (!held.value || !before.length) return (before = placed([], () => true));
  const texts = new Map(measured.value.map((m) => [m.name, textOf(m)] as const));
  // A label whose words stay is the very same: it is not drawn anew.
  const kept = (before = before.map((label) => {
    const text = texts.get(label.name) ?? label.text;
    return text === label.text ? label : { ...label, text };
  }));
  const { kind, name: ofHeld } = held.value;
  if (kind === "mark") return kept;
  // The one whose point moves finds a place among the others.
  const others = kept.filter(({ name }) => name !== ofHeld);
  return [...others, ...placed(others, (name) => name === ofHeld)];
});

const textOf = (m: { error?: string | null; words: string }) => (m.error ? "–" : m.words || "…");

/** Places labels of the measurements asked for among those that lie already. */
function placed(there: Label[], isAsked: (name: string) => boolean): Label[] {
  const t = viewport.transform.value;
  const { width: wide, height: high } = viewport.size.value;
  const taken: Box[] = marks.value.length <= 24 ? marks.value.map((mark) => {
    const [x, y] = toScreen(t, mark.at);
    return { x: x - MARK_PX, y: y - 1.8 * MARK_PX, width: 2.6 * MARK_PX, height: 2.8 * MARK_PX };
  }) : [];
  const all = measured.value.map((m) => ({ m, points: m.points.map((point) => toScreen(t, point)) }));
  for (const { points } of all) {
    if (points.length <= 24) points.forEach(([x, y]) => taken.push({ x: x - 6, y: y - 6, width: 12, height: 12 }));
  }
  taken.push(...there.map(({ at, width }) => boxOf(at, width)));
  const isSelected = (name: string) => selected.value?.kind === "measurement" && sameHandle(selected.value, { ...selected.value, name });
  // What is selected has its place first.
  all.sort((a, b) => Number(isSelected(b.m.name)) - Number(isSelected(a.m.name)));
  const result: Label[] = [];
  for (const { m, points } of all.filter(({ m }) => isAsked(m.name))) {
    const text = textOf(m);
    const width = widthOf(text) + 2 * PAD;
    const from = middle(points, m.what);
    if (from[0] < -wide || 2 * wide < from[0] || from[1] < -high || 2 * high < from[1]) continue;
    const closed = m.what === "area" ? [...points, points[0]!] : points;
    const pieces = closed.slice(1).map((point, i) => [closed[i]!, point] as const).slice(0, 60);
    const isFree = (box: Box) =>
      2 <= box.x && box.x + box.width <= wide - 2 && 2 <= box.y && box.y + box.height <= high - 2
      && !taken.some((other) => overlap(box, other)) && !pieces.some(([a, b]) => crosses(box, a, b));
    let tried = 0;
    for (const at of spots(points, from, width)) {
      tried++;
      // That there is no value is said where there is room; the table says why.
      if (m.error && BESIDE < tried) break;
      const box = boxOf(at, width);
      if (!isFree(box)) continue;
      taken.push(box);
      result.push({ name: m.name, text, at, width, leads: tried <= 2 ? null : from });
      break;
    }
  }
  return result;
}

export function boxes(): Box[] {
  return labels.value.map(({ at, width }) => boxOf(at, width));
}

// Canvases have no elements that tests could look at.
(window as unknown as { resightLabels: () => Box[] }).resightLabels = boxes;
