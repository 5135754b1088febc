//! A scene solved: every question with its answer or its reason.

use super::scene::{NamedQuery, NamedScene};
use super::words;
use crate::core::survey::{Adjusted, Frame, Measured, RIVAL_GATE_CHI2, Suspect, adjust};

/// One question answered.
#[derive(Debug, Clone, PartialEq)]
pub struct QueryAnswer {
    /// The question.
    pub query: NamedQuery,
    /// One value, three for a position; or why there is none.
    pub result: Result<Vec<Measured>, String>,
}

/// A scene solved.
#[derive(Debug, Clone)]
pub struct Answers {
    /// Places of everything.
    pub adjusted: Adjusted,
    /// One a question, in order.
    pub answers: Vec<QueryAnswer>,
    /// What a reader must know besides: contradictions, rivals, what was left out.
    pub remarks: Vec<String>,
}

/// Solves a scene.
///
/// # Errors
/// A sentence, with the scene's names, where nothing can be solved.
pub fn measure(scene: &NamedScene) -> Result<Answers, String> {
    let cameras = scene.survey_cameras();
    let survey = scene.survey(&cameras);
    let adjusted = adjust(&survey).map_err(|e| words::error(scene, &e))?;
    let answer = |query: &NamedQuery| {
        let values = scene.core_queries(query).into_iter().enumerate().map(|(axis, q)| {
            let shift = if query.kind == super::QueryKind::Position { scene.origin_m[axis] } else { 0.0 };
            let moved = |m: Measured| Measured {
                value: m.value + shift,
                low: m.low + shift,
                high: m.high + shift,
                ..m
            };
            adjusted.measure(&survey, &q).map(moved).map_err(|e| words::error(scene, &e))
        });
        QueryAnswer { query: query.clone(), result: values.collect() }
    };
    let answers = scene.queries.iter().map(answer).collect();
    let remarks = remarks(scene, &adjusted);
    Ok(Answers { adjusted, answers, remarks })
}

/// Suspects named; the rest follow from the first.
const MOST_SUSPECTS: usize = 3;
/// Two statistics that differ by less than this part cannot be told apart.
const TIED: f64 = 0.01;

/// What contradicts what, where anything does.
fn contradiction(scene: &NamedScene, adjusted: &Adjusted) -> Option<String> {
    let Some((first, rest)) = adjusted.suspects.split_first() else {
        let (chi2, n) = (adjusted.chi2, adjusted.degrees_of_freedom);
        return adjusted.is_inconsistent.then(|| format!(
            "inconsistent: χ² {chi2:.1} for {n} degrees of freedom, and no single fact explains it; the sigmas are too small, or the intrinsics wrong"
        ));
    };
    let is_tied = |s: &&Suspect| first.sigmas * (1.0 - TIED) < s.sigmas;
    let tied = rest.iter().take(MOST_SUSPECTS - 1).take_while(is_tied);
    let which: Vec<String> = std::iter::once(first).chain(tied).map(|s| words::suspect(scene, s)).collect();
    Some(format!("inconsistent: {}; check it, correct or remove it, and measure again", which.join(", or ")))
}

fn remarks(scene: &NamedScene, adjusted: &Adjusted) -> Vec<String> {
    let mut remarks = Vec::new();
    remarks.extend(contradiction(scene, adjusted));
    if 1.0 < adjusted.noise_scale {
        remarks.push(format!("every interval was widened by {:.2} for that", adjusted.noise_scale.sqrt()));
    }
    if let Some(delta) = adjusted.rival_delta_chi2.filter(|d| *d < RIVAL_GATE_CHI2) {
        remarks.push(format!(
            "ambiguous: another arrangement of photographs and marks fits about as well (χ² {delta:.1} above, {RIVAL_GATE_CHI2} needed); add a mark off the others' plane, or another photograph"
        ));
    }
    if adjusted.degrees_of_freedom == 0 {
        remarks
            .push("nothing is left over to check anything with: no wrong click could be noticed".to_string());
    }
    if adjusted.frame == Frame::Held {
        remarks.push("coordinates leave a turn or a shift free: lengths, angles, areas and heights are right, positions only relative to each other".to_string());
    }
    remarks.extend(adjusted.undetermined.iter().map(|(item, reason)| {
        let (name, reason) = (words::item(scene, *item), words::error(scene, reason));
        if reason.starts_with(&name) {
            format!("left out: {reason}")
        } else {
            format!("left out: {name}: {reason}")
        }
    }));
    remarks
}
