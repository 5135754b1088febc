// A rig in space on a canvas: cameras with their fields of view, ellipsoids, targets. The eye circles a centre; y points down, as in every
// image. One file without imports and without a framework: the report of `resight rig` contains the same code, built from here.

export type Triple = readonly [number, number, number];

export interface SpaceCamera {
  name: string;
  /** Where it is, rig's frame, metres. */
  position_m: Triple;
  /** The border of its image at a chosen depth, rig's frame, metres; empty where the lens is not known. */
  border_m: readonly Triple[];
  /** Half axes of the ellipsoid that contains 95 % of its position, metres, not magnified; empty where that is not known. */
  half_axes_m: readonly Triple[];
  /** Colour by a name that `colour` of the options knows; else that of its place in the list. */
  colour?: string;
}

export interface SpaceTarget {
  name: string;
  position_m: Triple;
  /** Its outline, rig's frame, metres. */
  outline_m: readonly Triple[];
  is_closed: boolean;
  /** Its points, drawn as dots. */
  points_m: readonly Triple[];
  /** Where lines of sight end. */
  middle_m: Triple;
  /** Numbers of the cameras that observed it. */
  seen_by: readonly number[];
  /** Drawn in the colour of text, with its name. */
  is_strong: boolean;
}

export interface SpaceScene {
  centre_m: Triple;
  /** What lies within it is in the image at the beginning. */
  radius_m: number;
  /** Length of the axes of the rig. */
  axis_m: number;
  ellipsoid_magnification: number;
  cameras: readonly SpaceCamera[];
  targets: readonly SpaceTarget[];
}

/** What is drawn. */
export interface SpaceShown {
  targets: boolean;
  sights: boolean;
  ellipsoids: boolean;
  names: boolean;
}

export type Way = "start" | "top" | "front" | "side";

export interface SpaceView {
  show(scene: SpaceScene, shown?: Partial<SpaceShown>): void;
  look(way: Way): void;
  /** By angles, radians. */
  turn(right: number, down: number): void;
  /** Multiplies the distance. */
  come(factor: number): void;
  /** By pixels of the page: what lies at the centre follows the finger. */
  shift(right: number, down: number): void;
  /** Now; changes draw themselves before the next image is shown. */
  draw(): void;
  /** Takes its listeners off the canvas. */
  release(): void;
}

/** The eye: angles in radians, its distance and shift in reaches of the scene. */
interface Eye {
  yaw: number;
  pitch: number;
  distance: number;
  shift: [number, number];
}

type Place = [number, number] | null;
type Pen = CanvasRenderingContext2D;

// From behind the cameras' right shoulder; the still image of the report is drawn from there too (space.rs).
const START: Eye = { yaw: 0.6, pitch: 0.45, distance: 3.2, shift: [0, 0] };
const WAYS: Record<Way, Eye> = {
  start: START,
  top: { ...START, yaw: 0, pitch: Math.PI / 2 },
  front: { ...START, yaw: 0, pitch: 0 },
  side: { ...START, yaw: Math.PI / 2, pitch: 0 },
};
/** Part of half of the image's shorter side that the reach fills: ellipsoids, which stand out of it by a sixth at most, fit too. */
const FILLED = 0.8;
/** Nearer than this part of the first distance nothing is drawn. */
const NEAREST = 0.02;
const ROUND = 32;
const N_COLOURS = 7;
const SHOWN: SpaceShown = { targets: true, sights: false, ellipsoids: true, names: true };
const NOTHING: SpaceScene = { centre_m: [0, 0, 0], radius_m: 1, axis_m: 0.1, ellipsoid_magnification: 1, cameras: [], targets: [] };
const ARROWS: Record<string, [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

const limited = (x: number, least: number, greatest: number) => Math.min(greatest, Math.max(least, x));

/** A view on a canvas; `colour` gives the colour of `ink`, `faint`, `c0` … `c6`, `x`, `y` and `z` as it is now. */
export function spaceView(canvas: HTMLCanvasElement, colour: (name: string) => string): SpaceView {
  let scene = NOTHING;
  let shown = SHOWN;
  let eye: Eye = { ...START };
  let isDue = false;

  function later() {
    if (isDue) return;
    isDue = true;
    requestAnimationFrame(() => {
      isDue = false;
      draw();
    });
  }

  function draw() {
    const { pen, width, height } = cleared(canvas);
    const project = projector(scene, eye, width, height);
    if (shown.targets) drawTargets(pen, project, scene, colour);
    if (shown.sights) drawSights(pen, project, scene, colour);
    drawAxes(pen, project, scene.axis_m, colour);
    drawCameras(pen, project, scene, shown, colour);
    if (shown.names) drawLabels(pen, labels(project), width, height);
  }

  function labels(project: (x: Triple) => Place): Label[] {
    const targets = scene.targets.filter((t) => shown.targets && t.is_strong);
    return [
      ...scene.cameras.map(({ name, position_m }) => ({ at: project(position_m), text: name, colour: colour("ink") })),
      ...targets.map(({ name, position_m }) => ({ at: project(position_m), text: name, colour: colour("faint") })),
    ];
  }

  const view: SpaceView = {
    show(next, what = {}) {
      scene = next;
      shown = { ...shown, ...what };
      later();
    },
    look(way) {
      eye = { ...WAYS[way], shift: [0, 0] };
      later();
    },
    turn(right, down) {
      eye = { ...eye, yaw: eye.yaw + right, pitch: limited(eye.pitch + down, -Math.PI / 2, Math.PI / 2) };
      later();
    },
    come(factor) {
      eye = { ...eye, distance: limited(eye.distance * factor, 0.15, 20) };
      later();
    },
    shift(right, down) {
      const scale = (2 * eye.distance) / (FILLED * START.distance * Math.min(canvas.clientWidth, canvas.clientHeight));
      eye = { ...eye, shift: [eye.shift[0] + right * scale, eye.shift[1] + down * scale] };
      later();
    },
    draw,
    release: () => undefined,
  };
  view.release = attach(canvas, view);
  return view;
}

/** A canvas as sharp as the screen; lengths are those of the page. */
function cleared(canvas: HTMLCanvasElement): { pen: Pen; width: number; height: number } {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  canvas.width = Math.max(1, Math.round(width * ratio));
  canvas.height = Math.max(1, Math.round(height * ratio));
  const pen = canvas.getContext("2d") as Pen;
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.lineJoin = "round";
  pen.font = "14px system-ui, sans-serif";
  return { pen, width, height };
}

/** From a place in the rig to the image; null behind the eye. */
function projector(scene: SpaceScene, eye: Eye, width: number, height: number): (x: Triple) => Place {
  const [cx, cy, cz] = scene.centre_m;
  const radius = scene.radius_m;
  const away = eye.distance * radius;
  const focal = (FILLED * START.distance * Math.min(width, height)) / 2;
  const [sy, cyaw] = [Math.sin(eye.yaw), Math.cos(eye.yaw)];
  const [sp, cp] = [Math.sin(eye.pitch), Math.cos(eye.pitch)];
  return ([x, y, z]) => {
    const [dx, dy, dz] = [x - cx, y - cy, z - cz];
    const right = cyaw * dx + sy * dz + eye.shift[0] * radius;
    const ahead = cyaw * dz - sy * dx;
    const down = cp * dy - sp * ahead + eye.shift[1] * radius;
    const depth = cp * ahead + sp * dy + away;
    if (depth < NEAREST * START.distance * radius) return null;
    return [width / 2 + (focal * right) / depth, height / 2 + (focal * down) / depth];
  };
}

/** A whole line, or nothing where part of it lies behind the eye. */
function line(pen: Pen, points: readonly Place[], isClosed: boolean) {
  const [first] = points;
  if (!first || points.some((p) => p === null)) return;
  pen.moveTo(first[0], first[1]);
  for (const p of points.slice(1)) if (p) pen.lineTo(p[0], p[1]);
  if (isClosed) pen.closePath();
}

function stroke(pen: Pen, colour: string, width: number, opacity: number, trace: () => void) {
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.globalAlpha = opacity;
  pen.beginPath();
  trace();
  pen.stroke();
  pen.globalAlpha = 1;
}

interface Label {
  at: Place;
  text: string;
  colour: string;
}

/** Longer names are cut. */
const MOST_LETTERS = 24;
/** Room that a line of a name takes, px. */
const LINE_PX = 16;
/** Between a name and its place, px. */
const APART_PX = 6;

/** Names beside their places, on the first side where none lies over another or leaves the image; one that finds no side is left out. */
function drawLabels(pen: Pen, labels: Label[], width: number, height: number) {
  const taken: [number, number, number][] = [];
  for (const { at, text, colour } of labels) {
    if (at === null || text === "") continue;
    const short = text.length <= MOST_LETTERS ? text : `${text.slice(0, MOST_LETTERS - 1)}…`;
    const wide = pen.measureText(short).width;
    const isFree = ([x, y]: [number, number]) => 0 <= x && x + wide <= width && LINE_PX <= y && y <= height
      && taken.every(([left, right, base]) => right < x || x + wide < left || LINE_PX <= Math.abs(base - y));
    const rights = [at[0] + APART_PX, at[0] - APART_PX - wide];
    const found = rights.flatMap((x): [number, number][] => [[x, at[1] - APART_PX], [x, at[1] + APART_PX + LINE_PX / 2]]).find(isFree);
    if (!found) continue;
    taken.push([found[0], found[0] + wide, found[1]]);
    pen.fillStyle = colour;
    pen.fillText(short, found[0], found[1]);
  }
}

function drawTargets(pen: Pen, project: (x: Triple) => Place, scene: SpaceScene, colour: (name: string) => string) {
  for (const isStrong of [false, true]) {
    const targets = scene.targets.filter((t) => t.is_strong === isStrong);
    stroke(pen, colour(isStrong ? "ink" : "faint"), isStrong ? 1.6 : 0.8, isStrong ? 1 : 0.7, () => {
      for (const t of targets) line(pen, t.outline_m.map(project), t.is_closed);
    });
    if (!isStrong) continue;
    for (const t of targets) {
      pen.fillStyle = colour("ink");
      for (const x of t.points_m) {
        const at = project(x);
        if (at) pen.fillRect(at[0] - 1.2, at[1] - 1.2, 2.4, 2.4);
      }
    }
  }
}

const ownColour = (camera: SpaceCamera, i: number) => camera.colour ?? `c${i % N_COLOURS}`;

function drawSights(pen: Pen, project: (x: Triple) => Place, scene: SpaceScene, colour: (name: string) => string) {
  scene.cameras.forEach((camera, i) => {
    const from = project(camera.position_m);
    stroke(pen, colour(ownColour(camera, i)), 0.8, 0.5, () => {
      for (const t of scene.targets) if (t.seen_by.includes(i)) line(pen, [from, project(t.middle_m)], false);
    });
  });
}

function ring(camera: SpaceCamera, a: Triple, b: Triple, scale: number): Triple[] {
  const [x, y, z] = camera.position_m;
  return Array.from({ length: ROUND }, (_, k) => {
    const [sin, cos] = [scale * Math.sin((2 * Math.PI * k) / ROUND), scale * Math.cos((2 * Math.PI * k) / ROUND)];
    return [x + cos * a[0] + sin * b[0], y + cos * a[1] + sin * b[1], z + cos * a[2] + sin * b[2]];
  });
}

function drawCameras(pen: Pen, project: (x: Triple) => Place, scene: SpaceScene, shown: SpaceShown, colour: (name: string) => string) {
  scene.cameras.forEach((camera, i) => {
    const own = colour(ownColour(camera, i));
    const border = camera.border_m.map(project);
    const centre = project(camera.position_m);
    const step = Math.max(1, Math.floor(border.length / 4));
    stroke(pen, own, 1.6, 1, () => {
      line(pen, border, true);
      for (let k = 0; k < border.length; k += step) line(pen, [centre, border[k] ?? null], false);
    });
    if (camera.border_m.length === 0 && centre) {
      pen.fillStyle = own;
      pen.fillRect(centre[0] - 4, centre[1] - 4, 8, 8);
    }
    const [a, b, c] = camera.half_axes_m;
    if (shown.ellipsoids && a && b && c) {
      const scale = scene.ellipsoid_magnification;
      const pairs: [Triple, Triple][] = [[a, b], [a, c], [b, c]];
      stroke(pen, own, 1, 0.9, () => {
        for (const [p, q] of pairs) line(pen, ring(camera, p, q, scale).map(project), true);
      });
    }
  });
}

function drawAxes(pen: Pen, project: (x: Triple) => Place, length: number, colour: (name: string) => string) {
  const ends: [string, Triple][] = [["x", [length, 0, 0]], ["y", [0, length, 0]], ["z", [0, 0, length]]];
  for (const [name, end] of ends) {
    stroke(pen, colour(name), 2, 1, () => line(pen, [project([0, 0, 0]), project(end)], false));
  }
}

/** Mouse, fingers, wheel and keys; gives what takes them off again. */
function attach(canvas: HTMLCanvasElement, view: SpaceView): () => void {
  const fingers = new Map<number, [number, number]>();
  const offs: (() => void)[] = [];
  function on<K extends keyof HTMLElementEventMap>(kind: K, listener: (event: HTMLElementEventMap[K]) => void, options?: AddEventListenerOptions) {
    canvas.addEventListener(kind, listener, options);
    offs.push(() => canvas.removeEventListener(kind, listener));
  }
  on("pointerdown", (event) => {
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    canvas.setPointerCapture(event.pointerId);
    canvas.focus({ preventScroll: true });
  });
  for (const end of ["pointerup", "pointercancel"] as const) on(end, (event) => fingers.delete(event.pointerId));
  on("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
    const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (other) {
      const gap = (x: number, y: number) => Math.max(1, Math.hypot(x - other[0], y - other[1]));
      view.shift(dx / 2, dy / 2);
      view.come(gap(...before) / gap(event.clientX, event.clientY));
    } else if (event.shiftKey || event.buttons === 2) {
      view.shift(dx, dy);
    } else {
      view.turn(-dx * 0.008, dy * 0.008);
    }
  });
  on("contextmenu", (event) => event.preventDefault());
  on("wheel", (event) => {
    if (document.activeElement !== canvas) return; // Scrolling past must not zoom.
    event.preventDefault();
    view.come(Math.exp(limited(event.deltaY, -200, 200) * 0.002));
  }, { passive: false });
  on("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const arrow = ARROWS[event.key];
    if (arrow && event.shiftKey) view.shift(20 * arrow[0], 20 * arrow[1]);
    else if (arrow) view.turn(-0.08 * arrow[0], 0.08 * arrow[1]);
    else if (event.key === "+" || event.key === "=") view.come(0.9);
    else if (event.key === "-") view.come(1 / 0.9);
    else if (event.key === "0") view.look("start");
    else return;
    event.preventDefault();
  });
  return () => offs.forEach((off) => off());
}
