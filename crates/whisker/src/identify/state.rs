//! The free parameters of a hypothesis, the outline they define, and the derivatives of the outline's parameters by them.

use super::outline::{Corners, Outline, Smooth};
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

/// A hypothesis at some parameters.
#[derive(Debug, Clone)]
pub(super) enum State {
    /// c, r.
    Circle { centre: Vector2<f64>, radius: f64 },
    /// c, P: no direction is singular where the axes are equal.
    Root { centre: Vector2<f64>, root: Matrix2<f64> },
    /// c, a, b, angle.
    Axes { centre: Vector2<f64>, axes: [f64; 2], angle: f64 },
    /// c, √(ab), angle; a/b held.
    AxesOfRatio { centre: Vector2<f64>, mean: f64, angle: f64, ratio: f64 },
    /// c, a, b, angle.
    Rectangle { centre: Vector2<f64>, sides: [f64; 2], angle: f64 },
    /// c, √(ab), angle; a/b held: 1 for a square.
    RectangleOfRatio { centre: Vector2<f64>, mean: f64, angle: f64, ratio: f64 },
    /// Its corners.
    Chain(Vec<Vector2<f64>>),
}

/// Below a hundredth of the noise no size can be seen: a size stays above this, metres.
pub(super) const SMALLEST_M: f64 = 1e-6;
/// No whisker reaches further: a size stays below this, metres.
pub(super) const LARGEST_M: f64 = 10.0;

impl State {
    pub fn n_parameters(&self) -> usize {
        match self {
            State::Circle { .. } => 3,
            State::AxesOfRatio { .. } | State::RectangleOfRatio { .. } => 4,
            State::Root { .. } | State::Axes { .. } | State::Rectangle { .. } => 5,
            State::Chain(corners) => 2 * corners.len(),
        }
    }

    /// None where there is no such outline.
    pub fn outline(&self) -> Option<Outline> {
        match self {
            State::Chain(corners) => Corners::new(corners.clone()).map(Outline::Corners),
            State::Rectangle { .. } | State::RectangleOfRatio { .. } => {
                let (centre, sides, angle) = self.frame();
                let corner =
                    |s: &[f64; 2]| centre + local(angle, 0.5 * s[0] * sides[0], 0.5 * s[1] * sides[1]);
                Corners::new(SIGNS.iter().map(corner).collect()).map(Outline::Corners)
            }
            _ => {
                let (centre, axes, angle) = self.frame();
                let root = match self {
                    State::Root { root, .. } => *root,
                    _ => spread(angle, axes),
                };
                Some(Outline::Smooth(Smooth { centre, root }))
            }
        }
    }

    /// Centre, sizes along and across, direction of the first.
    pub fn frame(&self) -> (Vector2<f64>, [f64; 2], f64) {
        match self {
            State::Circle { centre, radius } => (*centre, [*radius; 2], 0.0),
            State::Root { centre, root } => {
                let (axes, angle) = principal(root);
                (*centre, axes, angle)
            }
            State::Axes { centre, axes: sizes, angle } | State::Rectangle { centre, sides: sizes, angle } => {
                (*centre, *sizes, *angle)
            }
            State::AxesOfRatio { centre, mean, angle, ratio }
            | State::RectangleOfRatio { centre, mean, angle, ratio } => {
                (*centre, [mean * ratio.sqrt(), mean / ratio.sqrt()], *angle)
            }
            State::Chain(corners) => {
                (corners.iter().sum::<Vector2<f64>>() / corners.len() as f64, [0.0; 2], 0.0)
            }
        }
    }

    /// Derivatives of the outline's parameters by the hypothesis's.
    pub fn outline_by_parameters(&self) -> DMatrix<f64> {
        match self {
            State::Chain(corners) => DMatrix::identity(2 * corners.len(), 2 * corners.len()),
            State::Root { .. } => DMatrix::identity(5, 5),
            State::Circle { .. } => {
                DMatrix::from_row_slice(5, 3, &[1., 0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 0., 0., 1.])
            }
            State::Axes { .. } => self.root_by_axes(),
            State::AxesOfRatio { ratio, .. } => self.root_by_axes() * by_mean(*ratio),
            State::Rectangle { .. } => self.corners_by_sides(),
            State::RectangleOfRatio { ratio, .. } => self.corners_by_sides() * by_mean(*ratio),
        }
    }

    /// (c, P) by (c, a, b, angle).
    fn root_by_axes(&self) -> DMatrix<f64> {
        let (_, [a, b], angle) = self.frame();
        let (u, v) = (local(angle, 1.0, 0.0), local(angle, 0.0, 1.0));
        let columns =
            [u * u.transpose(), v * v.transpose(), (a - b) * (u * v.transpose() + v * u.transpose())];
        let mut by = DMatrix::identity(5, 5);
        for (j, m) in columns.iter().enumerate() {
            by[(2, 2 + j)] = m[(0, 0)];
            by[(3, 2 + j)] = m[(0, 1)];
            by[(4, 2 + j)] = m[(1, 1)];
        }
        by
    }

    /// Corners by (c, a, b, angle).
    fn corners_by_sides(&self) -> DMatrix<f64> {
        let (_, [a, b], angle) = self.frame();
        let mut by = DMatrix::zeros(8, 5);
        for (k, [i, j]) in SIGNS.iter().enumerate() {
            let off = local(angle, 0.5 * i * a, 0.5 * j * b);
            let columns = [
                Vector2::x(),
                Vector2::y(),
                local(angle, 0.5 * i, 0.0),
                local(angle, 0.0, 0.5 * j),
                Vector2::new(-off.y, off.x),
            ];
            for (column, d) in columns.iter().enumerate() {
                by[(2 * k, column)] = d.x;
                by[(2 * k + 1, column)] = d.y;
            }
        }
        by
    }

    /// The parameters changed by δ; none where no such outline is left.
    pub fn moved(&self, by: &DVector<f64>) -> Option<State> {
        let shift = Vector2::new(by[0], by[1]);
        let size = |value: f64| (SMALLEST_M < value && value < LARGEST_M).then_some(value);
        Some(match self {
            State::Circle { centre, radius } => {
                State::Circle { centre: centre + shift, radius: size(radius + by[2])? }
            }
            State::Root { centre, root } => {
                let root = root + Matrix2::new(by[2], by[3], by[3], by[4]);
                let (axes, _) = principal(&root);
                size(axes[1]).and(size(axes[0]))?;
                State::Root { centre: centre + shift, root }
            }
            State::Axes { centre, axes: [a, b], angle } => State::Axes {
                centre: centre + shift,
                axes: [size(a + by[2])?, size(b + by[3])?],
                angle: angle + by[4],
            },
            State::Rectangle { centre, sides: [a, b], angle } => State::Rectangle {
                centre: centre + shift,
                sides: [size(a + by[2])?, size(b + by[3])?],
                angle: angle + by[4],
            },
            State::AxesOfRatio { centre, mean, angle, ratio } => State::AxesOfRatio {
                centre: centre + shift,
                mean: size(mean + by[2])?,
                angle: angle + by[3],
                ratio: *ratio,
            },
            State::RectangleOfRatio { centre, mean, angle, ratio } => State::RectangleOfRatio {
                centre: centre + shift,
                mean: size(mean + by[2])?,
                angle: angle + by[3],
                ratio: *ratio,
            },
            State::Chain(corners) => State::Chain(
                corners.iter().enumerate().map(|(k, c)| c + Vector2::new(by[2 * k], by[2 * k + 1])).collect(),
            ),
        })
    }
}

/// Corners of a rectangle, counter-clockwise.
const SIGNS: [[f64; 2]; 4] = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];

/// A vector given along and across a direction.
pub(super) fn local(angle: f64, along: f64, across: f64) -> Vector2<f64> {
    let (sin, cos) = angle.sin_cos();
    Vector2::new(cos * along - sin * across, sin * along + cos * across)
}

/// R diag(a, b) Rᵀ.
pub(super) fn spread(angle: f64, [a, b]: [f64; 2]) -> Matrix2<f64> {
    let (u, v) = (local(angle, 1.0, 0.0), local(angle, 0.0, 1.0));
    a * u * u.transpose() + b * v * v.transpose()
}

/// The inverse of `spread`: the larger size first.
pub(super) fn principal(root: &Matrix2<f64>) -> ([f64; 2], f64) {
    let (half_sum, half_difference) =
        (0.5 * (root[(0, 0)] + root[(1, 1)]), 0.5 * (root[(0, 0)] - root[(1, 1)]));
    let radius = half_difference.hypot(root[(0, 1)]);
    ([half_sum + radius, half_sum - radius], 0.5 * root[(0, 1)].atan2(half_difference))
}

/// (c, a, b, angle) by (c, √(ab), angle) at a ratio.
fn by_mean(ratio: f64) -> DMatrix<f64> {
    let mut by = DMatrix::zeros(5, 4);
    by[(0, 0)] = 1.0;
    by[(1, 1)] = 1.0;
    by[(2, 2)] = ratio.sqrt();
    by[(3, 2)] = 1.0 / ratio.sqrt();
    by[(4, 3)] = 1.0;
    by
}
