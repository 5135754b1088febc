//! The error budget of every camera of a rig: docs/math/budget.md section 3.

use super::RigConfig;
use super::adjust::{Adjusted, active, settled_loss};
use super::distance::add_distances;
use super::layout::Layout;
use crate::budget::{Budget, ErrorSource, excess};
use crate::least_squares::rig::{Eliminated, RigEquations};
use crate::least_squares::{NormalEquations, PivotedPose};
use crate::locate::parts::Pulls;
use crate::locate::problem::Problem;
use crate::pose::symmetric;
use crate::{Matrix6, Vector6};
use nalgebra::DMatrix;

/// The budgets of all cameras.
pub(super) struct Budgets<'a> {
    layout: &'a Layout<'a>,
    of_cameras: Vec<Budget>,
}

impl<'a> Budgets<'a> {
    pub(super) fn new(layout: &'a Layout) -> Self {
        Budgets { layout, of_cameras: vec![Budget::default(); layout.problem.cameras.len()] }
    }

    /// Adds the part that a source has in the covariance of the shared blocks.
    pub(super) fn add(&mut self, source: ErrorSource, of_shared: &DMatrix<f64>) {
        for (camera, budget) in self.of_cameras.iter_mut().enumerate() {
            if let Some(block) = self.layout.graph.block_of_camera[camera] {
                let part: Matrix6 = of_shared.fixed_view::<6, 6>(6 * block, 6 * block).into();
                budget.add(source, &symmetric(&part));
            }
        }
    }

    /// Adds what a covariance of the shared blocks has beyond another one.
    pub(super) fn add_excess(&mut self, source: ErrorSource, whole: &DMatrix<f64>, least: &DMatrix<f64>) {
        for (camera, budget) in self.of_cameras.iter_mut().enumerate() {
            let Some(block) = self.layout.graph.block_of_camera[camera] else { continue };
            let [whole, least] = [whole, least].map(|matrix| -> Matrix6 {
                symmetric(&matrix.fixed_view::<6, 6>(6 * block, 6 * block).into())
            });
            budget.add(source, &excess(&whole, &least).unwrap_or(whole - least));
        }
    }

    /// Adds what points, their positions on the targets and known distances contribute to `inverse`, the covariance that they give together.
    pub(super) fn add_observations(
        &mut self,
        adjusted: &Adjusted,
        eliminated: &Eliminated,
        inverse: &DMatrix<f64>,
        config: &RigConfig,
    ) {
        let has_uncertain = self.layout.observations.iter().any(|s| s.seen.iter().any(|c| c.sigma_m != 0.0));
        if !has_uncertain && config.known_distances.is_empty() {
            return self.add(ErrorSource::Pixels, inverse);
        }
        for (source, pull) in pulls(self.layout, adjusted, config) {
            if let Some(pull) = pull {
                self.add(source, &adjusted.equations.scatter(eliminated, inverse, &pull));
            }
        }
        // The pulls are those of the minimum, `inverse` is that of the state before.
        let whole_of = |block: usize| -> Matrix6 { inverse.fixed_view::<6, 6>(6 * block, 6 * block).into() };
        let of_cameras = std::mem::take(&mut self.of_cameras).into_iter().enumerate();
        let exact = of_cameras.map(|(camera, budget)| match self.layout.graph.block_of_camera[camera] {
            Some(block) => budget.adding_up_to(&symmetric(&whole_of(block))),
            None => Some(budget),
        });
        self.of_cameras = exact.collect::<Option<_>>().unwrap_or_default();
    }

    /// Multiplies every part.
    pub(super) fn scale(&mut self, by: f64) {
        self.of_cameras.iter_mut().for_each(|budget| *budget = std::mem::take(budget).scaled(by));
    }

    pub(super) fn finish(self) -> Vec<Budget> {
        self.of_cameras
    }
}

/// The equations that hold one source's pulls in place of the information; `None` where a point leaves the field.
fn pulls(
    layout: &Layout,
    adjusted: &Adjusted,
    config: &RigConfig,
) -> [(ErrorSource, Option<RigEquations>); 3] {
    let (places, graph) = (&adjusted.places, &adjusted.graph);
    let (active, loss) = (active(layout, &adjusted.parts), settled_loss(config.loss));
    let of = |take: fn(&Pulls) -> Matrix6| {
        let normal = |i: usize, place: &PivotedPose| {
            let pivot = &layout.pivot_in_target[layout.observations[i].target];
            let problem = Problem { loss, ..Problem::new(&active[i], layout.camera(i)) };
            let sums = Pulls::of(place, pivot, &problem)?;
            Some(NormalEquations::from_parts(0.0, &Vector6::zeros(), &take(&sums)))
        };
        RigEquations::new(places, graph, normal)
    };
    let mut of_distances = RigEquations::new(places, graph, |_, _| Some(NormalEquations::zero()));
    if let Some(equations) = &mut of_distances {
        add_distances(equations, config.known_distances, places, graph);
    }
    [
        (ErrorSource::Pixels, of(|sums| sums.pixels)),
        (ErrorSource::Target, of(|sums| sums.target)),
        (ErrorSource::Priors, of_distances),
    ]
}
