//! Brings observations into the canonical order of a [`NamedRig`].

use super::names::natural;
use super::{NamedRig, NamedTarget};
use crate::core::Correspondence;
use crate::core::multiview::rig::Observation;
use crate::formats::NamedCamera;
use std::cmp::Ordering;
use std::collections::BTreeMap;

/// The points of one target in one frame of one camera.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedObservation {
    /// Index into the given cameras.
    pub camera: usize,
    /// Name of its view.
    pub view: String,
    /// Index into the given targets.
    pub target: usize,
    /// When its frame was taken, s.
    pub t_s: Option<f64>,
    /// Its points by name, in any order.
    pub points: Vec<(String, Correspondence)>,
}

/// A rig, and the names of its indices.
#[derive(Debug, Clone, PartialEq)]
pub struct Gathered {
    /// The rig, as input of the solver.
    pub rig: NamedRig,
    /// For each observation: the view in which it was taken (that of a target at rest is not the rig's view of it).
    pub taken_in: Vec<String>,
    /// For each observation: when it was taken, s.
    pub stamps_s: Vec<Option<f64>>,
    /// For each observation: the names of its points.
    pub points: Vec<Vec<String>>,
    /// The view that holds all observations of the target at rest.
    pub world_view: Option<usize>,
}

/// An observation with its new indices, and its points.
struct Found {
    view: usize,
    camera: usize,
    target: usize,
    taken_in: String,
    t_s: Option<f64>,
    points: Vec<(String, Correspondence)>,
}

/// Sorts everything by name: the rig is the same, to the bit, for any order of cameras, targets, observations and points.
///
/// Observations of the same camera, view and target are joined; those without points are dropped. The target `world` does not move relative to
/// the cameras, so that all its observations form one view of its own, after all others.
pub fn gather(
    cameras: Vec<NamedCamera>,
    targets: Vec<NamedTarget>,
    observations: Vec<NamedObservation>,
    world: Option<usize>,
) -> Gathered {
    let (cameras, camera_numbers) = sorted(cameras, |camera| &camera.name);
    let (targets, target_numbers) = sorted(targets, |target| &target.name);
    let targets = bodies_in_order(targets);
    let seen: Vec<NamedObservation> =
        observations.into_iter().filter(|observation| !observation.points.is_empty()).collect();
    let (mut views, numbers) = view_numbers(&seen, world);
    let world_view = seen.iter().any(|g| Some(g.target) == world).then_some(views.len());
    if world_view.is_some() {
        views.push(unused_name(&views));
    }
    let number = |observation: NamedObservation| Found {
        view: match world_view {
            Some(view) if Some(observation.target) == world => view,
            _ => numbers[&observation.view],
        },
        camera: camera_numbers[observation.camera],
        target: target_numbers[observation.target],
        taken_in: observation.view,
        t_s: observation.t_s,
        points: observation.points,
    };
    let found = in_order(seen.into_iter().map(number).collect());
    let mut gathered = Gathered {
        rig: NamedRig {
            lenses: cameras.iter().map(|c| c.camera.clone()).collect(),
            body_of_target: targets.iter().map(|t| t.body).collect(),
            cameras,
            views,
            targets,
            observations: Vec::with_capacity(found.len()),
        },
        taken_in: Vec::with_capacity(found.len()),
        stamps_s: Vec::with_capacity(found.len()),
        points: Vec::with_capacity(found.len()),
        world_view,
    };
    found.into_iter().for_each(|observation| gathered.push(observation));
    gathered
}

impl Gathered {
    fn push(&mut self, found: Found) {
        let Found { view, camera, target, taken_in, t_s, points } = found;
        let (names, seen) = points.into_iter().unzip();
        self.rig.observations.push(Observation { camera, view, target, seen });
        self.points.push(names);
        self.taken_in.push(taken_in);
        self.stamps_s.push(t_s);
    }
}

/// Returns the items sorted by name, and the new index of each old one.
fn sorted<T>(items: Vec<T>, name: impl Fn(&T) -> &str) -> (Vec<T>, Vec<usize>) {
    let mut numbered: Vec<(usize, T)> = items.into_iter().enumerate().collect();
    numbered.sort_by(|a, b| natural(name(&a.1), name(&b.1)));
    let mut numbers = vec![0; numbered.len()];
    numbered.iter().enumerate().for_each(|(new, (old, _))| numbers[*old] = new);
    (numbered.into_iter().map(|(_, item)| item).collect(), numbers)
}

/// Numbers the bodies in the order of their first targets.
fn bodies_in_order(targets: Vec<NamedTarget>) -> Vec<NamedTarget> {
    let mut numbers = BTreeMap::new();
    let renumbered = targets.into_iter().map(|target| {
        let n = numbers.len();
        let body = *numbers.entry(target.body).or_insert(n);
        NamedTarget { body, ..target }
    });
    renumbered.collect()
}

/// Returns the views in order, and the index of each name; observations of the target at rest need none.
fn view_numbers(seen: &[NamedObservation], world: Option<usize>) -> (Vec<String>, BTreeMap<String, usize>) {
    let moving = seen.iter().filter(|observation| Some(observation.target) != world);
    let mut views: Vec<String> = moving.map(|observation| observation.view.clone()).collect();
    views.sort_by(|a, b| natural(a, b));
    views.dedup();
    let numbers = views.iter().cloned().zip(0..).collect();
    (views, numbers)
}

/// Returns `world`, or a similar name that is not that of another view.
fn unused_name(views: &[String]) -> String {
    let mut name = "world".to_string();
    while views.contains(&name) {
        name.push('\'');
    }
    name
}

/// Sorts by camera, view, target and frame; the points of one frame are joined and sorted.
fn in_order(mut found: Vec<Found>) -> Vec<Found> {
    let key = |f: &Found| (f.view, f.camera, f.target);
    found.sort_by(|a, b| key(a).cmp(&key(b)).then_with(|| natural(&a.taken_in, &b.taken_in)));
    let mut joined: Vec<Found> = Vec::with_capacity(found.len());
    for next in found {
        match joined.last_mut() {
            Some(last) if key(last) == key(&next) && last.taken_in == next.taken_in => {
                last.points.extend(next.points);
            }
            _ => joined.push(next),
        }
    }
    joined.iter_mut().for_each(|observation| observation.points.sort_by(by_name_then_place));
    joined
}

fn by_name_then_place(a: &(String, Correspondence), b: &(String, Correspondence)) -> Ordering {
    let numbers =
        |c: &Correspondence| [c.pixel.x, c.pixel.y, c.x_in_target.x, c.x_in_target.y, c.x_in_target.z];
    let pairs = numbers(&a.1).into_iter().zip(numbers(&b.1));
    pairs.fold(natural(&a.0, &b.0), |order, (x, y)| order.then(x.total_cmp(&y)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::{Camera, Pixel, Point};

    fn camera(name: &str) -> NamedCamera {
        NamedCamera {
            name: name.into(),
            camera: Camera::normalized(),
            placement: None,
            intrinsics_covariance: None,
        }
    }

    fn target(name: &str, body: usize) -> NamedTarget {
        NamedTarget { name: name.into(), target: None, body }
    }

    fn point(name: &str, u: f64) -> (String, Correspondence) {
        let place = Point::new(u, 0.0, 0.0);
        let seen = Correspondence::new(&Camera::normalized(), place, Pixel::new(u, 0.1), 0.5);
        (name.to_string(), seen.unwrap())
    }

    fn observation(camera: usize, view: &str, target: usize, points: &[(&str, f64)]) -> NamedObservation {
        let points = points.iter().map(|(name, u)| point(name, *u)).collect();
        NamedObservation { camera, view: view.into(), target, t_s: None, points }
    }

    #[test]
    fn any_order_gives_the_same_rig() {
        let straight = gather(
            vec![camera("a"), camera("b"), camera("b10")],
            vec![target("x", 0), target("y", 1)],
            vec![
                observation(0, "2", 0, &[("0", 0.1), ("1", 0.2)]),
                observation(1, "2", 0, &[("0", 0.3)]),
                observation(2, "10", 1, &[("10", 0.3), ("9", 0.2)]),
                observation(2, "10", 1, &[]),
            ],
            None,
        );
        let shuffled = gather(
            vec![camera("b10"), camera("b"), camera("a")],
            vec![target("y", 4), target("x", 2)],
            vec![
                observation(1, "2", 1, &[("0", 0.3)]),
                observation(0, "10", 0, &[("9", 0.2)]),
                observation(2, "2", 1, &[("1", 0.2)]),
                observation(0, "10", 0, &[("10", 0.3)]),
                observation(2, "2", 1, &[("0", 0.1)]),
            ],
            None,
        );
        assert_eq!(straight, shuffled);
        assert_eq!(straight.rig.views, ["2", "10"]);
        assert_eq!(straight.points[2], ["9", "10"]);
        assert_eq!(straight.rig.body_of_target, [0, 1]);
    }

    /// Two targets of one body keep it; the world's observations stay apart but share a view.
    #[test]
    fn the_world_is_one_view() {
        let gathered = gather(
            vec![camera("a")],
            vec![target("w", 7), target("p", 3), target("q", 3)],
            vec![
                observation(0, "1", 0, &[("0", 0.1)]),
                observation(0, "2", 0, &[("0", 0.2)]),
                observation(0, "2", 1, &[("0", 0.2)]),
                observation(0, "world", 2, &[("0", 0.2)]),
            ],
            Some(0),
        );
        assert_eq!(gathered.rig.views, ["2", "world", "world'"]);
        assert_eq!(gathered.world_view, Some(2));
        assert_eq!(gathered.rig.body_of_target, [0, 0, 1]);
        let of_world: Vec<&str> = gathered
            .rig
            .observations
            .iter()
            .zip(&gathered.taken_in)
            .filter(|(s, _)| s.view == 2)
            .map(|(_, v)| v.as_str())
            .collect();
        assert_eq!(of_world, ["1", "2"]);
    }
}
