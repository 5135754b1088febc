//! Error budgets: the parts of a covariance add up to it, each is one itself, and errors of one source alone scatter the pose as its part says.

use crate::common::{Rng, views};
use nalgebra::allocator::Allocator;
use nalgebra::{DMatrix, DefaultAllocator, Dim, Matrix3, OMatrix, Vector2, Vector3};
use resight_core::budget::{Budget, ErrorSource};
use resight_core::correspondence::Detection;
use resight_core::locate::group::RigidGroup;
use resight_core::locate::loss::Loss;
use resight_core::locate::{Config, Method, PoseEstimate, locate};
use resight_core::multiview::tag_map::locate_target;
use resight_core::robust;
use resight_core::target::{Chessboard, Feature, MapTag, PrintedScale, TagMap};
use resight_core::{Camera, Correspondence, Matrix6, Point, Pose, Prior, Target, Vector6};

const SIGMA_PX: f64 = 0.3;
const SIGMA_POINT_M: f64 = 0.002;
const SIGMA_SCALE: [f64; 2] = [0.002, 0.001];
const SIGMA_GROUP_M: f64 = 0.003;
const SIGMA_GROUP_RAD: f64 = 0.004;
const SIGMA_HEIGHT_M: f64 = 0.004;
const FIRST_OF_GROUP: usize = 12;

/// Of the intrinsics: fx and fy share an error of 3 px, the principal point has one of 2 px.
fn intrinsics() -> [f64; 16] {
    let (f, c) = (9.0, 4.0);
    [f, f, 0.0, 0.0, f, f, 0.0, 0.0, 0.0, 0.0, c, 0.0, 0.0, 0.0, 0.0, c]
}

/// Twelve points in space, and a tag that is not quite where it should be.
fn points() -> Vec<Point> {
    let mut rng = Rng::new(5);
    let mut points: Vec<Point> = (0..FIRST_OF_GROUP)
        .map(|_| Point::new(rng.uniform(-0.5, 0.5), rng.uniform(-0.4, 0.4), rng.uniform(-0.4, 0.4)))
        .collect();
    points.extend(
        [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]].map(|[x, y]| Point::new(0.4 + x, y, 0.1)),
    );
    points
}

fn group() -> RigidGroup {
    RigidGroup {
        first: FIRST_OF_GROUP,
        n_points: 4,
        centre_in_target: Point::new(0.4, 0.0, 0.1),
        sigma_m: SIGMA_GROUP_M,
        sigma_rad: SIGMA_GROUP_RAD,
    }
}

fn truth() -> Pose {
    views::looking_at(Point::new(0.3, -0.4, -2.2), Point::new(0.05, 0.0, 0.0))
}

/// The camera's distance from the target's xy plane.
fn height(error_m: f64) -> Prior {
    let height_m = truth().origin().z + error_m;
    Prior::Height { normal_in_target: Vector3::z(), offset_m: 0.0, height_m, sigma_m: SIGMA_HEIGHT_M }
}

/// The errors that are switched on.
#[derive(Debug, Clone, Copy, Default)]
struct On {
    pixels: bool,
    lens: bool,
    points: bool,
    scale: bool,
    group: bool,
    priors: bool,
}

fn normal3(rng: &mut Rng) -> Vector3<f64> {
    Vector3::new(rng.normal(), rng.normal(), rng.normal())
}

/// What the true camera sees of the true points, and the height that is stated.
fn drawn(rng: &mut Rng, on: On) -> (Vec<Correspondence>, Prior) {
    let solves = views::camera();
    let if_on = |is_on: bool, sigma: f64| if is_on { sigma } else { 0.0 };
    let (f, c) = (if_on(on.lens, 3.0), if_on(on.lens, 2.0));
    let f = f * rng.normal();
    let by = [f, f, c * rng.normal(), c * rng.normal()];
    let took: Vec<f64> = solves.parameters().iter().zip(by).map(|((_, value), by)| value + by).collect();
    let took = solves.with_parameters(&took).expect("a camera");
    let longer = SIGMA_SCALE.map(|sigma| 1.0 + if_on(on.scale, sigma) * rng.normal());
    let turn = normal3(rng) * if_on(on.group, SIGMA_GROUP_RAD);
    let shift = normal3(rng) * if_on(on.group, SIGMA_GROUP_M);
    let see = |(i, x): (usize, Point), rng: &mut Rng| {
        let mut true_x = x + normal3(rng) * if_on(on.points, SIGMA_POINT_M);
        if FIRST_OF_GROUP <= i {
            true_x += turn.cross(&(x - group().centre_in_target)) + shift;
        }
        let true_x = Point::new(true_x.x * longer[0], true_x.y * longer[1], true_x.z);
        let noise = Vector2::new(rng.normal(), rng.normal()) * if_on(on.pixels, SIGMA_PX);
        let pixel = took.project(&(truth() * true_x)).expect("in the field") + noise;
        let c = Correspondence::new(&solves, x, pixel, SIGMA_PX).expect("in the field");
        Correspondence { sigma_m: SIGMA_POINT_M, ..c }
    };
    let seen = points().into_iter().enumerate().map(|point| see(point, rng)).collect();
    (seen, height(if_on(on.priors, SIGMA_HEIGHT_M) * rng.normal()))
}

fn solved(seen: &[Correspondence], config: &Config) -> (PoseEstimate, Budget) {
    let estimate = locate(seen, &views::camera(), config).expect("a pose");
    let budget = estimate.budget(seen, &views::camera(), config).expect("its budget");
    (estimate, budget)
}

/// Everything that can be stated is.
fn with_all<T>(prior: &Prior, of: impl FnOnce(&Config) -> T) -> T {
    let (intrinsics, groups, priors) = (intrinsics(), [group()], [*prior]);
    of(&Config {
        intrinsics_covariance: Some(&intrinsics),
        target_scale_sigma: SIGMA_SCALE,
        groups: &groups,
        priors: &priors,
        ..Config::default()
    })
}

pub fn part(budget: &Budget, source: ErrorSource) -> Matrix6 {
    let found = budget.parts().iter().find(|part| part.source == source);
    found.map_or(Matrix6::zeros(), |part| part.covariance)
}

pub fn assert_adds_up(budget: &Budget, covariance: &Matrix6, what: &str) {
    assert_parts(budget, covariance, what);
    let shares: f64 = budget.parts().iter().map(|part| budget.position_share(part)).sum();
    assert!((shares - 1.0).abs() < 1e-9, "{what}: {shares}");
}

/// The parts of a covariance of any size add up to it, and none has a negative variance, both in its standard deviations.
pub fn assert_parts<D: Dim>(budget: &Budget<OMatrix<f64, D, D>>, covariance: &OMatrix<f64, D, D>, what: &str)
where
    DefaultAllocator: Allocator<D, D>,
{
    let n = covariance.nrows();
    let unit: Vec<f64> =
        (0..n).map(|i| covariance[(i, i)].sqrt()).map(|s| if s == 0.0 { 1.0 } else { s }).collect();
    let whitened = |m: &OMatrix<f64, D, D>| DMatrix::from_fn(n, n, |i, j| m[(i, j)] / (unit[i] * unit[j]));
    let mut sum = DMatrix::zeros(n, n);
    for part in budget.parts() {
        let whitened = whitened(&part.covariance);
        assert!(
            whitened.clone().symmetric_eigenvalues().min() > -1e-9,
            "{what}: {:?} {whitened}",
            part.source
        );
        assert!((&whitened - whitened.transpose()).amax() < 1e-12, "{what}: {:?}", part.source);
        assert!(0.0 < whitened.trace(), "{what}: {:?}", part.source);
        sum += whitened;
    }
    let apart = (sum - whitened(covariance)).amax();
    assert!(apart < 1e-9, "{what}: {apart:e}");
}

/// Scatter of the pose with one source of errors switched on, in standard deviations of the whole covariance, beside that of the part.
fn assert_scatters(on: On, source: ErrorSource, take: impl Fn(&Budget) -> Matrix6) {
    const N: usize = 3000;
    let exact = drawn(&mut Rng::new(1), On::default());
    let budget = with_all(&exact.1, |config| solved(&exact.0, config).1);
    let whitening = budget.covariance().cholesky().expect("positive").l().try_inverse().expect("regular");
    let mut rng = Rng::new(7 + source as u64);
    let mut scatter = Matrix6::zeros();
    for _ in 0..N {
        let (seen, prior) = drawn(&mut rng, on);
        let e = with_all(&prior, |config| locate(&seen, &views::camera(), config)).expect("a pose");
        let error: Vector6 = whitening * (e.cam_from_target * truth().inverse()).log();
        scatter += error * error.transpose() / N as f64;
    }
    let expected = whitening * take(&budget) * whitening.transpose();
    let (apart, ratio) = ((scatter - expected).norm() / expected.norm(), scatter.trace() / expected.trace());
    println!("{source:?} {on:?}: {apart:.3} apart, ratio {ratio:.3}, share {:.4}", expected.trace() / 6.0);
    assert!(apart < 0.12 && (ratio - 1.0).abs() < 0.12, "{source:?} {on:?}: {apart} {ratio}");
}

#[test]
fn pixels_alone_scatter_as_their_part() {
    let on = On { pixels: true, ..On::default() };
    assert_scatters(on, ErrorSource::Pixels, |budget| part(budget, ErrorSource::Pixels));
}

#[test]
fn a_lens_alone_scatters_as_its_part() {
    let on = On { lens: true, ..On::default() };
    assert_scatters(on, ErrorSource::Lens, |budget| part(budget, ErrorSource::Lens));
}

#[test]
fn a_target_alone_scatters_as_its_part() {
    let on = On { points: true, scale: true, group: true, ..On::default() };
    assert_scatters(on, ErrorSource::Target, |budget| part(budget, ErrorSource::Target));
}

#[test]
fn a_prior_alone_scatters_as_its_part() {
    let on = On { priors: true, ..On::default() };
    assert_scatters(on, ErrorSource::Priors, |budget| part(budget, ErrorSource::Priors));
}

/// The three causes of the target's part, each by itself: the other two are stated as exact.
#[test]
fn each_cause_of_the_targets_part_scatters_by_itself() {
    let (intrinsics, groups) = (intrinsics(), [group()]);
    let base = Config { intrinsics_covariance: Some(&intrinsics), ..Config::default() };
    let exact_points = |seen: Vec<Correspondence>| -> Vec<Correspondence> {
        seen.into_iter().map(|c| Correspondence { sigma_m: 0.0, ..c }).collect()
    };
    let causes = [
        (On { points: true, ..On::default() }, base, true),
        (On { scale: true, ..On::default() }, Config { target_scale_sigma: SIGMA_SCALE, ..base }, false),
        (On { group: true, ..On::default() }, Config { groups: &groups, ..base }, false),
    ];
    for (on, config, has_points) in causes {
        let observe = |rng: &mut Rng, on: On| {
            let seen = drawn(rng, on).0;
            if has_points { seen } else { exact_points(seen) }
        };
        let (_, budget) = solved(&observe(&mut Rng::new(1), On::default()), &config);
        let expected = part(&budget, ErrorSource::Target);
        let (mut rng, mut variance, n) = (Rng::new(3), 0.0, 1500);
        for _ in 0..n {
            let e = locate(&observe(&mut rng, on), &views::camera(), &config).expect("a pose");
            let error = (e.cam_from_target * truth().inverse()).log();
            variance += error.fixed_rows::<3>(3).norm_squared() / f64::from(n);
        }
        let ratio = variance / expected.fixed_view::<3, 3>(3, 3).trace();
        assert!((ratio - 1.0).abs() < 0.13, "{on:?}: {ratio}");
    }
}

#[test]
fn all_parts_add_up() {
    let mut rng = Rng::new(2);
    let all = On { pixels: true, lens: true, points: true, scale: true, group: true, priors: true };
    let sources = [ErrorSource::Pixels, ErrorSource::Lens, ErrorSource::Target, ErrorSource::Priors];
    for _ in 0..50 {
        let (seen, prior) = drawn(&mut rng, all);
        let (estimate, budget) = with_all(&prior, |config| solved(&seen, config));
        assert_adds_up(&budget, &estimate.covariance, "all");
        for source in sources {
            assert!(part(&budget, source).trace() > 0.0, "{source:?}");
        }
    }
}

/// Any layout near and far, any method and loss: bent likelihoods, ambiguous and contradicting views among them.
#[test]
fn parts_add_up_in_any_view() {
    let mut rng = Rng::new(4);
    let (mut seen_sources, mut n) = (Vec::new(), 0);
    let losses = [Loss::Squared, Loss::Huber { sigmas: 1.5 }, Loss::Cauchy { sigmas: 2.0 }];
    for trial in 0..600 {
        let layouts = views::all();
        let (name, points) = &layouts[trial % layouts.len()];
        let loss = losses[rng.index(losses.len())];
        let pose = Pose::new(rng.rotation(), Vector3::new(0.0, 0.0, rng.uniform(3.0, 9.0)));
        let (drawn_px, sigma_m) = (SIGMA_PX * [1.0, 6.0][rng.index(2)], [0.0, 0.003][rng.index(2)]);
        let covariance = intrinsics();
        let intrinsics_covariance = (rng.index(2) == 0).then_some(&covariance[..]);
        let config = Config { loss, intrinsics_covariance, ..Config::default() };
        let Some(seen) = observed(&mut rng, &pose, points, drawn_px, sigma_m) else { continue };
        let Ok(estimate) = locate(&seen, &views::camera(), &config) else { continue };
        let budget = estimate.budget(&seen, &views::camera(), &config).expect("its budget");
        assert_adds_up(&budget, &estimate.covariance, &format!("{name} {loss:?} {trial}"));
        seen_sources.extend(budget.parts().iter().map(|part| part.source));
        n += 1;
    }
    let count = |source| seen_sources.iter().filter(|s| **s == source).count();
    let counted =
        [ErrorSource::Bend, ErrorSource::Lens, ErrorSource::Target, ErrorSource::Residuals].map(count);
    println!("{n} views; bend, lens, target, residuals: {counted:?}");
    assert!(400 < n && counted.iter().all(|k| 20 < *k), "{n} {counted:?}");
}

fn observed(
    rng: &mut Rng,
    pose: &Pose,
    points: &[Point],
    drawn_px: f64,
    sigma_m: f64,
) -> Option<Vec<Correspondence>> {
    let camera = views::camera();
    let see = |x: &Point| {
        let noise = Vector2::new(rng.normal(), rng.normal()) * drawn_px;
        let pixel = camera.project(&(pose * x))? + noise;
        Some(Correspondence { sigma_m, ..Correspondence::new(&camera, *x, pixel, SIGMA_PX).ok()? })
    };
    points.iter().map(see).collect()
}

/// Smooth displacements of a board's image: what the points share has its part.
#[test]
fn a_shared_error_has_its_part() {
    let camera = views::camera();
    let pose = views::looking_at(Point::new(0.2, -0.3, -1.2), Point::new(0.25, 0.2, 0.0));
    let mut rng = Rng::new(9);
    let board: Vec<Point> =
        (0..70).map(|i| Point::new(0.05 * f64::from(i % 10), 0.05 * f64::from(i / 10), 0.0)).collect();
    let bent = |x: &Point| {
        let pixel = camera.project(&(pose * *x)).expect("in the field");
        let (s, t) = ((x.x - 0.225) / 0.225, (x.y - 0.15) / 0.15);
        let noise = Vector2::new(rng.normal(), rng.normal()) * 0.05;
        Correspondence::new(&camera, *x, pixel + Vector2::new(s * s, s * t) * 0.5 + noise, 0.05)
            .expect("seen")
    };
    let seen: Vec<Correspondence> = board.iter().map(bent).collect();
    let (estimate, budget) = solved(&seen, &Config::default());
    assert!(0.0 < estimate.shared_error_px);
    assert_adds_up(&budget, &estimate.covariance, "shared");
    let without = Config { shared_errors: false, ..Config::default() };
    let (alone, of_alone) = solved(&seen, &without);
    let widened = estimate.covariance - alone.covariance;
    let of_view = part(&budget, ErrorSource::SharedInView);
    // The pose stands one vanishing step beyond the state whose covariance it has.
    assert!((widened - of_view).norm() < 1e-4 * widened.norm());
    assert_eq!(part(&of_alone, ErrorSource::SharedInView), Matrix6::zeros());
}

/// Residuals larger than stated: the part beyond the stated noise is χ² per degree of freedom less one times what is stated.
#[test]
fn residuals_have_the_part_that_they_widen_by() {
    let mut rng = Rng::new(12);
    let seen: Vec<Correspondence> = drawn(&mut rng, On { pixels: true, ..On::default() })
        .0
        .into_iter()
        .map(|c| Correspondence { sigma_px: 0.1, sigma_m: 0.0, ..c })
        .collect();
    let config = Config { shared_errors: false, ..Config::default() };
    let (estimate, budget) = solved(&seen, &config);
    let per_degree = estimate.chi2 / estimate.degrees_of_freedom as f64;
    assert!(3.0 < per_degree, "{per_degree}");
    assert_adds_up(&budget, &estimate.covariance, "residuals");
    let ratio = part(&budget, ErrorSource::Residuals).component_div(&part(&budget, ErrorSource::Pixels));
    assert!((ratio / (per_degree - 1.0)).iter().all(|x| (x - 1.0).abs() < 1e-3), "{ratio}");
}

#[test]
fn a_single_source_is_the_whole() {
    let mut rng = Rng::new(13);
    let seen: Vec<Correspondence> = drawn(&mut rng, On { pixels: true, ..On::default() })
        .0
        .into_iter()
        .map(|c| Correspondence { sigma_m: 0.0, ..c })
        .collect();
    let (estimate, budget) = solved(&seen, &Config::default());
    let [only] = budget.parts() else { panic!("{budget:?}") };
    assert_eq!(only.source, ErrorSource::Pixels);
    assert!((only.covariance - estimate.covariance).norm() < 1e-9 * estimate.covariance.norm());
}

#[test]
fn the_paper_s_answer_has_one_too() {
    let mut rng = Rng::new(14);
    let pose = views::looking_at(Point::new(0.5, -1.5, -2.5), Point::new(0.4, 0.2, 0.0));
    let seen = observed(&mut rng, &pose, &views::line_plus_one(), SIGMA_PX, 0.0).expect("in the field");
    let config = Config { method: Method::Wang2004, ..Config::default() };
    let (estimate, budget) = solved(&seen, &config);
    assert_adds_up(&budget, &estimate.covariance, "wang2004");
}

/// After a consensus the points that agree have the budget.
#[test]
fn a_consensus_has_one() {
    let mut rng = Rng::new(15);
    let mut seen = drawn(&mut rng, On { pixels: true, ..On::default() }).0;
    seen.iter_mut().for_each(|c| c.sigma_m = 0.0);
    let camera = views::camera();
    seen[3] = Correspondence::new(&camera, seen[3].x_in_target, seen[9].pixel, SIGMA_PX).expect("seen");
    let config = robust::Config::with_threshold_px(3.0 * SIGMA_PX);
    let found = robust::consensus(&seen, &camera, &config).expect("a consensus");
    assert!(!found.inliers.contains(&3) && found.truncation < 1.0);
    let kept: Vec<Correspondence> = found.inliers.iter().map(|i| seen[*i]).collect();
    let budget = found.estimate.budget(&kept, &camera, &config.locate).expect("its budget");
    assert_adds_up(&budget, &found.estimate.covariance, "consensus");
    let hidden = part(&budget, ErrorSource::Residuals).trace() / budget.covariance().trace();
    assert!((hidden - (1.0 - found.truncation)).abs() < 1e-4, "{hidden} {}", found.truncation);
}

/// Whole targets: a printed board whose scale is uncertain, and a map of tags that are not quite where it says.
#[test]
fn targets_have_their_part() {
    let board = Target::Chessboard(Chessboard { rows: 6, columns: 9, square_m: 0.06 });
    let printed = board.printed_at(PrintedScale { ratio: [1.0; 2], sigma: [0.002; 2] });
    let tag = |id: u32, x: f64, z: f64| MapTag {
        id,
        size_m: 0.2,
        world_from_tag: Pose::new(Matrix3::identity(), Vector3::new(x, 0.1 * z, z)),
        sigma_m: 0.004,
        sigma_rad: 0.01,
    };
    let tags = vec![tag(0, -0.4, 0.0), tag(1, 0.0, 0.3), tag(2, 0.4, -0.2)];
    let map = Target::TagMap(TagMap { family: "tag36h11".into(), tags, joint_covariance: None });
    let pose = views::looking_at(Point::new(0.4, -0.5, -1.9), Point::new(0.1, 0.1, 0.0));
    for target in [printed, map] {
        let camera: Camera = views::camera();
        let mut rng = Rng::new(16);
        let see = |feature: Feature| {
            let x = target.point(feature)?.position;
            let pixel = camera.project(&(pose * x))? + Vector2::new(rng.normal(), rng.normal()) * SIGMA_PX;
            let (sigma_px, lens_sigma_px, covariance_px2) = (SIGMA_PX, 0.0, None);
            Some(Detection { feature, pixel, sigma_px, lens_sigma_px, covariance_px2 })
        };
        let detections: Vec<Detection> =
            target.features().into_iter().map(see).collect::<Option<_>>().expect("all in the field");
        let config = Config::default();
        let found = locate_target(&detections, &target, &camera, &config);
        let estimate = found.estimate.clone().expect("a pose");
        let budget = found.budget(&target, &camera, &config).expect("its budget");
        assert_adds_up(&budget, &estimate.covariance, "target");
        let share = budget.parts().iter().find(|part| part.source == ErrorSource::Target);
        assert!(0.2 < budget.position_share(share.expect("a part")), "{budget:?}");
    }
}
