// Distances, typed where they are drawn.
import { computed, untracked, useSignalEffect } from "@preact/signals";
import { useRef } from "preact/hooks";
import type { DistanceView } from "../api/types";
import { isSmall } from "../parts/screen";
import { type Point, toScreen } from "../parts/transform";
import { photographTexts as texts } from "../texts/photograph";
import { type Box, boxes, overlap, widthOf } from "./labels";
import { apply, failed, marks, measured, nextMark, tool, view, viewport } from "./store";
import { Field } from "./field";
import { number, pairs, type Pair } from "./pairs";

const HEIGHT = 34;
/** What the field of a chip takes, and the room around it and its words; on small screens there is less of it, px. */
const FIELD = 62;
const AROUND = 24;
const AROUND_SMALL = 8;
/** How far chips stay from a mark, px. */
const APART = 14;
/** A chip farther from its distance than this has a line to it, px. */
const LED_PX = 50;

interface Placed extends Pair {
  x: number;
  y: number;
  /** One of its ends has no place without it. */
  isMissing: boolean;
  /** The middle of its distance, where it lies away from it. */
  leads: Point | null;
}

/** Beside the middle of each distance, apart from marks, labels and each other. Where there is no room at this zoom a distance that is typed already
 * has no chip: the table has it. */
export const placed = computed((): Placed[] => {
  const now = view.value;
  if (!now || tool.value !== "marks") return [];
  const t = viewport.transform.value;
  const size = viewport.size.value;
  const at = new Map(marks.value.map((mark) => [mark.name, toScreen(t, mark.at)] as const));
  const all = [...at.values()];
  const centre: Point = [mean(all.map(([x]) => x)), mean(all.map(([, y]) => y))];
  const taken = boxes();
  const points = measured.value.flatMap((m) => (m.points.length <= 24 ? m.points.map((point) => toScreen(t, point)) : []));
  const result: Placed[] = [];
  const hasPlace = (name: string) => now.points.some((point) => point.name === name && point.position_m);
  const wanted = pairs(now.template, now.points, now.distances);
  // What is still to be typed has its place first.
  for (const pair of [...wanted.filter(({ typed }) => !typed), ...wanted.filter(({ typed }) => typed)]) {
    const [a, b] = [at.get(pair.a), at.get(pair.b)];
    if (!a || !b) continue;
    const middle: Point = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
    const isMissing = !pair.typed && !(hasPlace(pair.a) && hasPlace(pair.b));
    const width = widthOfChip(pair, isMissing);
    const found = free(a, b, width, centre, all, taken, points, size);
    if (found.isBlocked && pair.typed) continue;
    const [x, y] = found.spot;
    taken.push(boxAt(found.spot, width));
    result.push({ ...pair, x, y, isMissing, leads: Math.hypot(x - middle[0], y - middle[1]) < LED_PX ? null : middle });
  }
  return result;
});

function mean(values: number[]): number {
  return values.reduce((sum, value) => sum + value, 0) / Math.max(1, values.length);
}

/** On small screens only a chip that asks has the names of its ends. */
const hasNames = (isMissing: boolean) => isMissing || !isSmall.value;

/** As wide as the style makes it. */
function widthOfChip({ a, b }: Pair, isMissing: boolean): number {
  const names = hasNames(isMissing) ? widthOf(texts.marks.short(a, b)) : 0;
  return names + FIELD + widthOf("m") + (isSmall.value ? AROUND_SMALL : AROUND);
}

function boxAt([x, y]: Point, width: number): Box {
  return { x: x - width / 2, y: y - HEIGHT / 2, width, height: HEIGHT };
}

/** The best spot, and whether something is hidden even there. */
function free(a: Point, b: Point, wide: number, centre: Point, marks: Point[], taken: Box[], points: Point[], size: { width: number; height: number }) {
  const middle: Point = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
  const long = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
  const along: Point = [(b[0] - a[0]) / long, (b[1] - a[1]) / long];
  let normal: Point = [-along[1], along[0]];
  const outwards = (middle[0] - centre[0]) * normal[0] + (middle[1] - centre[1]) * normal[1];
  if (outwards < 0) normal = [-normal[0], -normal[1]];
  let best: { cost: number; spot: Point; isBlocked: boolean } | null = null;
  for (const step of [0, 1, -1, 2, -2, 3, -3, 4, -4]) {
    for (const aside of [0, 0.2, -0.2]) {
      const spot: Point = [
        Math.max(wide / 2 + 4, Math.min(size.width - wide / 2 - 4, middle[0] + step * 36 * normal[0] + aside * long * along[0])),
        Math.max(HEIGHT / 2 + 4, Math.min(size.height - HEIGHT / 2 - 4, middle[1] + step * 36 * normal[1] + aside * long * along[1])),
      ];
      const covers = (at: Point, apart: number) => Math.abs(at[0] - spot[0]) < wide / 2 + apart && Math.abs(at[1] - spot[1]) < HEIGHT / 2 + apart;
      const hidden = marks.filter((at) => covers(at, APART)).length + 3 * taken.filter((box) => overlap(box, boxAt(spot, wide))).length;
      const cost = hidden + 0.3 * points.filter((at) => covers(at, 6)).length + 0.05 * Math.abs(step) + 0.1 * Math.abs(aside);
      if (!best || cost < best.cost) best = { cost, spot, isBlocked: 0 < hidden };
      if (cost === 0) return best;
    }
  }
  return best!;
}

export function Chips() {
  // Until all marks stand a press means the photograph below: no chip may take it.
  const passes = nextMark.value !== null;
  return <>{placed.value.map((pair) => <Chip key={`${pair.a} ${pair.b}`} {...pair} passes={passes} />)}</>;
}

/** Where a chip lies now. */
function transformOf(a: string, b: string): string {
  const found = placed.value.find((one) => one.a === a && one.b === b);
  // It goes with the panels, which follow.
  if (!found) return "translate(-999px, -999px)";
  const { x, y } = found;
  return `translate(${x}px, ${y}px) translate(-50%, -50%)`;
}

/** Its place follows what is drawn, while the field itself is rendered with the panels. */
function Chip({ a, b, typed, passes, isMissing }: Pair & { passes: boolean; isMissing: boolean }) {
  const label = useRef<HTMLLabelElement>(null);
  useSignalEffect(() => {
    const transform = transformOf(a, b);
    if (label.current) label.current.style.transform = transform;
  });
  return (
    <label class="chip" data-missing={isMissing} data-passes={passes} ref={label} style={{ transform: untracked(() => transformOf(a, b)) }}>
      {hasNames(isMissing) && <span aria-hidden="true">{texts.marks.short(a, b)}</span>}
      <DistanceInput a={a} b={b} typed={typed} isBrief />
      <span aria-hidden="true">m</span>
    </label>
  );
}

/** A field for a distance; an empty one forgets it. */
export function DistanceInput({ a, b, typed, isBrief }: { a: string; b: string; typed: DistanceView | null; isBrief?: boolean }) {
  const state = (text: string) => {
    if (text === "") {
      if (typed) void apply({ kind: "remove_distance", a, b });
      return;
    }
    const distance_m = number(text);
    if (0 < distance_m) void apply({ kind: "set_distance", a, b, distance_m });
    else failed("marks", texts.marks.noDistance);
    return 0 < distance_m;
  };
  return (
    <Field
      label={texts.marks.distance(a, b)}
      placeholder="?"
      value={typed ? shortest(typed.distance_m) : ""}
      brief={typed && isBrief ? brief(typed.distance_m) : undefined}
      isWrong={(text) => !(0 < number(text))}
      onState={state}
    />
  );
}

/** Four figures, or three where they would not fit into a chip, and none of the whole metres lost: what is cut off reads as another number. */
function brief(metres: number): string {
  const figures = Math.max(metres < 1 ? 3 : 4, String(Math.trunc(metres)).length);
  return shortest(Number(metres.toPrecision(figures)));
}

/** `3.00`, `0.155`: at least two decimals. */
export function shortest(metres: number): string {
  const plain = String(metres);
  const decimals = plain.includes("e") ? 0 : (plain.split(".")[1]?.length ?? 0);
  return decimals < 2 ? metres.toFixed(2) : plain;
}
