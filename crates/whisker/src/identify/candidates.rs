//! The hypotheses, each at its best parameters, and how they compare.

use super::fit::{Fit, Search, correlation, verdicts};
use super::row::{OUTLIER_COST, Row};
use super::start::{self, Lines, arc};
use super::state::{State, local, spread};
use super::{Class, Config, Model, Score};
use nalgebra::Vector2;
use std::f64::consts::PI;

/// A hypothesis at its best.
#[derive(Debug, Clone)]
pub(super) struct Candidate {
    pub fit: Fit,
    pub score: Score,
}

/// The data that the hypotheses are fitted to.
pub(super) struct Evidence<'a> {
    pub rows: &'a [Row],
    pub search: Search<'a>,
    pub lines: Lines<'a>,
}

/// All hypotheses asked for, best first; `excess` is the factor on the noise's variance that the best needs, at least 1.
pub(super) struct Candidates {
    pub list: Vec<Candidate>,
    pub excess: f64,
}

impl Model {
    /// The class it stands for; a corner is any of them.
    pub fn class(self) -> Option<Class> {
        match self {
            Model::Corner => None,
            Model::Circle => Some(Class::Circle),
            Model::Ellipse => Some(Class::Ellipse),
            Model::Square => Some(Class::Square),
            Model::Rectangle => Some(Class::Rectangle),
            Model::Polygon { .. } => Some(Class::Polygon),
        }
    }

    /// Whether its outline has no corner.
    pub fn is_smooth(self) -> bool {
        matches!(self, Model::Circle | Model::Ellipse)
    }
}

impl Candidates {
    pub fn of(evidence: &Evidence, config: &Config) -> Self {
        let rows = evidence.rows;
        let mut fits = simple(evidence, &config.classes);
        let explained = fits.iter().any(|(model, fit)| explains(&score(rows, *model, fit), rows.len()));
        if config.classes.contains(&Class::Polygon) && !explained {
            fits.extend(polygons(evidence, config.max_corners));
        }
        ranked(rows, fits)
    }

    /// The best of those that `wanted` accepts.
    pub fn best(&self, wanted: impl Fn(Model) -> bool) -> Option<&Candidate> {
        self.list.iter().find(|candidate| wanted(candidate.score.model))
    }
}

/// Above this χ² per degree of freedom, or this share of outliers, polygons are tried: more parameters find nothing below it.
const EXPLAINED: (f64, f64) = (1.5, 0.05);

fn explains(score: &Score, n_rows: usize) -> bool {
    score.chi2_per_degree_of_freedom <= EXPLAINED.0 && score.n_outliers as f64 <= EXPLAINED.1 * n_rows as f64
}

fn simple(evidence: &Evidence, classes: &[Class]) -> Vec<(Model, Fit)> {
    let (search, lines) = (&evidence.search, &evidence.lines);
    let mut best = f64::INFINITY;
    let mut note = |fit: Option<Fit>| {
        best = fit.as_ref().map_or(best, |fit| fit.cost.min(best));
        (fit, best)
    };
    let (circle, best_cost) = note(start::circle(lines).and_then(|start| search.fit(&start, f64::INFINITY)));
    let (square, best_cost) =
        note(search.best_fit(&search.promising(&start::squares(lines), KEPT), best_cost));
    let ellipses: Vec<State> = start::ellipse(lines).into_iter().chain(circle.iter().map(as_root)).collect();
    let (ellipse, best_cost) = note(search.best_fit(&ellipses, best_cost));
    let mut rectangles: Vec<State> = square.iter().map(|square| as_rectangle(&square.state)).collect();
    rectangles.extend(search.promising(&start::rectangles(lines), KEPT));
    let (rectangle, best_cost) = note(search.best_fit(&rectangles, best_cost));
    let corner = start::corner(lines).and_then(|start| search.fit(&start, best_cost));
    let all = [
        (Model::Corner, corner),
        (Model::Circle, circle),
        (Model::Ellipse, ellipse),
        (Model::Square, square),
        (Model::Rectangle, rectangle),
    ];
    let asked = |model: Model| model.class().is_none_or(|class| classes.contains(&class));
    all.into_iter()
        .filter(|(model, _)| asked(*model))
        .filter_map(|(model, fit)| Some((model, fit?)))
        .collect()
}

fn as_root(circle: &Fit) -> State {
    let (centre, axes, angle) = circle.state.frame();
    State::Root { centre, root: spread(angle, axes) }
}

fn as_rectangle(square: &State) -> State {
    let (centre, sides, angle) = square.frame();
    State::Rectangle { centre, sides, angle }
}

/// Chains of every number of corners: from cuts of the contacts upwards, then each with two neighbouring corners made one.
fn polygons(evidence: &Evidence, most: usize) -> Vec<(Model, Fit)> {
    let search = &evidence.search;
    let mut best: Vec<Option<Fit>> = vec![None; most + 1];
    let mut keep = |fit: Option<Fit>| -> Option<Fit> {
        let fit = fit?;
        let place = best.get_mut(fit.state.n_parameters() / 2)?;
        if place.as_ref().is_none_or(|held| fit.cost < held.cost) {
            *place = Some(fit.clone());
        }
        Some(fit)
    };
    for start in start::chains(&evidence.lines, most) {
        let mut fit = keep(search.fit(&start, f64::INFINITY));
        while let Some(merged) = fit.as_ref().and_then(|fit| start::merged(&fit.state)) {
            fit = keep(search.fit(&merged, f64::INFINITY));
        }
    }
    let model = |fit: &Fit| Model::Polygon { corners: fit.state.n_parameters() / 2 };
    best.into_iter().flatten().map(|fit| (model(&fit), fit)).collect()
}

fn score(rows: &[Row], model: Model, fit: &Fit) -> Score {
    let squared = verdicts(rows, &fit.state).squared;
    let inliers = || rows.iter().zip(&squared).filter(|(_, squared)| **squared < OUTLIER_COST);
    let n_parameters = fit.state.n_parameters();
    // A tip contact is a point on the outline, any other also a direction.
    let constraints: usize = inliers().map(|(row, _)| if row.tip { 1 } else { 2 }).sum();
    let degrees_of_freedom = constraints.saturating_sub(n_parameters).max(1);
    Score {
        model,
        n_parameters,
        chi2: fit.cost,
        chi2_per_degree_of_freedom: inliers().map(|(_, squared)| squared).sum::<f64>()
            / degrees_of_freedom as f64,
        n_outliers: rows.len() - inliers().count(),
        bic: f64::INFINITY,
    }
}

fn ranked(rows: &[Row], fits: Vec<(Model, Fit)>) -> Candidates {
    let mut list: Vec<Candidate> =
        fits.into_iter().map(|(model, fit)| Candidate { score: score(rows, model, &fit), fit }).collect();
    let least = list.iter().min_by(|a, b| a.score.chi2.total_cmp(&b.score.chi2));
    let excess = least.map_or(1.0, |best| {
        best.score.chi2_per_degree_of_freedom.max(1.0) * correlation(rows, &best.fit.state)
    });
    for Candidate { score, .. } in &mut list {
        score.bic = score.chi2 / excess + score.n_parameters as f64 * (rows.len() as f64).ln();
    }
    list.sort_by(|a, b| a.score.bic.total_cmp(&b.score.bic).then(a.score.model.cmp(&b.score.model)));
    // A chain whose corners merged is another's duplicate.
    list.dedup_by(|a, b| a.score.model == b.score.model);
    Candidates { list, excess }
}

/// Starts followed to their end, of those that cost least as they are.
const KEPT: usize = 3;

/// Directions in which an ellipse of given ratio starts, over a half turn.
const DIRECTIONS: u32 = 8;

/// What the best ellipse with axes of this ratio costs; `circle` is the best circle.
pub(super) fn cost_of_axes(evidence: &Evidence, circle: &State, ratio: f64) -> f64 {
    let (centre, [radius, _], _) = circle.frame();
    let middle = arc(evidence.lines.list, f64::INFINITY).map_or(0.0, |([from, to], _)| 0.5 * (from + to));
    let starts: Vec<State> = (0..DIRECTIONS)
        .map(|k| osculating(centre, radius, middle, f64::from(k) * PI / f64::from(DIRECTIONS), ratio))
        .collect();
    let search = &evidence.search;
    search.best_fit(&search.promising(&starts, KEPT), f64::INFINITY).map_or(f64::INFINITY, |fit| fit.cost)
}

/// The ellipse that shares place and curvature with a circle where the normal is β: a short arc cannot tell them
/// apart; eq. (15).
fn osculating(centre: Vector2<f64>, radius: f64, beta: f64, angle: f64, ratio: f64) -> State {
    let n = Vector2::new(beta.cos(), beta.sin());
    let unit = spread(angle, [ratio.sqrt(), 1.0 / ratio.sqrt()]);
    let height = (unit * n).norm();
    let mean = radius * height.powi(3);
    State::AxesOfRatio {
        centre: centre + radius * n - mean * (unit * (unit * n)) / height,
        mean,
        angle,
        ratio,
    }
}

/// What the best rectangle with sides of this ratio, either way, costs.
pub(super) fn cost_of_sides(search: &Search, near: &[&State], ratio: f64) -> f64 {
    let starts = near.iter().flat_map(|state| {
        let (centre, sides, angle) = state.frame();
        let corners = state.outline().map(corner_list).unwrap_or_default();
        [ratio, 1.0 / ratio]
            .into_iter()
            .flat_map(move |ratio| stretched(centre, sides, angle, ratio, &corners))
    });
    search
        .best_fit(&search.promising(&starts.collect::<Vec<_>>(), KEPT), f64::INFINITY)
        .map_or(f64::INFINITY, |fit| fit.cost)
}

fn corner_list(outline: super::outline::Outline) -> Vec<Vector2<f64>> {
    match outline {
        super::outline::Outline::Corners(corners) => corners.corners,
        super::outline::Outline::Smooth(_) => Vec::new(),
    }
}

/// Rectangles of a ratio that keep one corner in place, each in turn: where one corner was felt best, that one is right.
fn stretched(
    centre: Vector2<f64>,
    sides: [f64; 2],
    angle: f64,
    ratio: f64,
    corners: &[Vector2<f64>],
) -> Vec<State> {
    let old_ratio = sides[0] / sides[1];
    let mean = (sides[0] * sides[1]).sqrt();
    let grow = (ratio / old_ratio).sqrt();
    let (u, v) = (local(angle, 1.0, 0.0), local(angle, 0.0, 1.0));
    // Both sides changed, only the first, only the second.
    let changes = [(grow, 1.0 / grow), (grow * grow, 1.0), (1.0, 1.0 / (grow * grow))];
    let mut states = Vec::new();
    for corner in corners {
        let off = centre - corner;
        for (along, across) in changes {
            let centre = corner + along * off.dot(&u) * u + across * off.dot(&v) * v;
            let mean = mean * (along * across).sqrt();
            states.push(State::RectangleOfRatio { centre, mean, angle, ratio });
        }
    }
    states
}
