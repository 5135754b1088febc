// What is known of a capture of intrinsics: how it is, and its newest image.
import { signal } from "@preact/signals";
import type { CapturedHeader, CaptureView } from "../api/types";
import { transport, type Stream } from "../transport";
import { pictured } from "./pictured";

export type CapturedShot = CapturedHeader & { bitmap: ImageBitmap };

export class CaptureStore {
  readonly view = signal<CaptureView | null>(null);
  readonly shot = signal<CapturedShot | undefined>(undefined);
  readonly isConnected = signal(false);
  private isClosed = false;
  private held: (() => void) | null = null;
  private readonly stream: Stream;

  constructor() {
    document.addEventListener("visibilitychange", this.seen);
    this.stream = transport.stream("/ws/capture", {}, {
      text: (message) => this.taken((message as { capture: CaptureView }).capture),
      binary: (message) => void this.pictured(message),
      connected: (is) => (this.isConnected.value = is),
    });
  }

  close() {
    this.isClosed = true;
    document.removeEventListener("visibilitychange", this.seen);
    this.stream.close();
    this.shot.value?.bitmap.close();
  }

  async takeBack(view: string) {
    this.taken(await transport.post<CaptureView>("/api/capture/take-back", { view }));
  }

  async finish() {
    this.taken(await transport.post<CaptureView>("/api/capture/finish", {}));
  }

  /** After the end nothing more comes, and the program is gone. */
  private taken(view: CaptureView) {
    if (this.view.value?.is_over) return;
    this.view.value = view;
    if (view.is_over) this.stream.close();
  }

  /** Decodes an image; the next is asked for when this one is drawn, and not while nobody looks. */
  private async pictured(message: ArrayBuffer) {
    try {
      const shot = await pictured<CapturedHeader>(message);
      if (this.isClosed) return shot.bitmap.close();
      const before = this.shot.value?.bitmap;
      this.shot.value = shot;
      // Whoever draws it has done so by then.
      if (before) setTimeout(() => before.close(), 1000);
    } finally {
      const next = () => this.stream.send({ ack: 1 });
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
