// The sweep on a canvas. The world's y points up; a picture of 1000 units across holds what `frame` says.
import type { PlayedContact, PlayedReading, Replay } from "../api/types";
import { toScreen, type Point, type ViewportState } from "../parts/transform";

export const UNITS = 1000;
/** Part of the extent that is left free around it. */
const MARGIN = 0.06;
/** Faint shapes of a sweep. */
const FAINT = 12;

/** From metres to the picture. */
export interface Frame {
  width: number;
  height: number;
  toPicture: (x: Point) => Point;
  units_per_m: number;
}

export function frameOf([least, greatest]: readonly [Point, Point]): Frame {
  const [w, h] = [greatest[0] - least[0], greatest[1] - least[1]];
  const size = Math.max(w, h, 1e-6);
  const units_per_m = UNITS / (size * (1 + 2 * MARGIN));
  const margin = MARGIN * size;
  return {
    width: (w + 2 * margin) * units_per_m,
    height: (h + 2 * margin) * units_per_m,
    toPicture: ([x, y]) => [(x - least[0] + margin) * units_per_m, (greatest[1] + margin - y) * units_per_m],
    units_per_m,
  };
}

export interface Shown {
  shapes: boolean;
  ellipses: boolean;
  outline: boolean;
}

const own = (name: string) => getComputedStyle(document.documentElement).getPropertyValue(`--whisker${name && `-${name}`}`).trim();

export type Kind = "mid" | "tip" | "weak" | "odd";
export function kindOf(reading: PlayedReading): Kind {
  if (reading.status === "ok") return reading.contact?.mode === "tip" ? "tip" : "mid";
  return reading.status === "low_force" ? "weak" : "odd";
}

export function drawSweep(pen: CanvasRenderingContext2D, state: ViewportState, frame: Frame, replay: Replay, all: readonly PlayedReading[], now: PlayedReading | null, shown: Shown) {
  const transform = state.transform.value;
  const put = (x: Point) => toScreen(transform, frame.toPicture(x));
  const line = (points: readonly Point[], colour: string, width: number, opacity = 1, dashes: number[] = [], closed = false) => {
    if (points.length < 2) return;
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.globalAlpha = opacity;
    pen.setLineDash(dashes);
    pen.beginPath();
    points.forEach((x, i) => (i ? pen.lineTo(...put(x)) : pen.moveTo(...put(x))));
    if (closed) pen.closePath();
    pen.stroke();
    pen.globalAlpha = 1;
    pen.setLineDash([]);
  };
  if (shown.outline) {
    line(replay.given_outline_m, own("given"), 2, 1, [6, 5], true);
    line(replay.found?.outline_m ?? [], own("outline"), 2.5, replay.found?.is_named ? 1 : 0.5, [], true);
  }
  line(all.flatMap(({ hub }): Point[] => (hub ? [[hub[0], hub[1]]] : [])), own("hub"), 2);
  if (shown.shapes) {
    const touching = all.filter((one) => one.contact && one.shape_m.length);
    const step = Math.max(1, Math.ceil(touching.length / FAINT));
    touching.forEach((one, i) => i % step === 0 && line(one.shape_m, own("faint"), 1, 0.8));
  }
  for (const one of all) {
    if (!one.contact) continue;
    const colour = own(kindOf(one));
    if (shown.ellipses) line(ellipse(one.contact), colour, 1, 0.45, [], true);
    dot(pen, put(one.contact.x_m), colour, 2.5);
  }
  if (!now) return;
  line(now.shape_m, own(""), 2.5);
  if (now.hub) dot(pen, put([now.hub[0], now.hub[1]]), own("hub"), 6);
  if (now.contact) {
    const colour = own(kindOf(now));
    line(ellipse(now.contact), colour, 2, 1, [], true);
    dot(pen, put(now.contact.x_m), colour, 6);
  }
  scaleBar(pen, state, frame, own(""));
}

function ellipse({ x_m, half_axes_m: [a, b] }: PlayedContact): Point[] {
  return Array.from({ length: 48 }, (_, k) => {
    const [sin, cos] = [Math.sin((2 * Math.PI * k) / 48), Math.cos((2 * Math.PI * k) / 48)];
    return [x_m[0] + cos * a[0] + sin * b[0], x_m[1] + cos * a[1] + sin * b[1]];
  });
}

function dot(pen: CanvasRenderingContext2D, [x, y]: Point, colour: string, radius: number) {
  pen.fillStyle = colour;
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fill();
}

/** 1, 2 or 5 times a power of ten metres, about a fifth of the width. */
function scaleBar(pen: CanvasRenderingContext2D, state: ViewportState, frame: Frame, colour: string) {
  const { width, height } = state.size.value;
  const px_per_m = frame.units_per_m * state.transform.value.scale;
  const wanted = width / 5 / px_per_m;
  const power = 10 ** Math.floor(Math.log10(wanted));
  const length = power * (5 <= wanted / power ? 5 : 2 <= wanted / power ? 2 : 1);
  const [x, y] = [16, height - 16];
  pen.strokeStyle = colour;
  pen.lineWidth = 2;
  pen.beginPath();
  pen.moveTo(x, y);
  pen.lineTo(x + length * px_per_m, y);
  pen.stroke();
  pen.fillStyle = colour;
  pen.font = "14px system-ui, sans-serif";
  pen.fillText(`${Number((1e3 * length).toPrecision(3))} mm`, x, y - 7);
}
