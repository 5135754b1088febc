// Which way to move a camera so that it is where it was: straight for turning it aside, curved about its line of sight. It shrinks with what
// is left to do, of the most there was since the alarm.
import type { WayBackView } from "../api/types";

const SHORTEST = 7;
const LONGEST = 21;
const most = new Map<string, number>();

/** What is left, of the most there was; forgotten when nothing is. */
function share(camera: string, left: number): number {
  const before = Math.max(most.get(camera) ?? 0, left);
  most.set(camera, before);
  return before ? left / before : 0;
}

export function forget(camera: string) {
  most.delete(camera);
}

export function Arrow({ camera, back }: { camera: string; back: WayBackView }) {
  const [up = 0, right = 0, clockwise = 0] = back.rotation_rad;
  const [x = 0, y = 0] = back.translation_m;
  const turn = Math.hypot(up, right);
  const isTurn = 0 < Math.hypot(turn, clockwise);
  // Rotations and shifts are never compared with each other: shifts are drawn where nothing is to be rotated.
  const left = isTurn ? Math.hypot(turn, clockwise) : Math.hypot(...back.translation_m);
  const length = SHORTEST + (LONGEST - SHORTEST) * share(camera + isTurn, left);
  const [dx, dy] = isTurn ? [right, -up] : [x, y];
  const across = Math.hypot(dx, dy);
  const isCurved = isTurn && turn < Math.abs(clockwise);
  return (
    <svg class="way-back" viewBox="-26 -26 52 52" width="52" height="52" aria-hidden="true" data-length={left ? length.toFixed(1) : "0"}>
      <circle r="25" />
      {left === 0 ? <path d="M-9 0l6 7 12 -14" /> : isCurved ? <path d={curve(Math.sign(clockwise), length)} /> : across > 0 ? (
        <path d={straight(dx / across, dy / across, length)} stroke-dasharray={isTurn ? undefined : "5 3"} />
      ) : <path d={depth(back.translation_m[2] ?? 0, length)} />}
    </svg>
  );
}

function straight(x: number, y: number, length: number): string {
  const [ex, ey] = [x * length, y * length];
  const head = (side: number) => `${ex - 8 * x + side * 6 * y} ${ey - 8 * y - side * 6 * x}`;
  return `M${-ex} ${-ey}L${ex} ${ey}M${head(1)}L${ex} ${ey}L${head(-1)}`;
}

/** An arc about the middle, as long as the arrow would be. */
function curve(sense: number, length: number): string {
  const r = 15;
  const angle = (length / LONGEST) * 2.4;
  const [ex, ey] = [r * Math.sin(angle) * sense, -r * Math.cos(angle)];
  const [tx, ty] = [Math.cos(angle) * sense, Math.sin(angle)];
  const head = (side: number) => `${ex - 7 * tx + side * 5 * ty} ${ey - 7 * ty - side * 5 * tx}`;
  return `M0 ${-r}A${r} ${r} 0 ${Math.PI < angle ? 1 : 0} ${sense > 0 ? 1 : 0} ${ex} ${ey}M${head(1)}L${ex} ${ey}L${head(-1)}`;
}

/** Forwards grows, backwards shrinks: two squares. */
function depth(forward: number, length: number): string {
  const [outer, inner] = [length, 0.5 * length];
  const square = (s: number) => `M${-s} ${-s}H${s}V${s}H${-s}Z`;
  const from = forward > 0 ? inner : outer;
  const to = forward > 0 ? outer : inner;
  return `${square(outer)}${square(inner)}M${from} ${from}L${to} ${to}M${-from} ${-from}L${-to} ${-to}`;
}
