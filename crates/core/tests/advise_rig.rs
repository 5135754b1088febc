//! The next board of a rig: what the adviser foretells against joint adjustments of noisy views, by a solver of the test's own.

use crate::common::{Rng, views};
use nalgebra::{DMatrix, DVector, Matrix6, Vector2, Vector3, Vector6};
use resight_core::advise::board::{Criterion, RigCamera, RigInformation, RigPlan};
use resight_core::advise::volume::Shape;
use resight_core::camera::ImageSize;
use resight_core::target::{Chessboard, Target};
use resight_core::{Camera, Error, Point, Pose};

const SIGMA_PX: f64 = 0.3;

fn camera() -> Camera {
    Camera { size: Some(ImageSize { width_px: 640, height_px: 480 }), ..views::camera() }
}

fn board() -> Shape {
    Shape::of(&Target::Chessboard(Chessboard { rows: 3, columns: 4, square_m: 0.12 }))
}

/// Three cameras in a row that look a little inwards.
fn places() -> Vec<Pose> {
    let place = |x: f64, turn: f64| {
        let rotation = Pose::exp(&Vector6::new(0.0, turn, 0.0, 0.0, 0.0, 0.0)).rotation;
        Pose::new(rotation, -(rotation * Vector3::new(x, 0.0, 0.0)))
    };
    vec![place(0.0, 0.0), place(0.5, 0.2), place(-0.4, -0.15)]
}

fn rig<'a>(camera: &'a Camera, places: &[Pose]) -> Vec<RigCamera<'a>> {
    places.iter().map(|p| RigCamera { camera, cam_from_rig: *p, intrinsics_covariance: None }).collect()
}

/// Two views to begin with, straight ahead.
fn first_views(plan: &RigPlan) -> Vec<Pose> {
    vec![
        plan.rig_from_board_at(&Point::new(0.0, 0.0, 2.2), 0.3, 0.5, 0.2),
        plan.rig_from_board_at(&Point::new(0.1, 0.1, 2.5), 0.5, 2.5, 1.0),
    ]
}

fn information(plan: &RigPlan, boards: &[Pose]) -> RigInformation {
    boards.iter().fold(RigInformation::nothing(plan), |sum, b| plan.with(&sum, b).expect("seen by two").0)
}

/// A joint adjustment: poses of the cameras but the first and of every board, from the truth by Gauss and Newton with derivatives by
/// differences. Shares no formula with the product but Exp.
struct Adjustment<'a> {
    plan: &'a RigPlan<'a>,
    boards: &'a [Pose],
    /// (camera, board, point, pixel)
    seen: Vec<(usize, usize, Point, Vector2<f64>)>,
}

impl<'a> Adjustment<'a> {
    fn new(plan: &'a RigPlan<'a>, boards: &'a [Pose]) -> Self {
        let mut seen = Vec::new();
        for (b, pose) in boards.iter().enumerate() {
            for c in 0..plan.cameras.len() {
                let points = plan.seen(c, pose).unwrap_or_default();
                seen.extend(points.iter().map(|p| (c, b, p.x_in_target, p.pixel)));
            }
        }
        Adjustment { plan, boards, seen }
    }

    fn start(&self) -> Vec<Pose> {
        self.plan.cameras[1..].iter().map(|c| c.cam_from_rig).chain(self.boards.iter().copied()).collect()
    }

    fn pixel(&self, state: &[Pose], c: usize, b: usize, x: &Point) -> Vector2<f64> {
        let n = self.plan.cameras.len() - 1;
        let in_rig = state[n + b] * *x;
        views::pixel_of(&if c == 0 { in_rig } else { state[c - 1] * in_rig })
    }

    /// Derivatives of all pixels by all motions, at the truth: the noise is small enough to keep them.
    fn jacobian(&self) -> DMatrix<f64> {
        const STEP: f64 = 6e-6;
        let state = self.start();
        let mut j = DMatrix::zeros(2 * self.seen.len(), 6 * state.len());
        for k in 0..6 * state.len() {
            let moved = |h: f64| {
                let mut s = state.clone();
                s[k / 6] = Pose::exp(&Vector6::ith(k % 6, h)) * s[k / 6];
                s
            };
            let (plus, minus) = (moved(STEP), moved(-STEP));
            for (row, (c, b, x, _)) in self.seen.iter().enumerate() {
                let d = (self.pixel(&plus, *c, *b, x) - self.pixel(&minus, *c, *b, x)) / (2.0 * STEP);
                j.fixed_view_mut::<2, 1>(2 * row, k).copy_from(&d);
            }
        }
        j
    }

    /// Solves noisy pixels; the derivatives are kept, so that three steps of a contraction end at the minimum to its first order.
    fn solve(&self, gain: &DMatrix<f64>, rng: &mut Rng) -> Vec<Pose> {
        let noisy: Vec<Vector2<f64>> =
            self.seen.iter().map(|s| s.3 + Vector2::new(rng.normal(), rng.normal()) * SIGMA_PX).collect();
        let mut state = self.start();
        for _ in 0..4 {
            let mut r = DVector::zeros(2 * self.seen.len());
            for (row, (c, b, x, _)) in self.seen.iter().enumerate() {
                r.fixed_rows_mut::<2>(2 * row).copy_from(&(noisy[row] - self.pixel(&state, *c, *b, x)));
            }
            let step = gain * r;
            for (k, pose) in state.iter_mut().enumerate() {
                let by: Vector6<f64> = step.fixed_rows::<6>(6 * k).into_owned();
                *pose = Pose::exp(&by) * *pose;
            }
        }
        state
    }
}

/// Spread over that foretold of each camera but the first, all directions together; and its greatest spread of place, metres.
fn tried(
    plan: &RigPlan,
    boards: &[Pose],
    covariances: &[Matrix6<f64>],
    n: usize,
    seed: u64,
) -> Vec<(f64, f64)> {
    let adjustment = Adjustment::new(plan, boards);
    let j = adjustment.jacobian();
    let gain = (j.transpose() * &j).try_inverse().expect("determined") * j.transpose();
    let mut rng = Rng::new(seed);
    let mut squares = vec![Matrix6::<f64>::zeros(); covariances.len()];
    for _ in 0..n {
        let state = adjustment.solve(&gain, &mut rng);
        for (i, square) in squares.iter_mut().enumerate() {
            let xi = (state[i] * plan.cameras[i + 1].cam_from_rig.inverse()).log();
            *square += xi * xi.transpose() / n as f64;
        }
    }
    let ratio = |(m, c): (&Matrix6<f64>, &Matrix6<f64>)| {
        let place = m.fixed_view::<3, 3>(3, 3).into_owned().symmetric_eigenvalues().max().sqrt();
        (((c.try_inverse().expect("positive definite") * m).trace() / 6.0).sqrt(), place)
    };
    squares.iter().zip(covariances).map(ratio).collect()
}

#[test]
fn next_board_is_worth_what_is_foretold() {
    let (camera, shape, places) = (camera(), board(), places());
    let cameras = rig(&camera, &places);
    let plan = RigPlan { cameras: &cameras, reference: 0, board: &shape, sigma_px: SIGMA_PX };
    let mut boards = first_views(&plan);
    let mut so_far = information(&plan, &boards);
    let candidates = plan.candidates([1.2, 3.5], 1500);
    assert!(200 < candidates.len(), "{}", candidates.len());
    for round in 0..3 {
        let now = so_far.cameras().unwrap();
        let covariances: Vec<Matrix6<f64>> = now.iter().map(|c| c.covariance).collect();
        // 600 draws of two cameras' six numbers: 0.8 % by chance.
        let t = tried(&plan, &boards, &covariances, 600, 81 + round);
        let predicted = now.iter().map(|c| c.position_m).fold(0.0, f64::max);
        let found = t.iter().map(|t| t.1).fold(0.0, f64::max);
        println!(
            "{} views: spread / foretold {t:.3?}; worst place {:.2} mm, foretold {:.2}",
            boards.len(),
            1e3 * found,
            1e3 * predicted
        );
        assert!(t.iter().all(|(ratio, _)| (ratio - 1.0).abs() < 0.05), "{t:?}");
        assert!((found / predicted - 1.0).abs() < 0.08, "{found} {predicted}");
        let best = plan.next(&so_far, &candidates, Criterion::Worst, 1).unwrap().remove(0);
        let then = best.cameras.iter().map(|c| c.position_m).fold(0.0, f64::max);
        assert!(then < 0.9 * predicted, "the best board gains little: {then} of {predicted}");
        boards.push(best.rig_from_board);
        so_far = best.information;
    }
}

/// The elimination of the boards' own poses equals the block of the whole inverse.
#[test]
fn eliminated_information_is_that_of_the_whole() {
    let (camera, shape, places) = (camera(), board(), places());
    let cameras = rig(&camera, &places);
    let plan = RigPlan { cameras: &cameras, reference: 0, board: &shape, sigma_px: SIGMA_PX };
    let boards = first_views(&plan);
    let j = Adjustment::new(&plan, &boards).jacobian() / SIGMA_PX;
    let whole = (j.transpose() * j).try_inverse().unwrap();
    for (i, c) in information(&plan, &boards).cameras().unwrap().iter().enumerate() {
        let block: Matrix6<f64> = whole.fixed_view::<6, 6>(6 * i, 6 * i).into_owned();
        assert!((c.covariance - block).norm() < 1e-5 * block.norm(), "{i}");
        assert!(c.is_determined && c.camera == i + 1);
    }
}

/// Which camera is the reference changes the frames, not what two cameras know of each other.
#[test]
fn the_choice_of_reference_is_a_gauge() {
    let (camera, shape, places) = (camera(), board(), places());
    let cameras = rig(&camera, &places[..2]);
    let of = |reference: usize| {
        let plan = RigPlan { cameras: &cameras, reference, board: &shape, sigma_px: SIGMA_PX };
        (information(&plan, &first_views(&plan)).cameras().unwrap()[0], plan.cameras[1].cam_from_rig)
    };
    // cam1_from_cam0's covariance in frame 1, and that of its inverse in frame 0.
    let ((a, b), cam1_from_cam0) = ((of(0).0, of(1).0), of(0).1);
    assert_eq!((a.camera, b.camera), (1, 0));
    let inverse = cam1_from_cam0.inverse_covariance(&a.covariance);
    assert!((inverse - b.covariance).norm() < 1e-6 * inverse.norm());
}

/// Every criterion lowers what it is about more than the others do, or as much; the best of the list is the best of all.
#[test]
fn each_criterion_is_best_at_its_own() {
    let (camera, shape, places) = (camera(), board(), places());
    let cameras = rig(&camera, &places);
    let plan = RigPlan { cameras: &cameras, reference: 0, board: &shape, sigma_px: SIGMA_PX };
    let so_far = information(&plan, &first_views(&plan));
    let candidates = plan.candidates([1.2, 3.5], 600);
    let best = |criterion| plan.next(&so_far, &candidates, criterion, 1).unwrap().remove(0);
    let worst = |s: &resight_core::advise::board::Suggestion| {
        s.cameras.iter().map(|c| c.position_m).fold(0.0, f64::max)
    };
    let trace = |s: &resight_core::advise::board::Suggestion| {
        s.cameras.iter().map(|c| c.covariance.fixed_view::<3, 3>(3, 3).trace()).sum::<f64>()
    };
    let [e, a, d] = [Criterion::Worst, Criterion::Trace, Criterion::Determinant].map(best);
    assert!(worst(&e) <= worst(&a) && worst(&e) <= worst(&d));
    assert!(trace(&a) <= trace(&e) && trace(&a) <= trace(&d));
    let all: Vec<f64> =
        candidates.iter().filter_map(|c| plan.suggestion(&so_far, c)).map(|s| worst(&s)).collect();
    assert!(all.iter().all(|w| worst(&e) <= *w));
}

/// Cameras that nothing joins yet come first, and are said to be undetermined till then.
#[test]
fn a_board_that_joins_comes_first() {
    let (camera, shape, places) = (camera(), board(), places());
    let cameras = rig(&camera, &places);
    let plan = RigPlan { cameras: &cameras, reference: 0, board: &shape, sigma_px: SIGMA_PX };
    let nothing = RigInformation::nothing(&plan);
    assert!(nothing.cameras().unwrap().iter().all(|c| !c.is_determined));
    let best = plan.next(&nothing, &plan.candidates([1.2, 3.5], 400), Criterion::Worst, 3).unwrap();
    assert!(
        best[0].cameras.iter().all(|c| c.is_determined) && best[0].seen_by == [0, 1, 2],
        "{:?}",
        best[0].seen_by
    );
    assert_eq!(best.len(), 3);
}

#[test]
fn what_cannot_be_is_refused() {
    let (camera, shape, places) = (camera(), board(), places());
    let one = rig(&camera, &places[..1]);
    let plan = RigPlan { cameras: &one, reference: 0, board: &shape, sigma_px: SIGMA_PX };
    let nothing = RigInformation::nothing(&plan);
    assert!(matches!(plan.next(&nothing, &[Pose::identity()], Criterion::Worst, 1), Err(Error::EmptyRig)));
    // Back to back: no board is seen by both.
    let back = Pose::exp(&Vector6::new(0.0, std::f64::consts::PI, 0.0, 0.0, 0.0, 0.0));
    let apart = rig(&camera, &[places[0], back]);
    let plan = RigPlan { cameras: &apart, reference: 0, board: &shape, sigma_px: SIGMA_PX };
    let candidates = plan.candidates([1.2, 3.5], 200);
    assert!(candidates.is_empty());
    let refused = plan.next(&RigInformation::nothing(&plan), &candidates, Criterion::Worst, 1);
    assert!(matches!(refused, Err(Error::InvalidSetting { .. })));
}

/// Of 600 px: f to 2 px, the principal point to 1.5 px.
fn lens_covariance() -> [f64; 16] {
    [4.0, 4.0, 0.0, 0.0, 4.0, 4.0, 0.0, 0.0, 0.0, 0.0, 2.25, 0.0, 0.0, 0.0, 0.0, 2.25]
}

/// Each camera's lens is drawn from its covariance and keeps its error through all boards: the places scatter as foretold, and by far more
/// than with exact lenses.
#[test]
fn uncertain_lenses_are_in_what_is_foretold() {
    let (camera, shape, places, stated) = (camera(), board(), places(), lens_covariance());
    let exact = rig(&camera, &places);
    let uncertain: Vec<RigCamera> =
        exact.iter().map(|c| RigCamera { intrinsics_covariance: Some(&stated), ..*c }).collect();
    let plan_of = |cameras| RigPlan { cameras, reference: 0, board: &shape, sigma_px: SIGMA_PX };
    let (plan, without) = (plan_of(&uncertain[..]), plan_of(&exact[..]));
    let mut boards = first_views(&plan);
    boards.push(plan.rig_from_board_at(&Point::new(-0.1, 0.0, 1.8), 0.6, 4.0, 2.0));
    let foretold = information(&plan, &boards).cameras().unwrap();
    let by_pixels = information(&without, &boards).cameras().unwrap();
    let adjustment = Adjustment::new(&without, &boards);
    let j = adjustment.jacobian();
    let gain = (j.transpose() * &j).try_inverse().expect("determined") * j.transpose();
    let (mut rng, n) = (Rng::new(97), 600);
    let (mut nees, mut nees_by_pixels) = ([0.0; 2], [0.0; 2]);
    for _ in 0..n {
        let took: Vec<Camera> = (0..3)
            .map(|_| {
                let f = 2.0 * rng.normal();
                let by = [f, f, 1.5 * rng.normal(), 1.5 * rng.normal()];
                let values: Vec<f64> = camera.parameters().iter().zip(by).map(|(p, by)| p.1 + by).collect();
                camera.with_parameters(&values).unwrap()
            })
            .collect();
        let mut other = Adjustment::new(&without, &boards);
        let state = other.start();
        for s in &mut other.seen {
            let pose = if s.0 == 0 { Pose::identity() } else { state[s.0 - 1] };
            s.3 = took[s.0].project(&(pose * boards[s.1] * s.2)).unwrap();
        }
        let state = other.solve(&gain, &mut rng);
        for i in 0..2 {
            let xi = (state[i] * places[i + 1].inverse()).log();
            let of = |c: &Matrix6<f64>| xi.dot(&c.cholesky().unwrap().solve(&xi)) / f64::from(n);
            nees[i] += of(&foretold[i].covariance);
            nees_by_pixels[i] += of(&by_pixels[i].covariance);
        }
    }
    println!("NEES {nees:.2?}, with lenses taken as exact {nees_by_pixels:.2?}");
    assert!(nees.iter().all(|x| (5.5..6.5).contains(x)), "{nees:?}");
    assert!(nees_by_pixels.iter().all(|x| 20.0 < *x), "{nees_by_pixels:?}");
    for (c, exact) in foretold.iter().zip(&by_pixels) {
        assert_eq!(c.position_exact_intrinsics_m, Some(exact.position_m));
        assert!(exact.position_exact_intrinsics_m.is_none() && exact.position_m < c.position_m);
    }
}
