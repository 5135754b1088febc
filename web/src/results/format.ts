// Numbers with their standard deviations: as many digits as the ± has two of.

/** Decimals that show two digits of a standard deviation. */
function decimalsFor(sigma: number): number {
  if (!(0 < sigma)) return 3;
  return Math.max(0, Math.min(6, 1 - Math.floor(Math.log10(sigma))));
}

/** U+2212 for a minus, and no −0. */
export function fixed(x: number, decimals: number): string {
  const text = x.toFixed(decimals);
  return /^-0\.?0*$/.test(text) ? text.slice(1) : text.replace("-", "−");
}

/** A unit behind its number: no space before a degree sign, nothing where there is none. */
function behind(unit: string): string {
  return unit === "" || unit === "°" ? unit : ` ${unit}`;
}

/** `12.345 ± 0.012 unit`, both scaled; without a ± where there is none. */
export function plusMinus(value: number, sigma: number | null | undefined, scale: number, unit: string, decimals = 1): string {
  if (!sigma) return fixed(value * scale, decimals) + behind(unit);
  const n = decimalsFor(sigma * scale);
  return `${fixed(value * scale, n)} ± ${fixed(sigma * scale, n)}${behind(unit)}`;
}

export const MM = 1e3;
export const DEG = 180 / Math.PI;

/** A factor: `200`, `0.5`. */
export function factor(x: number): string {
  return Number(x.toPrecision(6)).toLocaleString("en", { useGrouping: true, maximumFractionDigits: 6 });
}

/** A standard deviation alone. */
export function sigmaOnly(sigma: number, scale: number, unit: string): string {
  return fixed(sigma * scale, decimalsFor(sigma * scale)) + behind(unit);
}
