// What the tab knows: the session's view as the program last gave it, and what the person is about to do.
import { batch, computed, signal } from "@preact/signals";
import { options } from "preact";
import type { Command, GivenLine, LineDirection, MeasuredKind, Snapped, SnapTo, View } from "../api/types";
import { decodePicture, type Picture } from "../parts/picture";
import { type Point, ViewportState, toPicture } from "../parts/transform";
import { Problem, transport } from "../transport";
import { photographTexts as texts } from "../texts/photograph";
import { forget, hasPhotograph, keep, keepPhotograph, lastKept, succeed, successorOf, wholeSession, type WholeSession } from "./kept";
import { Link } from "./link";

export interface StepError {
  step: string;
  text: string;
}

/** A point that can be moved: a mark, or one of a measurement. */
export type Handle = { kind: "mark"; name: string } | { kind: "measurement"; name: string; index: number };
/** A line of the scene that says how long the lens is. */
export type LineTool = `line_${LineDirection}`;
export type Tool = "marks" | MeasuredKind | LineTool;

export const session = signal<string | null>(null);
export const photo = signal(0);
export const view = signal<View | null>(null);
export const error = signal<StepError | null>(null);
export const busy = signal<string | null>(null);
export const picture = signal<Picture | null>(null);
export const selected = signal<Handle | null>(null);
/** The point in the hand, and where the hand has it: it is drawn there at once, and everything else with the answer to it. */
export const moved = signal<{ handle: Handle; at: Point } | null>(null);
/** The handle of that point: unchanged while it moves. */
export const held = computed(() => moved.value?.handle ?? null);
export const tool = signal<Tool>("marks");
/** Whether a click adds a further mark beyond those that the template needs. */
export const addsMark = signal(false);
/** Lines that were marked for the lens, before they are used. */
export const lensLines = signal<GivenLine[]>([]);
/** Points of a measurement that is not complete yet. */
export const pending = signal<Point[]>([]);
export const hovered = signal<Point | null>(null);
/** Whether the last thing done was done by keys: the middle of the view is then the pointer. */
export const byKeys = signal(false);
export const snapTo = signal<SnapTo | null>(null);
export const snapped = signal<{ handle: Handle; found: Snapped } | null>(null);
export const showsBirdseye = signal(false);
export const showsKeys = signal(false);
export const viewport = new ViewportState();

let link: Link | null = null;
let pictureOf = "";

export function sameHandle(a: Handle | null, b: Handle | null): boolean {
  return !!a && !!b && a.kind === b.kind && a.name === b.name && (a.kind === "mark" || a.index === (b as typeof a).index);
}

/** What is drawn of a mark. */
export interface Mark {
  name: string;
  at: Point;
  residual_px: number | null;
  /** It fits worse than its error explains. */
  is_suspect: boolean;
}

/** Marks as the program has them. */
export const marks = computed((): Mark[] => (view.value?.points ?? []).map(({ name, u_px, v_px, residual_px, is_suspect }): Mark => ({
  name,
  at: [u_px, v_px],
  residual_px: residual_px ?? null,
  is_suspect,
})));

/** All measurements; what hangs on them is found anew when they change, not with every move of a mark. */
export const measurements = computed(() => view.value?.measurements ?? []);
/** Those of the photograph. */
export const measured = computed(() => measurements.value.filter((m) => m.photo === photo.value));

/** Where a click or Enter would place something: the pointer, or the middle of the view. */
export const aim = computed((): Point | null => {
  if (hovered.value || !byKeys.value) return hovered.value;
  const { width, height } = viewport.size.value;
  return toPicture(viewport.transform.value, [width / 2, height / 2]);
});

const NEEDED = { line_and_post: 4, four_points: 4, rectangle: 4, target: 0, own: 3 };

/** The name that the next click gives, where it adds a mark. */
export const nextMark = computed((): string | null => {
  const now = view.value;
  if (!now?.photo || tool.value !== "marks") return null;
  const names = marks.value.map((mark) => mark.name);
  // One that was just placed has its name before the program knows it.
  if (held.value?.kind === "mark" && !names.includes(held.value.name)) names.push(held.value.name);
  const elsewhere = now.names_elsewhere.find((name) => !names.includes(name));
  if (elsewhere) return elsewhere;
  if (!addsMark.value && NEEDED[now.template] <= names.length) return null;
  return freeName(names);
});

/** A, B, … Z, A1, … */
function freeName(taken: string[]): string {
  for (let i = 0; ; i++) {
    const name = String.fromCharCode(65 + (i % 26)) + (i < 26 ? "" : Math.floor(i / 26));
    if (!taken.includes(name)) return name;
  }
}

export const needsMarks = computed(() => (view.value ? NEEDED[view.value.template] : 4));

/**
 * Measurements of a view; those that are as they were stay the very same, so that what hangs on them is not found anew. With `keepsValues` those
 * do whose points are as they were.
 */
function keptAlike(last: View | null, next: View, keepsValues = false): View["measurements"] {
  if (!last) return next.measurements;
  if (last.n_measured === next.n_measured) return last.measurements;
  const known = new Map(last.measurements.map((m) => [m.name, m] as const));
  const kept = next.measurements.map((m) => {
    const before = known.get(m.name);
    if (!before || before.photo !== m.photo || before.what !== m.what || String(before.points) !== String(m.points)) return m;
    return keepsValues || JSON.stringify(before) === JSON.stringify(m) ? before : { ...m, points: before.points };
  });
  return isAlike(kept, last.measurements) ? last.measurements : kept;
}

/** Whether two lists hold the very same. */
export function isAlike(a: readonly unknown[], b: readonly unknown[]): boolean {
  return a.length === b.length && a.every((one, i) => one === b[i]);
}

function took(next: View) {
  // Its photograph was taken back.
  if (!next.photo && next.photos.length) return void showPhoto(next.photos.length - 1);
  seen = Math.max(seen, next.version);
  const last = view.value;
  const isDragged = !!last && isHeld && !!moved.peek();
  if (isDragged) follow(next);
  next = { ...next, measurements: keptAlike(last, next, isDragged), n_measured: isDragged ? last.n_measured : next.n_measured };
  batch(() => {
    view.value = next;
    photo.value = next.photo_index;
    error.value = next.error ?? null;
    const handle = selected.value;
    const isThere = !handle || (handle.kind === "mark"
      ? next.points.some((point) => point.name === handle.name)
      : next.measurements.some((m) => m.name === handle.name && handle.index < m.points.length));
    if (!isThere) selected.value = null;
  });
  remember();
  void showPicture(next);
  void keepSession(next);
}

/** The highest version of the session that this page made or has seen. */
let seen = 0;
/** Whether the session was changed by another page: said for some seconds. */
export const changedElsewhere = signal(false);
let elsewhereTimer = 0;
const ELSEWHERE_MS = 6000;

/** Photographs on their way: the program tells of them before it answers, and nobody else has changed anything. */
let uploads = 0;

/** What the program says by itself: what is measured by now, and what another page changed. */
function news(next: View) {
  if (next.version < seen || (0 < uploads && seen < next.version)) return;
  const isOthers = seen < next.version;
  // While something is under the hand, what it has drawn stays: measurements alone are taken over.
  if (moved.peek() && view.value && !isOthers) return follow(next);
  if (isOthers) {
    changedElsewhere.value = true;
    clearTimeout(elsewhereTimer);
    elsewhereTimer = window.setTimeout(() => (changedElsewhere.value = false), ELSEWHERE_MS);
  }
  const shown = next.photo_index === photo.value;
  if (shown) took({ ...next, error: error.value ?? null, snap: null });
  else void showPhoto(photo.value);
}

/** The newest measurements with a point that is in the hand, where they are not shown yet. */
let following: View | null = null;

/** While a point is in the hand, what was measured follows when the panels do: nobody reads numbers that change with each frame. */
function follow(next: View) {
  if (!following) setTimeout(takeFollowing, PANELS_MS);
  following = next;
}

function takeFollowing() {
  const [now, next] = [view.value, following];
  following = null;
  // A point that was put down has been answered with all that is measured.
  if (!now || !next || !moved.peek() || next.n_measured === now.n_measured) return;
  const is_measuring = next.version < seen ? now.is_measuring : next.is_measuring;
  view.value = { ...now, measurements: keptAlike(now, next), n_measured: next.n_measured, is_measuring };
}

function failed(step: string, problem: unknown) {
  error.value = { step, text: problem instanceof Error ? problem.message : String(problem) };
}

/** Whether the point in the hand is still being moved, and not put down. */
let isHeld = false;

/** No point is being moved any more. */
function letGo() {
  moved.value = null;
}

/** The point that is being moved, and where it is now, drawn or not. */
export function inHand() {
  return moved.peek();
}

/** While a point is dragged the panels follow so much later at most, ms: what lies over the photograph is drawn at once. */
const PANELS_MS = 100;
options.debounceRendering = (render) => {
  if (!moved.peek() || !isHeld) return queueMicrotask(render);
  setTimeout(() => {
    takeFollowing();
    render();
  }, PANELS_MS);
};

/** Applies a command; answers the view, or null where it was overtaken or failed. */
export async function apply(command: Command, step = "marks"): Promise<View | null> {
  if (!link) return null;
  try {
    const next = await link.send(photo.value, command);
    if (next) {
      batch(() => {
        if (link!.isIdle && !isHeld) letGo();
        took(next);
      });
    }
    return next;
  } catch (problem) {
    letGo();
    failed(problem instanceof Problem && problem.kind === "not_found" ? "photograph" : step, problem);
    return null;
  }
}

/** Moves a point while it is held (`drag`), or puts it where it stays. */
export function move(handle: Handle, at: Point, drag: boolean): Promise<View | null> {
  const shown = view.value?.photo;
  if (!shown) return Promise.resolve(null);
  const inside = (x: number, n: number) => Math.max(-0.5, Math.min(n - 0.5, x));
  const [u_px, v_px] = [inside(at[0], shown.width_px), inside(at[1], shown.height_px)];
  isHeld = drag;
  moved.value = { handle, at: [u_px, v_px] };
  snapped.value = null;
  return apply(handle.kind === "mark"
    ? { kind: "put_point", name: handle.name, u_px, v_px, drag }
    : { kind: "move_measurement", name: handle.name, index: handle.index, u_px, v_px, drag }, handle.kind === "mark" ? "marks" : "measure");
}

/** Where a handle is. */
export function placeOf(handle: Handle): Point | null {
  const hand = moved.value;
  if (hand && sameHandle(hand.handle, handle)) return hand.at;
  if (handle.kind === "mark") return marks.value.find((mark) => mark.name === handle.name)?.at ?? null;
  return measured.value.find((m) => m.name === handle.name)?.points[handle.index] ?? null;
}

/** Asks what a point would snap to; it is shown, and done only when accepted. */
export async function proposeSnap(handle: Handle) {
  const at = placeOf(handle);
  if (!at || !snapTo.value) return;
  const next = await apply({ kind: "snap", u_px: at[0], v_px: at[1], to: snapTo.value });
  snapped.value = next?.snap ? { handle, found: next.snap } : null;
}

export async function acceptSnap() {
  const proposal = snapped.value;
  if (!proposal) return;
  snapped.value = null;
  const { u_px, v_px, sigma_px } = proposal.found;
  const { handle } = proposal;
  if (handle.kind === "mark") await apply({ kind: "put_point", name: handle.name, u_px, v_px, sigma_px });
  else await move(handle, [u_px, v_px], false);
}

/** Which way the lines of a tool run; none of other tools. */
export function lineOf(what: Tool): LineDirection | null {
  return what.startsWith("line_") ? (what.slice("line_".length) as LineDirection) : null;
}

export function isMeasured(what: Tool): what is MeasuredKind {
  return what !== "marks" && !lineOf(what);
}

/** Adds the point of a click to the measurement under way, and the measurement when it is complete. */
export async function addMeasured(at: Point, ends = false) {
  const what = tool.value;
  if (what === "marks") return;
  const points = ends ? pending.value : [...pending.value, at];
  const direction = lineOf(what);
  if (direction) {
    const [a, b] = points;
    if (a && b) lensLines.value = [...lensLines.value, { direction, ends: [[...a], [...b]] }];
    pending.value = a && b ? [] : points;
    return;
  }
  if (!isMeasured(what)) return;
  const needed = { length: 2, height: 2, position: 1, polyline: Infinity, area: Infinity }[what];
  pending.value = points;
  const isComplete = needed <= points.length || (ends && (what === "area" ? 3 : 2) <= points.length);
  if (!isComplete) return;
  pending.value = [];
  const name = freeMeasurement(what);
  await apply({ kind: "add_measurement", name, what, points: points.map(([u, v]) => [u, v]) }, "measure");
  selected.value = { kind: "measurement", name, index: points.length - 1 };
}

function freeMeasurement(what: MeasuredKind): string {
  const taken = new Set(view.value?.measurements.map((m) => m.name));
  for (let i = 1; ; i++) {
    const name = `${texts.kinds[what].toLowerCase()} ${i}`;
    if (!taken.has(name)) return name;
  }
}

async function showPicture(next: View) {
  const shown = next.photo;
  const key = shown?.sha256 ?? "";
  if (key === pictureOf) return;
  pictureOf = key;
  // What was shown before must not be seen under the marks of another photograph.
  picture.value = null;
  if (!shown || !session.value) return;
  try {
    const file = await transport.photograph(session.value, next.photo_index);
    const decoded = await decodePicture(file);
    if (pictureOf !== key) return;
    viewport.show(decoded.width, decoded.height, decoded.turns);
    picture.value = decoded;
    void keepPhotograph(key, file);
  } catch (problem) {
    if (pictureOf === key) failed("photograph", problem);
  }
}

// What is open survives a reload of the page: the session itself is the program's.
const KEPT = "resight session";

let kept = "";

function remember() {
  const now = JSON.stringify({ session: session.value, photo: photo.value });
  if (now !== kept) sessionStorage.setItem(KEPT, now);
  kept = now;
}

function use(id: string, next: View) {
  link?.close();
  link = new Link(id, { news, gone: () => void openAgain(id) });
  seen = next.version;
  offered.value = null;
  batch(() => {
    // Numbers of another session mean nothing here.
    view.value = null;
    session.value = id;
    selected.value = null;
    pending.value = [];
    lensLines.value = [];
    snapped.value = null;
    letGo();
    tool.value = "marks";
    addsMark.value = false;
    took(next);
  });
}

/** Opens a session: empty, the example, or a saved one. What is open stays where that fails. */
export async function open(what: { example?: boolean; load?: string } = {}): Promise<boolean> {
  busy.value = texts.opening;
  try {
    const opened = await transport.open(what);
    use(opened.session, opened.view);
    return true;
  } catch (problem) {
    failed("photograph", problem);
    return false;
  } finally {
    busy.value = null;
  }
}

/** The session that was open before the page was loaded again; where the program has it no longer, the page offers its own copy. */
export async function resume() {
  const kept = sessionStorage.getItem(KEPT);
  if (session.value) return;
  if (!kept) return void (offered.value = await lastKept());
  busy.value = texts.opening;
  const { session: id, photo: number } = JSON.parse(kept) as { session: string; photo: number };
  try {
    use(id, await transport.view(id, number));
  } catch (problem) {
    if (await followed(id, number)) return;
    sessionStorage.removeItem(KEPT);
    offered.value = await lastKept(id);
    if (!offered.value) failed("photograph", problem);
  } finally {
    busy.value = null;
  }
}

/** Shows the session that took the place of another one; whether there is one. */
async function followed(id: string, number: number): Promise<boolean> {
  const next = await successorOf(id);
  if (!next) return false;
  try {
    use(next, await transport.view(next, number));
    return true;
  } catch {
    return followed(next, number);
  }
}

/** Does something that windows of this browser must not do at once. Where browsers have no locks (pages of other machines without TLS) it is just done. */
function alone(name: string, job: () => Promise<void>): Promise<void> {
  return navigator.locks ? navigator.locks.request(name, job) : job();
}

/** A session that the page has kept and the program does not have: when it was kept, and how it is opened. */
export const offered = signal<WholeSession | null>(null);

/** The program was started again while the page was open: what is on the page is opened anew, once for all windows that show it. */
async function openAgain(id: string) {
  link?.close();
  link = null;
  await alone(`resight ${id}`, async () => {
    if (session.value !== id || (await followed(id, photo.value))) return;
    const kept = await lastKept(id);
    if (kept?.id !== id) return failed("photograph", new Problem("not_found", texts.lost));
    offered.value = kept;
    await openKept();
  });
}

/** Opens the session that the page has kept. */
export async function openKept(): Promise<boolean> {
  const kept = offered.value;
  if (!kept) return false;
  const number = photo.value;
  const isOpen = await open({ load: wholeSession(kept) });
  if (isOpen && number) await showPhoto(number);
  if (isOpen) await succeed(kept, session.value!);
  return isOpen;
}

/** Forgets what is offered, and offers what is older. */
export async function forgetKept() {
  const kept = offered.value;
  offered.value = null;
  if (!kept) return;
  await forget(kept.id);
  offered.value = await lastKept();
}

let keepTimer = 0;
let keptVersion = "";
/** The page keeps a session when nothing has changed for so long, ms. */
const KEEP_MS = 800;

/** Keeps the session in the browser, without the photographs, which are kept as they come. */
function keepSession(next: View) {
  const id = session.value;
  const version = `${id} ${next.version}`;
  if (!id || !next.photo || version === keptVersion) return;
  clearTimeout(keepTimer);
  keepTimer = window.setTimeout(async () => {
    if (moved.peek() || session.value !== id) return;
    try {
      const text = await (await transport.file("/api/session/save", { session: id, photographs: "false" })).blob.text();
      for (const [number, { sha256 }] of next.photos.entries()) {
        if (!(await hasPhotograph(sha256))) await keepPhotograph(sha256, await transport.photograph(id, number));
      }
      await keep({ id, text, kept_ms: Date.now(), names: next.photos.map(({ name }) => name), hashes: next.photos.map(({ sha256 }) => sha256) });
      keptVersion = version;
    } catch {
      // Private windows keep nothing, and a program that does not answer is asked again with the next change.
    }
  }, KEEP_MS);
}

/** Adds a photograph to the session, or begins one with it; whether it is there now. */
export async function addPhotograph(file: File): Promise<boolean> {
  if (!session.value && !(await open())) return false;
  busy.value = texts.sending(file.name, 0);
  uploads++;
  try {
    took(await transport.addPhotograph(session.value!, file, file.name, (share) => (busy.value = texts.sending(file.name, share))));
    return true;
  } catch (problem) {
    failed("photograph", problem);
    return false;
  } finally {
    uploads--;
    busy.value = null;
  }
}

/** A photograph that this device has just taken: phones give all of theirs one name. */
export function addTaken(file: File): Promise<boolean> {
  const [, ending = ".jpg"] = /(\.\w+)$/.exec(file.name) ?? [];
  const time = new Date().toTimeString().slice(0, 8).replaceAll(":", "");
  return addPhotograph(new File([file], `photo-${time}${ending}`, { type: file.type }));
}

/** Gives up what takes long: a search for a target. */
export async function cancel() {
  if (session.value) await transport.cancel(session.value).catch(() => {});
}

/** The next frame of a watched camera as a photograph, with the camera's lens. */
export async function takeFrame(camera: string) {
  busy.value = texts.waitingFor(camera);
  try {
    const { blob } = await transport.file("/api/live/frame", { camera });
    if (!(await addPhotograph(new File([blob], `${camera}.png`, { type: "image/png" })))) return;
    const lens = await transport.file("/api/live/lens", { camera });
    await apply({ kind: "set_lens", lens: { by: "file", name: `${camera}.toml`, text: await lens.blob.text() } }, "lens");
  } catch (problem) {
    failed("photograph", problem);
  } finally {
    busy.value = null;
  }
}

export async function showPhoto(number: number) {
  if (!session.value) return;
  try {
    took(await transport.view(session.value, number));
  } catch (problem) {
    failed("photograph", problem);
  }
}

/** Files from anywhere: photographs, a saved session, a camera file. */
export async function takeFiles(files: File[]) {
  for (const file of files) {
    if (/\.(png|jpe?g)$/i.test(file.name) || file.type.startsWith("image/")) await addPhotograph(file);
    else await takeText(file);
  }
}

async function takeText(file: File) {
  if (TEXT_BYTES < file.size) return failed("photograph", texts.tooLargeText(file.name));
  const text = await file.text();
  if (/^\[session\]/m.test(text)) await open({ load: text });
  else if (view.value?.photo) await apply({ kind: "set_lens", lens: { by: "file", name: file.name, text } }, "lens");
  else failed("photograph", texts.noUse(file.name));
}

/** Saved sessions hold their photographs. */
const TEXT_BYTES = 256 << 20;

export { failed };
