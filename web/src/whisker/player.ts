// Which reading of which sweep is shown, and playing through them.
import { computed, signal } from "@preact/signals";
import type { PlayedReading, Replay } from "../api/types";
import { whiskerTexts } from "../texts/whisker";
import { Result } from "../results/result";

export const result = new Result<Replay>("/api/whisker", whiskerTexts);

/** A sweep takes so long to play, ms. */
const SWEEP_MS = 8000;

export const sweep = signal(0);
/** Within the sweep. */
export const at = signal(0);
export const playing = signal(false);

/** Readings by sweep, in their order. */
export const sweeps = computed(() => {
  const by = new Map<number, PlayedReading[]>();
  for (const reading of result.value.value?.readings ?? []) {
    const own = by.get(reading.sweep);
    if (own) own.push(reading);
    else by.set(reading.sweep, [reading]);
  }
  return [...by.entries()].map(([number, readings]) => ({ number, readings }));
});

export const readings = computed(() => sweeps.value[sweep.value]?.readings ?? []);
export const reading = computed(() => readings.value[at.value] ?? null);

/** Starts anew with the first reading that touches, so that something is to be seen at once. */
export function begin() {
  playing.value = false;
  sweep.value = 0;
  firstTouch();
}

export function chooseSweep(i: number) {
  sweep.value = i;
  firstTouch();
}

function firstTouch() {
  const touching = readings.value.flatMap((one, i) => (one.contact ? [i] : []));
  at.value = touching[Math.floor(touching.length / 2)] ?? 0;
}

export function play() {
  if (playing.value) {
    playing.value = false;
    return;
  }
  playing.value = true;
  const n = readings.value.length;
  const first = at.value < n - 1 ? at.value : 0;
  const began = performance.now();
  const mine = sweep.value;
  const frame = (now: number) => {
    if (!playing.value || sweep.value !== mine) {
      playing.value = false;
      return;
    }
    at.value = Math.min(n - 1, first + Math.floor(((now - began) / SWEEP_MS) * n));
    if (at.value === n - 1) playing.value = false;
    else requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}
