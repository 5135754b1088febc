// The ground from straight above, beside the photograph. Asked for again when it would change, not while something is dragged.
import { effect, signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { decodePicture, type Picture } from "../parts/picture";
import { ViewportState } from "../parts/transform";
import { Viewport } from "../parts/viewport";
import { Problem, transport } from "../transport";
import { common } from "../texts/common";
import { photographTexts as texts } from "../texts/photograph";
import { held, photo, session, showsBirdseye, view } from "./store";

const state = new ViewportState();
const image = signal<Picture | null>(null);
const reason = signal<string | null>(null);

/** Rest before it is asked for, ms. */
const REST_MS = 150;

export function Birdseye() {
  useEffect(() => {
    let timer = 0;
    let shown = -1;
    const stop = effect(() => {
      const version = view.value?.birdseye?.version;
      const number = photo.value;
      if (held.value || version === undefined || version === shown) return;
      clearTimeout(timer);
      timer = window.setTimeout(async () => {
        shown = version;
        try {
          const next = await decodePicture(await transport.birdseye(session.value!, number));
          const { width, height } = image.value ?? { width: 0, height: 0 };
          if (next.width !== width || next.height !== height) state.show(next.width, next.height);
          image.value = next;
          reason.value = null;
        } catch (problem) {
          reason.value = problem instanceof Problem ? problem.message : String(problem);
        }
      }, REST_MS);
    });
    return () => {
      clearTimeout(timer);
      stop();
      image.value = null;
    };
  }, []);
  const isOld = !view.value?.birdseye;
  return (
    <section class="birdseye" aria-label={texts.birdseye.label} data-old={isOld} data-ready={!!image.value}>
      <Viewport state={state} picture={image} layers={[]} label={texts.birdseye.label} />
      {(reason.value || !image.value) && <p class="over-note">{reason.value ?? (isOld ? texts.birdseye.none : common.loading)}</p>}
      <p class="legend small">{texts.birdseye.legend}</p>
      <button class="close" aria-label={texts.birdseye.close} onClick={() => (showsBirdseye.value = false)}>✕</button>
    </section>
  );
}
