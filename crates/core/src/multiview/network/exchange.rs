//! What was exchanged, where a network contradicts itself: two labels of a photograph, its columns and rows, its top and bottom, or the axes of the
//! control points. An exchange is named where it makes everything agree.

use super::{Constraint, NetworkProblem};
use crate::{Pixel, Point};
use nalgebra::Vector3;

/// Numbers of a network that are exchanged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exchange {
    /// The labels of two points of a photograph.
    Labels {
        /// Index of the photograph.
        photo: usize,
        /// Index of one point.
        a: usize,
        /// Index of the other point.
        b: usize,
    },
    /// u and v of all image points of a photograph.
    Columns {
        /// Index of the photograph.
        photo: usize,
    },
    /// Top and bottom of a photograph: v of its image points is counted upwards.
    TopAndBottom {
        /// Index of the photograph.
        photo: usize,
    },
    /// x and y of all control points.
    ControlPoints,
}

/// The number of photographs whose image points are exchanged as a whole.
const MOST_PHOTOS: usize = 12;
/// More exchanges that make everything agree say nothing.
const MOST_TIED: usize = 2;
/// The number of pairs of labels that are tried: each is an adjustment.
const MOST_PAIRS: usize = 30;
/// Two exchanges whose χ² differ by less than this cannot be distinguished.
const TIED_CHI2: f64 = 9.0;

/// Two image points of one photograph: constraint, photograph, point.
struct Pair {
    first: (usize, usize, usize),
    second: (usize, usize, usize),
    n_control_points: usize,
    n_suspected: usize,
}

/// Exchanges that explain a contradiction, and the constraints with the first of them.
type Exchanged = (Vec<Exchange>, Vec<Constraint>);

/// Returns the exchange that makes everything agree; none where no exchange or several of them do. `suspected` are constraints that may be wrong;
/// `is_explained` says that one of them alone explains the contradiction, so that only exchanges of its label are tried. `chi2` returns that of a
/// network whose constraints agree.
pub(super) fn exchanged(
    network: &NetworkProblem,
    suspected: &[usize],
    is_explained: bool,
    chi2: impl Fn(&NetworkProblem) -> Option<f64>,
) -> Option<Exchanged> {
    let of_labels = labels(network, suspected, is_explained, &chi2);
    of_labels.or_else(|| if is_explained { None } else { wholes(network, chi2) })
}

/// Exchanges a whole photograph, or the axes of all control points. Of two photographs, each may be the one that is upside down: both are named.
fn wholes(network: &NetworkProblem, chi2: impl Fn(&NetworkProblem) -> Option<f64>) -> Option<Exchanged> {
    let photos = 0..network.camera_of_photo.len().min(MOST_PHOTOS);
    let of_photo = |photo| [Exchange::Columns { photo }, Exchange::TopAndBottom { photo }];
    let tried = photos.flat_map(of_photo).chain([Exchange::ControlPoints]);
    let attempt = |exchange: Exchange| {
        let constraints: Option<Vec<Constraint>> =
            network.constraints.iter().map(|constraint| exchange.applied(network, constraint)).collect();
        let constraints = constraints.filter(|changed| changed[..] != *network.constraints)?;
        let chi2 = chi2(&NetworkProblem { constraints: &constraints, ..*network })?;
        Some((chi2, exchange, constraints))
    };
    let mut found: Vec<(f64, Exchange, Vec<Constraint>)> = tried.filter_map(attempt).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let least = found.first()?.0;
    found.retain(|(chi2, ..)| *chi2 < least + TIED_CHI2);
    let exchanged: Vec<Exchange> = found.iter().map(|(_, exchange, _)| *exchange).collect();
    let (.., constraints) = found.into_iter().next().filter(|_| exchanged.len() <= MOST_TIED)?;
    Some((exchanged, constraints))
}

impl Exchange {
    /// Returns a constraint with the exchange; none where the size of the photograph is needed and unknown.
    fn applied(self, network: &NetworkProblem, constraint: &Constraint) -> Option<Constraint> {
        let mut changed = *constraint;
        match (&mut changed, self) {
            (
                Constraint::ImagePoint { photo, pixel, covariance_px2, .. },
                Exchange::Columns { photo: whole },
            ) if *photo == whole => {
                *pixel = Pixel::new(pixel.y, pixel.x);
                *covariance_px2 = covariance_px2.with_axes_exchanged();
            }
            (Constraint::ImagePoint { photo, pixel, .. }, Exchange::TopAndBottom { photo: whole })
                if *photo == whole =>
            {
                let camera = network.cameras.get(*network.camera_of_photo.get(whole)?)?.camera;
                pixel.y = f64::from(camera.size?.height_px) - 1.0 - pixel.y;
            }
            (Constraint::Place { x_in_world, sigma_m, .. }, Exchange::ControlPoints) => {
                *x_in_world = Point::new(x_in_world.y, x_in_world.x, x_in_world.z);
                *sigma_m = Vector3::new(sigma_m.y, sigma_m.x, sigma_m.z);
            }
            _ => {}
        }
        Some(changed)
    }
}

/// Exchanges those two labels that make everything agree.
fn labels(
    network: &NetworkProblem,
    suspected: &[usize],
    is_explained: bool,
    chi2: &impl Fn(&NetworkProblem) -> Option<f64>,
) -> Option<Exchanged> {
    let mut pairs = pairs(network, suspected);
    pairs.retain(|pair| !is_explained || 0 < pair.n_suspected);
    // Control points come first because they determine the pose of the photograph.
    pairs.sort_by_key(|pair| (2 - pair.n_control_points, 2 - pair.n_suspected));
    pairs.truncate(MOST_PAIRS);
    let attempt = |pair: &Pair| {
        let mut constraints = network.constraints.to_vec();
        exchange(&mut constraints, pair.first.0, pair.second.0);
        let chi2 = chi2(&NetworkProblem { constraints: &constraints, ..*network })?;
        let (a, b) = (pair.first.2.min(pair.second.2), pair.first.2.max(pair.second.2));
        Some((chi2, (vec![Exchange::Labels { photo: pair.first.1, a, b }], constraints)))
    };
    let mut tiers = pairs.chunk_by(|a, b| a.n_control_points == b.n_control_points);
    let mut found: Vec<(f64, Exchanged)> = tiers.find_map(|tier| {
        let found: Vec<_> = tier.iter().filter_map(attempt).collect();
        (!found.is_empty()).then_some(found)
    })?;
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let is_alone = found.get(1).is_none_or(|second| found[0].0 + TIED_CHI2 < second.0);
    found.into_iter().next().filter(|_| is_alone).map(|(_, exchanged)| exchanged)
}

fn pairs(network: &NetworkProblem, suspected: &[usize]) -> Vec<Pair> {
    let image_points: Vec<(usize, usize, usize)> =
        network.constraints.iter().enumerate().filter_map(image_point).collect();
    let is_control_point = |p: usize| {
        let mut of_point = network.constraints.iter().filter(|f| f.points().contains(&Some(p)));
        of_point.any(|f| matches!(f, Constraint::Place { .. } | Constraint::Distance { .. }))
    };
    let count = |is: &dyn Fn(&(usize, usize, usize)) -> bool, both: [&(usize, usize, usize); 2]| {
        both.into_iter().filter(|point| is(point)).count()
    };
    let pair = |first: &(usize, usize, usize), second: &(usize, usize, usize)| Pair {
        first: *first,
        second: *second,
        n_control_points: count(&|point| is_control_point(point.2), [first, second]),
        n_suspected: count(&|point| suspected.contains(&point.0), [first, second]),
    };
    let of_first = |(n, first): (usize, &(usize, usize, usize))| -> Vec<Pair> {
        let others = image_points[n + 1..].iter().filter(|other| other.1 == first.1 && other.2 != first.2);
        others.map(|second| pair(first, second)).collect()
    };
    image_points.iter().enumerate().flat_map(of_first).collect()
}

/// Returns index, photograph and point of an image point.
fn image_point((index, constraint): (usize, &Constraint)) -> Option<(usize, usize, usize)> {
    match constraint {
        Constraint::ImagePoint { photo, point, .. } => Some((index, *photo, *point)),
        _ => None,
    }
}

fn exchange(constraints: &mut [Constraint], first: usize, second: usize) {
    let pixel_of = |constraint: &Constraint| match constraint {
        Constraint::ImagePoint { pixel, .. } => Some(*pixel),
        _ => None,
    };
    let pixels = [pixel_of(&constraints[second]), pixel_of(&constraints[first])];
    for (index, new) in [first, second].into_iter().zip(pixels) {
        if let (Constraint::ImagePoint { pixel, .. }, Some(new)) = (&mut constraints[index], new) {
            *pixel = new;
        }
    }
}
