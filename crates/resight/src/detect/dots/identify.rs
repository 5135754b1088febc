//! Which four dots are the target? Every explanation is tested, and accepted only if chance would hardly give it.
//!
//! A simple ratio on a line is not kept by perspective, so nothing is thrown away on the ratio alone: it tells the depth
//! ratio k of the line's ends, which must be plausible and must agree with the dots' shapes. What counts in the end is
//! the number of false alarms (A. Desolneux, L. Moisan, J.-M. Morel, 2000): how many explanations as good as this one
//! this many dots of such shapes would give when strewn at random; dots.md eqs. (18)–(20).
//! Cost: at most `MAX_DOTS` dots of a polarity, so at most MAX_DOTS³/2 triples, `MAX_TRIPLES` of which are tried with
//! every fourth dot, `MAX_FITS` of these in full.

use super::layout::{self, Fit, Layout, ViewDot};
use super::view::View;
use nalgebra::Matrix2;

/// Dots of one polarity that take part, the most conspicuous first.
pub(super) const MAX_DOTS: usize = 160;
const MAX_TRIPLES: usize = 3000;
const MAX_FITS: usize = 12_000;

/// Depth of one dot over that of another on the line, and over the line's own depth.
const MAX_LN_DEPTH: f64 = 0.9;
/// Largest χ² of the 9 degrees of freedom of the shapes; exceeded by 1 in 700 when the tolerances are right.
const MAX_SHAPE_CHI2: f64 = 27.0;
/// Largest χ² of a place against line or circle: 4 σ.
const MAX_PLACE_CHI2: f64 = 16.0;
/// Another explanation of the same dots within this many decades: then nothing can be said.
const RIVAL_DECADES: f64 = 1.5;
/// Straight lines in an image of an unknown lens bow by up to this part of their length.
const UNKNOWN_LENS_BOW: f64 = 0.003;

/// Four dots explained as the target.
#[derive(Debug, Clone, Copy)]
pub(super) struct Explanation {
    /// Indices of the dots, in the order of `Layout::ids`.
    pub dots: [usize; 4],
    /// log₁₀ of the number of such explanations expected by chance in this image.
    pub log10_false_alarms: f64,
    /// The same, worsened by the misfit: for ranking.
    pub score: f64,
    /// Place and shape.
    pub fit: Fit,
}

/// Three dots on a line.
struct Triple {
    ends: [usize; 2],
    middle: usize,
    /// Place of the middle between the ends.
    t: f64,
    off_px: f64,
}

/// What is looked for, where.
pub(super) struct Search<'a> {
    pub layout: &'a Layout,
    pub view: &'a View<'a>,
    pub image_area_px2: f64,
    pub max_log10_false_alarms: f64,
}

impl Search<'_> {
    /// All acceptable explanations that contradict no other, best first. `dots` are of one polarity.
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
                fits += 1;
                found.extend(self.explain(dots, order, k, triple.off_px));
            }
        }
        self.without_rivals(found)
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
                    // The middle's own place and the line's place there: together at most √2 of a single sigma.
                    let sigma = std::f64::consts::SQRT_2 * b.place_sigma_px() + bow * length * b.scale_px;
                    if off_px * off_px <= MAX_PLACE_CHI2 * sigma * sigma && alike(a, b) && alike(b, c) {
                        triples.push(Triple { ends: [i, j], middle: m, t, off_px });
                    }
                }
            }
        }
        if MAX_TRIPLES < triples.len() {
            triples.sort_by(|a, b| a.off_px.total_cmp(&b.off_px));
            triples.truncate(MAX_TRIPLES);
        }
        triples
    }

    /// The order of the dots in which the target is seen from its front, and k; none when the ratio or the distance of
    /// the fourth would need an absurd perspective.
    fn order(&self, dots: &[ViewDot], triple: &Triple, fourth: usize) -> Option<([usize; 4], f64)> {
        let [i, j] = triple.ends;
        let along = dots[j].y - dots[i].y;
        let side = along.perp(&(dots[fourth].y - dots[i].y));
        // Seen from the front x × y of the target points away from the camera, as u × v of the image does.
        let forward = 0.0 < side * self.layout.off[1];
        let (start, end, t) = if forward { (i, j, triple.t) } else { (j, i, 1.0 - triple.t) };
        let k = layout::end_depth(self.layout.r, t);
        let across = side.abs() / along.norm_squared() / self.layout.off[1].abs();
        let plausible = k.ln().abs() < MAX_LN_DEPTH && 0.1 < across && across < 10.0;
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
        if self.max_log10_false_alarms + RIVAL_DECADES < alarms {
            return None;
        }
        let chi2 = fit.chi2 + rigid.map_or(0.0, |r| r.chi2) + (off_px / four[1].place_sigma_px()).powi(2);
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
        let mut trials = 2.0;
        for (i, moments) in fit.moments_px2.iter().enumerate() {
            let similar = dots.iter().filter(|d| same_shape(d, &four[i], moments)).count();
            trials *= (similar.saturating_sub(i)).max(1) as f64;
        }
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
        let part = |area: f64| (area / self.image_area_px2).min(1.0).log10();
        f64::log10(trials) + part(middle) + part(fourth)
    }

    /// Best first; of explanations that share dots only the best, and none if a rival is nearly as good.
    fn without_rivals(&self, mut found: Vec<Explanation>) -> Vec<Explanation> {
        found.sort_by(|a, b| a.score.total_cmp(&b.score));
        let mut kept: Vec<(Explanation, bool)> = Vec::new();
        for e in found {
            let shares = |k: &&mut (Explanation, bool)| k.0.dots.iter().any(|i| e.dots.contains(i));
            let mut taken = false;
            for (better, sure) in kept.iter_mut().filter(|k| shares(&k)) {
                taken = true;
                if e.score - better.score < RIVAL_DECADES {
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

/// Whether two dots may belong to one target at all: brightness within 3:1, area within 16:1.
fn alike(a: &ViewDot, b: &ViewDot) -> bool {
    let within = |x: f64, y: f64, ratio: f64| x <= ratio * y && y <= ratio * x;
    within(a.dot.contrast.abs(), b.dot.contrast.abs(), 3.0) && within(a.radius_px, b.radius_px, 4.0)
}

/// Whether chance could have taken this dot for another: moments within 4 tolerances, contrast within 2:1.
fn same_shape(dot: &ViewDot, model: &ViewDot, moments: &Matrix2<f64>) -> bool {
    let ratio = dot.dot.contrast / model.dot.contrast;
    let off = dot.dot.moments_px2 - moments;
    let tolerance = 4.0 * (0.03 * moments.trace()).hypot(0.2);
    0.5 < ratio && ratio < 2.0 && off.amax() < tolerance
}
