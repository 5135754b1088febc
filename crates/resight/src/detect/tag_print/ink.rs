//! The print of a tag seen through a blur, in closed form, so that it is smooth in every unknown (docs/math/tag_print.md section 1).

use crate::detect::families::{Family, draw};
use std::ops::Range;
use std::sync::LazyLock;

/// Largest number of lines between cells along an edge; a family with more is not compared.
const MOST_CELLS: usize = 12;
/// Beyond this many standard deviations a blurred edge is flat.
const REACH_SIGMAS: f64 = 3.3;

/// The cells of a tag.
#[derive(Debug, Clone)]
pub(in crate::detect) struct Print {
    /// Cells along the edge of the whole print, and from its edge to the square whose corners are detected.
    pub width: usize,
    pub inset: usize,
    /// −1 black, 1 white, row by row.
    values: Vec<f64>,
    /// Whether the family defines the print in each cell.
    is_known: Vec<bool>,
}

/// The blurred print at a position, and its derivatives with respect to the position, in cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ink {
    pub value: f64,
    /// First derivatives, ∂x and ∂y.
    pub slope: [f64; 2],
    /// Second derivatives xx, xy, yy.
    pub bend: [f64; 3],
}

/// The blur perpendicular to the lines of a print, in cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Blur {
    pub sigma: [f64; 2],
    /// Correlation of the two: not zero where the lines are not perpendicular in the image.
    pub correlation: f64,
}

/// The lines near a position, along one direction: fewer than `N`.
struct Lines<const N: usize> {
    first: usize,
    n: usize,
    /// Density (1/√2π) exp(−a²/2) of each line; a, its distance in standard deviations.
    density: [f64; N],
    away: [f64; N],
    /// Share of each cell from `first` − 1 on.
    share: [f64; N],
}

/// Number of lines near most positions, as opposed to all: clearing the larger table takes longer than the work with the smaller.
const FEW: usize = 3;
const ALL: usize = MOST_CELLS + 1;

impl Print {
    /// Draws the print; `None` for a family with more cells than a tag has.
    pub fn new(family: &Family, code: u64) -> Option<Self> {
        let pattern = draw(family, code);
        let (width, inset) = (pattern.width_cells, pattern.inset_cells);
        if !(3..MOST_CELLS).contains(&width) || inset < 1 {
            return None;
        }
        let is_near = |c: usize| inset - 1 <= c && c <= width - inset;
        let mut is_known: Vec<bool> =
            (0..width * width).map(|k| is_near(k % width) && is_near(k / width)).collect();
        for (x, y) in family.bit_x.iter().zip(&family.bit_y) {
            is_known[(y + inset as i32) as usize * width + (x + inset as i32) as usize] = true;
        }
        let values = pattern.white.iter().map(|white| if *white { 1.0 } else { -1.0 }).collect();
        Some(Print { width, inset, values, is_known })
    }

    /// Returns whether a black border is all around, with a margin of white around it and nothing printed there.
    pub(super) fn has_plain_margin(&self) -> bool {
        let last = self.width - 1;
        let is_ring = |k: usize, ring: usize| {
            let (x, y) = (k % self.width, k / self.width);
            x.min(y).min(last - x).min(last - y) == ring
        };
        self.inset == 1
            && (0..self.values.len())
                .all(|k| !(is_ring(k, 0) && self.values[k] < 0.0 || is_ring(k, 1) && 0.0 < self.values[k]))
    }

    /// Returns whether a cell, counted from the edge of the whole print, is white.
    pub(super) fn is_white(&self, x: usize, y: usize) -> bool {
        0.0 < self.values[y * self.width + x]
    }

    /// Returns the same print inside a margin of this brightness at its top, right, bottom and left.
    pub(super) fn with_margin(&self, [top, right, bottom, left]: [f64; 4]) -> Self {
        let mut print = self.clone();
        let last = self.width - 1;
        for (k, value) in print.values.iter_mut().enumerate() {
            let (x, y) = (k % self.width, k / self.width);
            let sides = [(y == 0, top), (x == last, right), (y == last, bottom), (x == 0, left)];
            let here = sides.iter().filter(|(is_here, _)| *is_here).map(|(_, brightness)| *brightness);
            let n = here.clone().count();
            if 0 < n {
                *value = here.sum::<f64>() / n as f64;
            }
        }
        print
    }

    /// Returns whether the family defines the print at a position.
    pub fn is_known(&self, [x, y]: [f64; 2]) -> bool {
        let cell = |x: f64| (0.0 <= x && x < self.width as f64).then_some(x as usize);
        cell(x).zip(cell(y)).is_some_and(|(x, y)| self.is_known[y * self.width + x])
    }

    /// Returns whether a line between two cells, in either direction, is near enough to be visible through a blur of these variances.
    pub(super) fn is_near_line(&self, x: [f64; 2], variances: [f64; 2]) -> bool {
        let last = self.width as f64 - 1.0;
        let is_near = |k: usize| {
            // This is faster than `round`, which is a function call.
            let line = ((x[k].max(0.0) + 0.5) as usize as f64).clamp(1.0, last);
            (x[k] - line).powi(2) <= REACH_SIGMAS * REACH_SIGMAS * variances[k]
        };
        is_near(0) || is_near(1)
    }

    /// Returns the print at a position through a Gaussian blur; beyond its edge it continues as at the edge. `None` where no line is near.
    pub(super) fn at(&self, [x, y]: [f64; 2], blur: &Blur) -> Option<Ink> {
        let (across, down) = (self.near(x, blur.sigma[0]), self.near(y, blur.sigma[1]));
        if across.len().max(down.len()) == 1 {
            return Some(self.at_corner([x, y], blur, across, down));
        }
        if across.len().max(down.len()) < FEW {
            self.at_with::<FEW>([x, y], blur, across, down)
        } else {
            self.at_with::<ALL>([x, y], blur, across, down)
        }
    }

    fn at_with<const N: usize>(
        &self,
        [x, y]: [f64; 2],
        blur: &Blur,
        across: Range<usize>,
        down: Range<usize>,
    ) -> Option<Ink> {
        let (across, down) =
            (Lines::<N>::new(across, x, blur.sigma[0]), Lines::<N>::new(down, y, blur.sigma[1]));
        if across.n == 0 && down.n == 0 {
            return None;
        }
        let [sx, sy] = blur.sigma;
        let cell = |i: usize, j: usize| self.values[j * self.width + i];
        let (i0, j0) = (across.first - 1, down.first - 1);
        let mut ink = Ink { value: 0.0, slope: [0.0; 2], bend: [0.0; 3] };
        for j in 0..=down.n {
            let row: f64 = (0..=across.n).map(|i| across.share[i] * cell(i0 + i, j0 + j)).sum();
            ink.value += down.share[j] * row;
        }
        for i in 0..across.n {
            let jump: f64 =
                (0..=down.n).map(|j| down.share[j] * (cell(i0 + i + 1, j0 + j) - cell(i0 + i, j0 + j))).sum();
            ink.slope[0] += across.density[i] * jump / sx;
            ink.bend[0] -= across.away[i] * across.density[i] * jump / (sx * sx);
        }
        for j in 0..down.n {
            let jump: f64 = (0..=across.n)
                .map(|i| across.share[i] * (cell(i0 + i, j0 + j + 1) - cell(i0 + i, j0 + j)))
                .sum();
            ink.slope[1] += down.density[j] * jump / sy;
            ink.bend[2] -= down.away[j] * down.density[j] * jump / (sy * sy);
        }
        // Where lines cross, the blur is a Gaussian of two correlated coordinates: the tetrachoric series up to its third term.
        let r = blur.correlation;
        for i in 0..across.n {
            for j in 0..down.n {
                let (a, b) = (across.away[i], down.away[j]);
                let jump = cell(i0 + i + 1, j0 + j + 1) - cell(i0 + i, j0 + j + 1) - cell(i0 + i + 1, j0 + j)
                    + cell(i0 + i, j0 + j);
                let at_crossing = jump * across.density[i] * down.density[j];
                let (a2, b2) = (a * a - 1.0, b * b - 1.0);
                ink.value += at_crossing * r * (1.0 + r * (0.5 * a * b + r / 6.0 * a2 * b2));
                ink.slope[0] -= at_crossing * r * (a + 0.5 * r * a2 * b) / sx;
                ink.slope[1] -= at_crossing * r * (b + 0.5 * r * b2 * a) / sy;
                ink.bend[0] += at_crossing * r * a2 / (sx * sx);
                ink.bend[1] += at_crossing * (1.0 + r * a * b) / (sx * sy);
                ink.bend[2] += at_crossing * r * b2 / (sy * sy);
            }
        }
        Some(ink)
    }

    /// Computes the same where at most one line is near along each direction, as at most positions: a line that is not near has zero density.
    #[inline]
    fn at_corner(&self, [x, y]: [f64; 2], blur: &Blur, across: Range<usize>, down: Range<usize>) -> Ink {
        let table = &*NORMAL;
        let [per_x, per_y] = blur.sigma.map(f64::recip);
        // The cell before the line, the density of the line, its distance, and the share of the blur beyond it.
        let along = |lines: &Range<usize>, x: f64, per_sigma: f64| {
            let away = (x - lines.start as f64) * per_sigma;
            let is_near = lines.len() as f64;
            let (density, beyond) = normal(table, away * is_near);
            (lines.start - 1, is_near * density, is_near * away, is_near * beyond)
        };
        let (i, p, a, u) = along(&across, x, per_x);
        let (j, q, b, v) = along(&down, y, per_y);
        // Without a line, the same cell is on both sides.
        let (i1, j1) = (i + across.len(), j + down.len());
        let cell = |i: usize, j: usize| self.values[j * self.width + i];
        let (v00, v10, v01, v11) = (cell(i, j), cell(i1, j), cell(i, j1), cell(i1, j1));
        let (along_x, along_y) =
            ((1.0 - v) * (v10 - v00) + v * (v11 - v01), (1.0 - u) * (v01 - v00) + u * (v11 - v10));
        let at_crossing = (v11 - v01 - v10 + v00) * p * q;
        let (r, a2, b2) = (blur.correlation, a * a - 1.0, b * b - 1.0);
        Ink {
            value: (1.0 - v) * ((1.0 - u) * v00 + u * v10)
                + v * ((1.0 - u) * v01 + u * v11)
                + at_crossing * r * (1.0 + r * (0.5 * a * b + r / 6.0 * a2 * b2)),
            slope: [
                (p * along_x - at_crossing * r * (a + 0.5 * r * a2 * b)) * per_x,
                (q * along_y - at_crossing * r * (b + 0.5 * r * b2 * a)) * per_y,
            ],
            bend: [
                (at_crossing * r * a2 - a * p * along_x) * per_x * per_x,
                at_crossing * (1.0 + r * a * b) * per_x * per_y,
                (at_crossing * r * b2 - b * q * along_y) * per_y * per_y,
            ],
        }
    }

    /// Returns the colour of the cell at a position, clamped to the print.
    #[cfg(test)]
    fn plain(&self, [x, y]: [f64; 2]) -> f64 {
        let cell = |x: f64| (x.max(0.0) as usize).min(self.width - 1);
        self.values[cell(y) * self.width + cell(x)]
    }

    /// Returns the lines within reach; a position that is not finite has none.
    fn near(&self, x: f64, sigma: f64) -> Range<usize> {
        let bound = |x: f64| x.max(1.0).min(self.width as f64) as usize;
        // This is faster than `ceil` and `floor`, which are function calls: all numbers are positive.
        let (low, high) = (x - REACH_SIGMAS * sigma, x + REACH_SIGMAS * sigma);
        let first = bound(low);
        let first = if (first as f64) < low { first + 1 } else { first };
        first..bound(high + 1.0).max(first)
    }
}

impl<const N: usize> Lines<N> {
    fn new(lines: Range<usize>, x: f64, sigma: f64) -> Self {
        let (first, n) = (lines.start, lines.len().min(N - 1));
        let mut lines = Lines { first, n, density: [0.0; N], away: [0.0; N], share: [0.0; N] };
        // The share beyond each line, less the share beyond the next.
        let (mut left, table) = (1.0, &*NORMAL);
        for k in 0..n {
            let away = (x - (first + k) as f64) / sigma;
            let (density, beyond) = normal(table, away);
            (lines.away[k], lines.density[k], lines.share[k]) = (away, density, left - beyond);
            left = beyond;
        }
        lines.share[n] = left;
        lines
    }
}

/// The density of the standard normal distribution and its integral, at these steps.
static NORMAL: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| {
    let end = (REACH_SIGMAS * STEPS) as i32 + 1;
    (-end..=end).map(|k| normal_at(k as f64 / STEPS)).collect()
});
const STEPS: f64 = 32.0;

/// The density of the standard normal distribution and its integral within [`REACH_SIGMAS`]: Taylor's series about the nearest step, to 1e-8.
#[inline]
fn normal(table: &[(f64, f64)], a: f64) -> (f64, f64) {
    let middle = table.len() / 2;
    let index = (a * STEPS + middle as f64 + 0.5) as usize;
    let Some((density, beyond)) = table.get(index) else { return normal_at(a) };
    let at = (index as f64 - middle as f64) / STEPS;
    let d = a - at;
    let (first, second, third) = (-at, at * at - 1.0, at * (3.0 - at * at));
    let bell = density * (1.0 + d * (first + d * (0.5 * second + d * third / 6.0)));
    (bell, beyond + density * d * (1.0 + d * (0.5 * first + d * (second / 6.0 + d * third / 24.0))))
}

/// Returns the same to 1.5e-7 anywhere (M. Abramowitz and I. Stegun, Handbook of Mathematical Functions, 7.1.26): a ten-thousandth of a grey
/// level.
fn normal_at(a: f64) -> (f64, f64) {
    let bell = (-0.5 * a * a).exp();
    let t = 1.0 / (1.0 + 0.327_591_1 * a.abs() * std::f64::consts::FRAC_1_SQRT_2);
    let series = t
        * (0.254_829_592
            + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    let tail = 0.5 * series * bell;
    (0.398_942_280_401_432_7 * bell, if a < 0.0 { tail } else { 1.0 - tail })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn print() -> Print {
        let family = Family::named("tag36h11").unwrap();
        Print::new(&family, family.codes[7]).unwrap()
    }

    /// Averages the cells under a correlated Gaussian, on a fine grid.
    fn by_sampling(print: &Print, [x, y]: [f64; 2], blur: &Blur) -> f64 {
        let (r, steps) = (blur.correlation, 1200);
        let (mut sum, mut weight) = (0.0, 0.0);
        for k in 0..steps * steps {
            let at = |k: usize| 10.0 * ((k as f64 + 0.5) / steps as f64 - 0.5);
            let (a, b) = (at(k % steps), at(k / steps));
            let w = (-0.5 * (a * a + b * b)).exp();
            let (dx, dy) = (blur.sigma[0] * a, blur.sigma[1] * (r * a + (1.0 - r * r).sqrt() * b));
            sum += w * print.plain([x - dx, y - dy]);
            weight += w;
        }
        sum / weight
    }

    #[test]
    fn the_table_is_the_normal_distribution() {
        for k in -3300..=3300 {
            let a = k as f64 * 1e-3;
            let (by_table, by_series) = (normal(&NORMAL, a), normal_at(a));
            assert!((by_table.0 - by_series.0).abs() < 2e-8, "{a}");
            assert!((by_table.1 - by_series.1).abs() < 4e-7, "{a}");
        }
    }

    #[test]
    fn closed_form_is_the_blurred_print() {
        let print = print();
        for (correlation, bar) in [(0.0, 4e-3), (0.3, 6e-3), (-0.5, 1.8e-2)] {
            for at in [[1.1, 1.05], [2.0, 3.1], [5.4, 6.6], [8.9, 4.0]] {
                let blur = Blur { sigma: [0.35, 0.25], correlation };
                let (closed, sampled) = (print.at(at, &blur).unwrap().value, by_sampling(&print, at, &blur));
                assert!((closed - sampled).abs() < bar, "{correlation} {at:?}: {closed} {sampled}");
            }
        }
    }

    /// Where at most one line is near along a direction, both ways of computing give the same.
    #[test]
    fn few_lines_and_many_are_the_same() {
        let print = print();
        let blur = Blur { sigma: [0.14, 0.12], correlation: 0.2 };
        let (mut n, mut largest) = (0, 0.0f64);
        for k in 0..4000 {
            let at = [0.0025 * f64::from(k), (0.0137 * f64::from(k)) % 10.0];
            let (across, down) = (print.near(at[0], blur.sigma[0]), print.near(at[1], blur.sigma[1]));
            if across.len().max(down.len()) == 1 {
                let all = print.at_with::<ALL>(at, &blur, across.clone(), down.clone()).unwrap();
                let few = print.at_corner(at, &blur, across, down);
                let numbers = |ink: Ink| [[ink.value, ink.slope[0], ink.slope[1]], ink.bend].concat();
                let differences = numbers(all).into_iter().zip(numbers(few)).map(|(a, b)| (a - b).abs());
                largest = differences.fold(largest, f64::max);
                n += 1;
            }
        }
        assert!(2000 < n && largest < 1e-10, "{n} {largest}");
    }

    #[test]
    fn derivatives_are_those_of_the_value() {
        let (print, h) = (print(), 1e-4);
        let blur = Blur { sigma: [0.4, 0.3], correlation: 0.1 };
        let value = |x: f64, y: f64| print.at([x, y], &blur).unwrap();
        for [x, y] in [[1.1, 1.05], [2.0, 3.1], [5.4, 6.6]] {
            let ink = value(x, y);
            let differences = [
                (value(x + h, y).value - value(x - h, y).value) / (2.0 * h),
                (value(x, y + h).value - value(x, y - h).value) / (2.0 * h),
            ];
            let bends = [
                (value(x + h, y).slope[0] - value(x - h, y).slope[0]) / (2.0 * h),
                (value(x, y + h).slope[0] - value(x, y - h).slope[0]) / (2.0 * h),
                (value(x, y + h).slope[1] - value(x, y - h).slope[1]) / (2.0 * h),
            ];
            // Terms of the second power of the correlation are left out of the derivatives.
            (0..2).for_each(|k| {
                assert!((ink.slope[k] - differences[k]).abs() < 0.02, "{ink:?} {differences:?}")
            });
            (0..3).for_each(|k| assert!((ink.bend[k] - bends[k]).abs() < 0.1, "{ink:?} {bends:?}"));
        }
    }
}
