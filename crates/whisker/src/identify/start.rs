//! Where the fits start: support functions that are linear in their parameters, solved on the supporting lines alone.
//!
//!   n·x = h(n):  circle n·c + r  ·  rectangle at a given direction n·c + ½ a |n·u| + ½ b |n·v|  ·  corner n·c
//!   chain  contacts in the order of β cut into runs, each run one corner, by dynamic programming
//! Numbers: docs/math/whisker_identify.md eq. (11), (12), section 5.

use super::outline::positive_angle;
use super::row::Row;
use super::state::{LARGEST_M, SMALLEST_M, State, local, principal, spread};
use nalgebra::{DMatrix, DVector, Matrix2, SMatrix, SVector, Vector2, Vector3, Vector4};
use std::f64::consts::{FRAC_PI_2, TAU};

/// A supporting line: n·x = d, weight 1/m².
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    normal: Vector2<f64>,
    beta: f64,
    offset: f64,
    weight: f64,
}

/// A start is not led by the few lines that claim to be better than a tenth of a millimetre, 1/m².
const MOST_WEIGHT: f64 = 1e8;

/// The lines of the contacts between clamp and tip, in the order of β beginning after the widest gap; offsets from `origin`.
pub(super) fn lines(rows: &[Row], origin: Vector2<f64>) -> Vec<Line> {
    let mut lines: Vec<Line> = rows.iter().filter(|row| !row.tip).map(|row| line(row, origin)).collect();
    lines.sort_by(|a, b| a.beta.total_cmp(&b.beta));
    let n = lines.len();
    let gap = |k: usize| positive_angle(lines[(k + 1) % n].beta - lines[k].beta);
    if let Some(widest) = (0..n).max_by(|i, j| gap(*i).total_cmp(&gap(*j))) {
        lines.rotate_left((widest + 1) % n);
    }
    lines
}

fn line(row: &Row, origin: Vector2<f64>) -> Line {
    let normal = row.normal();
    Line {
        normal,
        beta: positive_angle(row.beta),
        offset: normal.dot(&(row.x - origin)),
        weight: row.line_weight.min(MOST_WEIGHT),
    }
}

/// Places the lines leave open stay near the contacts: a standard deviation, metres.
const LOOSE_M: f64 = 1.0;
/// Squared residual, in variances, from which a line counts less: five standard deviations, since faces turn with their noise.
const FAR: f64 = 25.0;
/// Contacts that all lie in one place are supposed to spread by this, metres.
pub(super) const SMALLEST_SPREAD_M: f64 = 1e-3;
/// Solutions, each with the lines weighted by the one before.
const PASSES: usize = 5;

/// The lines, and what is supposed where they leave something open.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lines<'a> {
    /// Sorted, offsets from `origin`.
    pub list: &'a [Line],
    /// Near all contacts, metres.
    pub origin: Vector2<f64>,
    /// How far the contacts spread about it, metres: a size no line determines is supposed to be this, give or take as much.
    pub spread: f64,
}

/// Weighted linear least squares of n·x = φ(n)ᵀ q; q = [place, sizes …]. Lines far off, as the median goes, count less from the
/// second pass on.
fn linear<const P: usize>(
    lines: &Lines,
    supposed: &SVector<f64, P>,
    features: impl Fn(&Line) -> SVector<f64, P>,
) -> Option<SVector<f64, P>> {
    let loose = SVector::<f64, P>::from_fn(|i, _| if i < 2 { LOOSE_M } else { lines.spread });
    let prior = SMatrix::from_diagonal(&loose.map(|sigma| 1.0 / (sigma * sigma)));
    let mut q = *supposed;
    let mut squared = vec![0.0; lines.list.len()];
    for _ in 0..PASSES {
        let far = FAR.max(4.0 * quantile(squared.iter().copied(), 0.5));
        let mut information = prior;
        let mut moment = prior * supposed;
        for (line, squared) in lines.list.iter().zip(&squared) {
            let phi = features(line);
            let weight = line.weight / (1.0 + squared / far).powi(2);
            information += weight * phi * phi.transpose();
            moment += weight * line.offset * phi;
        }
        q = information.cholesky()?.solve(&moment);
        for (line, squared) in lines.list.iter().zip(&mut squared) {
            *squared = (line.offset - features(line).dot(&q)).powi(2) * line.weight;
        }
    }
    Some(q)
}

/// The value that a share of all lie below; 0 of none.
pub(super) fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    let place = ((sorted.len() as f64 * share) as usize).min(sorted.len().saturating_sub(1));
    if sorted.is_empty() { 0.0 } else { *sorted.select_nth_unstable_by(place, f64::total_cmp).1 }
}

fn within(size: f64) -> f64 {
    size.clamp(1e3 * SMALLEST_M, 0.1 * LARGEST_M)
}

/// The circle that touches the lines, eq. (11).
pub(super) fn circle(lines: &Lines) -> Option<State> {
    let q = linear(lines, &[0.0, 0.0, lines.spread].into(), |line| line.normal.push(1.0))?;
    Some(State::Circle { centre: lines.origin + Vector2::new(q[0], q[1]), radius: within(q[2]) })
}

/// The corner all lines pass.
pub(super) fn corner(lines: &Lines) -> Option<State> {
    let q = linear(lines, &Vector2::zeros(), |line| line.normal)?;
    Some(State::Chain(vec![lines.origin + q]))
}

/// The ellipse that touches the lines, to first order in its eccentricity: |P n| ≈ nᵀ P n, eq. (11).
pub(super) fn ellipse(lines: &Lines) -> Option<State> {
    let features = |line: &Line| {
        let n = line.normal;
        SVector::<f64, 5>::new(n.x, n.y, n.x * n.x, 2.0 * n.x * n.y, n.y * n.y)
    };
    let supposed = [0.0, 0.0, lines.spread, 0.0, lines.spread];
    let q = linear(lines, &supposed.into(), features)?;
    let (axes, angle) = principal(&Matrix2::new(q[2], q[3], q[3], q[4]));
    let centre = lines.origin + Vector2::new(q[0], q[1]);
    Some(State::Root { centre, root: spread(angle, axes.map(within)) })
}

/// Directions tried, over a quarter turn.
const DIRECTIONS: usize = 30;

fn directions() -> impl Iterator<Item = f64> {
    (0..DIRECTIONS).map(|k| k as f64 * FRAC_PI_2 / DIRECTIONS as f64)
}

/// Rectangles at directions over a quarter turn, eq. (12).
pub(super) fn rectangles(lines: &Lines) -> Vec<State> {
    let at = |angle: f64| {
        let (u, v) = (local(angle, 0.5, 0.0), local(angle, 0.0, 0.5));
        let features = move |line: &Line| {
            let n = line.normal;
            Vector4::new(n.x, n.y, n.dot(&u).abs(), n.dot(&v).abs())
        };
        let q = linear(lines, &[0.0, 0.0, lines.spread, lines.spread].into(), features)?;
        let centre = lines.origin + Vector2::new(q[0], q[1]);
        Some(State::Rectangle { centre, sides: [within(q[2]), within(q[3])], angle })
    };
    directions().filter_map(at).collect()
}

/// Squares likewise.
pub(super) fn squares(lines: &Lines) -> Vec<State> {
    let at = |angle: f64| {
        let (u, v) = (local(angle, 0.5, 0.0), local(angle, 0.0, 0.5));
        let features = move |line: &Line| {
            let n = line.normal;
            Vector3::new(n.x, n.y, n.dot(&u).abs() + n.dot(&v).abs())
        };
        let q = linear(lines, &[0.0, 0.0, lines.spread].into(), features)?;
        let centre = lines.origin + Vector2::new(q[0], q[1]);
        Some(State::RectangleOfRatio { centre, mean: within(q[2]), angle, ratio: 1.0 })
    };
    directions().filter_map(at).collect()
}

/// Contacts are cut between groups: more groups than this cost time and add nothing.
const GROUPS: usize = 90;

/// Sums over lines from which a corner's least squares follow.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    nn: [f64; 3],
    nd: [f64; 2],
    dd: f64,
}

impl Sums {
    fn add(mut self, line: &Line) -> Self {
        let (n, w) = (line.normal, line.weight);
        self.nn[0] += w * n.x * n.x;
        self.nn[1] += w * n.x * n.y;
        self.nn[2] += w * n.y * n.y;
        self.nd[0] += w * line.offset * n.x;
        self.nd[1] += w * line.offset * n.y;
        self.dd += w * line.offset * line.offset;
        self
    }

    fn minus(&self, other: &Self) -> Self {
        Sums {
            nn: std::array::from_fn(|i| self.nn[i] - other.nn[i]),
            nd: std::array::from_fn(|i| self.nd[i] - other.nd[i]),
            dd: self.dd - other.dd,
        }
    }

    /// The corner and what it leaves.
    fn corner(&self) -> (Vector2<f64>, f64) {
        let loose = 1.0 / (LOOSE_M * LOOSE_M);
        let (a, b, c) = (self.nn[0] + loose, self.nn[1], self.nn[2] + loose);
        let determinant = a * c - b * b;
        let x = (c * self.nd[0] - b * self.nd[1]) / determinant;
        let y = (a * self.nd[1] - b * self.nd[0]) / determinant;
        (Vector2::new(x, y), self.dd - x * self.nd[0] - y * self.nd[1])
    }
}

/// Chains of 2 … `most` corners: for each number the cut that leaves least. Fewer where a chain is not convex.
pub(super) fn chains(lines: &Lines, most: usize) -> Vec<State> {
    let (lines, origin) = (lines.list, lines.origin);
    let groups = GROUPS.min(lines.len());
    if groups < 2 {
        return Vec::new();
    }
    let mut until = vec![Sums::default()];
    for k in 0..groups {
        let range = k * lines.len() / groups..(k + 1) * lines.len() / groups;
        until.push(lines[range].iter().fold(until[k], Sums::add));
    }
    let run = |from: usize, to: usize| until[to].minus(&until[from]).corner();
    let cuts = cheapest_cuts(groups, most, |from, to| run(from, to).1);
    let chain = |ends: &Vec<usize>| {
        let corners: Vec<_> = ends.windows(2).map(|pair| origin + run(pair[0], pair[1]).0).collect();
        convex_hull(corners)
    };
    cuts.iter().map(chain).filter(|hull| 2 <= hull.len()).map(State::Chain).collect()
}

/// Corners nearer than this are one that noise has split, metres.
const SPLIT_M: f64 = 1e-3;

/// The chain with its nearest two corners made one; none where they are far enough apart, or only two are left.
pub(super) fn merged(chain: &State) -> Option<State> {
    let State::Chain(corners) = chain else { return None };
    let m = corners.len();
    let edge = |k: usize| (corners[(k + 1) % m] - corners[k]).norm();
    let shortest = (0..m).min_by(|i, j| edge(*i).total_cmp(&edge(*j)))?;
    if m <= 2 || SPLIT_M < edge(shortest) {
        return None;
    }
    let mut fewer = corners.clone();
    fewer[shortest] = 0.5 * (corners[shortest] + corners[(shortest + 1) % m]);
    fewer.remove((shortest + 1) % m);
    Some(State::Chain(fewer))
}

/// For 2 … `most` runs the ends of the runs that cost least together.
fn cheapest_cuts(n: usize, most: usize, cost: impl Fn(usize, usize) -> f64) -> Vec<Vec<usize>> {
    let table =
        DMatrix::from_fn(n + 1, n + 1, |from, to| if from < to { cost(from, to) } else { f64::INFINITY });
    let mut least = DVector::from_fn(n + 1, |to, _| table[(0, to)]);
    let mut chosen: Vec<Vec<usize>> = Vec::new();
    let mut cuts = Vec::new();
    for runs in 2..=most.min(n) {
        let mut next = DVector::from_element(n + 1, f64::INFINITY);
        let mut from = vec![0; n + 1];
        for to in runs..=n {
            for cut in runs - 1..to {
                let total = least[cut] + table[(cut, to)];
                if total < next[to] {
                    next[to] = total;
                    from[to] = cut;
                }
            }
        }
        least = next;
        chosen.push(from);
        let mut ends = vec![n];
        for from in chosen.iter().rev() {
            ends.push(from[ends[ends.len() - 1]]);
        }
        ends.push(0);
        ends.reverse();
        cuts.push(ends);
    }
    cuts
}

/// The hull's corners, counter-clockwise (Andrew's monotone chain).
fn convex_hull(mut points: Vec<Vector2<f64>>) -> Vec<Vector2<f64>> {
    points.retain(|p| p.iter().all(|v| v.is_finite()));
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let half = |points: &mut dyn Iterator<Item = &Vector2<f64>>| {
        let mut kept: Vec<Vector2<f64>> = Vec::new();
        for p in points {
            while 2 <= kept.len() && {
                let (a, b) = (kept[kept.len() - 2], kept[kept.len() - 1]);
                (b - a).perp(&(p - b)) <= 0.0
            } {
                kept.pop();
            }
            kept.push(*p);
        }
        kept.pop();
        kept
    };
    let mut hull = half(&mut points.iter());
    hull.extend(half(&mut points.iter().rev()));
    hull
}

/// The shortest arc that holds all the normals, `[from, to]`, and the gaps in it wider than `wide`, radians.
pub(super) fn arc(lines: &[Line], wide: f64) -> Option<([f64; 2], Vec<[f64; 2]>)> {
    let first = lines.first()?.beta;
    let first = if std::f64::consts::PI <= first { first - TAU } else { first };
    let angles: Vec<f64> = lines.iter().map(|line| first + positive_angle(line.beta - first)).collect();
    let gaps =
        angles.windows(2).filter(|pair| wide < pair[1] - pair[0]).map(|pair| [pair[0], pair[1]]).collect();
    Some(([first, *angles.last()?], gaps))
}
