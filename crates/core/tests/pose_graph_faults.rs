//! Faults × graphs × stated covariances from 0.4 to 4 times the true ones: an answer that a fault moves by more than three standard deviations
//! is not called right, and graphs without a fault are. A recorded room of eleven cameras and simulated ones; a third of the simulated rooms by
//! default, all with RESIGHT_RUNS=1. Needs the folder named by RESIGHT_DATA.
//!
//! What it leaves out, because no pair shows it: one scale of all translations (millimetres for metres), all pairs inverted or transposed where
//! no loop is closed, all translations negative, which is a scale of −1, and pairs that nothing checks, whose redundancy of 0 the answer states.

use crate::common::Rng;
use crate::common::recordings::room_of_pairs;
use crate::common::verdicts::Verdicts;
use crate::recorded::recorded;
use nalgebra::{Matrix6, Vector6};
use resight_core::multiview::pose_graph::{
    PairNoise, PoseGraph, PoseGraphConfig, PoseGraphSolution, RelativePose, solve_pose_graph,
};
use resight_core::{Error, Pose};

/// Smaller differences are irrelevant.
const SMALL_RAD: f64 = 0.01 * std::f64::consts::PI / 180.0;
const SMALL_M: f64 = 1e-4;
/// Factors on the stated covariances.
const TIMES: [f64; 4] = [0.4, 1.0, 2.0, 4.0];

#[derive(Clone)]
struct Graph {
    name: String,
    n_cameras: usize,
    pairs: Vec<RelativePose>,
}

impl Graph {
    fn solved(&self) -> Result<PoseGraphSolution, Error> {
        let config = PoseGraphConfig { reference_camera: 0, median_sigma: None };
        solve_pose_graph(&PoseGraph { n_cameras: self.n_cameras, pairs: &self.pairs }, &config)
    }

    /// Covariances stated so many times as large.
    fn stated(&self, times: f64) -> Self {
        let mut graph = self.clone();
        for pair in &mut graph.pairs {
            if let PairNoise::Covariance(covariance) = &mut pair.noise {
                *covariance *= times;
            }
        }
        graph
    }

    fn with(&self, change: impl Fn(usize, &mut RelativePose)) -> Self {
        let mut graph = self.clone();
        graph.pairs.iter_mut().enumerate().for_each(|(i, pair)| change(i, pair));
        graph
    }

    /// Number of pairs of a camera.
    fn degree(&self, camera: usize) -> usize {
        self.pairs.iter().filter(|pair| pair.a == camera || pair.b == camera).count()
    }
}

/// Cameras 2 m around the middle of a room, a ring of pairs and every other one with the chance given, each with a covariance of its own.
fn simulated(seed: u64, n: usize, chance: f64, has_covariances: bool) -> Graph {
    let mut rng = Rng::new(seed);
    let cameras: Vec<Pose> = (0..n).map(|_| Pose::new(rng.rotation(), rng.unit_vector() * 2.0)).collect();
    let mut joined: Vec<(usize, usize)> = (0..n).map(|i| (i, (i + 1) % n)).collect();
    for a in 0..n {
        let others = (a + 2..n).filter(|b| (a, *b) != (0, n - 1));
        joined.extend(others.filter(|_| rng.uniform(0.0, 1.0) < chance).map(|b| (b, a)));
    }
    let pair = |(a, b): (usize, usize)| {
        let root = Matrix6::from_fn(|i, j| match i == j {
            true => 1.0,
            false => 0.3 * rng.normal(),
        });
        let mut scale = Matrix6::identity();
        (0..3).for_each(|i| scale[(i, i)] = 0.3);
        let covariance = scale * root * root.transpose() * scale * 9e-6 * rng.uniform(0.5, 4.0);
        let drawn = covariance.cholesky().expect("positive").l() * Vector6::from_fn(|_, _| rng.normal());
        let noise = match has_covariances {
            true => PairNoise::Covariance(covariance),
            false => PairNoise::Error(covariance.trace().sqrt()),
        };
        RelativePose { a, b, b_from_a: Pose::exp(&drawn) * cameras[b] * cameras[a].inverse(), noise }
    };
    let pairs: Vec<RelativePose> = joined.into_iter().map(pair).collect();
    let stated = if has_covariances { "" } else { ", errors" };
    Graph { name: format!("{n} cameras, {} pairs{stated}", pairs.len()), n_cameras: n, pairs }
}

/// The recorded room: errors as its file states them, or covariances as its pairs agree.
fn recorded_rooms() -> [Graph; 2] {
    let (n_cameras, pairs) = room_of_pairs(&recorded(""));
    let errors = Graph { name: "room, errors".into(), n_cameras, pairs };
    let sigma = errors.solved().expect("an answer").median_sigma.expect("estimated");
    let mut all: Vec<f64> = errors.pairs.iter().map(error_of).collect();
    all.sort_by(f64::total_cmp);
    let middle = all[all.len() / 2];
    let mut covariances = errors.with(|_, pair| {
        let times = error_of(pair) / middle;
        let [r, m] = [sigma.sigma_rad, sigma.sigma_m].map(|sigma| (sigma * times).powi(2));
        pair.noise = PairNoise::Covariance(Matrix6::from_diagonal(&Vector6::new(r, r, r, m, m, m)));
    });
    covariances.name = "room, covariances".into();
    [errors, covariances]
}

fn error_of(pair: &RelativePose) -> f64 {
    match pair.noise {
        PairNoise::Error(error) => error,
        PairNoise::Covariance(covariance) => covariance.trace().sqrt(),
    }
}

fn turned(about: usize, degrees: f64) -> Pose {
    Pose::exp(&Vector6::ith(about, degrees.to_radians()))
}

fn shifted(along: usize, by_m: f64) -> Pose {
    Pose::exp(&Vector6::ith(3 + along, by_m))
}

/// The pose whose rotation vector was written in degrees and read as radians.
fn in_degrees(pose: &Pose) -> Pose {
    let rotated = Pose { translation: nalgebra::Vector3::zeros(), ..*pose }.log();
    let read = Pose::exp(&(rotated * 180.0 / std::f64::consts::PI));
    Pose { translation: pose.translation, ..read }
}

fn faults(graph: &Graph) -> Vec<(String, Graph)> {
    let mut all: Vec<(String, Graph)> = Vec::new();
    let n = graph.pairs.len();
    // A pair of the ring and another one.
    for at in [1, n - 1] {
        let mut of_pair = |what: &str, change: &dyn Fn(&mut RelativePose)| {
            let changed = graph.with(|i, pair| {
                if i == at {
                    change(pair)
                }
            });
            all.push((format!("{what}, pair {at}"), changed));
        };
        of_pair("1° about z", &|p| p.b_from_a = turned(2, 1.0) * p.b_from_a);
        of_pair("5° about x", &|p| p.b_from_a = turned(0, 5.0) * p.b_from_a);
        of_pair("90° about z", &|p| p.b_from_a = turned(2, 90.0) * p.b_from_a);
        of_pair("30 mm", &|p| p.b_from_a = shifted(0, 0.03) * p.b_from_a);
        of_pair("200 mm", &|p| p.b_from_a = shifted(1, 0.2) * p.b_from_a);
        of_pair("inverted", &|p| p.b_from_a = p.b_from_a.inverse());
        of_pair("rotation transposed", &|p| p.b_from_a.rotation = p.b_from_a.rotation.transpose());
        of_pair("millimetres", &|p| p.b_from_a.translation *= 1e3);
        of_pair("board 3 % larger", &|p| p.b_from_a.translation *= 1.03);
        of_pair("degrees", &|p| p.b_from_a = in_degrees(&p.b_from_a));
        of_pair("another camera", &|p| {
            let other = (0..graph.n_cameras).find(|c| ![p.a, p.b].contains(c));
            p.b = other.expect("three cameras");
        });
    }
    let camera = graph.n_cameras / 2;
    let mut of_camera = |what: &str, change: &dyn Fn(usize, &mut RelativePose)| {
        let k = std::cell::Cell::new(0);
        let changed = graph.with(|_, pair| {
            if pair.a == camera || pair.b == camera {
                change(k.get(), pair);
                k.set(k.get() + 1);
            }
        });
        all.push((format!("{what}, camera {camera}"), changed));
    };
    let moved = |pair: &mut RelativePose, by: Pose| match pair.b == camera {
        true => pair.b_from_a = by * pair.b_from_a,
        false => pair.b_from_a = pair.b_from_a * by.inverse(),
    };
    let half = graph.degree(camera) / 2;
    of_camera("moved 2° after half its pairs", &|k, p| {
        if k < half {
            moved(p, turned(1, 2.0))
        }
    });
    of_camera("moved 50 mm after half its pairs", &|k, p| {
        if k < half {
            moved(p, shifted(0, 0.05))
        }
    });
    of_camera("two pairs 3°", &|k, p| {
        if k < 2 {
            moved(p, turned([0, 1][k], 3.0))
        }
    });
    of_camera("its pairs inverted", &|_, p| p.b_from_a = p.b_from_a.inverse());
    of_camera("its pairs in degrees", &|_, p| p.b_from_a = in_degrees(&p.b_from_a));
    of_camera("its pairs 5 % larger", &|_, p| p.b_from_a.translation *= 1.05);
    of_camera("its pairs in millimetres", &|_, p| p.b_from_a.translation *= 1e3);
    let second = (camera + 1) % graph.n_cameras;
    let exchanged = |c: usize| match c {
        c if c == camera => second,
        c if c == second => camera,
        c => c,
    };
    let k = std::cell::Cell::new(0);
    let in_third = graph.with(|_, p| {
        if [p.a, p.b].iter().any(|c| exchanged(*c) != *c) {
            k.set(k.get() + 1);
            if k.get() % 3 == 1 {
                (p.a, p.b) = (exchanged(p.a), exchanged(p.b));
            }
        }
    });
    all.push(("names exchanged in a third of the pairs".into(), in_third));
    all.push(("all inverted".into(), graph.with(|_, p| p.b_from_a = p.b_from_a.inverse())));
    all.push(("all in degrees".into(), graph.with(|_, p| p.b_from_a = in_degrees(&p.b_from_a))));
    let transposed = graph.with(|_, p| p.b_from_a.rotation = p.b_from_a.rotation.transpose());
    all.push(("all rotations transposed".into(), transposed));
    let third = graph.with(|i, p| {
        if i % 3 == 1 {
            p.b_from_a = p.b_from_a.inverse()
        }
    });
    all.push(("a third inverted".into(), third));
    let scaled = graph.with(|i, p| {
        if i % 2 == 1 {
            p.b_from_a.translation *= 1.03
        }
    });
    all.push(("board 3 % larger in half the pairs".into(), scaled));
    all
}

/// By how much a fault moves the worst camera, in the standard deviations of both answers; 0 where that is nobody's concern.
fn off(found: &PoseGraphSolution, right: &PoseGraphSolution) -> f64 {
    let of_camera = |(a, b): (usize, usize)| {
        let (Some((here, own)), Some((there, others))) = (found.b_from_a(a, b), right.b_from_a(a, b)) else {
            return f64::INFINITY;
        };
        let apart = (here * there.inverse()).log();
        if apart.fixed_rows::<3>(0).norm() < SMALL_RAD && apart.fixed_rows::<3>(3).norm() < SMALL_M {
            return 0.0;
        }
        let sum = own + others;
        (0..6).map(|i| apart[i].abs() / sum[(i, i)].sqrt().max(1e-12)).fold(0.0, f64::max)
    };
    (1..found.cameras.len()).map(|b| of_camera((0, b))).fold(0.0, f64::max)
}

fn describe(found: &PoseGraphSolution) -> String {
    let named: Vec<String> = found.warnings().iter().map(|warning| format!("{warning:?}")).collect();
    format!(
        "χ² {:.1} of {} noise {:.2} sigma {:?} {named:?}",
        found.chi2,
        found.degrees_of_freedom,
        found.noise_scale,
        found.median_sigma.map(|s| [s.sigma_rad.to_degrees(), 1e3 * s.sigma_m])
    )
}

fn graphs() -> Vec<Graph> {
    let is_all = std::env::var_os("RESIGHT_RUNS").is_some();
    let [errors, covariances] = recorded_rooms();
    let mut all = vec![errors];
    all.extend(
        TIMES.map(|times| Graph {
            name: format!("{} × {times}", covariances.name),
            ..covariances.stated(times)
        }),
    );
    for (k, (n, chance)) in
        [(4, 1.0), (6, 0.5), (8, 0.4), (5, 0.6), (10, 0.3), (7, 1.0)].into_iter().enumerate()
    {
        if !is_all && k % 3 != 0 {
            continue;
        }
        let room = simulated(900 + k as u64, n, chance, true);
        all.extend(
            TIMES.map(|times| Graph { name: format!("{} × {times}", room.name), ..room.stated(times) }),
        );
        all.push(simulated(900 + k as u64, n, chance, false));
    }
    all
}

#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn an_answer_that_is_wrong_is_not_called_right() {
    let mut verdicts = Verdicts::default();
    for graph in graphs() {
        let right = graph.solved().expect("an answer");
        let is_right = right.verdict.fault.is_none();
        verdicts.right(format!("{}, right: {}", graph.name, describe(&right)), is_right);
        for (fault, wrong) in faults(&graph) {
            let what = format!("{}, {fault}", graph.name);
            match wrong.solved() {
                Ok(found) => {
                    let is_ok = found.verdict.fault.is_none();
                    verdicts.fault(&what, is_ok, off(&found, &right), &describe(&found));
                }
                Err(reason) => verdicts.refused(format!("{what}: refused {reason}")),
            }
        }
    }
    // Twelve of the seventeen in all rooms are pairs of one camera that are 5 % larger: with its worst pair left out the rest agrees, or the sigmas that are
    // estimated from it widen. Three are a camera moved half-way, one is a board 3 % larger in half of the pairs, one two pairs off alike.
    verdicts.check(if std::env::var_os("RESIGHT_RUNS").is_some() { 17 } else { 1 });
}
