// Distances, typed where they are drawn.
import { computed, untracked, useSignalEffect } from "@preact/signals";
import { useRef } from "preact/hooks";
import type { DistanceView } from "../api/types";
import { type Point, toScreen } from "../parts/transform";
import { photographTexts as texts } from "../texts/photograph";
import { type Box, boxes, overlap } from "./labels";
import { apply, failed, marks, nextMark, tool, view, viewport } from "./store";
import { Field } from "./field";
import { number, pairs, type Pair } from "./pairs";

const WIDTH = 118;
const NARROW = 74;
const HEIGHT = 34;
/** Narrower viewports have shorter chips, px. */
const PHONE_PX = 520;

interface Placed extends Pair {
  x: number;
  y: number;
}

/** Beside the middle of each distance, apart from marks and from each other. */
const placed = computed((): Placed[] => {
  const now = view.value;
  if (!now || tool.value !== "marks") return [];
  const t = viewport.transform.value;
  const size = viewport.size.value;
  const at = new Map(marks.value.map((mark) => [mark.name, toScreen(t, mark.at)] as const));
  const all = [...at.values()];
  const middle: Point = [mean(all.map(([x]) => x)), mean(all.map(([, y]) => y))];
  const taken = boxes();
  const result: Placed[] = [];
  for (const pair of pairs(now.template, now.points, now.distances)) {
    const [a, b] = [at.get(pair.a), at.get(pair.b)];
    if (!a || !b) continue;
    const spot = free(a, b, middle, all, taken, size);
    taken.push(boxAt(spot, size.width));
    result.push({ ...pair, x: spot[0], y: spot[1] });
  }
  return result;
});

function mean(values: number[]): number {
  return values.reduce((sum, value) => sum + value, 0) / Math.max(1, values.length);
}

function boxAt([x, y]: Point, viewportWidth: number): Box {
  const width = viewportWidth < PHONE_PX ? NARROW : WIDTH;
  return { x: x - width / 2, y: y - HEIGHT / 2, width, height: HEIGHT };
}

function free(a: Point, b: Point, centre: Point, marks: Point[], taken: Box[], size: { width: number; height: number }): Point {
  const middle: Point = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
  const long = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
  let normal: Point = [-(b[1] - a[1]) / long, (b[0] - a[0]) / long];
  const outwards = (middle[0] - centre[0]) * normal[0] + (middle[1] - centre[1]) * normal[1];
  if (outwards < 0) normal = [-normal[0], -normal[1]];
  const wide = size.width < PHONE_PX ? NARROW : WIDTH;
  let best: { cost: number; spot: Point } | null = null;
  for (const step of [0, 1, -1, 2, -2, 3, -3, 4, -4]) {
    const by = step * 36;
    const spot: Point = [
      Math.max(wide / 2 + 4, Math.min(size.width - wide / 2 - 4, middle[0] + by * normal[0])),
      Math.max(HEIGHT / 2 + 4, Math.min(size.height - HEIGHT / 2 - 4, middle[1] + by * normal[1])),
    ];
    const covers = (at: Point, dx: number, dy: number) => (Math.abs(at[0] - spot[0]) < dx && Math.abs(at[1] - spot[1]) < dy ? 1 : 0);
    const cost = marks.reduce((sum, at) => sum + covers(at, wide / 2 + 14, HEIGHT / 2 + 14), 0)
      + taken.filter((box) => overlap(box, boxAt(spot, size.width))).length * 3 + 0.05 * Math.abs(step);
    if (!best || cost < best.cost) best = { cost, spot };
  }
  return best!.spot;
}

export function Chips() {
  // Until all marks stand a press means the photograph below: no chip may take it.
  const passes = nextMark.value !== null;
  // A distance is missing where one of its ends has no place without it.
  const hasPlace = (name: string) => view.value?.points.some((point) => point.name === name && point.position_m) ?? false;
  const isMissing = ({ a, b, typed }: Pair) => !typed && !(hasPlace(a) && hasPlace(b));
  return <>{placed.value.map((pair) => <Chip key={`${pair.a} ${pair.b}`} {...pair} passes={passes} isMissing={isMissing(pair)} />)}</>;
}

/** Where a chip lies now. */
function transformOf(a: string, b: string): string {
  const { x, y } = placed.value.find((one) => one.a === a && one.b === b) ?? { x: 0, y: 0 };
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
      <span aria-hidden="true" class="name">{texts.marks.short(a, b)}</span>
      <DistanceInput a={a} b={b} typed={typed} />
      <span aria-hidden="true">m</span>
    </label>
  );
}

/** A field for a distance; an empty one forgets it. */
export function DistanceInput({ a, b, typed }: { a: string; b: string; typed: DistanceView | null }) {
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
      isWrong={(text) => !(0 < number(text))}
      onState={state}
    />
  );
}

/** `3.00`, `0.155`: at least two decimals. */
export function shortest(metres: number): string {
  const plain = String(metres);
  const decimals = plain.includes("e") ? 0 : (plain.split(".")[1]?.length ?? 0);
  return decimals < 2 ? metres.toFixed(2) : plain;
}
