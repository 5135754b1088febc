// What the tab knows: how the cameras are, their newest pictures, the log, and whether all that is still so.
import { computed, signal } from "@preact/signals";
import type { CameraView, LiveView, LogLine } from "../api/types";
import { Problem, transport, type Stream } from "../transport";
import { pictured } from "./pictured";

/** A frame and what was found in it, in pixels of the frame. */
export interface Shot {
  camera: string;
  frame: number;
  time_s: number;
  width_px: number;
  height_px: number;
  outline: [number, number][][];
  /** u, v, residual u and v, whether it agrees; of the one camera at full size. */
  points?: [number, number, number, number, number][];
  bitmap: ImageBitmap;
}

export type Link = "connecting" | "connected" | "gone" | "no session";

/** A status this old is not now, ms. */
const LATE_MS = 2000;
const AGAIN_MS = 3000;
const LINES = 500;

export class LiveStore {
  readonly link = signal<Link>("connecting");
  readonly view = signal<LiveView | null>(null);
  readonly shots = signal<Record<string, Shot>>({});
  readonly log = signal<LogLine[]>([]);
  /** The camera that is shown alone. */
  readonly chosen = signal<string | null>(null);
  private readonly isLate = signal(false);
  /** Whether what is shown is so now. */
  readonly isNow = computed(() => this.link.value === "connected" && !this.isLate.value);
  /** Cameras with an alarm first, the others in the session's order. */
  readonly cameras = computed(() => {
    const all = this.view.value?.cameras ?? [];
    return [...all.filter((one) => one.alarm), ...all.filter((one) => !one.alarm)];
  });
  private stream: Stream | null = null;
  private viewed = 0;
  private isClosed = false;
  private timer = 0;
  private readonly beat = window.setInterval(() => (this.isLate.value = LATE_MS < performance.now() - this.viewed), 500);
  private held: (() => void) | null = null;

  constructor() {
    document.addEventListener("visibilitychange", this.seen);
    void this.begin();
  }

  close() {
    this.isClosed = true;
    clearInterval(this.beat);
    clearTimeout(this.timer);
    document.removeEventListener("visibilitychange", this.seen);
    this.stream?.close();
    Object.values(this.shots.value).forEach((shot) => shot.bitmap.close());
  }

  /** Whether this camera's picture and numbers are of now. */
  isLive(camera: CameraView): boolean {
    return this.isNow.value && camera.is_fresh && !this.view.value?.is_over;
  }

  choose(camera: string | null) {
    this.chosen.value = camera;
    this.stream?.send({ show: camera });
  }

  async acknowledge(camera: string) {
    this.view.value = await transport.post<LiveView>("/api/live/acknowledge", { camera });
  }

  async reset(camera: string) {
    this.view.value = await transport.post<LiveView>("/api/live/reset", { camera });
  }

  async setReference(camera: string) {
    this.view.value = await transport.post<LiveView>("/api/live/reference", { camera, confirm: true });
  }

  /** Watches the example, which the program draws. */
  async example() {
    await transport.post<LiveView>("/api/live/example", {});
    clearTimeout(this.timer);
    this.link.value = "connecting";
    await this.begin();
  }

  private async begin() {
    try {
      if (!(await transport.cameras()).length) throw new Problem("not_found", "");
      const view = await transport.live();
      if (this.isClosed) return;
      this.taken(view);
      this.log.value = await transport.get<LogLine[]>("/api/live/log");
      if (!this.isClosed && !this.stream) this.connect();
    } catch (fault) {
      const isMissing = fault instanceof Problem && fault.kind === "not_found";
      if (isMissing) {
        this.stream?.close();
        this.stream = null;
        this.view.value = null;
      }
      this.link.value = isMissing ? "no session" : "gone";
      if (!this.isClosed) this.timer = window.setTimeout(() => void this.begin(), AGAIN_MS);
    }
  }

  private connect() {
    this.stream = transport.stream("/ws/live", {}, {
      text: (message) => this.heard(message as { live?: LiveView } & Partial<LogLine>),
      binary: (message) => void this.pictured(message),
      connected: (is) => {
        const wasConnected = this.link.value === "connected";
        this.link.value = is ? "connected" : "gone";
        if (is) this.stream?.send({ show: this.chosen.value });
        // Another program may have taken its place, without cameras.
        else if (wasConnected && !this.isClosed) void this.begin();
      },
    });
  }

  private taken(view: LiveView) {
    this.view.value = view;
    this.viewed = performance.now();
    this.isLate.value = false;
  }

  private heard(message: { live?: LiveView } & Partial<LogLine>) {
    if (message.live) this.taken(message.live);
    else if (message.text && message.unix_s) {
      const line = { unix_s: message.unix_s, text: message.text, camera: message.camera ?? null };
      this.log.value = [...this.log.value.slice(1 - LINES), line];
    }
  }

  /** Decodes a picture; the next is asked for when this one is drawn, and not while nobody looks. */
  private async pictured(message: ArrayBuffer) {
    let frame = 0;
    try {
      const shot = await pictured<Omit<Shot, "bitmap">>(message);
      frame = shot.frame;
      if (this.isClosed) return shot.bitmap.close();
      const before = this.shots.value[shot.camera]?.bitmap;
      this.shots.value = { ...this.shots.value, [shot.camera]: shot };
      // Whoever draws it has done so by then.
      if (before) setTimeout(() => before.close(), 1000);
    } finally {
      const next = () => this.stream?.send({ ack: frame });
      if (document.hidden) this.held = next;
      else next();
    }
  }

  private readonly seen = () => {
    if (document.hidden) return;
    this.held?.();
    this.held = null;
  };
}
