//! Compares contacts with the truth: errors, calibration of the error bars, modes, and missed contacts.

use super::contacts::ContactRow;
use super::truth::{TruthContact, TruthRow};
use crate::estimate::Mode;
use std::collections::BTreeMap;

/// Contacts with less force than this say little about the place along the whisker; newtons.
pub const FIRM_N: f64 = 0.1;

/// A share of the contacts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    /// Every contact of the truth.
    All,
    /// Those with a true force of `FIRM_N` or more.
    Firm,
    /// Of those, between clamp and tip.
    FirmMid,
    /// Of those, at the tip.
    FirmTip,
}

impl Group {
    /// In the order of the report.
    pub const ALL: [Group; 4] = [Group::All, Group::Firm, Group::FirmMid, Group::FirmTip];

    fn holds(self, truth: &TruthContact) -> bool {
        let is_firm = FIRM_N <= truth.force_n.norm();
        match self {
            Group::All => true,
            Group::Firm => is_firm,
            Group::FirmMid => is_firm && !truth.is_tip(),
            Group::FirmTip => is_firm && truth.is_tip(),
        }
    }
}

/// How far the contacts of a group are from the truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// Which.
    pub group: Group,
    /// Contacts of the truth.
    pub n_true: usize,
    /// Of those, with a place and status ok: the figures below are theirs.
    pub n_scored: usize,
    /// Root mean square of the distance to the true point, metres.
    pub rms_m: f64,
    /// Half are nearer, metres.
    pub median_m: f64,
    /// The farthest, metres.
    pub max_m: f64,
    /// Root mean square error of the arc length, metres.
    pub s_rms_m: f64,
    /// Root mean square error of the direction, radians.
    pub theta_rms_rad: f64,
    /// Mean squared error in units of its covariance, two degrees of freedom: 2 where error bars are right.
    pub nees: f64,
    /// Share of the scored whose mode is right.
    pub mode_right: f64,
}

/// A whole comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// By group; those without a scored contact have NaN figures.
    pub scores: Vec<Score>,
    /// Contacts of the truth (`FIRM_N` or more) to which no place, or a status other than ok, was given.
    pub n_firm_unanswered: usize,
    /// Contacts said, with status ok, where nothing is touched.
    pub n_false: usize,
    /// Rows of the truth without a row of contacts.
    pub n_unmatched: usize,
}

/// A contact beside its truth.
struct Pair<'a> {
    row: &'a ContactRow,
    truth: &'a TruthContact,
    error_m: f64,
    nees: f64,
}

/// Compares by sweep and sample.
pub fn compare(rows: &[ContactRow], truth: &[TruthRow]) -> Comparison {
    let by_number: BTreeMap<(u32, u32), &ContactRow> =
        rows.iter().map(|row| ((row.sweep, row.sample), row)).collect();
    let row_of = |truth: &TruthRow| by_number.get(&(truth.sweep, truth.sample)).copied();
    let pairs: Vec<Pair> = truth.iter().filter_map(|t| pair(row_of(t)?, t.contact.as_ref()?)).collect();
    let scores: Vec<Score> = Group::ALL.iter().map(|group| score(*group, &pairs, truth)).collect();
    let is_false = |t: &&TruthRow| t.contact.is_none() && row_of(t).is_some_and(ContactRow::is_ok);
    Comparison {
        n_firm_unanswered: scores[1].n_true - scores[1].n_scored,
        scores,
        n_false: truth.iter().filter(is_false).count(),
        n_unmatched: truth.iter().filter(|t| row_of(t).is_none()).count(),
    }
}

fn pair<'a>(row: &'a ContactRow, truth: &'a TruthContact) -> Option<Pair<'a>> {
    let figures = row.figures.filter(|_| row.is_ok())?;
    let error = figures.x_in_world - truth.x_in_world;
    let inverse = figures.covariance.fixed_view::<2, 2>(0, 0).into_owned().try_inverse();
    let nees = inverse.map_or(f64::NAN, |inverse| error.dot(&(inverse * error)));
    Some(Pair { row, truth, error_m: error.norm(), nees })
}

fn score(group: Group, pairs: &[Pair], truth: &[TruthRow]) -> Score {
    let n_true = truth.iter().filter_map(|t| t.contact.as_ref()).filter(|t| group.holds(t)).count();
    let pairs: Vec<&Pair> = pairs.iter().filter(|p| group.holds(p.truth)).collect();
    let mean = |of: &dyn Fn(&Pair) -> f64| pairs.iter().map(|p| of(p)).sum::<f64>() / pairs.len() as f64;
    let figure =
        |p: &Pair, of: fn(&super::contacts::Figures) -> f64| p.row.figures.as_ref().map_or(f64::NAN, of);
    let mut errors: Vec<f64> = pairs.iter().map(|p| p.error_m).collect();
    errors.sort_by(f64::total_cmp);
    Score {
        group,
        n_true,
        n_scored: pairs.len(),
        rms_m: mean(&|p| p.error_m * p.error_m).sqrt(),
        median_m: errors.get(errors.len() / 2).copied().unwrap_or(f64::NAN),
        max_m: errors.last().copied().unwrap_or(f64::NAN),
        s_rms_m: mean(&|p| (figure(p, |f| f.s_m) - p.truth.s_m).powi(2)).sqrt(),
        theta_rms_rad: mean(&|p| turn(figure(p, |f| f.theta_rad) - p.truth.theta_rad).powi(2)).sqrt(),
        nees: mean(&|p| p.nees),
        mode_right: mean(&|p| f64::from((p.row.mode == Mode::Tip) == p.truth.is_tip())),
    }
}

/// Between −π and π.
fn turn(angle_rad: f64) -> f64 {
    let (sin, cos) = angle_rad.sin_cos();
    sin.atan2(cos)
}
