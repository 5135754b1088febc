//! Compares the points of a frame with those of the frame before and of kept views.

use crate::core::{Correspondence, Pixel};
use nalgebra::Complex;
use std::collections::HashMap;

/// Views whose points are closer to each other, as a share of the image's longer side (root mean square), show the target at nearly the same
/// place: a tilt of some 15°.
pub(super) const APART: f64 = 0.03;
/// Views whose points agree as well after one was moved, rotated and scaled in the image show the target with the same tilt.
pub(super) const TILTED: f64 = 0.01;
/// Views are compared if they share at least this part of the points of either.
const SHARED: f64 = 0.5;

/// The points of a view with their names.
pub(super) type Seen<'a> = &'a [(String, Correspondence)];

/// The points of a frame by name.
#[derive(Debug, Clone)]
pub(super) struct Points {
    all: Vec<(String, Correspondence)>,
    index: HashMap<String, usize>,
}

impl Points {
    pub(super) fn new(points: &[(String, Correspondence)]) -> Self {
        let index = points.iter().enumerate().map(|(i, (name, _))| (name.clone(), i)).collect();
        Points { all: points.to_vec(), index }
    }

    pub(super) fn len(&self) -> usize {
        self.all.len()
    }

    pub(super) fn pixels(&self) -> Vec<[f64; 2]> {
        self.all.iter().map(|(_, c)| c.pixel.into()).collect()
    }

    pub(super) fn correspondences(&self) -> Vec<Correspondence> {
        self.all.iter().map(|(_, c)| *c).collect()
    }

    pub(super) fn median_sigma_px(&self) -> f64 {
        median(self.all.iter().map(|(_, c)| c.sigma_px).collect()).unwrap_or(0.0)
    }

    /// Returns the median distance of the points from those of another frame; `None` where they share no point.
    pub(super) fn median_motion_px(&self, other: &Points) -> Option<f64> {
        median(self.shared(&other.all).map(|[a, b]| (a - b).norm()).collect())
    }

    /// Returns the pixels of the points that a view has too, in this frame and in that view.
    fn shared<'a>(&'a self, view: Seen<'a>) -> impl Iterator<Item = [Pixel; 2]> + 'a {
        let own = move |name: &String| self.index.get(name).map(|i| self.all[*i].1.pixel);
        view.iter().filter_map(move |(name, c)| Some([own(name)?, c.pixel]))
    }

    /// Returns the same where enough points are shared for a comparison.
    fn compared(&self, view: Seen) -> Option<Vec<[Pixel; 2]>> {
        let pairs: Vec<_> = self.shared(view).collect();
        let most = self.len().max(view.len()) as f64;
        (0.0 < most && SHARED * most <= pairs.len() as f64).then_some(pairs)
    }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Returns the view whose points are nearest, and their root mean square distance, px.
pub(super) fn nearest(points: &Points, views: &[Seen]) -> Option<(usize, f64)> {
    least(points, views, |pairs| rms(pairs.iter().map(|[a, b]| (a - b).norm_squared())))
}

/// Returns the view whose points are nearest after the best motion, rotation and scaling in the image, and their root mean square distance.
pub(super) fn same_tilt(points: &Points, views: &[Seen]) -> Option<(usize, f64)> {
    least(points, views, after_similarity)
}

fn least(points: &Points, views: &[Seen], distance: impl Fn(&[[Pixel; 2]]) -> f64) -> Option<(usize, f64)> {
    let compared = views.iter().enumerate().filter_map(|(i, view)| Some((i, points.compared(view)?)));
    compared.map(|(i, pairs)| (i, distance(&pairs))).min_by(|a, b| a.1.total_cmp(&b.1))
}

fn rms(squares: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = squares.len().max(1) as f64;
    (squares.sum::<f64>() / n).sqrt()
}

/// As complex numbers z about their means, a similarity is a factor: the best one from z to w is Σ z̄ w / Σ |z|².
fn after_similarity(pairs: &[[Pixel; 2]]) -> f64 {
    let complex = |i: usize| -> Vec<Complex<f64>> {
        let mean = pairs.iter().map(|pair| pair[i]).sum::<Pixel>() / pairs.len().max(1) as f64;
        pairs.iter().map(|pair| Complex::new(pair[i].x - mean.x, pair[i].y - mean.y)).collect()
    };
    let (z, w) = (complex(1), complex(0));
    let across: Complex<f64> = z.iter().zip(&w).map(|(z, w)| z.conj() * w).sum();
    let extent: f64 = z.iter().map(Complex::norm_sqr).sum();
    let factor = if 0.0 < extent { across / extent } else { Complex::new(0.0, 0.0) };
    rms(z.iter().zip(&w).map(|(z, w)| (w - factor * z).norm_sqr()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::{Camera, Point};

    fn points(pixel: impl Fn(f64, f64) -> [f64; 2]) -> Vec<(String, Correspondence)> {
        let camera = Camera::normalized();
        let one = |i: usize| {
            let (x, y) = ((i % 5) as f64, (i / 5) as f64);
            let [u, v] = pixel(x, y);
            let c = Correspondence::new(&camera, Point::new(x, y, 0.0), Pixel::new(u, v), 0.1).unwrap();
            (i.to_string(), c)
        };
        (0..20).map(one).collect()
    }

    /// A view that was moved, rotated by 30° and halved has the same tilt; one that is foreshortened has not.
    #[test]
    fn a_similarity_is_no_tilt() {
        let first = points(|x, y| [40.0 * x, 40.0 * y]);
        let (s, c) = 30f64.to_radians().sin_cos();
        let moved = Points::new(&points(|x, y| [20.0 * (c * x - s * y) + 300.0, 20.0 * (s * x + c * y)]));
        let tilted = Points::new(&points(|x, y| [30.0 * x, 40.0 * y]));
        assert!(same_tilt(&moved, &[&first]).unwrap().1 < 1e-9);
        assert!(100.0 < nearest(&moved, &[&first]).unwrap().1);
        assert!(5.0 < same_tilt(&tilted, &[&first]).unwrap().1);
    }

    /// Views that share few points are not compared; the median motion is that of most points.
    #[test]
    fn comparisons_need_shared_points() {
        let all = points(|x, y| [40.0 * x, 40.0 * y]);
        assert!(nearest(&Points::new(&all[..9]), &[&all]).is_none());
        assert_eq!(nearest(&Points::new(&all[..12]), &[&all]), Some((0, 0.0)));
        let moved = Points::new(&points(|x, y| [40.0 * x + 3.0, 40.0 * y + 4.0]));
        assert_eq!(moved.median_motion_px(&Points::new(&all)), Some(5.0));
    }
}
