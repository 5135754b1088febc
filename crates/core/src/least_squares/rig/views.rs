//! The information of each view about the shared blocks, with its bodies' poses eliminated: docs/math/clustered.md eq. (1).

use super::{Eliminated, RigEquations, RigGraph, RigPoses};
use crate::least_squares::clustered::Cluster;
use crate::{Matrix6, Vector6};
use nalgebra::{DMatrix, DVector};

/// A shared block on which an observation depends: its position in the cluster, and the observation's motion with its own.
type Touched = Vec<(usize, Matrix6)>;

impl RigEquations {
    /// Returns one cluster for each view with observations that take part and depend on a shared block; `view_of_body` ascends.
    pub(crate) fn clusters(
        &self,
        eliminated: &Eliminated,
        places: &RigPoses,
        graph: &RigGraph,
        view_of_body: &[usize],
    ) -> Vec<Cluster> {
        let left = eliminated.reduced.solve(&eliminated.gradient);
        let mut clusters = Vec::new();
        let mut first = 0;
        for links in graph.links.chunk_by(|a, b| view_of_body[a.body] == view_of_body[b.body]) {
            let range = first..first + links.len();
            first = range.end;
            clusters.extend(self.cluster(eliminated, places, graph, range, &left));
        }
        clusters
    }

    fn cluster(
        &self,
        eliminated: &Eliminated,
        places: &RigPoses,
        graph: &RigGraph,
        links: core::ops::Range<usize>,
        left: &DVector<f64>,
    ) -> Option<Cluster> {
        let active = || links.clone().filter(|i| graph.is_active[graph.links[*i].body]);
        let blocks_of = |i: usize| {
            let link = &graph.links[i];
            graph.block_of_camera[link.camera].into_iter().chain(graph.block_of_target[link.target])
        };
        let mut blocks: Vec<usize> = active().flat_map(blocks_of).collect();
        blocks.sort_unstable();
        blocks.dedup();
        let n = 6 * blocks.len();
        let mut cluster = Cluster { blocks, information: DMatrix::zeros(n, n), score: DVector::zeros(n) };
        let mut bodies: Vec<usize> = Vec::new();
        for i in active() {
            let touched = touched(&cluster.blocks, places, graph, i);
            let (information, gradient) = &self.observations[i];
            add(&mut cluster, &touched, information, gradient);
            bodies.push(graph.links[i].body);
        }
        bodies.dedup();
        bodies.into_iter().for_each(|body| self.eliminate(&mut cluster, eliminated, body));
        // The equations belong to the state one vanishing step before the minimum.
        for (i, block) in cluster.blocks.clone().into_iter().enumerate() {
            let by = cluster.information.columns(6 * i, 6) * left.rows(6 * block, 6);
            cluster.score -= by;
        }
        (0 < n).then_some(cluster)
    }

    /// Computes S = H − C A⁻¹ Cᵀ and s = h − C A⁻¹ a for one body.
    fn eliminate(&self, cluster: &mut Cluster, eliminated: &Eliminated, body: usize) {
        let (inverse, gradient) = (&eliminated.inverses[body], &self.bodies[body].gradient);
        let couplings = self.couplings_of(body);
        let place = |block: usize| cluster.blocks.binary_search(&block).unwrap_or(0);
        let places: Vec<usize> = couplings.iter().map(|c| place(c.block)).collect();
        for (c, row) in couplings.iter().zip(&places) {
            let solved = c.shared_body * inverse;
            let mut rows = cluster.score.fixed_rows_mut::<6>(6 * row);
            rows -= solved * gradient;
            for (other, column) in couplings.iter().zip(&places) {
                let mut block = cluster.information.fixed_view_mut::<6, 6>(6 * row, 6 * column);
                block -= solved * other.shared_body.transpose();
            }
        }
    }
}

fn touched(blocks: &[usize], places: &RigPoses, graph: &RigGraph, i: usize) -> Touched {
    let link = &graph.links[i];
    let chain = places.chain(link, graph);
    let camera = graph.block_of_camera[link.camera].map(|b| (b, chain.by_camera()));
    let target = graph.block_of_target[link.target].map(|b| (b, chain.by_target()));
    let place = |(block, by): (usize, Matrix6)| Some((blocks.binary_search(&block).ok()?, by));
    camera.into_iter().chain(target).filter_map(place).collect()
}

/// Adds an observation's own sums, before its body is eliminated.
fn add(cluster: &mut Cluster, touched: &Touched, information: &Matrix6, gradient: &Vector6) {
    for (row, by_row) in touched {
        let mut rows = cluster.score.fixed_rows_mut::<6>(6 * row);
        rows += by_row.tr_mul(gradient);
        let carried = by_row.tr_mul(information);
        for (column, by_column) in touched {
            let mut block = cluster.information.fixed_view_mut::<6, 6>(6 * row, 6 * column);
            block += carried * by_column;
        }
    }
}
