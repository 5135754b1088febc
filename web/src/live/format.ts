// Numbers as people read them: with their unit, and as many digits as their ± warrants.
import { fixed } from "../results/format";

const DEGREES = 180 / Math.PI;

function decimals(sigma: number, most: number): number {
  if (!(0 < sigma)) return Math.min(3, most);
  return Math.max(0, Math.min(most, 1 - Math.floor(Math.log10(sigma))));
}

/** `6.213 ± 0.004 m` */
export function metres(value: number, sigma: number): string {
  const digits = decimals(sigma, 5);
  return `${fixed(value, digits)} ± ${fixed(sigma, digits)} m`;
}

/** `23.41 ± 0.03°` */
export function degrees(rad: number, sigmaRad: number): string {
  const digits = decimals(sigmaRad * DEGREES, 4);
  return `${fixed(rad * DEGREES, digits)} ± ${fixed(sigmaRad * DEGREES, digits)}°`;
}

const rounded = (x: number) => x.toFixed(decimals(x, 4));

/** The length of three standard deviations together. */
export function size(of: readonly number[]): number {
  return Math.hypot(...of);
}

/** `0.012°` */
export function angle(rad: number): string {
  return `${rounded(rad * DEGREES)}°`;
}

/** `0.61 mm`, and metres where that is too long. */
export function length(m: number): string {
  return m < 1 ? `${rounded(1e3 * m)} mm` : `${rounded(m)} m`;
}

/** `3.1 ms` */
export function milliseconds(us: number | null | undefined): string {
  if (us == null) return "–";
  const ms = us / 1e3;
  return `${ms.toFixed(ms < 1 ? 3 : ms < 10 ? 2 : ms < 100 ? 1 : 0)} ms`;
}

export function rate(fps: number | null | undefined): string {
  if (fps == null) return "–";
  return fps.toFixed(fps < 1 ? 2 : 1);
}

/** `3 s`, `5 min`, `2 h` */
export function duration(s: number): string {
  if (s < 90) return `${Math.round(s)} s`;
  return s < 5400 ? `${Math.round(s / 60)} min` : `${Math.round(s / 3600)} h`;
}

/** Times of capture that are seconds since 1970, as times of day. */
export function timed(text: string): string {
  return text.replace(/\b(1\d{9}(?:\.\d+)?) s\b/g, (_, unixS) => clock(Number(unixS)));
}

/** A time of day; with its day where that is not today. */
export function clock(unixS: number): string {
  const at = new Date(1e3 * unixS);
  const time = at.toLocaleTimeString("en-GB");
  return at.toDateString() === new Date().toDateString() ? time : `${at.toLocaleDateString("en-GB")} ${time}`;
}
