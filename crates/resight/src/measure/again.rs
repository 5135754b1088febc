//! Reuses answers of an earlier scene where the scenes differ only in points on which an answer does not depend.

use super::scene::{NamedQuery, NamedScene};
use crate::core::multiview::network::{Adjusted, Constraint, NetworkStatus};
use std::collections::HashMap;

/// The constraints on one point, in the order of the scene.
type About<'a> = Vec<&'a Constraint>;

/// A solved scene, whose answers are reused where a new scene agrees with it.
pub(super) struct Known<'a> {
    now: Parts<'a>,
    before: Parts<'a>,
}

/// A scene, split into the parts on which its answers depend.
struct Parts<'a> {
    scene: &'a NamedScene,
    /// Which points are not checked by any constraint: answers about other points do not depend on them.
    is_free: Vec<bool>,
    /// The constraints on each of them.
    about: Vec<About<'a>>,
}

impl<'a> Parts<'a> {
    fn new(scene: &'a NamedScene, adjusted: &Adjusted) -> Self {
        let is_free = adjusted.points_that_nothing_checks();
        let mut about: Vec<About> = vec![Vec::new(); scene.points.len()];
        for constraint in &scene.constraints {
            for point in constraint.points().into_iter().flatten() {
                about[point].push(constraint);
            }
        }
        Parts { scene, is_free, about }
    }

    /// Returns the constraints on which everything depends.
    fn base(&self) -> impl Iterator<Item = &'a Constraint> + '_ {
        let is_base = |f: &&Constraint| !f.points().into_iter().flatten().any(|p| self.is_free[p]);
        self.scene.constraints.iter().filter(is_base)
    }
}

impl<'a> Known<'a> {
    /// Compares two scenes; `None` where they differ in anything on which all answers depend, or where either has a fault.
    pub(super) fn new(
        scene: &'a NamedScene,
        adjusted: &Adjusted,
        before: &'a NamedScene,
        before_adjusted: &Adjusted,
    ) -> Option<Self> {
        let is_plain = |a: &Adjusted| a.status() == NetworkStatus::Ok && a.undetermined.is_empty();
        if !(is_plain(adjusted) && is_plain(before_adjusted)) {
            return None;
        }
        let is_same = scene.cameras == before.cameras
            && scene.camera_of_photo == before.camera_of_photo
            && scene.planes == before.planes
            && scene.frame == before.frame
            && scene.origin_m == before.origin_m;
        let (now, before) = (Parts::new(scene, adjusted), Parts::new(before, before_adjusted));
        // Points are compared by name: their indices change when others are added or removed.
        let numbers: HashMap<&str, usize> =
            before.scene.points.iter().enumerate().map(|(i, name)| (name.as_str(), i)).collect();
        let moved = |f: &Constraint| {
            let mut moved = *f;
            moved.renumber(|p| numbers.get(scene.points[p].as_str()).copied()).then_some(moved)
        };
        let is_base_same = is_same && now.base().map(moved).eq(before.base().map(|f| Some(*f)));
        is_base_same.then_some(Known { now, before })
    }

    /// Returns the index of the earlier query with the same answer, where there is one.
    pub(super) fn question(&self, query: &NamedQuery) -> Option<usize> {
        let at = self.before.scene.queries.iter().position(|q| q.name == query.name)?;
        let asked = &self.before.scene.queries[at];
        let is_alike = asked.kind == query.kind && asked.points.len() == query.points.len();
        let is_same = |(now, before): (&usize, &usize)| {
            let to_before = |p: usize| (p == *now).then_some(*before);
            let moved = |f: &&Constraint| {
                let mut moved = **f;
                moved.renumber(to_before).then_some(moved)
            };
            let is_free = self.now.is_free[*now];
            is_free == self.before.is_free[*before]
                && self.now.scene.points[*now] == self.before.scene.points[*before]
                && (!is_free
                    || self.now.about[*now]
                        .iter()
                        .map(moved)
                        .eq(self.before.about[*before].iter().map(|f| Some(**f))))
        };
        let is_known = is_alike && query.points.iter().zip(&asked.points).all(is_same);
        is_known.then_some(at)
    }
}
