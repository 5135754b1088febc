//! From initial values to the joint minimum and its covariance, and the points and photographs left out of both.

use super::rows::{equations, n_rows};
use super::starts::{Draft, undetermined};
use super::state::{Layout, LensAt, State};
use super::trilaterate::{Places, lengths, plane_of};
use super::{Adjusted, Constraint, Frame, Item, NetworkProblem, gauge, snoop};
use crate::least_squares::Minimum;
use crate::least_squares::arrow::{ArrowEquations, ArrowInverse};
use crate::least_squares::dense::{MAX_STEPS, minimize_dense, minimize_dense_within};
use crate::locate::consistency::{is_unlikely, noise_scale};
use crate::{Error, Point};
use nalgebra::{DVector, Matrix3, SymmetricEigen, Vector3};

/// A point whose largest standard deviation exceeds this share of its distance from the camera is undetermined.
const LARGEST_SIGMA: f64 = 1.0 / 3.0;
/// Scaled information below which a direction counts as undetermined: rounding of a few hundred unknowns.
const LEAST_INFORMATION: f64 = 1e-12;

/// Adjusts a draft: drops what turns out to be undetermined and adjusts the rest again. With a limit `far_chi2`, gives up a draft that converges
/// slowly and is still above the limit.
pub(super) fn settle(
    network: &NetworkProblem,
    draft: Draft,
    far_chi2: Option<f64>,
) -> Result<Adjusted, Error> {
    let mut dropped = draft.dropped;
    let (mut state, mut faces) = (draft.state, false);
    loop {
        let items: Vec<Item> = dropped.iter().map(|d| d.0).collect();
        let anything = (0..network.camera_of_photo.len()).any(|p| !items.contains(&Item::Photo(p)));
        if !anything {
            return Err(dropped.into_iter().next().map_or(Error::NoLength, |d| d.1));
        }
        let (layout, frame) = gauge::layout(network, &state, &items, draft.control_points);
        let solved = lowest(network, &state, &layout, far_chi2);
        let Some(solved) = solved else {
            let (item, reason) = out_of_field(network, &state, &items)
                .ok_or(Error::NoSolution { n_points: network.n_points })?;
            dropped.push((item, reason));
            continue;
        };
        if solved.is_minimum()
            && !faces
            && let Some(turned) = gauge::facing_cameras(network, &solved.state, &layout, frame)
        {
            (state, faces) = (turned, true);
            continue;
        }
        let lost = match inverse(&solved.equations) {
            Err(direction) => blamed(&direction, &layout),
            Ok(covariance) => match weakest(network, &solved, &layout, &covariance) {
                None => return conclude(network, solved, layout, frame, covariance, dropped),
                lost => lost,
            },
        };
        let lost = lost.ok_or(Error::NotConverged { steps: solved.steps })?;
        dropped.push(lost);
        if solved.is_minimum() {
            state = solved.state;
        }
    }
}

type NetworkMinimum = Minimum<State, ArrowEquations>;

/// (steps, factor): after so many steps a draft whose χ² is still above the factor times the limit is given up.
const LOOKS: [(usize, f64); 2] = [(12, 100.0), (40, 1.0)];

/// Returns the minimum from a state; a state that has not converged where its χ² is far above the limit at one of the checks of `LOOKS`.
fn lowest(
    network: &NetworkProblem,
    state: &State,
    layout: &Layout,
    far_chi2: Option<f64>,
) -> Option<NetworkMinimum> {
    let within = |max_steps| {
        minimize_dense_within(
            max_steps,
            state.clone(),
            |s| equations(network.constraints, s, layout),
            |s, by| s.moved(layout, by),
        )
    };
    for (steps, times) in LOOKS {
        let Some(far_chi2) = far_chi2 else { break };
        let found = within(steps)?;
        if found.is_minimum() || times * far_chi2 < found.equations.chi2 {
            return Some(found);
        }
    }
    within(MAX_STEPS)
}

fn conclude(
    network: &NetworkProblem,
    solved: NetworkMinimum,
    layout: Layout,
    frame: Frame,
    covariance: ArrowInverse,
    mut undetermined: Vec<(Item, Error)>,
) -> Result<Adjusted, Error> {
    if !solved.is_minimum() {
        return Err(Error::NotConverged { steps: solved.steps });
    }
    undetermined.sort_by_key(|u| u.0);
    // The equations of the minimum itself, not those of the state one vanishing step before: the rows' shares then add up to the covariance.
    let last = equations(network.constraints, &solved.state, &layout).and_then(|last| inverse(&last).ok());
    let covariance = last.unwrap_or(covariance);
    let degrees_of_freedom = n_rows(network.constraints, &solved.state, &layout).saturating_sub(layout.n);
    let chi2 = solved.equations.chi2;
    let suspects = snoop::suspects(network.constraints, &solved.state, &layout, &covariance);
    let scale = noise_scale(chi2, degrees_of_freedom);
    Ok(Adjusted {
        state: solved.state,
        layout,
        constraints: network.constraints.to_vec(),
        left_out: Vec::new(),
        exchanged: Vec::new(),
        on_line: None,
        has_lost_control_points: false,
        covariance: covariance.scaled(scale),
        chi2,
        degrees_of_freedom,
        noise_scale: scale,
        is_inconsistent: is_unlikely(chi2, degrees_of_freedom),
        suspects,
        undetermined,
        alternative_delta_chi2: None,
        alternative: None,
        frame,
        steps: solved.steps,
    })
}

/// Returns H⁻¹; where H is singular, the direction that nothing determines, each unknown over its own scale.
fn inverse(equations: &ArrowEquations) -> Result<ArrowInverse, DVector<f64>> {
    let unit: Vec<f64> = equations.diagonal().iter().map(|d| d.sqrt().recip()).collect();
    let n = unit.len();
    if let Some(none) = unit.iter().position(|u| !u.is_finite()) {
        return Err(DVector::from_fn(n, |i, _| f64::from(u8::from(i == none))));
    }
    let scaled = equations.scaled(&unit);
    let is_known = scaled.factor(0.0).is_some_and(|factor| LEAST_INFORMATION < factor.least_pivot().powi(2));
    // Units change nothing but rounding in a factor.
    match equations.factor(0.0).filter(|_| is_known) {
        Some(factor) => Ok(factor.inverse()),
        None => {
            let eigen = SymmetricEigen::new(scaled.dense());
            Err(eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned())
        }
    }
}

/// Returns the point that an undetermined direction moves most; a photograph where no point moves.
fn blamed(direction: &DVector<f64>, layout: &Layout) -> Option<(Item, Error)> {
    let part = |at: &[Option<usize>]| at.iter().flatten().map(|i| direction[*i].powi(2)).sum::<f64>();
    let points = layout.point.iter().enumerate().map(|(i, at)| (part(at), Item::Point(i)));
    let photos = layout.photo.iter().enumerate().map(|(i, at)| {
        let all: Vec<Option<usize>> = (0..6).map(|k| at.map(|at| at + k)).collect();
        (part(&all), Item::Photo(i))
    });
    let tilts = layout
        .tilt
        .iter()
        .enumerate()
        .map(|(i, at)| (part(&[*at, at.map(|a| a + 1), layout.height[i]]), Item::Plane(i)));
    let (share, item) = points.chain(photos).chain(tilts).max_by(|a, b| a.0.total_cmp(&b.0))?;
    let reason = "the constraints leave a direction of it free; mark it in another photograph, or add a distance or coordinates";
    let why = match item {
        Item::Point(i) => undetermined("point", i, reason, 0.0, 1.0),
        Item::Photo(i) => undetermined("photo", i, reason, 0.0, 1.0),
        Item::Plane(i) => undetermined("plane", i, reason, 0.0, 1.0),
    };
    (0.0 < share).then_some((item, why))
}

/// Returns the least determined point, if its uncertainty is too large for a position.
fn weakest(
    network: &NetworkProblem,
    solved: &NetworkMinimum,
    layout: &Layout,
    covariance: &ArrowInverse,
) -> Option<(Item, Error)> {
    let mut nearest = vec![f64::INFINITY; network.n_points];
    for constraint in network.constraints {
        let Constraint::ImagePoint { photo, point, .. } = constraint else { continue };
        if layout.has_photo(*photo) {
            let distance = (solved.state.points[*point] - solved.state.photos[*photo].origin()).norm();
            nearest[*point] = distance.min(nearest[*point]);
        }
    }
    let relative = |point: usize| {
        let at = layout.point[point];
        let block = Matrix3::from_fn(|i, j| match (at[i], at[j]) {
            (Some(i), Some(j)) => covariance.at(i, j),
            _ => 0.0,
        });
        let sigma = block.symmetric_eigenvalues().max().max(0.0).sqrt();
        nearest[point].is_finite().then(|| (sigma / nearest[point], point))
    };
    let all = (0..network.n_points).filter(|p| layout.has_point(*p));
    let (worst, point) = all.filter_map(relative).max_by(|a, b| a.0.total_cmp(&b.0))?;
    let reason = "its standard deviation is too large a part of its distance from the camera; mark it in a photograph from farther aside";
    (LARGEST_SIGMA < worst)
        .then(|| (Item::Point(point), undetermined("point", point, reason, worst, LARGEST_SIGMA)))
}

/// Returns a point outside the field of a photograph that shows it.
fn out_of_field(network: &NetworkProblem, state: &State, dropped: &[Item]) -> Option<(Item, Error)> {
    network.constraints.iter().find_map(|f| {
        let Constraint::ImagePoint { photo, point, .. } = f else { return None };
        if dropped.contains(&Item::Photo(*photo)) || dropped.contains(&Item::Point(*point)) {
            return None;
        }
        let x = state.photos[*photo] * state.points[*point];
        let camera = &state.lenses[state.camera_of_photo[*photo]].camera;
        let reason =
            "its place lies behind a photograph that shows it, or outside its lens; check its image points";
        camera
            .project(&x)
            .is_none()
            .then(|| (Item::Point(*point), undetermined("point", *point, reason, x.z, 0.0)))
    })
}

/// Checks whether the mutual distances alone agree, before any photograph is used.
pub(super) fn check_distances(network: &NetworkProblem, control_points: &Places) -> Result<(), Error> {
    let is_laid = |p: usize| control_points[p].is_some();
    let used: Vec<usize> =
        lengths(network).iter().filter(|(_, l)| l.ends.iter().all(|p| is_laid(*p))).map(|l| l.0).collect();
    if gauge::is_given(network) || used.is_empty() {
        return Ok(());
    }
    let constraints: Vec<Constraint> = used.iter().map(|i| network.constraints[*i]).collect();
    let Some(frame) = gauge::frame_control_points(control_points) else { return Ok(()) };
    let planes = plane_of(network);
    let state = State {
        photos: Vec::new(),
        points: in_frame(control_points, frame),
        planes: Vec::new(),
        lenses: Vec::<LensAt>::new(),
        camera_of_photo: Vec::new(),
    };
    let only = NetworkProblem {
        cameras: &[],
        camera_of_photo: &[],
        planes: &[],
        constraints: &constraints,
        ..*network
    };
    let dropped: Vec<Item> = (0..network.n_points).filter(|p| !is_laid(*p)).map(Item::Point).collect();
    let [a, b, c] = frame;
    let mut held = vec![(a, 0), (a, 1), (a, 2), (b, 1), (b, 2), (c, 2)];
    let is_flat = planes[a].is_some() && [b, c].iter().all(|p| planes[*p] == planes[a]);
    held.extend((0..network.n_points).filter(|p| is_flat && planes[*p] == planes[a]).map(|p| (p, 2)));
    let layout = Layout::new(&only, &state, &dropped, &held);
    let solved = minimize_dense(state, |s| equations(&constraints, s, &layout), |s, by| s.moved(&layout, by));
    let Some(solved) = solved.filter(|s| s.is_minimum()) else { return Ok(()) };
    let degrees_of_freedom = constraints.len().saturating_sub(layout.n);
    if !is_unlikely(solved.equations.chi2, degrees_of_freedom) {
        return Ok(());
    }
    let Ok(covariance) = inverse(&solved.equations) else { return Ok(()) };
    match snoop::suspects(&constraints, &solved.state, &layout, &covariance).first() {
        Some(worst) => Err(Error::InconsistentDistances {
            constraint: used[worst.constraint],
            off_m: worst.off,
            sigmas: worst.sigmas,
        }),
        None => Ok(()),
    }
}

/// Returns the positions in the frame of three control points.
fn in_frame(control_points: &Places, [a, b, c]: [usize; 3]) -> Vec<Point> {
    let at = |p: usize| control_points[p].unwrap_or_default();
    let x: Vector3<f64> = (at(b) - at(a)).normalize();
    let z = x.cross(&(at(c) - at(a))).normalize();
    let rotation = Matrix3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()]);
    (0..control_points.len()).map(|p| rotation * (at(p) - at(a))).collect()
}
