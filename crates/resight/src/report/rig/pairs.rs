//! Pairs of cameras: the number of shared views, and their relative pose.

use super::pieces::{number, row, tabular};
use crate::core::{Matrix6, Pose};
use crate::report::html::escaped;
use crate::report::words;
use crate::rig::RigRun;
use crate::rig::relative::between;
use crate::scene::geometry;

/// Largest number of rows; the pairs with the most shared views come first.
const MOST_ROWS: usize = 300;
const HEAD: [&str; 9] = [
    "from",
    "to",
    "shared views",
    "distance",
    "x",
    "y",
    "z (frame of the first)",
    "rotated by",
    "± about its x y z",
];

/// Returns one row for each pair of cameras that share views.
pub(super) fn table(run: &RigRun) -> String {
    let n = run.rig.cameras.len();
    let counts = &run.solution.shared.counts;
    let all = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
    let mut pairs: Vec<(usize, usize)> = all.filter(|&(a, b)| 0 < counts[a][b]).collect();
    let n_pairs = pairs.len();
    pairs.sort_by_key(|&(a, b)| (std::cmp::Reverse(counts[a][b]), a, b));
    pairs.truncate(MOST_ROWS);
    let rows: String = pairs.iter().map(|&(a, b)| row(&cells(run, a, b))).collect();
    let shown = if pairs.len() < n_pairs {
        format!(" ({} of {n_pairs} pairs: those with the most shared views)", pairs.len())
    } else {
        String::new()
    };
    let caption = format!(
        "Pairs that share views: the second camera seen from the first, ± one standard deviation{shown}"
    );
    format!("{}{}", tabular("pairs", &caption, &HEAD, &rows), note(run))
}

fn note(run: &RigRun) -> &'static str {
    if run.solution.joint_covariance.is_some() || run.rig.cameras.len() < 3 {
        ""
    } else {
        "<p class=\"note\">± of a pair without the reference camera needs the covariance of all cameras together \
         (<code>--joint-covariance</code>).</p>"
    }
}

fn cells(run: &RigRun, a: usize, b: usize) -> Vec<String> {
    let (b_from_a, covariance) = relative(run, a, b);
    let name = |i: usize| escaped(&run.rig.cameras[i].name);
    let place = b_from_a.origin();
    let mut cells = vec![name(a), name(b), super::grouped(run.solution.shared.counts[a][b])];
    let turned_deg = b_from_a.angle_to_rad(&Pose::identity()).to_degrees();
    match covariance {
        Some(covariance) => {
            let of_place = geometry::position_covariance(&b_from_a, &covariance);
            let along = place / place.norm().max(f64::MIN_POSITIVE);
            let distance = (along.transpose() * of_place * along)[(0, 0)].max(0.0).sqrt();
            cells.push(words::coordinate(place.norm(), distance).trim_start_matches('+').into());
            cells.extend((0..3).map(|i| words::coordinate(place[i], of_place[(i, i)].max(0.0).sqrt())));
            let turns = words::sigmas(&covariance).0;
            let decimals = words::decimals(turns.into_iter().fold(0.0, f64::max).to_degrees());
            cells.extend([format!("{turned_deg:.decimals$}°"), turns.map(words::degrees).join(" ")]);
        }
        None => {
            cells.push(words::length(place.norm()));
            cells.extend((0..3).map(|i| format!("{} mm", number(place[i] * 1e3, 1))));
            cells.extend([format!("{turned_deg:.2}°"), "–".into()]);
        }
    }
    cells
}

/// Returns `cam_b_from_cam_a` and its covariance in frame b, where the run determines it: from the covariance of all cameras together, or,
/// without it, for pairs with the reference camera, which has no covariance of its own.
pub(super) fn relative(run: &RigRun, a: usize, b: usize) -> (Pose, Option<Matrix6>) {
    let s = &run.solution;
    let b_from_a = s.cameras[b].cam_from_rig * s.cameras[a].cam_from_rig.inverse();
    let covariance = match between(s, a, b) {
        Some(both) => Some(both.covariance),
        None if a == s.reference => Some(s.cameras[b].covariance),
        None if b == s.reference => {
            Some(s.cameras[a].cam_from_rig.inverse_covariance(&s.cameras[a].covariance))
        }
        None => None,
    };
    (b_from_a, covariance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::Vector6;
    use crate::core::multiview::rig::{CameraInRig, RigSolution, RigVerdict, SharedViews};
    use crate::rig::NamedRig;
    use nalgebra::{DMatrix, Matrix6x3};

    fn run(cameras: Vec<CameraInRig>, joint_covariance: Option<DMatrix<f64>>) -> RigRun {
        let rig = NamedRig {
            cameras: vec![],
            lenses: vec![],
            views: vec![],
            targets: vec![],
            body_of_target: vec![],
            observations: vec![],
        };
        let solution = RigSolution {
            reference: 0,
            cameras,
            budgets: vec![],
            targets: vec![],
            bodies: vec![],
            observations: vec![],
            shared: SharedViews { counts: vec![], groups: vec![] },
            weakest_link: None,
            scales: vec![],
            rms_px: 0.0,
            chi2: 0.0,
            degrees_of_freedom: 0,
            n_seen: 0,
            n_used: 0,
            joint_covariance,
            joint_targets: None,
            noise_scale: 1.0,
            view_scale: 1.0,
            lens_sigma_m: None,
            explanations: vec![],
            steps: 0,
            verdict: RigVerdict::default(),
        };
        RigRun { rig, solution, lenses: vec![], times: None, inputs: vec![], command: None }
    }

    fn camera(motion: [f64; 6], covariance: Matrix6) -> CameraInRig {
        let cam_from_rig = Pose::exp(&Vector6::from_row_slice(&motion));
        CameraInRig { cam_from_rig, covariance, n_views: 1, n_seen: 1, n_used: 1, rms_px: 0.0 }
    }

    /// Three common causes move two cameras together; the pair's covariance is that of the resulting differences, by finite steps.
    #[test]
    fn what_two_cameras_share_does_not_move_them_apart() {
        let [ja, jb] =
            [1.0f64, 2.0].map(|k| Matrix6x3::from_fn(|i, j| 1e-3 * (k * (i + 3 * j) as f64 + 1.0).sin()));
        let [sa, sb] = [ja, jb].map(|j| j * j.transpose());
        let a = camera([0.3, -0.2, 0.1, 0.5, 0.1, -0.4], sa);
        let b = camera([-0.1, 0.8, 0.2, -0.3, 0.6, 0.9], sb);
        let mut joint = DMatrix::zeros(18, 18);
        joint.view_mut((6, 6), (6, 6)).copy_from(&sa);
        joint.view_mut((12, 12), (6, 6)).copy_from(&sb);
        joint.view_mut((12, 6), (6, 6)).copy_from(&(jb * ja.transpose()));
        joint.view_mut((6, 12), (6, 6)).copy_from(&(ja * jb.transpose()));
        let first = camera([0.0; 6], Matrix6::zeros());
        let (ta, tb) = (a.cam_from_rig, b.cam_from_rig);
        let run = run(vec![first, a, b], Some(joint));
        let (b_from_a, covariance) = relative(&run, 1, 2);
        let mut expected = Matrix6::zeros();
        for cause in 0..3 {
            let step = 1e-4;
            let moved = (Pose::exp(&(jb.column(cause) * step)) * tb)
                * (Pose::exp(&(ja.column(cause) * step)) * ta).inverse();
            let xi = (moved * b_from_a.inverse()).log() / step;
            expected += xi * xi.transpose();
        }
        // Steps of 1e-4 leave errors of second order, 1e-4 of causes of 1e-3.
        assert!((covariance.unwrap() - expected).norm() < 1e-5 * expected.norm());
        assert_eq!(relative(&run, 0, 2).1, Some(sb));
        let back = relative(&run, 2, 0).1.unwrap();
        assert!((back - tb.inverse_covariance(&sb)).norm() < 1e-12 * back.norm());
    }

    #[test]
    fn without_the_joint_covariance_only_pairs_with_the_reference_have_one() {
        let covariance = Matrix6::from_diagonal(&Vector6::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0));
        let other = camera([0.3, -0.2, 0.1, 0.5, 0.1, -0.4], covariance);
        let run = run(vec![camera([0.0; 6], Matrix6::zeros()), other.clone(), other.clone()], None);
        assert_eq!(relative(&run, 0, 1).1, Some(covariance));
        let back = relative(&run, 1, 0);
        assert!((back.0 * other.cam_from_rig).log().norm() < 1e-12);
        assert_eq!(back.1, Some(other.cam_from_rig.inverse_covariance(&covariance)));
        assert!(relative(&run, 1, 2).1.is_none());
    }
}
