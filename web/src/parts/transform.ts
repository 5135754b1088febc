// How a picture lies on the screen: turned by quarters, scaled and moved. Pixels are those of the file: (0, 0) is the centre of the first.
import { signal } from "@preact/signals";

export type Turns = 0 | 1 | 2 | 3;

export interface Transform {
  /** Screen pixels for one of the picture. */
  scale: number;
  x: number;
  y: number;
  /** Quarters clockwise. */
  turns: Turns;
}

export type Point = readonly [number, number];

const MOST_SCALE = 64;

function turned([u, v]: Point, turns: Turns): Point {
  switch (turns) {
    case 1: return [-v, u];
    case 2: return [-u, -v];
    case 3: return [v, -u];
    default: return [u, v];
  }
}

export function toScreen(t: Transform, at: Point): Point {
  const [u, v] = turned(at, t.turns);
  return [t.x + t.scale * u, t.y + t.scale * v];
}

export function toPicture(t: Transform, [x, y]: Point): Point {
  return turned([(x - t.x) / t.scale, (y - t.y) / t.scale], ((4 - t.turns) % 4) as Turns);
}

/** A motion on the screen as one of the picture. */
export function motionInPicture(t: Transform, dx: number, dy: number): Point {
  return turned([dx / t.scale, dy / t.scale], ((4 - t.turns) % 4) as Turns);
}

/** The transform and size of a viewport; signals, so that whoever reads them is drawn again. */
export class ViewportState {
  readonly size = signal({ width: 0, height: 0 });
  readonly transform = signal<Transform>({ scale: 1, x: 0, y: 0, turns: 0 });
  private picture = { width: 0, height: 0 };
  private isFitted = true;

  /** Shows a picture of this size as a whole. */
  show(width: number, height: number, turns: Turns = 0) {
    this.picture = { width, height };
    this.fit(turns);
  }

  resized(width: number, height: number) {
    const { width: before, height: over } = this.size.value;
    if (before === width && over === height) return;
    this.size.value = { width, height };
    if (this.isFitted) this.fit(this.transform.value.turns);
    else this.pan((width - before) / 2, (height - over) / 2);
  }

  fit(turns: Turns = this.transform.value.turns) {
    const { width, height } = this.size.value;
    const { width: w, height: h } = this.picture;
    if (!w || !h || !width || !height) {
      this.transform.value = { ...this.transform.value, turns };
      return;
    }
    const [tw, th] = turns % 2 ? [h, w] : [w, h];
    const scale = Math.min(width / tw, height / th, 8);
    const [mu, mv] = turned([w / 2 - 0.5, h / 2 - 0.5], turns);
    this.transform.value = { scale, turns, x: width / 2 - scale * mu, y: height / 2 - scale * mv };
    this.isFitted = true;
  }

  turn() {
    this.fit(((this.transform.value.turns + 1) % 4) as Turns);
  }

  pan(dx: number, dy: number) {
    const t = this.transform.value;
    this.isFitted = false;
    this.transform.value = { ...t, x: t.x + dx, y: t.y + dy };
  }

  /** Zooms about a point of the screen; the middle where none is given. */
  zoom(factor: number, x = this.size.value.width / 2, y = this.size.value.height / 2) {
    const t = this.transform.value;
    const { width, height } = this.size.value;
    const longest = Math.max(this.picture.width, this.picture.height, 1);
    const least = Math.min(1, (0.5 * Math.min(width, height)) / longest) || 0.01;
    const scale = Math.max(least, Math.min(MOST_SCALE, t.scale * factor));
    const by = scale / t.scale;
    this.isFitted = false;
    this.transform.value = { ...t, scale, x: x - by * (x - t.x), y: y - by * (y - t.y) };
  }

  /** Brings a pixel of the picture into sight. */
  reveal(at: Point, margin = 40) {
    const [x, y] = toScreen(this.transform.value, at);
    const { width, height } = this.size.value;
    const by = (p: number, n: number) => (p < margin ? margin - p : n - margin < p ? n - margin - p : 0);
    if (by(x, width) || by(y, height)) this.pan(by(x, width), by(y, height));
  }
}
