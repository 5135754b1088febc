// A curve of the picture as a path of the screen, with no more points than an eye can tell: strokes take as long as they have points.
import type { Transform } from "./transform";

/** How far a path may be from its curve, px of the screen. */
const APART_PX = 0.1;
const COS = [1, 0, -1, 0];
const SIN = [0, 1, 0, -1];

export type Curve = readonly (readonly number[])[];

/** Adds a curve to the path. A point is left out where a straight line from the last one kept passes all that are left out closely enough. */
export function trace(path: CanvasPath, t: Transform, curve: Curve) {
  const [c, s] = [t.scale * COS[t.turns]!, t.scale * SIN[t.turns]!];
  // The last point kept, the last one seen, and the sleeve in which the next may lie: a direction, its slopes and how far it is followed.
  let [keptX, keptY, seenX, seenY] = [0, 0, 0, 0];
  let [alongX, alongY, least, most, far] = [0, 0, 0, 0, 0];
  for (let i = 0; i < curve.length; i++) {
    const [u, v] = curve[i] as unknown as readonly [number, number];
    const [x, y] = [t.x + c * u - s * v, t.y + s * u + c * v];
    if (i === 0) {
      path.moveTo(x, y);
      [keptX, keptY] = [x, y];
    } else {
      const ahead = alongX * (x - keptX) + alongY * (y - keptY);
      const aside = alongX * (y - keptY) - alongY * (x - keptX);
      if (far && far <= ahead && least * ahead <= aside && aside <= most * ahead) {
        least = Math.max(least, (aside - APART_PX) / ahead);
        most = Math.min(most, (aside + APART_PX) / ahead);
        far = ahead;
      } else {
        if (far) {
          path.lineTo(seenX, seenY);
          [keptX, keptY] = [seenX, seenY];
        }
        far = Math.hypot(x - keptX, y - keptY);
        if (far <= APART_PX) far = 0;
        else [alongX, alongY, least, most] = [(x - keptX) / far, (y - keptY) / far, -APART_PX / far, APART_PX / far];
      }
    }
    [seenX, seenY] = [x, y];
  }
  if (1 < curve.length) path.lineTo(seenX, seenY);
}
