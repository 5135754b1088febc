//! Pose graphs: chains, joint answers, statistics, wrong pairs, what is refused.

use crate::budget::{assert_adds_up, part};
use crate::common::{Rng, held};
use crate::warnings;
use nalgebra::{DMatrix, Matrix6, Vector6};
use resight_core::budget::ErrorSource;
use resight_core::multiview::pose_graph::{
    PairNoise, PairSigma, PoseGraph, PoseGraphConfig, PoseGraphSolution, RelativePose, chain, groups,
    solve_pose_graph,
};
use resight_core::{Error, Pose};

/// Cameras around a room, each looking anywhere.
fn room(rng: &mut Rng, n: usize) -> Vec<Pose> {
    let mut cameras: Vec<Pose> = (0..n).map(|_| Pose::new(rng.rotation(), rng.unit_vector() * 2.0)).collect();
    let rig_from_first = cameras[0].inverse();
    for camera in &mut cameras {
        *camera = *camera * rig_from_first;
    }
    cameras
}

/// A ring, and every pair that a coin picks.
fn joined(rng: &mut Rng, n: usize, chance: f64) -> Vec<(usize, usize)> {
    let mut pairs: Vec<_> = (0..n).map(|i| (i, (i + 1) % n)).collect();
    for a in 0..n {
        pairs.extend(
            (a + 2..n)
                .filter(|b| (a, *b) != (0, n - 1))
                .filter(|_| rng.uniform(0.0, 1.0) < chance)
                .map(|b| (b, a)),
        );
    }
    pairs
}

fn covariance(rng: &mut Rng) -> Matrix6<f64> {
    let root = Matrix6::from_fn(|i, j| if i == j { 1.0 } else { 0.3 * rng.normal() });
    root * root.transpose() * 1e-6 * rng.uniform(0.5, 4.0)
}

fn drawn(rng: &mut Rng, covariance: &Matrix6<f64>) -> Vector6<f64> {
    covariance.cholesky().unwrap().l() * Vector6::from_fn(|_, _| rng.normal())
}

/// Each pair disturbed by a covariance of its own.
fn measured(rng: &mut Rng, cameras: &[Pose], stated: &[(usize, usize, Matrix6<f64>)]) -> Vec<RelativePose> {
    let pair = |&(a, b, covariance): &(usize, usize, Matrix6<f64>)| RelativePose {
        a,
        b,
        b_from_a: Pose::exp(&drawn(rng, &covariance)) * cameras[b] * cameras[a].inverse(),
        noise: PairNoise::Covariance(covariance),
    };
    stated.iter().map(pair).collect()
}

fn solve(n_cameras: usize, pairs: &[RelativePose]) -> Result<PoseGraphSolution, Error> {
    let found = solve_pose_graph(
        &PoseGraph { n_cameras, pairs },
        &PoseGraphConfig { reference_camera: 0, median_sigma: None },
    )?;
    held::assert_graph(&found, "a graph");
    Ok(found)
}

fn error(cameras: &[Pose], found: &PoseGraphSolution, i: usize) -> Vector6<f64> {
    (found.cameras[i].cam_from_rig * cameras[i].inverse()).log()
}

fn squared(error: &Vector6<f64>, covariance: &Matrix6<f64>) -> f64 {
    error.dot(&covariance.cholesky().unwrap().solve(error))
}

/// Information of all cameras but the first, derivatives by central differences of the predicted pairs.
fn information(cameras: &[Pose], stated: &[(usize, usize, Matrix6<f64>)]) -> DMatrix<f64> {
    const STEP: f64 = 1e-5;
    let n = 6 * (cameras.len() - 1);
    let mut sum = DMatrix::zeros(n, n);
    for (a, b, covariance) in stated {
        let truth = cameras[*b] * cameras[*a].inverse();
        let predicted = |column: usize, h: f64| {
            let moved = |i: usize| match 1 + column / 6 == i {
                true => Pose::exp(&Vector6::ith(column % 6, h)) * cameras[i],
                false => cameras[i],
            };
            (moved(*b) * moved(*a).inverse() * truth.inverse()).log()
        };
        let jacobian = DMatrix::from_fn(6, n, |row, column| {
            (predicted(column, STEP) - predicted(column, -STEP))[row] / (2.0 * STEP)
        });
        let weight = covariance.try_inverse().unwrap();
        let weight = DMatrix::from_fn(6, 6, |i, j| weight[(i, j)]);
        sum += jacobian.transpose() * weight * jacobian;
    }
    sum
}

#[test]
fn exact_pairs_give_the_exact_rig() {
    let mut rng = Rng::new(201);
    for n in [1, 2, 3, 8] {
        let cameras = room(&mut rng, n);
        let ring = if n < 3 { (1..n).map(|i| (0, i)).collect() } else { joined(&mut rng, n, 0.5) };
        for error_measure in [0.5, 3.0] {
            let exact = |&(a, b): &(usize, usize)| RelativePose {
                a,
                b,
                b_from_a: cameras[b] * cameras[a].inverse(),
                noise: PairNoise::Error(error_measure),
            };
            let pairs: Vec<_> = ring.iter().map(exact).collect();
            let found = solve(n, &pairs).unwrap();
            for i in 0..n {
                assert!(error(&cameras, &found, i).amax() < 1e-12, "{n} {i}");
            }
            assert!(found.pairs.iter().all(|pair| !pair.is_suspicious));
            assert!(found.joint_covariance.iter().all(|x| x.is_finite()));
        }
    }
}

/// NEES of every camera and of a relative pose between two of them, and the mean squared error against the Cramér–Rao bound.
/// 1000 runs of 5 cameras: 6 ± 0.05.
#[test]
fn covariance_and_efficiency_are_those_of_the_bound() {
    let mut rng = Rng::new(202);
    let (n, runs) = (6, 1000);
    let cameras = room(&mut rng, n);
    let stated: Vec<_> =
        joined(&mut rng, n, 0.4).iter().map(|(a, b)| (*a, *b, covariance(&mut rng))).collect();
    let bound = information(&cameras, &stated).try_inverse().unwrap();
    let (mut nees, mut in_bounds, mut relative, mut chi2, mut suspicious) = (0.0, 0.0, 0.0, 0.0, 0);
    for _ in 0..runs {
        let pairs = measured(&mut rng, &cameras, &stated);
        let found = solve(n, &pairs).unwrap();
        for i in 1..n {
            let error = error(&cameras, &found, i);
            nees += squared(&error, &found.cameras[i].covariance);
            in_bounds += squared(&error, &bound.fixed_view::<6, 6>(6 * (i - 1), 6 * (i - 1)).into());
        }
        let (b_from_a, own) = found.b_from_a(2, 4).unwrap();
        relative += squared(&(b_from_a * (cameras[4] * cameras[2].inverse()).inverse()).log(), &own)
            / f64::from(runs);
        chi2 += found.chi2 / found.degrees_of_freedom as f64 / f64::from(runs);
        suspicious += found.pairs.iter().filter(|pair| pair.is_suspicious).count();
    }
    let all = f64::from(runs) * (n - 1) as f64;
    println!(
        "{} pairs: NEES {:.3}, relative {relative:.3}, efficiency {:.3}, χ² per degree of freedom {chi2:.3}, suspicious {suspicious} of {}",
        stated.len(),
        nees / all,
        6.0 * all / in_bounds,
        stated.len() * runs as usize
    );
    assert!((5.7..6.3).contains(&(nees / all)) && (5.7..6.3).contains(&relative));
    assert!(0.95 < 6.0 * all / in_bounds);
    assert!((chi2 - 1.0).abs() < 0.03);
    // Stated once in ten thousand each.
    assert!(suspicious as f64 <= 4.0 * 1e-4 * (stated.len() * runs as usize) as f64, "{suspicious}");
}

/// Errors only: the sigmas are found, and the covariances rest on them.
#[test]
fn sigmas_come_from_the_agreement_of_the_pairs() {
    let mut rng = Rng::new(203);
    let (n, runs, sigma) = (8, 300, PairSigma { sigma_rad: 2e-3, sigma_m: 7e-3 });
    let cameras = room(&mut rng, n);
    let ring = joined(&mut rng, n, 0.6);
    let errors: Vec<f64> = ring.iter().map(|_| rng.uniform(0.5, 2.0)).collect();
    let mut sorted = errors.clone();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted[sorted.len() / 2];
    let (mut turn, mut shift, mut nees) = (0.0, 0.0, 0.0);
    for _ in 0..runs {
        let pair = |(i, &(a, b)): (usize, &(usize, usize))| {
            let scale = errors[i] / middle;
            let (r, t) = (sigma.sigma_rad * scale, sigma.sigma_m * scale);
            let noise = Vector6::new(r, r, r, t, t, t).component_mul(&Vector6::from_fn(|_, _| rng.normal()));
            let b_from_a = Pose::exp(&noise) * cameras[b] * cameras[a].inverse();
            RelativePose { a, b, b_from_a, noise: PairNoise::Error(errors[i] * 1e-3) }
        };
        let pairs: Vec<_> = ring.iter().enumerate().map(pair).collect();
        let found = solve(n, &pairs).unwrap();
        let own = found.median_sigma.unwrap();
        turn += (own.sigma_rad / sigma.sigma_rad).powi(2) / f64::from(runs);
        shift += (own.sigma_m / sigma.sigma_m).powi(2) / f64::from(runs);
        // By construction: the estimated sigmas make χ² what it should be.
        let used = found.pairs.iter().filter(|pair| pair.is_used).count();
        assert_eq!(found.degrees_of_freedom, 6 * (used - n + 1));
        assert!((found.chi2 / found.degrees_of_freedom as f64 - 1.0).abs() < 1e-6);
        let redundancy: f64 = found.pairs.iter().filter(|p| p.is_used).map(|p| p.redundancy).sum();
        assert!((redundancy - found.degrees_of_freedom as f64).abs() < 1e-6);
        nees +=
            (1..n).map(|i| squared(&error(&cameras, &found, i), &found.cameras[i].covariance)).sum::<f64>();
    }
    nees /= f64::from(runs) * (n - 1) as f64;
    println!(
        "variances found over true: turns {turn:.3}, shifts {shift:.3}; NEES {nees:.3}, {} pairs",
        ring.len()
    );
    // 22 pairs, 45 numbers each: ± 0.21 a run, ± 0.012 for the mean.
    assert!((turn - 1.0).abs() < 0.05 && (shift - 1.0).abs() < 0.05, "{turn} {shift}");
    // Estimated variances make NEES an F variable: its mean is ν/(ν − 2) larger.
    assert!((5.7..6.5).contains(&nees), "{nees}");
}

/// The first pair and two more, sorted, with no camera in two of them or with fewer than two good ones: more cannot be identified.
fn one_each(rng: &mut Rng, n: usize, stated: &[(usize, usize, Matrix6<f64>)]) -> [usize; 3] {
    loop {
        let mut wrong = [0, 1 + rng.index(stated.len() - 1), 1 + rng.index(stated.len() - 1)];
        wrong.sort_unstable();
        let of = |camera: usize| {
            let mine = (0..stated.len()).filter(|i| stated[*i].0 == camera || stated[*i].1 == camera);
            mine.partition::<Vec<_>, _>(|i| wrong.contains(i))
        };
        if wrong[1] != wrong[2] && (0..n).map(of).all(|(bad, good)| bad.len() <= 1 && 2 <= good.len()) {
            return wrong;
        }
    }
}

/// Pairs off by degrees and centimetres are named, whatever start the chain through them gives; the rest is as good as without them.
#[test]
fn wrong_pairs_are_named_and_do_no_harm() {
    let mut rng = Rng::new(204);
    for run in 0..40 {
        let n = 8;
        let cameras = room(&mut rng, n);
        let stated: Vec<_> =
            joined(&mut rng, n, 0.7).iter().map(|(a, b)| (*a, *b, covariance(&mut rng))).collect();
        let mut pairs = measured(&mut rng, &cameras, &stated);
        let size = if run % 2 == 0 { 0.05 } else { 1.0 };
        let wrong = one_each(&mut rng, n, &stated);
        for i in wrong {
            let (turn, shift) = (rng.unit_vector() * size, rng.unit_vector() * size);
            let off = Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z);
            pairs[i].b_from_a = Pose::exp(&off) * pairs[i].b_from_a;
        }
        let found = solve(n, &pairs).unwrap();
        let named: Vec<usize> = (0..pairs.len()).filter(|i| found.pairs[*i].is_suspicious).collect();
        assert_eq!(named, wrong, "run {run}");
        for i in 1..n {
            // χ² with six degrees of freedom: 35 is exceeded four times in a million.
            assert!(squared(&error(&cameras, &found, i), &found.cameras[i].covariance) < 35.0, "run {run}");
        }
    }
}

/// A bridge cannot be checked, and says so; it is never called suspicious.
#[test]
fn a_bridge_is_said_to_be_unchecked() {
    let mut rng = Rng::new(205);
    let cameras = room(&mut rng, 5);
    let ring = [(0, 1), (1, 2), (2, 0), (0, 2), (2, 3), (3, 4)];
    let stated: Vec<_> = ring.iter().map(|(a, b)| (*a, *b, covariance(&mut rng))).collect();
    let found = solve(5, &measured(&mut rng, &cameras, &stated)).unwrap();
    for (i, pair) in found.pairs.iter().enumerate() {
        let is_bridge = 4 <= i;
        assert_eq!(pair.redundancy < 1e-6, is_bridge, "{i}: {}", pair.redundancy);
        assert!(!is_bridge || pair.disagreement_sigma.is_none() && pair.residual.amax() < 1e-9);
    }
    assert_eq!(found.degrees_of_freedom, 12);
}

/// Three pairs of a triangle that hangs on the rest by one camera: a misclosure is named, all three are suspects, and the covariances of its
/// cameras hold that any of them may be wrong.
#[test]
fn suspects_that_nobody_can_tell_apart_are_named_together() {
    let mut rng = Rng::new(210);
    let cameras = room(&mut rng, 7);
    let mut ring: Vec<_> = joined(&mut rng, 5, 1.0);
    let first = ring.len();
    ring.extend([(0, 5), (5, 6), (0, 6)]);
    let stated: Vec<_> = ring.iter().map(|(a, b)| (*a, *b, covariance(&mut rng))).collect();
    for wrong in first..first + 3 {
        let mut pairs = measured(&mut rng, &cameras, &stated);
        pairs[wrong].b_from_a =
            Pose::exp(&Vector6::new(0.05, 0.0, 0.0, 0.0, 0.05, 0.0)) * pairs[wrong].b_from_a;
        let found = solve(7, &pairs).unwrap();
        let named: Vec<usize> = (0..pairs.len()).filter(|i| found.pairs[*i].is_suspicious).collect();
        assert_eq!(named, [first, first + 1, first + 2]);
        assert!(found.pairs.iter().all(|pair| pair.is_used));
        for i in 5..7 {
            let (budget, whole) = (&found.budgets[i], &found.cameras[i].covariance);
            assert_adds_up(budget, whole, "suspects");
            let doubt = part(budget, ErrorSource::Residuals).trace() / whole.trace();
            assert!(0.9 < doubt, "{i}: {doubt}");
            assert!(squared(&error(&cameras, &found, i), whole) < 30.0, "{i}");
        }
    }
}

/// Pairs, and residuals beyond their stated sigmas, add up to each camera's covariance.
#[test]
fn the_parts_of_a_pose_graph_add_up() {
    let mut rng = Rng::new(211);
    let cameras = room(&mut rng, 6);
    let stated: Vec<_> =
        joined(&mut rng, 6, 0.6).iter().map(|(a, b)| (*a, *b, covariance(&mut rng))).collect();
    for times in [1.0, 16.0] {
        let truth: Vec<_> = stated.iter().map(|(a, b, c)| (*a, *b, c * times)).collect();
        let mut pairs = measured(&mut rng, &cameras, &truth);
        for (pair, (.., stated)) in pairs.iter_mut().zip(&stated) {
            pair.noise = PairNoise::Covariance(*stated);
        }
        let found = solve(6, &pairs).unwrap();
        for (budget, camera) in found.budgets.iter().zip(&found.cameras).skip(1) {
            assert_adds_up(budget, &camera.covariance, "pairs");
            assert_eq!(budget.has(ErrorSource::Residuals), 1.0 < found.noise_scale);
        }
        assert_eq!(1.0 < times, 1.0 < found.noise_scale, "{}", found.noise_scale);
        assert!(found.budgets[0].parts().is_empty());
    }
}

/// The joint answer is the same rig whichever camera is the reference camera, and whichever way round a pair is stated.
#[test]
fn neither_anchor_nor_direction_matters() {
    let mut rng = Rng::new(206);
    let n = 6;
    let cameras = room(&mut rng, n);
    let stated: Vec<_> =
        joined(&mut rng, n, 0.5).iter().map(|(a, b)| (*a, *b, covariance(&mut rng))).collect();
    let pairs = measured(&mut rng, &cameras, &stated);
    let first = solve(n, &pairs).unwrap();
    let turned: Vec<_> = pairs
        .iter()
        .map(|p| {
            let PairNoise::Covariance(c) = p.noise else { unreachable!() };
            let noise = PairNoise::Covariance(p.b_from_a.inverse_covariance(&c));
            RelativePose { a: p.b, b: p.a, b_from_a: p.b_from_a.inverse(), noise }
        })
        .collect();
    let config = PoseGraphConfig { reference_camera: 3, median_sigma: None };
    let second = solve_pose_graph(&PoseGraph { n_cameras: n, pairs: &turned }, &config).unwrap();
    for (a, b) in (0..n).flat_map(|a| (0..n).filter(move |b| a != *b).map(move |b| (a, b))) {
        let ((one, own), (two, other)) = (first.b_from_a(a, b).unwrap(), second.b_from_a(a, b).unwrap());
        // The loop ends 3·10⁻⁴ standard deviations or nearer to the minimum.
        assert!(squared(&(one * two.inverse()).log(), &own).sqrt() < 1e-3);
        assert!((own - other).amax() < 1e-3 * own.amax());
    }
}

#[test]
fn a_chain_takes_the_path_of_least_error() {
    let mut rng = Rng::new(207);
    let cameras = room(&mut rng, 5);
    let pair = |a: usize, b: usize, error: f64| RelativePose {
        a,
        b,
        b_from_a: cameras[b] * cameras[a].inverse(),
        noise: PairNoise::Error(error),
    };
    // 0–2 directly costs 5, by 1 it costs 3; 3 hangs on 2 and 4 on 3, stated the other way round.
    let pairs = [pair(0, 2, 5.0), pair(0, 1, 1.0), pair(2, 1, 2.0), pair(2, 3, 0.5), pair(4, 3, 0.25)];
    let found = chain(&PoseGraph { n_cameras: 5, pairs: &pairs }, 0).unwrap();
    assert_eq!(found.cameras[4].path, [0, 1, 2, 3, 4]);
    assert_eq!(found.cameras[4].pairs, [1, 2, 3, 4]);
    assert_eq!(found.cameras.iter().map(|c| c.error).collect::<Vec<_>>(), [0.0, 1.0, 3.0, 3.5, 3.75]);
    for (i, camera) in found.cameras.iter().enumerate() {
        assert!((camera.cam_from_rig * cameras[i].inverse()).log().amax() < 1e-14);
    }
}

/// Along a tree the joint answer is the chain, its covariance too.
#[test]
fn without_loops_the_joint_answer_is_the_chain() {
    let mut rng = Rng::new(208);
    let cameras = room(&mut rng, 5);
    let stated: Vec<_> =
        [(0, 1), (2, 1), (1, 3), (4, 3)].iter().map(|(a, b)| (*a, *b, covariance(&mut rng))).collect();
    let pairs = measured(&mut rng, &cameras, &stated);
    let (joint, chained) =
        (solve(5, &pairs).unwrap(), chain(&PoseGraph { n_cameras: 5, pairs: &pairs }, 0).unwrap());
    for (one, two) in joint.cameras.iter().zip(&chained.cameras) {
        assert!((one.cam_from_rig * two.cam_from_rig.inverse()).log().amax() < 1e-12);
        assert!((one.covariance - two.covariance.unwrap()).amax() <= 1e-9 * one.covariance.amax());
    }
    assert_eq!((joint.degrees_of_freedom, joint.noise_scale), (0, 1.0));
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let mut rng = Rng::new(209);
    let cameras = room(&mut rng, 5);
    let stated: Vec<_> =
        [(0, 1), (1, 2), (2, 0), (3, 4)].iter().map(|(a, b)| (*a, *b, covariance(&mut rng))).collect();
    let pairs = measured(&mut rng, &cameras, &stated);
    assert_eq!(groups(&PoseGraph { n_cameras: 5, pairs: &pairs }), [vec![0, 1, 2], vec![3, 4]]);
    assert_eq!(solve(5, &pairs).unwrap_err(), Error::Disconnected { groups: 2, a: 0, b: 3 });
    assert!(matches!(solve(4, &pairs), Err(Error::InvalidPose { item: "pair", index: 3, .. })));
    let spoil: [fn(&mut RelativePose); 6] = [
        |pair| pair.b_from_a.translation.y = f64::INFINITY,
        |pair| pair.b_from_a.rotation *= 2.0,
        |pair| pair.a = pair.b,
        |pair| pair.noise = PairNoise::Covariance(Matrix6::zeros()),
        |pair| pair.noise = PairNoise::Error(0.0),
        |pair| pair.noise = PairNoise::Error(1.0),
    ];
    for (i, spoil) in spoil.iter().enumerate() {
        let mut bad = pairs[..3].to_vec();
        spoil(&mut bad[1]);
        let error = solve(3, &bad).unwrap_err();
        assert!(matches!(error, Error::InvalidPose { item: "pair", index: 1, .. }), "{i}: {error}");
    }
    let config = PoseGraphConfig { reference_camera: 7, median_sigma: None };
    let graph = PoseGraph { n_cameras: 3, pairs: &pairs[..3] };
    assert!(matches!(solve_pose_graph(&graph, &config), Err(Error::InvalidSetting { .. })));
}

/// Pairs noisier than stated, one wrong pair that the others contradict, one of a loop whose pairs nothing distinguishes: each is in the numbers.
#[test]
fn what_is_said_against_a_graph_is_in_its_numbers() {
    let (mut rng, mut seen) = (Rng::new(212), Vec::new());
    let cameras = room(&mut rng, 8);
    let mut ring: Vec<_> = joined(&mut rng, 6, 1.0);
    ring.extend([(0, 6), (6, 7), (0, 7)]);
    let stated: Vec<_> = ring.iter().map(|(a, b)| (*a, *b, covariance(&mut rng))).collect();
    for (times, wrong) in [(36.0, None), (1.0, Some(2)), (1.0, Some(ring.len() - 1))] {
        let truth: Vec<_> = stated.iter().map(|(a, b, c)| (*a, *b, c * times)).collect();
        let mut pairs = measured(&mut rng, &cameras, &truth);
        pairs.iter_mut().zip(&stated).for_each(|(pair, (.., c))| pair.noise = PairNoise::Covariance(*c));
        if let Some(wrong) = wrong {
            let motion = Pose::exp(&Vector6::new(0.05, 0.0, 0.0, 0.0, 0.05, 0.0));
            pairs[wrong].b_from_a = motion * pairs[wrong].b_from_a;
        }
        seen.extend(solve(8, &pairs).unwrap().warnings().iter().map(warnings::of_graph));
    }
    println!("{seen:?}");
    for kind in 0..3 {
        assert!(seen.contains(&kind), "no scenario gives kind {kind}: {seen:?}");
    }
}
