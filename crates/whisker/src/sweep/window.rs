//! The memory of the fixed-lag smoother: the nodes of its window, each with its last derivatives, and the quadratic form that represents all
//! earlier ones.

use super::batch::{Prior, TOUCH_SLIDE, add_pair};
use super::chain::{Chain, Local};
use super::envelope::{self, Pair};
use super::node::{Instrument, Linear, Node, Role};
use nalgebra::{Matrix4, Vector4};

/// A node in the window.
#[derive(Debug, Clone)]
pub struct Entry {
    /// The sample.
    pub node: Node,
    /// Its unknowns.
    pub state: Local,
    /// Its derivatives.
    pub linear: Linear,
    /// Where `linear` was taken: state and shared angle.
    pub at: (Local, f64),
    /// Sweep and number; none of a touch.
    pub name: Option<(u32, u32)>,
    /// Whether the envelope condition holds to the next.
    pub linked: bool,
}

impl Entry {
    /// The linearisation carried to the present state.
    pub fn present(&self, shared_rad: f64) -> Linear {
        let (by_state, by_shared) = (self.state - self.at.0, shared_rad - self.at.1);
        let mut linear = self.linear;
        linear.x += linear.x_by * by_state;
        linear.alpha_rad += linear.alpha_by.dot(&by_state) + linear.alpha_by_shared * by_shared;
        if let Some((residual, by, shared)) = &mut linear.constraint {
            *residual += by.dot(&by_state) + *shared * by_shared;
        }
        linear
    }
}

/// What left the window, as a quadratic form of the first node and the shared angle about a reference.
#[derive(Debug, Clone, Copy)]
pub struct Inherited {
    /// H of the first node.
    pub hessian: Matrix4<f64>,
    /// H between the first node and the shared angle.
    pub border: Local,
    /// Gradient by the first node.
    pub gradient: Local,
    /// H of the shared angle.
    pub corner: f64,
    /// Gradient by the shared angle.
    pub corner_gradient: f64,
    /// The first node's unknowns and the shared angle the form is about.
    pub reference: (Local, f64),
}

impl Inherited {
    /// What is known of the friction angle beforehand; of the first node nothing.
    pub fn of_prior(prior: &Prior) -> Self {
        Inherited {
            hessian: Matrix4::zeros(),
            border: Local::zeros(),
            gradient: Local::zeros(),
            corner: prior.sigma_rad.powi(-2),
            corner_gradient: 0.0,
            reference: (Local::zeros(), prior.angle_rad),
        }
    }

    /// Adds the form to a chain about the present values; its value there.
    pub fn add_to(&self, chain: &mut Chain, state: &Local, shared_rad: f64) -> f64 {
        let (by_state, by_shared) = (state - self.reference.0, shared_rad - self.reference.1);
        let gradient = self.gradient + self.hessian * by_state + self.border * by_shared;
        chain.add_block(0, &self.hessian, &self.border, &gradient);
        let slope = self.corner_gradient + self.corner * by_shared + self.border.dot(&by_state);
        chain.add_shared(self.corner, slope);
        by_state.dot(&(gradient + self.gradient)) + by_shared * (slope + self.corner_gradient)
    }
}

/// Adds a node's readings and constraint; their sum of squares.
pub fn add_own(chain: &mut Chain, index: usize, entry: &Entry, present: &Linear) -> f64 {
    let deviation = entry.node.deviation(&entry.state);
    chain.add_block(index, &Matrix4::identity(), &Vector4::zeros(), &deviation);
    if let Some((residual, by, by_shared)) = &present.constraint {
        chain.add_single(index, *residual, by, *by_shared);
        return deviation.norm_squared() + residual * residual;
    }
    deviation.norm_squared()
}

/// Adds what holds between a node and the next; its sum of squares.
pub fn add_link(
    chain: &mut Chain,
    index: usize,
    first: &Entry,
    pair: [&Linear; 2],
    with: &Instrument,
) -> f64 {
    if !first.linked {
        return 0.0;
    }
    let sigma = envelope::sigma_m(pair[0], pair[1]);
    let envelope = Pair::envelope(pair[0], pair[1]);
    add_pair(chain, index, &envelope, sigma);
    let mut chi2 = (envelope.residual_m / sigma).powi(2);
    if matches!(first.node.role, Role::Touch { .. }) {
        let (slide, sigma) = (Pair::slide(pair[0], pair[1]), TOUCH_SLIDE * with.rod.length_m);
        add_pair(chain, index, &slide, sigma);
        chi2 += (slide.residual_m / sigma).powi(2);
    }
    chi2
}
