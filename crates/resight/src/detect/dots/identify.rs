//! Identifies the four dots of the target: every explanation is tested, and accepted only if it is unlikely to arise by chance.
//!
//! Perspective does not preserve a simple ratio on a line, so that no triple is rejected for its ratio alone: the ratio gives the depth ratio k
//! of the line's ends, which must be plausible and must agree with the dots' shapes. The final criterion is the number of false alarms (A.
//! Desolneux, L. Moisan, J.-M. Morel, 2000): the number of explanations as good as this one that as many dots of such shapes would give if
//! distributed at random; dots.md eqs. (18)–(20).
//! Cost: at most `MAX_DOTS` dots of a polarity, so at most MAX_DOTS³/2 triples, `MAX_TRIPLES` of which are tried with
//! every fourth dot, `MAX_FITS` of these in full.

use super::layout::{self, Fit, Layout, ViewDot};
use super::view::View;
use nalgebra::Matrix2;
use resight_core::Pixel;

/// Number of dots of one polarity that take part, the most conspicuous first.
pub(super) const MAX_DOTS: usize = 160;
const MAX_TRIPLES: usize = 1500;
const MAX_FITS: usize = 2500;

/// Largest logarithm of the ratio of the depths of two dots on the line, and of any dot to the line.
const MAX_LN_DEPTH: f64 = 0.9;
/// Largest χ² of the shapes, 9 degrees of freedom: 1 in 15 would exceed it if the tolerances were independent errors; they are bounds on errors
/// that all four dots share.
const MAX_SHAPE_CHI2: f64 = 16.0;
/// Largest χ² of a position against line or circle: 4 σ.
const MAX_PLACE_CHI2: f64 = 16.0;
/// If another explanation of the same dots is within this many decades, neither is reported.
const ALTERNATIVE_DECADES: f64 = 1.5;
/// Straight lines in images of an unknown lens are bent by up to this part of their length.
const UNKNOWN_LENS_BOW: f64 = 0.003;

/// Four dots explained as the target.
#[derive(Debug, Clone, Copy)]
pub(super) struct Explanation {
    /// Indices of the dots, in the order of `Layout::ids`.
    pub dots: [usize; 4],
    /// log₁₀ of the number of such explanations expected by chance in this image.
    pub log10_false_alarms: f64,
    /// The same number increased by the misfit, for ranking.
    pub score: f64,
    /// Position and shape.
    pub fit: Fit,
}

/// Three dots on a line.
struct Triple {
    ends: [usize; 2],
    middle: usize,
    off_px: f64,
    /// k with the ends in this order, and in the other; `None` where the perspective would be implausible.
    depths: [Option<f64>; 2],
}

/// The target, and the dots.
pub(super) struct Search<'a> {
    pub layout: &'a Layout,
    pub view: &'a View<'a>,
    pub image_area_px2: f64,
    pub max_log10_false_alarms: f64,
}

impl Search<'_> {
    /// Returns all acceptable explanations that contradict no other, best first. `dots` are of one polarity.
    pub fn explanations(&self, dots: &[ViewDot]) -> Vec<Explanation> {
        let dots = &dots[..dots.len().min(MAX_DOTS)];
        let mut found = Vec::new();
        let mut fits = 0;
        for triple in self.triples(dots) {
            for fourth in 0..dots.len() {
                if fourth == triple.middle || triple.ends.contains(&fourth) || MAX_FITS <= fits {
                    continue;
                }
                let Some((order, k)) = self.order(dots, &triple, fourth) else { continue };
                let four = order.map(|i| dots[i]);
                if !layout::shapes_may_fit(self.layout, &four, k, 2.5 * MAX_SHAPE_CHI2) {
                    continue;
                }
                fits += 1;
                found.extend(self.explain(dots, order, k, triple.off_px));
            }
        }
        self.without_alternatives(found)
    }

    fn triples(&self, dots: &[ViewDot]) -> Vec<Triple> {
        let mut triples = Vec::new();
        let bow = if self.view.is_calibrated() { 0.0 } else { UNKNOWN_LENS_BOW };
        for (i, a) in dots.iter().enumerate() {
            for (j, c) in dots.iter().enumerate().skip(i + 1).filter(|(_, c)| alike(a, c)) {
                let along = c.y - a.y;
                let length2 = along.norm_squared();
                let length = length2.sqrt();
                for (m, b) in dots.iter().enumerate() {
                    let from_start = b.y - a.y;
                    let t = from_start.dot(&along) / length2;
                    if !(0.02 < t && t < 0.98) || m == i || m == j {
                        continue;
                    }
                    let off_px = along.perp(&from_start).abs() / length * b.scale_px;
                    // The position of the middle dot and the line's position there have together at most √2 of a single sigma.
                    let sigma = std::f64::consts::SQRT_2 * b.position_sigma_px() + bow * length * b.scale_px;
                    if MAX_PLACE_CHI2 * sigma * sigma < off_px * off_px || !alike(a, b) || !alike(b, c) {
                        continue;
                    }
                    let depths = [self.end_depth(a, b, c, t), self.end_depth(c, b, a, 1.0 - t)];
                    if depths.iter().any(Option::is_some) {
                        triples.push(Triple { ends: [i, j], middle: m, off_px, depths });
                    }
                }
            }
        }
        // The straightest come first, so that a limit discards the least likely.
        triples.sort_by(|a, b| a.off_px.total_cmp(&b.off_px));
        triples.truncate(MAX_TRIPLES);
        triples
    }

    /// Returns k for a line from `start` through `middle`, a part t of the way, to `end`; `None` when depths or areas exclude it.
    fn end_depth(&self, start: &ViewDot, middle: &ViewDot, end: &ViewDot, t: f64) -> Option<f64> {
        let k = layout::end_depth(self.layout.r, t);
        let w1 = 1.0 - self.layout.r + self.layout.r * k;
        let possible = k.ln().abs() < MAX_LN_DEPTH
            && areas_agree(start, end, k.ln())
            && areas_agree(start, middle, w1.ln())
            && areas_agree(middle, end, (k / w1).ln());
        possible.then_some(k)
    }

    /// Returns the order of the dots in which the target is seen from its front, and k; `None` when the distance of the fourth dot would need an
    /// implausible perspective.
    fn order(&self, dots: &[ViewDot], triple: &Triple, fourth: usize) -> Option<([usize; 4], f64)> {
        let [i, j] = triple.ends;
        let along = dots[j].y - dots[i].y;
        let side = along.perp(&(dots[fourth].y - dots[i].y));
        // Seen from the front, x × y of the target points away from the camera, like u × v of the image.
        let forward = 0.0 < side * self.layout.off[1];
        let (start, end, k) = if forward { (i, j, triple.depths[0]?) } else { (j, i, triple.depths[1]?) };
        let across = side.abs() / along.norm_squared() / self.layout.off[1].abs();
        // Depth of the line below the fourth dot.
        let below = 1.0 + (k - 1.0) * self.layout.off[0];
        let plausible = 0.1 < across
            && across < 10.0
            && 0.05 < below
            && areas_near(&dots[start], &dots[fourth], below.ln(), layout::LN_DEPTH_RANGE);
        (plausible && alike(&dots[fourth], &dots[i]) && alike(&dots[fourth], &dots[triple.middle]))
            .then_some(([start, triple.middle, end, fourth], k))
    }

    fn explain(&self, dots: &[ViewDot], order: [usize; 4], k: f64, off_px: f64) -> Option<Explanation> {
        let four = order.map(|i| dots[i]);
        let rigid = match self.view.is_calibrated() {
            true => Some(layout::rigid_check(self.layout, &four, self.view)?),
            false => None,
        };
        if rigid.as_ref().is_some_and(|r| MAX_PLACE_CHI2 < r.chi2) {
            return None;
        }
        let fit = layout::fit_shapes(self.layout, &four, k).filter(|f| f.chi2 < MAX_SHAPE_CHI2)?;
        let alarms =
            self.log10_false_alarms(dots, &four, &fit, off_px, rigid.as_ref().map(|r| r.distance_px));
        if self.max_log10_false_alarms + ALTERNATIVE_DECADES < alarms {
            return None;
        }
        let chi2 = fit.chi2 + rigid.map_or(0.0, |r| r.chi2) + (off_px / four[1].position_sigma_px()).powi(2);
        let score = alarms + (chi2 + (k.ln() / 0.5).powi(2)) * 0.5 * std::f64::consts::LOG10_E;
        Some(Explanation { dots: order, log10_false_alarms: alarms, score, fit })
    }

    /// dots.md eqs. (18)–(20).
    fn log10_false_alarms(
        &self,
        dots: &[ViewDot],
        four: &[ViewDot; 4],
        fit: &Fit,
        off_px: f64,
        rigid_px: Option<f64>,
    ) -> f64 {
        let similar = |i: usize| dots.iter().filter(move |d| same_shape(d, &four[i], &fit.moments_px2[i]));
        let count = |i: usize, own: usize| similar(i).count().saturating_sub(own).max(1) as f64;
        let crowd = Crowd::around(four);
        let strangers =
            dots.iter().filter(|d| crowd.holds(d) && alike(d, &four[0])).count().saturating_sub(4) as f64;
        // Dots per px² that could be mistaken for dot i: over the image, or among its neighbours where they are denser.
        let density =
            |i: usize, own: usize| (count(i, own) / self.image_area_px2).max(strangers / crowd.area_px2());
        let px = |a: usize, b: usize| (four[a].dot.centroid - four[b].dot.centroid).norm();
        let line = px(0, 2);
        let t = px(0, 1) / line;
        // Shapes confine ln k and the fourth dot's place to about 1.5 times their own precision.
        let confined = 1.5 * fit.resolution;
        let strip = 2.0 * off_px.max(four[1].dot.sigma_px).max(0.02);
        let middle = strip * line * (t * (1.0 - t) * 2.0 * confined.min(MAX_LN_DEPTH)).min(1.0);
        let reach = px(0, 3).max(px(2, 3)).max(px(1, 3));
        let anywhere = 4.0 * reach * reach;
        let mut fourth = (std::f64::consts::PI * (confined * reach).powi(2)).min(anywhere);
        if let Some(off) = rigid_px {
            let arc = (4.0 * reach).min(2.0 * confined * reach);
            fourth = fourth.min(2.0 * off.max(four[3].dot.sigma_px).max(0.05) * arc);
        }
        // Both polarities are searched.
        f64::log10(2.0 * count(0, 0) * count(2, 1) * middle * density(1, 2) * fourth * density(3, 3))
    }

    /// Keeps the best of explanations that share dots, best first, and none if a second one is nearly as good.
    fn without_alternatives(&self, mut found: Vec<Explanation>) -> Vec<Explanation> {
        found.sort_by(|a, b| a.score.total_cmp(&b.score));
        let mut kept: Vec<(Explanation, bool)> = Vec::new();
        for e in found {
            let shares = |k: &&mut (Explanation, bool)| k.0.dots.iter().any(|i| e.dots.contains(i));
            let mut taken = false;
            for (better, sure) in kept.iter_mut().filter(shares) {
                taken = true;
                if e.score - better.score < ALTERNATIVE_DECADES {
                    *sure = false;
                }
            }
            if !taken {
                kept.push((e, true));
            }
        }
        let accepted =
            |(e, sure): &(Explanation, bool)| *sure && e.log10_false_alarms <= self.max_log10_false_alarms;
        kept.into_iter().filter(accepted).map(|(e, _)| e).collect()
    }
}

/// The density of the dots around the four: text and textures are dense locally, whatever the rest of the image shows.
struct Crowd {
    centre: Pixel,
    radius_px: f64,
}

impl Crowd {
    fn around(four: &[ViewDot; 4]) -> Crowd {
        let centre = four.iter().map(|d| d.dot.centroid).sum::<Pixel>() / 4.0;
        let farthest = four.iter().map(|d| (d.dot.centroid - centre).norm()).fold(0.0, f64::max);
        Crowd { centre, radius_px: 1.2 * farthest }
    }

    fn holds(&self, dot: &ViewDot) -> bool {
        (dot.dot.centroid - self.centre).norm() <= self.radius_px
    }

    fn area_px2(&self) -> f64 {
        std::f64::consts::PI * self.radius_px * self.radius_px
    }
}

/// Returns whether two dots may belong to one target: brightness within 3:1, area within 16:1.
fn alike(a: &ViewDot, b: &ViewDot) -> bool {
    let within = |x: f64, y: f64, ratio: f64| x <= ratio * y && y <= ratio * x;
    within(a.dot.contrast.abs(), b.dot.contrast.abs(), 3.0) && within(a.radius_px, b.radius_px, 4.0)
}

/// Returns whether two areas fit a ratio of depths.
fn areas_agree(near: &ViewDot, far: &ViewDot, ln_depth: f64) -> bool {
    areas_near(near, far, ln_depth, 0.0)
}

/// Returns whether two areas fit a ratio of depths within `range` of e^`ln_depth`: the area of a disc's image is proportional to depth⁻³, less
/// the contribution of the blur.
fn areas_near(near: &ViewDot, far: &ViewDot, ln_depth: f64, range: f64) -> bool {
    let seen = 2.0 * (near.radius_px * far.scale_px / (far.radius_px * near.scale_px)).ln();
    // Blur of σ ≤ 1.6 px makes up to 4 σ² of radius².
    let smallest = near.radius_px.min(far.radius_px);
    let sharp = (1.0 - 10.0 / (smallest * smallest)).max(0.0);
    let (low, high) = (3.0 * (ln_depth - range), 3.0 * (ln_depth + range));
    let noise = |d: &ViewDot| d.dot.moments_sigma_px2 / d.dot.moments_px2.trace();
    let tolerance = 0.2 + 6.0 * (noise(near) + noise(far));
    low.min(sharp * low) - tolerance < seen && seen < high.max(sharp * high) + tolerance
}

/// Returns whether this dot could be mistaken for another: moments within 4 tolerances, contrast within 2:1.
fn same_shape(dot: &ViewDot, model: &ViewDot, moments: &Matrix2<f64>) -> bool {
    let ratio = dot.dot.contrast / model.dot.contrast;
    let off = dot.dot.moments_px2 - moments;
    let tolerance = 4.0 * (0.03 * moments.trace()).hypot(0.2);
    0.5 < ratio && ratio < 2.0 && off.amax() < tolerance
}
