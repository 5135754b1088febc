//! Boards that look the same after a rotation: every pose has others that fit equally well, and the image does not decide between them.

use crate::answer::{PoseAnswer, Status};
use crate::report::words::percent;
use resight_core::locate::PoseEstimate;
use resight_core::locate::choose::{Ambiguity, Hypothesis, Minimum};
use resight_core::{Pose, Target};

/// Adds the poses that the board's symmetry allows to an answer that is `ok` or `ambiguous`; other answers are unchanged.
pub(super) fn judged(mut answer: PoseAnswer, target: &Target) -> PoseAnswer {
    let symmetries = target.symmetries();
    let is_alike = matches!(answer.status(), Status::Ok | Status::Ambiguous);
    let Some(estimate) = answer.estimate.take_if(|_| is_alike && !symmetries.is_empty()) else {
        return answer;
    };
    let (n, estimate) = (1 + symmetries.len(), with_rotations(estimate, &symmetries));
    let (rotation, count) = if n == 2 { ("half a turn", "two") } else { ("each quarter of a turn", "four") };
    let tilt = match answer.status() {
        Status::Ambiguous => {
            "; besides, a second tilt fits each about equally well: tilt the target, or move closer"
        }
        _ => "",
    };
    answer.verdict.message = format!(
        "the board looks the same after {rotation}, so {count} poses fit alike, {} each; the first is the one that is upright in the image: choose by what \
         you know, or take {}{tilt}",
        percent(estimate.probability),
        crate::formats::unambiguous_instead(target)
    );
    answer.verdict.status = Status::Ambiguous;
    answer.estimate = Some(estimate);
    answer
}

/// Returns the estimate with the poses that follow by rotations of the target's frame, all equally probable; those of this estimate come first.
fn with_rotations(mut estimate: PoseEstimate, target_from_target: &[Pose]) -> PoseEstimate {
    let share = 1.0 / (1 + target_from_target.len()) as f64;
    let hypotheses: Vec<Hypothesis> = estimate.minima().collect();
    let rotated = |h: &Hypothesis, by: &Pose| Hypothesis {
        minimum: Minimum { cam_from_target: h.minimum.cam_from_target * *by, ..h.minimum },
        probability: share * h.probability,
        ..*h
    };
    let mut others: Vec<Hypothesis> = Vec::new();
    for h in &hypotheses {
        if others.is_empty() || h.is_alternative {
            others.extend(target_from_target.iter().map(|by| rotated(h, by)));
        }
    }
    others.extend(hypotheses[1..].iter().map(|h| Hypothesis { probability: share * h.probability, ..*h }));
    // The sort is stable: of equals, the rotated poses of the answer stay first.
    others.sort_by(|a, b| {
        b.is_alternative.cmp(&a.is_alternative).then(b.probability.total_cmp(&a.probability))
    });
    estimate.probability *= share;
    if let Some(first) = others.first() {
        estimate.ambiguity = Ambiguity::Ambiguous { ratio: 1.0, other: first.minimum };
    }
    estimate.others = std::array::from_fn(|i| others.get(i).copied());
    estimate
}
