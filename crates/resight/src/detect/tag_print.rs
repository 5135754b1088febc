//! Measures a tag by fitting everything printed on it to the image (docs/math/tag_print.md).
//!
//! The library fits a line to each edge of a tag. Where the image is blurred, or the tag small, the bits inside reach into these lines; but the
//! bits are known once the tag is decoded. Here the whole print, seen through the homography of four corners and a blur, is fitted to the image:
//! corners, brightness, contrast, blur, the spread of the ink and the bows of the edges minimise a robust sum of squares. Pixels that do not
//! look like the print (a finger over a corner) get no weight, and the corner there becomes less certain.

mod ink;
mod margin;
mod part;
mod rows;

pub(super) use ink::Print;

use super::region::longer_side_px;
use crate::GrayImage;
use nalgebra::{Cholesky, Const, Matrix2, SMatrix, SVector, SymmetricEigen};
use part::Part;
use resight_core::Pixel;
use rows::{BLUR, BOWS, CornersByMap, GAIN, GRAY, Line, MAP, Placed, Row, SPREAD, UNKNOWNS, WIDTH};

/// The corners of a tag.
#[derive(Debug, Clone, Copy)]
pub(super) struct LaidTag {
    pub corners: [Pixel; 4],
    /// Standard deviation of each coordinate of each corner, pixels.
    pub sigmas_px: [f64; 4],
    /// The share of its pixels that agree with the print.
    pub shown: f64,
    /// The share of the variance of these that the print explains,
    explained: f64,
    /// and of the variance of all pixels: it is small for a code that another print bears by chance.
    pub explained_of_all: f64,
    /// The start for the next image.
    fit: Fit,
}

/// The result.
#[derive(Debug, Clone, Copy)]
struct Fit {
    reduce: usize,
    is_smoothed: bool,
    /// Whether the start was so near that the derivatives there were those at the end.
    was_near: bool,
    blur_px2: Matrix2<f64>,
    x: Row,
}

type Normal = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// Longest edge of a tag that is compared at full size, pixels; larger tags are reduced.
const LONGEST_PX: f64 = 130.0;
/// Of a tag with longer edges every second pixel is compared, of one of twice this size every third, in pixels: enough, in the time of a small
/// tag.
const EVERY_PX: f64 = 56.0;
/// From this number of tags in one image on, each is compared at half of these lengths.
const MANY: usize = 4;
/// A part with fewer compared pixels is compared with all of them from the first round on.
const FEW: usize = 1000;
/// Largest number of rounds; each about squares the error, until foreign pixels are recognised.
const ROUNDS: usize = 40;
/// Corners that move less than this are near their end, pixels.
const NEAR_PX: f64 = 0.1;
/// Largest number of rounds with a start from the last image, which is near, unless the tag is not there.
const ROUNDS_AGAIN: usize = 8;
/// The corresponding limit for corners that start from the last image, pixels.
const NEAR_AGAIN_PX: f64 = 0.25;
/// Corners that move less have converged, pixels of the reduced image, or standard deviations of the noise; the last step leaves a tenth of its
/// length.
const SETTLED_PX: f64 = 5e-3;
const SETTLED_SIGMAS: f64 = 0.2;
/// Steps that move the corners by less, pixels, and the blur by less, in shares of its variance, do not change the derivatives:
const LINEAR_PX: f64 = 0.05;
const LINEAR_BLUR: f64 = 0.1;
/// then only the weights of the pixels are updated, this many times.
const REWEIGHTED: usize = 3;
/// Initial blur, without the pixel's own square, and largest blur, with it: standard deviations in pixels.
const FIRST_BLUR_PX: f64 = 0.6;
const MOST_BLUR_PX: f64 = 5.0;
/// Smallest final blur in a photograph that is not smoothed: sharpened images are narrower than the square of a pixel.
const LEAST_BLUR_PX: f64 = 0.25;
/// A narrower blur, with the pixel's own square (alone 0.289), is not smooth from pixel to pixel, pixels: that of drawings, sharpened and
/// reduced images. There an edge a tenth of a pixel off differs as much from the print as a foreign object, and a corner without its edges is
/// not determined. Such a part is smoothed before the print is fitted.
const SHARP_PX: f64 = 0.42;
/// In a drawing at least this share of the pixels has one of two grey levels; in photographs, whose light and noise differ from pixel to pixel,
/// at most 0.22 of those around a tag (compressed webcam films). Sharpened photographs are not treated as drawings.
const DRAWN_SHARE: f64 = 0.3;
/// Residuals beyond this, in units of the contrast, mark a pixel as foreign: in the first round, and at least.
const FOREIGN: (f64, f64) = (0.4, 0.12);
/// The same limit in robust standard deviations of the residuals.
const FOREIGN_SIGMAS: f64 = 5.0;
/// Least share of the pixels that agree with the print, and of their variance that it explains.
const SHOWN: f64 = 0.5;
const EXPLAINED: f64 = 0.8;
/// Least contrast of a print, grey levels.
const CONTRAST_GRAY: f64 = 8.0;
/// If the corners are farther than this from those of the library, in edges (or this many pixels), another print was fitted.
const REACH_EDGES: f64 = 0.3;
const REACH_PX: f64 = 1.5;

/// Prior standard deviations: of the blur from a round one, pixels² of its variance; of the spread of the ink, pixels; of the bow of an edge by
/// the lens, in squares of the edge over the longer side of the image (0.04 px at an edge of 50 px in an image of 1280).
const BLUR_PRIOR_PX2: f64 = 2.0;
const SPREAD_PRIOR_PX: f64 = 0.3;
const BOW_PRIOR: f64 = 0.02;
/// Share of the sums over squares that the unknowns absorb, in shares of an edge.
const TAKEN_UP: f64 = 1.5;
/// The error of the method itself, standard deviation in pixels.
const METHOD_PX: f64 = 0.003;
/// The same error for a drawing without blur, whose grey levels vary at a few positions of its edges only.
const SHARP_METHOD_PX: f64 = 0.015;
/// The same error for black and white without grey levels between: an edge along a row of pixels is uncertain by 1/√12 of a pixel.
const TWO_VALUED_METHOD_PX: f64 = 0.289;
/// Noise that is weighed against these priors, in standard deviations of the residuals.
const SHARED: f64 = 2.0;

/// Fits a print to the image with [`lay_with`], with its white margin, or with the ground around it where that explains more.
pub(super) fn lay(
    image: &GrayImage,
    noise_gray: f64,
    print: &Print,
    corners: &[Pixel; 4],
    n_tags: usize,
    before: Option<&LaidTag>,
) -> Option<LaidTag> {
    let laid = lay_with(image, noise_gray, print, corners, n_tags, before);
    // A tag that is not at its last position needs no second fit there.
    if laid.is_none() && before.is_some() {
        return None;
    }
    let start = laid.map_or(*corners, |laid| laid.corners);
    let Some(margins) = margin::dark(image, print, &start) else { return laid };
    let on_ground = lay_with(image, noise_gray, &print.with_margin(margins), &start, n_tags, None);
    let score = |laid: &LaidTag| laid.shown * laid.explained;
    match (laid, on_ground) {
        (Some(laid), Some(other)) if score(&other) <= score(&laid) => Some(laid),
        (laid, other) => other.or(laid),
    }
}

/// Fits a print to the image, starting from the corners of the library, or from those in the image `before`; `n_tags` tags are in the image.
/// `None` where the print is not visible.
fn lay_with(
    image: &GrayImage,
    noise_gray: f64,
    print: &Print,
    corners: &[Pixel; 4],
    n_tags: usize,
    before: Option<&LaidTag>,
) -> Option<LaidTag> {
    let share = if n_tags < MANY { 1.0 } else { 0.5 };
    let reduce = (longer_side_px(corners) / (share * LONGEST_PX)).ceil().clamp(1.0, 1e3) as usize;
    let mut part = Part::cut(image, &around(print, corners), reduce)?;
    let is_drawn = DRAWN_SHARE <= part.two_levels;
    // The rounding of each grey level counts as noise too.
    let noise_gray = (noise_gray.powi(2) + 1.0 / 12.0).sqrt() / reduce as f64;
    let start = corners.map(|corner| part.reduced(&corner));
    let every =
        (longer_side_px(corners) / (reduce as f64 * share * EVERY_PX)).ceil().clamp(1.0, 3.0) as usize;
    let n_pixels = part.size()[0] * part.size()[1] / every;
    let reach_px = (REACH_EDGES * super::sigma::shortest_edge_px(&start)).max(REACH_PX);
    let mut state = State {
        at: start,
        blur_px2: Matrix2::identity() * ((FIRST_BLUR_PX / reduce as f64).powi(2) + 1.0 / 12.0),
        x: None,
        foreign: FOREIGN.0,
        least_blur_px: if is_drawn { SHARP_PX } else { LEAST_BLUR_PX },
        is_smoothed: false,
        view_px: image.width_px.max(image.height_px) as f64 / reduce as f64,
    };
    let known = before.map(|before| &before.fit).filter(|fit| !fit.is_smoothed && fit.reduce == reduce);
    if let Some(fit) = known {
        (state.blur_px2, state.x) = (fit.blur_px2, Some(fit.x));
        (state.foreign, state.least_blur_px) = (FOREIGN.1, LEAST_BLUR_PX);
    }
    // About half of the pixels are near a line.
    let mut lines = Vec::with_capacity(n_pixels * 5 / 8);
    for round in 0..if before.is_some() { ROUNDS_AGAIN } else { ROUNDS } {
        let is_strict = state.foreign <= FOREIGN.1;
        let placed = Placed::new(print, &state.at, &state.blur_px2)?;
        // For a tag that is not small, half of the pixels determine the direction of the first steps.
        let is_half = !is_strict || round == 0 && known.is_some_and(|fit| !fit.was_near);
        let rows = if is_half && FEW <= n_pixels { 2 } else { 1 };
        placed.lines(&part, every, rows, &mut lines)?;
        let corners_by_map = placed.corners_by_map(&state.at);
        let residual = |line: &Line| state.x.map_or(0.0, |x| line.gray() - line.predicted(&x));
        let mut solved = state.solve(&lines, noise_gray, &corners_by_map, residual)?;
        let is_last = is_strict && rows == 1 && state.reweight(&lines, noise_gray, &mut solved)?;
        state.step(&solved)?;
        let is_another = known.is_some() && is_drawn && state.is_sharp();
        let away_px = (0..4).map(|k| (state.at[k] - start[k]).norm()).fold(0.0, f64::max);
        if is_another || reach_px < away_px {
            return None;
        }
        if is_last {
            let laid = conclude(&lines, &solved, &state, &part, noise_gray, every)?;
            return Some(LaidTag { fit: Fit { was_near: away_px < LINEAR_PX, ..laid.fit }, ..laid });
        }
        let moved_px = solved.steps.amax();
        if round == 0 && NEAR_AGAIN_PX <= moved_px {
            state.foreign = FOREIGN.0;
        }
        // The strict limit applies only near the end: before, an edge that is slightly off would be foreign.
        if moved_px < NEAR_PX && !is_strict {
            if is_drawn && state.is_sharp() {
                part = part.smoothed();
                state.blur_px2 += Matrix2::identity() * part::SMOOTHING_PX2;
                state.least_blur_px = part::SMOOTHING_PX2.sqrt();
                state.is_smoothed = true;
            } else {
                state.foreign = FOREIGN.1;
                state.least_blur_px = state.least_blur_px.min(LEAST_BLUR_PX);
            }
        }
    }
    None
}

/// Returns the corners of everything printed, and a small margin, in the image.
fn around(print: &Print, corners: &[Pixel; 4]) -> [Pixel; 4] {
    let centre = corners.iter().sum::<Pixel>() / 4.0;
    let cells = (print.width - 2 * print.inset) as f64;
    let grown = 1.15 * (1.0 + 2.0 * print.inset as f64 / cells);
    corners.map(|corner| centre + (corner - centre) * grown)
}

/// The state that changes from round to round.
struct State {
    at: [Pixel; 4],
    blur_px2: Matrix2<f64>,
    /// The unknowns that enter linearly; `None` before the first round.
    x: Option<Row>,
    /// Limit beyond which a pixel is foreign, in units of the contrast.
    foreign: f64,
    /// Lower limit of the blur, pixels.
    least_blur_px: f64,
    /// Whether the part is smoothed.
    is_smoothed: bool,
    /// Longer side of the image, pixels of the part.
    view_px: f64,
}

struct Solved {
    x: Row,
    factor: Cholesky<f64, Const<UNKNOWNS>>,
    corners_by_map: CornersByMap,
    /// The step of the corners' coordinates.
    steps: Pull,
    /// Weight of each line.
    weights: Vec<f64>,
}

impl Solved {
    /// Returns the derivative of the eight coordinates of the corners with respect to the sums over the lines, pixels.
    fn corners_by_sums(&self) -> SMatrix<f64, 8, UNKNOWNS> {
        let mut columns = SMatrix::<f64, UNKNOWNS, 8>::zeros();
        columns.fixed_rows_mut::<8>(MAP.start).copy_from(&(self.corners_by_map.transpose() / self.x[GAIN]));
        self.factor.solve(&columns).transpose()
    }

    /// Returns the covariance of the corners for noise of one grey level, pixels².
    fn by_noise_px2(&self, corners_by_sums: &SMatrix<f64, 8, UNKNOWNS>) -> CornersByMap {
        corners_by_sums.fixed_columns::<8>(MAP.start) * self.corners_by_map.transpose() / self.x[GAIN]
    }

    /// Returns whether the steps are negligible.
    fn are_small(&self, steps: &Pull, noise_gray: f64) -> bool {
        if LINEAR_PX <= steps.amax() {
            return false;
        }
        let by_noise_px2 = self.by_noise_px2(&self.corners_by_sums());
        let least_px = |i: usize| SETTLED_PX.max(SETTLED_SIGMAS * noise_gray * by_noise_px2[(i, i)].sqrt());
        (0..8).all(|i| steps[i].abs() < least_px(i))
    }
}

impl State {
    /// Returns whether edges are so sharp that they have to be smoothed; never for a part that is smoothed.
    fn is_sharp(&self) -> bool {
        let narrowest_px2 = self.blur_px2.symmetric_eigenvalues().min();
        !self.is_smoothed && narrowest_px2 < 1.001 * SHARP_PX.powi(2)
    }

    /// Returns the weights of J. Tukey's biweight, with a limit that decreases from round to round to that of the residuals themselves, and the
    /// robust standard deviation of the residuals, grey levels.
    fn weights(&self, lines: &[Line], noise_gray: f64, residual: impl Fn(&Line) -> f64) -> (Vec<f64>, f64) {
        let Some(x) = &self.x else { return (lines.iter().map(|line| line.weight).collect(), noise_gray) };
        let residuals: Vec<f64> = lines.iter().map(residual).collect();
        let mut sizes: Vec<f64> = residuals.iter().map(|e| e.abs()).collect();
        let middle = sizes.len() / 2;
        let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
        let sigma = (1.4826 * *median).max(noise_gray);
        let contrast = 2.0 * x[GAIN].abs();
        let limit = |foreign: f64| (foreign * contrast).max(FOREIGN_SIGMAS * sigma);
        let limit = limit(self.foreign);
        let weight = |(line, e): (&Line, &f64)| line.weight * (1.0 - (e / limit).powi(2)).max(0.0).powi(2);
        (lines.iter().zip(&residuals).map(weight).collect(), sigma)
    }

    /// Updates the weights of the lines for the residuals after a small step, with unchanged derivatives; returns whether the step has converged
    /// then.
    fn reweight(&self, lines: &[Line], noise_gray: f64, solved: &mut Solved) -> Option<bool> {
        if solved.are_small(&solved.steps, noise_gray) {
            return Some(true);
        }
        let blurred = solved.x.fixed_rows::<3>(BLUR.start).amax() / solved.x[GAIN];
        for _ in 0..REWEIGHTED {
            if LINEAR_PX <= solved.steps.amax() || LINEAR_BLUR * self.blur_px2.trace() <= blurred {
                break;
            }
            let next =
                self.solve(lines, noise_gray, &solved.corners_by_map, |line| line.residual(&solved.x))?;
            let is_settled = next.are_small(&(next.steps - solved.steps), noise_gray);
            *solved = next;
            if is_settled {
                return Some(true);
            }
        }
        Some(false)
    }

    fn solve(
        &self,
        lines: &[Line],
        noise_gray: f64,
        corners_by_map: &CornersByMap,
        residual: impl Fn(&Line) -> f64,
    ) -> Option<Solved> {
        let (weights, residual_gray) = self.weights(lines, noise_gray, residual);
        let sums = products(lines, &weights);
        let mut normal = Normal::from_fn(|i, j| if j <= i { sums[i][j] } else { 0.0 });
        let mut right = Row::from_fn(|i, _| sums[GRAY][i]);
        let gain = self.x.map_or(64.0, |x| x[GAIN]);
        // Errors of the print are shared by neighbouring pixels, and count for more than noise of the same size.
        let share2 = (SHARED * residual_gray / gain).powi(2);
        let mut known = |i: usize, sigma: f64, mean: f64| {
            normal[(i, i)] += share2 / (sigma * sigma);
            right[i] += share2 / (sigma * sigma) * mean;
        };
        // The departure from a round blur of the same variance.
        let b = self.blur_px2;
        let half = 0.5 * (b[(0, 0)] - b[(1, 1)]);
        known(BLUR.start, BLUR_PRIOR_PX2, -half * gain);
        known(BLUR.start + 1, BLUR_PRIOR_PX2, -b[(0, 1)] * gain);
        known(BLUR.start + 2, BLUR_PRIOR_PX2, half * gain);
        known(SPREAD, SPREAD_PRIOR_PX, 0.0);
        let edge_px = super::sigma::shortest_edge_px(&self.at);
        let bow_px = BOW_PRIOR * edge_px * edge_px / self.view_px;
        BOWS.for_each(|i| known(i, bow_px, 0.0));
        let factor = normal.cholesky()?;
        let x = factor.solve(&right);
        let steps = corners_by_map * x.fixed_rows::<8>(MAP.start) / x[GAIN];
        (x.iter().all(|x| x.is_finite()) && CONTRAST_GRAY < 2.0 * x[GAIN]).then_some(Solved {
            x,
            factor,
            corners_by_map: *corners_by_map,
            steps,
            weights,
        })
    }

    /// Takes a step; `None` if it is not finite.
    fn step(&mut self, solved: &Solved) -> Option<()> {
        let Solved { x, steps, .. } = solved;
        for (k, corner) in self.at.iter_mut().enumerate() {
            *corner += Pixel::new(steps[2 * k], steps[2 * k + 1]);
        }
        let more = x.fixed_rows::<3>(BLUR.start) / x[GAIN];
        let next = self.blur_px2 + Matrix2::new(more[0], more[1], more[1], more[2]);
        let most = 4.0 * self.blur_px2.trace();
        let mut eigen = SymmetricEigen::new(next);
        let (low, high) = (self.least_blur_px.powi(2), MOST_BLUR_PX.powi(2).min(most));
        eigen.eigenvalues.apply(|x| *x = x.clamp(low, high));
        self.blur_px2 = eigen.recompose();
        self.x = Some(*x);
        let is_finite = self.blur_px2.iter().all(|x| x.is_finite()) && steps.iter().all(|x| x.is_finite());
        is_finite.then_some(())
    }
}

/// Returns the sums over the lines of the products of each two entries of their rows, below the diagonal.
fn products(lines: &[Line], weights: &[f64]) -> [[f64; WIDTH]; GRAY + 1] {
    let mut sums = [[0.0; WIDTH]; GRAY + 1];
    let kept: Vec<(&Line, f64)> =
        lines.iter().zip(weights.iter().copied()).filter(|(_, weight)| 0.0 < *weight).collect();
    let (fours, rest) = kept.as_chunks::<4>();
    for four in fours {
        let [a, b, c, d] = four.map(|(line, _)| &line.row);
        for (j, sums) in sums.iter_mut().enumerate() {
            let [wa, wb, wc, wd] = four.map(|(line, weight)| weight * line.row[j]);
            // Computing whole groups of four columns is faster than avoiding the surplus ones.
            for i in 0..(j / 4 + 1) * 4 {
                sums[i] += (wa * a[i] + wb * b[i]) + (wc * c[i] + wd * d[i]);
            }
        }
    }
    for (line, weight) in rest {
        for (j, sums) in sums.iter_mut().enumerate() {
            let w = weight * line.row[j];
            sums.iter_mut().zip(&line.row).take(j + 1).for_each(|(sum, x)| *sum += w * x);
        }
    }
    sums
}

/// Decides whether the print is visible, and computes the uncertainty of its corners: docs/math/tag_print.md section 3.
fn conclude(
    lines: &[Line],
    solved: &Solved,
    state: &State,
    part: &Part,
    noise_gray: f64,
    every: usize,
) -> Option<LaidTag> {
    let Solved { x, weights, .. } = solved;
    let noise_gray2 = noise_gray * noise_gray;
    let shown: f64 = weights.iter().sum();
    let mean = lines.iter().zip(weights).map(|(line, w)| w * line.gray()).sum::<f64>() / shown;
    let widest_px2 = state.blur_px2.symmetric_eigenvalues().max();
    let reach = (3.0 * widest_px2.sqrt()).round().clamp(7.0, 9.0) as usize;
    // Pulls of a sparse lattice are summed in larger cells, of which there are fewer.
    let cell = if every < 2 { 1 } else { 2 };
    let [width, height] = part.size().map(|n| n.div_ceil(cell));
    let mut pulls = vec![Pull::zeros(); width * height];
    let rows = solved.corners_by_sums();
    let by_noise_px2 = solved.by_noise_px2(&rows);
    let (mut total, mut left) = (0.0, 0.0);
    let explained_of_all = explained_of_all(lines, x, noise_gray2);
    for (line, weight) in lines.iter().zip(weights).filter(|(_, weight)| 0.0 < **weight) {
        let residual = line.residual(x);
        total += weight * (line.gray() - mean).powi(2);
        left += weight * residual * residual;
        let (u, v) = (line.index % part.size()[0] / cell, line.index / part.size()[0] / cell);
        pull(&rows, line, weight * residual, &mut pulls[v * width + u]);
    }
    let explained = 1.0 - (left - shown * noise_gray2).max(0.0) / (total - shown * noise_gray2).max(1e-9);
    let expected: f64 = lines.iter().map(|line| line.weight).sum();
    if !(EXPLAINED <= explained) || !(SHOWN * expected <= shown) {
        return None;
    }
    let cells = reach.div_ceil(cell);
    let mut by_residual = squares(&pulls, width, cells);
    let share = reach as f64 / super::sigma::shortest_edge_px(&state.at);
    by_residual *= (1.0 + TAKEN_UP * share) / (cells * cells) as f64;
    let noise_px2 = |i: usize| noise_gray2 * by_noise_px2[(i, i)];
    let sums =
        |k: usize| (by_residual[2 * k] + by_residual[2 * k + 1], noise_px2(2 * k) + noise_px2(2 * k + 1));
    let corners = [0, 1, 2, 3].map(sums);
    let mut excesses = corners.map(|(by_residual, by_noise)| by_residual / by_noise);
    excesses.sort_by(f64::total_cmp);
    let common = (0.5 * (excesses[1] + excesses[2])).max(1.0);
    let method_px = if 1.0 <= part.two_levels {
        TWO_VALUED_METHOD_PX
    } else if state.is_smoothed {
        SHARP_METHOD_PX
    } else {
        METHOD_PX
    };
    let sigma = |(by_residual, by_noise): (f64, f64)| {
        let is_own = super::print::OWN_EXCESS * common * by_noise < by_residual;
        let variance_px2 = 0.5 * if is_own { by_residual } else { common * by_noise };
        (part.scale().powi(2) * variance_px2 + method_px.powi(2)).sqrt()
    };
    let sigmas_px = corners.map(sigma);
    let corners = state.at.map(|corner| part.full(&corner));
    let fit = Fit {
        reduce: part.scale() as usize,
        is_smoothed: state.is_smoothed,
        was_near: false,
        blur_px2: state.blur_px2,
        x: *x,
    };
    let laid = LaidTag { corners, sigmas_px, shown: shown / expected, explained, explained_of_all, fit };
    sigmas_px.iter().all(|s| s.is_finite()).then_some(laid)
}

/// Returns the share of the variance of all lines, less that of the noise, that the print explains.
fn explained_of_all(lines: &[Line], x: &Row, noise_gray2: f64) -> f64 {
    let weight: f64 = lines.iter().map(|line| line.weight).sum();
    let mean = lines.iter().map(|line| line.weight * line.gray()).sum::<f64>() / weight;
    let (total, left) = lines.iter().fold((0.0, 0.0), |(total, left), line| {
        let (from_mean, residual) = (line.gray() - mean, line.residual(x));
        (total + line.weight * from_mean * from_mean, left + line.weight * residual * residual)
    });
    1.0 - (left - weight * noise_gray2).max(0.0) / (total - weight * noise_gray2).max(1e-9)
}

/// The effect of a pixel's residual on the eight coordinates of the corners.
type Pull = SVector<f64, 8>;

/// Adds the pull of one pixel.
fn pull(corners_by_sums: &SMatrix<f64, 8, UNKNOWNS>, line: &Line, weighted: f64, sum: &mut Pull) {
    let mut by_row = Pull::zeros();
    for (column, x) in corners_by_sums.column_iter().zip(&line.row) {
        (0..8).for_each(|i| by_row[i] += column[i] * x);
    }
    *sum += by_row * weighted;
}

/// Returns the sum of the squares of the sums over all squares of `reach` pixels that touch the part.
fn squares(pulls: &[Pull], width: usize, reach: usize) -> Pull {
    let side = width + reach - 1;
    let height = pulls.len() / width;
    // Sums along each row, over the pixels up to `reach` − 1 before.
    let mut along = vec![Pull::zeros(); side * height];
    for (row, sums) in pulls.chunks(width).zip(along.chunks_mut(side)) {
        let mut sum = Pull::zeros();
        for (k, out) in sums.iter_mut().enumerate() {
            sum += row.get(k).copied().unwrap_or_else(Pull::zeros);
            if reach <= k {
                sum -= row[k - reach];
            }
            *out = sum;
        }
    }
    let (mut down, mut total) = (vec![Pull::zeros(); side], Pull::zeros());
    for k in 0..height + reach - 1 {
        for (u, sum) in down.iter_mut().enumerate() {
            if k < height {
                *sum += along[k * side + u];
            }
            if reach <= k {
                *sum -= along[(k - reach) * side + u];
            }
            total += sum.component_mul(sum);
        }
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_over_squares_are_those_of_their_pixels() {
        let pull = |k: usize| Pull::from_fn(|i, _| ((k * 7 + i * 3) % 11) as f64 - 5.0);
        let pulls: Vec<Pull> = (0..5 * 4).map(pull).collect();
        let mut expected = Pull::zeros();
        for (u, v) in (0..5 + 2).flat_map(|u| (0..4 + 2).map(move |v| (u, v))) {
            let is_in = |k: usize, first: usize| first <= k + 2 && k <= first;
            let inside = (0..20).filter(|k| is_in(k % 5, u) && is_in(k / 5, v));
            let sum: Pull = inside.map(|k| pulls[k]).sum();
            expected += sum.component_mul(&sum);
        }
        assert!((squares(&pulls, 5, 3) - expected).amax() < 1e-9);
    }
}
