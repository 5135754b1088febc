//! Many views at once answer as each would alone: same pose, same covariance, same verdict, same error.
//!
//! Whether the single answers are right is for the suites of the single path to say.

use crate::common::Rng;
use crate::common::views::looking_at;
use nalgebra::{Vector2, Vector3};
use resight_core::batch::{Given, Views, locate_each, locate_each_of_three};
use resight_core::camera::{BrownConrady, CameraMatrix, Pinhole};
use resight_core::locate::choose::{Ambiguity, Hypothesis, Minimum, Others};
use resight_core::locate::consistency::Consistency;
use resight_core::locate::{Config, PoseEstimate, locate};
use resight_core::solve::line_plus_one::Weakness;
use resight_core::{Camera, Correspondence, Error, Lens, Pixel, Point, Pose};

type Answer = Result<PoseEstimate, Error>;

const MATRIX: CameraMatrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 640.0, cy_px: 480.0 };

fn camera() -> Camera {
    Camera { lens: Lens::Pinhole(Pinhole { matrix: MATRIX }), size: None }
}

fn points() -> [Point; 4] {
    [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 1.0]].map(|[x, y]| Point::new(x, y, 0.0))
}

/// Random views of a target, their pixels disturbed.
fn pixels<const N: usize>(
    seed: u64,
    count: usize,
    range_m: (f64, f64),
    noise_px: f64,
    points: &[Point; N],
) -> Vec<[Pixel; N]> {
    let (camera, mut rng) = (camera(), Rng::new(seed));
    let mut views = Vec::new();
    while views.len() < count {
        let z = rng.uniform(range_m.0, range_m.1);
        let centre_in_cam = Vector3::new(rng.uniform(-0.5, 0.5) * z, rng.uniform(-0.4, 0.4) * z, z);
        let rotation = rng.rotation();
        let cam_from_target = Pose::new(rotation, centre_in_cam - rotation * Vector3::new(0.75, 0.25, 0.0));
        let mut noise = || Vector2::new(rng.normal(), rng.normal()) * noise_px;
        let seen = points.map(|x| Some(camera.project(&(cam_from_target * x))? + noise()));
        if seen.iter().all(Option::is_some) {
            views.push(seen.map(Option::unwrap_or_default));
        }
    }
    views
}

fn three() -> [Point; 3] {
    [[0.0, 0.0, 0.0], [1.8, 0.2, 0.1], [0.4, 1.3, -0.3]].map(Point::from)
}

fn together(views: &Views) -> Vec<Answer> {
    let mut answers = Vec::new();
    locate_each(views, &mut answers).expect("as many of each");
    answers
}

fn together_of_three(views: &Views<3>) -> Vec<Answer> {
    let mut answers = Vec::new();
    locate_each_of_three(views, &mut answers).expect("as many of each");
    answers
}

fn alone<const N: usize>(
    camera: &Camera,
    points: &[Point; N],
    pixels: &[Pixel; N],
    sigma_px: &[f64; N],
) -> Answer {
    let one = |k: usize| Correspondence::new(camera, points[k], pixels[k], sigma_px[k]);
    let seen: Vec<Correspondence> = (0..N).map(one).collect::<Result<_, _>>()?;
    locate(&seen, camera, &Config::default())
}

/// The standard deviation of the weakest rotation of any of the minima, radians.
fn weakest_rad(e: &PoseEstimate) -> f64 {
    let variances = e.minima().flat_map(|h| [0, 1, 2].map(|i| h.minimum.covariance[(i, i)]));
    variances.fold(0.0, f64::max).sqrt()
}

/// The worst condition of a covariance, of all minima.
fn condition(e: &PoseEstimate) -> f64 {
    let variances = |h: Hypothesis| h.minimum.covariance.symmetric_eigenvalues();
    let of_one = |h: Hypothesis| variances(h).max() / variances(h).min().max(1e-300);
    e.minima().map(of_one).fold(1.0, f64::max)
}

/// Weights go by determinants: the covariance's own rounding, 1e-16 times its condition, and the digits that its smallest eigenvalue
/// loses to the largest, the condition once more. Measured 1e-11 at 10³, 1e-6 at 10⁵, 6e-4 at 10⁷. A wrong exponent or root is off by
/// a part of the weight itself.
fn assert_same_weight(a: f64, b: f64, condition: f64) {
    let most = f64::min(1e-10 + 1e-15 * condition * condition, 1.0);
    assert!((a - b).abs() <= most, "{a} {b} {condition}");
}

/// Every field. Rounding alone separates the two: 1e-16 times the condition of a view (1e6 at most here) and a few steps.
fn assert_same(one: &Answer, other: &Answer) {
    match (one, other) {
        (Ok(a), Ok(b)) => {
            assert_same_minimum(&first(a), &first(b), 1e-9, 1e-7);
            assert_same_weight(a.probability, b.probability, condition(b));
            let lowest = a.minima().map(|h| h.minimum.chi2).fold(f64::INFINITY, f64::min);
            assert_same_others(&a.others, &b.others, lowest, condition(b));
            assert_same_verdict(&a.ambiguity, &b.ambiguity);
            assert_same_consistency(&a.consistency, &b.consistency);
            assert_same_weakness(&a.weakness, &b.weakness);
            let rest = |e: &PoseEstimate| (e.degrees_of_freedom, e.n_points, e.method, e.geometry);
            assert_eq!(rest(a), rest(b));
        }
        (Err(a), Err(b)) => assert_eq!(format!("{a}"), format!("{b}")),
        _ => panic!("{one:?} and {other:?}"),
    }
}

fn first(e: &PoseEstimate) -> Minimum {
    let PoseEstimate { cam_from_target, covariance, chi2, rms_px, log_determinant, .. } = *e;
    Minimum { cam_from_target, covariance, chi2, rms_px, log_determinant }
}

fn assert_near(a: f64, b: f64, relative: f64) {
    assert!((a - b).abs() <= relative * (1.0 + b.abs()), "{a} {b}");
}

/// A minimum whose weakest rotation is known worse than this lies in a valley so flat that rounding decides how many steps lead there: it is
/// found, by either path, to where a step would promise 1e-7 of χ², 3e-4 standard deviations from its bottom. One view in 60,000.
const FLAT_RAD: f64 = 0.5;

fn assert_same_minimum(a: &Minimum, b: &Minimum, tolerance: f64, of_covariance: f64) {
    let variance = (0..3).map(|i| b.covariance[(i, i)]).fold(0.0, f64::max);
    let is_flat = FLAT_RAD < variance.sqrt();
    let (of_pose, of_covariance, of_chi2) =
        if is_flat { (1e-3 * variance.sqrt(), 1e-2, 1e-6) } else { (tolerance, of_covariance, 1e-9) };
    let (p, q) = (&a.cam_from_target, &b.cam_from_target);
    let off = (p.rotation - q.rotation).amax().max((p.translation - q.translation).amax());
    assert!(off < of_pose * (1.0 + q.translation.amax()), "{off}");
    let off = (a.covariance - b.covariance).amax() / b.covariance.amax();
    assert!(off < of_covariance, "{off}");
    assert_near(a.chi2, b.chi2, of_chi2);
    assert_near(a.rms_px, b.rms_px, of_chi2);
}

fn assert_same_others(one: &Others, other: &Others, one_lowest: f64, condition: f64) {
    for (a, b) in one.iter().zip(other) {
        let (Some(a), Some(b)) = (a, b) else {
            assert_eq!(a, b);
            continue;
        };
        assert_eq!(a.is_alternative, b.is_alternative);
        assert_same_minimum(&a.minimum, &b.minimum, 1e-9, 1e-7);
        let difference = a.minimum.chi2 - one_lowest;
        assert!((a.delta_chi2 - difference).abs() <= 1e-12 * a.minimum.chi2);
        assert_same_weight(a.probability, b.probability, condition);
    }
}

fn assert_same_verdict(one: &Ambiguity, other: &Ambiguity) {
    match (one, other) {
        (Ambiguity::Unique { ratio: Some(a) }, Ambiguity::Unique { ratio: Some(b) }) => {
            assert_near(*a, *b, 1e-6)
        }
        (Ambiguity::Ambiguous { ratio: a, other: m }, Ambiguity::Ambiguous { ratio: b, other: n }) => {
            assert_near(*a, *b, 1e-6);
            assert_same_minimum(m, n, 1e-9, 1e-7);
        }
        (a, b) => assert_eq!(a, b),
    }
}

fn assert_same_consistency(one: &Consistency, other: &Consistency) {
    match (one, other) {
        (
            Consistency::Inconsistent {
                chi2_per_degree_of_freedom: a,
                worst_point: i,
                worst_px: x,
                worst_prior: p,
            },
            Consistency::Inconsistent {
                chi2_per_degree_of_freedom: b,
                worst_point: j,
                worst_px: y,
                worst_prior: q,
            },
        ) => {
            assert_eq!((i, p), (j, q));
            assert_near(*a, *b, 1e-9);
            assert_near(*x, *y, 1e-9);
        }
        (a, b) => assert_eq!(a, b),
    }
}

fn assert_same_weakness(one: &Option<Weakness>, other: &Option<Weakness>) {
    match (one, other) {
        (
            Some(Weakness::CriticalPlane { separation_sigma: a, needed_sigma: x }),
            Some(Weakness::CriticalPlane { separation_sigma: b, needed_sigma: y }),
        ) => {
            assert_eq!(x, y);
            assert_near(*a, *b, 1e-6);
        }
        (a, b) => assert_eq!(a, b),
    }
}

#[test]
fn views_answer_together_as_each_alone() {
    let (camera, points, n) = (camera(), points(), 20_003);
    // The last number: at most so many per cent in doubt. Measured 4.5, 45 (bent or ambiguous) and 0.05; were it more,
    // the lanes would be idle.
    let families = [(1, (2.0, 6.0), 0.3, 6), (2, (4.0, 15.0), 1.0, 50), (3, (4.0, 15.0), 0.0, 1)];
    for (seed, range_m, noise_px, most_percent) in families {
        let pixels = pixels(seed, n, range_m, noise_px, &points);
        let sigma_px = [noise_px.max(1e-3); 4];
        let (points_in_target, sigmas) = (Given::Shared(&points), Given::Shared(&sigma_px));
        let views =
            Views { camera: Given::Shared(&camera), points_in_target, pixels: &pixels, sigma_px: sigmas };
        let mut answers = Vec::new();
        let doubtful = locate_each(&views, &mut answers).expect("as many of each");
        println!(
            "{range_m:?} m, {noise_px} px: {:.2} % on the single path",
            100.0 * doubtful as f64 / n as f64
        );
        assert!(100 * doubtful < most_percent * n, "{doubtful}");
        assert_eq!(answers.len(), n);
        for (answer, pixels) in answers.iter().zip(&pixels) {
            assert_same(answer, &alone(&camera, &points, pixels, &sigma_px));
        }
    }
}

/// A view with nothing to say gives its own error, and the views in the same vector give what they give without it.
#[test]
fn a_bad_view_leaves_its_neighbours_alone() {
    let (camera, good) = (camera(), points());
    let count = 400;
    let clean = pixels(4, count, (2.0, 6.0), 0.3, &good);
    let on_a_line = [0.0, 1.0, 2.0, 3.0].map(|x| Point::new(x, 0.0, 0.0));
    let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| Point::new(x, y, 0.0));
    let (mut targets, mut seen, mut sigmas) = (vec![good; count], clean.clone(), vec![[0.3; 4]; count]);
    let bad: Vec<usize> = (0..count).step_by(3).collect();
    for (n, &i) in bad.iter().enumerate() {
        match n % 9 {
            0 => seen[i][1].x = f64::NAN,
            1 => seen[i][3].y = f64::INFINITY,
            2 => seen[i][2] = seen[i][0],
            3 => sigmas[i][0] = f64::NAN,
            4 => sigmas[i][2] = 0.0,
            5 => sigmas[i][3] = -1.0,
            6 => targets[i] = on_a_line,
            7 => targets[i] = square,
            _ => targets[i][2].z = f64::NAN,
        }
    }
    let (points_in_target, sigma_px) = (Given::Each(&targets[..]), Given::Each(&sigmas[..]));
    let answers =
        together(&Views { camera: Given::Shared(&camera), points_in_target, pixels: &seen, sigma_px });
    let (points_in_target, sigma_px) = (Given::Shared(&good), Given::Shared(&[0.3; 4]));
    let untouched =
        together(&Views { camera: Given::Shared(&camera), points_in_target, pixels: &clean, sigma_px });
    let mut errors = 0;
    for i in 0..count {
        if bad.contains(&i) {
            assert_same(&answers[i], &alone(&camera, &targets[i], &seen[i], &sigmas[i]));
            errors += usize::from(answers[i].is_err());
        } else {
            assert_eq!(answers[i], untouched[i], "{i}");
        }
    }
    // All but the squares, and the pixels given to two points: those are answered, and inconsistent.
    assert!(7 * bad.len() / 9 - 9 < errors, "{errors}");
}

/// For any number of views, with a remainder beside full vectors: a view's answer does not depend on its neighbours, to the last bit.
#[test]
fn every_length_gives_the_same_answers() {
    let (camera, points, sigma) = (camera(), points(), [0.3; 4]);
    let pixels = pixels(5, 40, (2.0, 6.0), 0.3, &points);
    let (points_in_target, sigma_px) = (Given::Shared(&points), Given::Shared(&sigma));
    let all =
        together(&Views { camera: Given::Shared(&camera), points_in_target, pixels: &pixels, sigma_px });
    for first in [0, 3] {
        for last in first..pixels.len() {
            let pixels = &pixels[first..last];
            let some =
                together(&Views { camera: Given::Shared(&camera), points_in_target, pixels, sigma_px });
            assert_eq!(some, all[first..last]);
        }
    }
}

/// Points in any order, a target of its own for each view, sigmas that differ.
#[test]
fn targets_and_sigmas_of_each_view() {
    let (camera, count) = (camera(), 600);
    let mut rng = Rng::new(6);
    let (mut targets, mut seen, mut sigmas) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..count {
        let (shift, stretch) = (Vector3::new(rng.uniform(-9.0, 9.0), 1.0, 2.0), rng.uniform(0.5, 2.0));
        let mut target = points().map(|x| x * stretch + shift);
        target.rotate_left(i % 4);
        let cam_from_target = looking_at(
            target[0] + Vector3::new(rng.uniform(1.0, 3.0), rng.uniform(-3.0, -1.0), rng.uniform(3.0, 5.0)),
            target[0] + Vector3::new(0.3, 0.2, 0.0),
        );
        sigmas.push([0.1, 0.2, 0.3, 0.4].map(|s| s * stretch));
        let pixel = |x: Point| camera.project(&(cam_from_target * x)).expect("in front");
        seen.push(target.map(|x| pixel(x) + Vector2::new(rng.normal(), rng.normal()) * 0.2));
        targets.push(target);
    }
    let (points_in_target, sigma_px) = (Given::Each(&targets[..]), Given::Each(&sigmas[..]));
    let answers =
        together(&Views { camera: Given::Shared(&camera), points_in_target, pixels: &seen, sigma_px });
    for i in 0..count {
        assert_same(&answers[i], &alone(&camera, &targets[i], &seen[i], &sigmas[i]));
    }
}

#[test]
fn a_lens_with_distortion_takes_the_single_path() {
    let lens = BrownConrady::new(MATRIX, &[-0.2, 0.05, 1e-3, -1e-3]).expect("a lens");
    let (camera, points, sigma) = (Camera { lens: lens.into(), size: None }, points(), [0.3; 4]);
    let pixels = pixels(7, 11, (4.0, 6.0), 0.3, &points);
    let (points_in_target, sigma_px) = (Given::Shared(&points), Given::Shared(&sigma));
    let answers =
        together(&Views { camera: Given::Shared(&camera), points_in_target, pixels: &pixels, sigma_px });
    for (answer, pixels) in answers.iter().zip(&pixels) {
        assert_eq!(answer, &alone(&camera, &points, pixels, &sigma));
    }
}

/// The fourth point 5 cm off a line of 2 m, the third 5 cm off one of 1.8 m: the search starts from more poses there than the lanes have.
#[test]
fn targets_near_a_line_take_the_single_path() {
    let (camera, n) = (camera(), 200);
    let points = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.3, 0.05]].map(|[x, y]| Point::new(x, y, 0.0));
    let pixels_of_four = pixels(11, n, (2.0, 6.0), 0.3, &points);
    let views = Views {
        camera: Given::Shared(&camera),
        points_in_target: Given::Shared(&points),
        pixels: &pixels_of_four,
        sigma_px: Given::Shared(&[0.3; 4]),
    };
    let mut answers = Vec::new();
    assert_eq!(locate_each(&views, &mut answers).expect("as many of each"), n);
    for (answer, pixels) in answers.iter().zip(&pixels_of_four) {
        assert_eq!(*answer, alone(&camera, &points, pixels, &[0.3; 4]));
    }
    let points = [[0.0, 0.0], [1.8, 0.0], [0.4, 0.05]].map(|[x, y]| Point::new(x, y, 0.0));
    let pixels_of_three = pixels(12, n, (2.0, 6.0), 0.3, &points);
    let views = Views {
        camera: Given::Shared(&camera),
        points_in_target: Given::Shared(&points),
        pixels: &pixels_of_three,
        sigma_px: Given::Shared(&[0.3; 3]),
    };
    assert_eq!(locate_each_of_three(&views, &mut answers).expect("as many of each"), n);
    for (answer, pixels) in answers.iter().zip(&pixels_of_three) {
        assert_eq!(*answer, alone(&camera, &points, pixels, &[0.3; 3]));
    }
}

#[test]
fn as_many_targets_and_sigmas_as_views() {
    let (camera, points, sigma) = (camera(), points(), [0.3; 4]);
    let pixels = pixels(8, 3, (2.0, 6.0), 0.3, &points);
    let two = [points; 2];
    let (points_in_target, sigma_px) = (Given::Each(&two[..]), Given::Shared(&sigma));
    let views = Views { camera: Given::Shared(&camera), points_in_target, pixels: &pixels, sigma_px };
    let error = locate_each(&views, &mut Vec::new()).expect_err("two targets for three views");
    assert_eq!(error, Error::CountMismatch { what: "points_in_target", seen: 2, needed: 3 });
}

/// Three points fit exactly in up to four poses, whose order is that of rounding: compared as sets, each with its nearest. Returns
/// whether the view was compared: beyond `MOST_RAD` two poses may be next to a double root, and rounding decides whether there are
/// two, one or none.
fn assert_same_set(one: &Answer, other: &Answer) -> bool {
    let (a, b) = match (one, other) {
        (Ok(a), Ok(b)) => (a, b),
        (Err(a), Err(b)) => {
            assert_eq!(format!("{a}"), format!("{b}"));
            return true;
        }
        // Rounding also decides whether such a view has a second pose, without which the first is too poorly known to be an answer.
        (Ok(found), Err(Error::DegenerateView { .. })) | (Err(Error::DegenerateView { .. }), Ok(found))
            if MOST_RAD < weakest_rad(found) =>
        {
            return false;
        }
        _ => panic!("{one:?} and {other:?}"),
    };
    if MOST_RAD < weakest_rad(b) {
        return false;
    }
    assert_eq!(a.minima().count(), b.minima().count());
    for h in a.minima() {
        let off =
            |g: &Hypothesis| (g.minimum.cam_from_target.rotation - h.minimum.cam_from_target.rotation).norm();
        let nearest = b.minima().min_by(|g, f| off(g).total_cmp(&off(f))).expect("at least one");
        // P3P is the same code, so that its poses are; the bend's share of a covariance is a difference of probes, measured up to 4e-6, and where
        // the walk along a ridge passes a saddle, which one of 40,000 views does, up to 7e-5.
        assert_same_minimum(&h.minimum, &nearest.minimum, 1e-12, 1e-4);
        assert_same_weight(h.probability, nearest.probability, condition(b));
        assert!(h.delta_chi2 < 1e-9 && h.is_alternative && nearest.is_alternative);
    }
    assert!((a.minima().map(|h| h.probability).sum::<f64>() - 1.0).abs() < 1e-12);
    assert!(
        a.minima().skip(1).zip(a.minima()).all(|(next, h)| next.probability <= h.probability),
        "the more probable first"
    );
    match a.ambiguity {
        Ambiguity::Ambiguous { other, .. } => assert_eq!(Some(other), a.others[0].map(|h| h.minimum)),
        Ambiguity::Unique { ratio } => assert_eq!((ratio, a.others[0]), (None, None)),
    }
    let rest = |e: &PoseEstimate| {
        (e.degrees_of_freedom, e.n_points, e.method, e.geometry, e.weakness, e.consistency)
    };
    assert_eq!(rest(a), rest(b));
    true
}

/// Standard deviation of the weakest rotation of any of the poses.
const MOST_RAD: f64 = 0.1;

#[test]
fn views_of_three_points_answer_together_as_each_alone() {
    let (camera, points, n) = (camera(), three(), 20_003);
    for (seed, range_m, noise_px) in [(11, (2.0, 6.0), 0.3), (12, (4.0, 15.0), 0.0)] {
        let pixels = pixels(seed, n, range_m, noise_px, &points);
        let sigma_px = [0.3, 0.2, 0.4];
        let (points_in_target, sigmas) = (Given::Shared(&points), Given::Shared(&sigma_px));
        let views =
            Views { camera: Given::Shared(&camera), points_in_target, pixels: &pixels, sigma_px: sigmas };
        let answers = together_of_three(&views);
        assert_eq!(answers.len(), n);
        let alike = answers.iter().zip(&pixels);
        let alike = alike.filter(|(one, p)| assert_same_set(one, &alone(&camera, &points, p, &sigma_px)));
        let compared = alike.count();
        println!("{range_m:?} m, {noise_px} px: {compared} of {n} compared");
        assert!(9 * n < 10 * compared, "{compared}");
    }
}

/// As `a_bad_view_leaves_its_neighbours_alone`; a view's answer does not depend on its neighbours to the last bit.
#[test]
fn a_bad_view_of_three_points_leaves_its_neighbours_alone() {
    let (camera, good, count) = (camera(), three(), 401);
    let clean = pixels(13, count, (2.0, 6.0), 0.3, &good);
    let on_a_line = [0.0, 1.0, 2.0].map(|x| Point::new(x, 0.0, 0.0));
    let (mut targets, mut seen, mut sigmas) = (vec![good; count], clean.clone(), vec![[0.3; 3]; count]);
    let bad: Vec<usize> = (0..count).step_by(3).collect();
    for (n, &i) in bad.iter().enumerate() {
        match n % 8 {
            0 => seen[i][1].x = f64::NAN,
            1 => seen[i][2].y = f64::INFINITY,
            2 => seen[i][2] = seen[i][0],
            3 => sigmas[i][0] = f64::NAN,
            4 => sigmas[i][2] = 0.0,
            5 => sigmas[i][1] = -1.0,
            6 => targets[i] = on_a_line,
            _ => targets[i][2].z = f64::NAN,
        }
    }
    let (points_in_target, sigma_px) = (Given::Each(&targets[..]), Given::Each(&sigmas[..]));
    let answers = together_of_three(&Views {
        camera: Given::Shared(&camera),
        points_in_target,
        pixels: &seen,
        sigma_px,
    });
    let (points_in_target, sigma_px) = (Given::Shared(&good), Given::Shared(&[0.3; 3]));
    let views = Views { camera: Given::Shared(&camera), points_in_target, pixels: &clean, sigma_px };
    let untouched = together_of_three(&views);
    for i in 0..count {
        if bad.contains(&i) {
            assert!(answers[i].is_err(), "{i}");
            assert!(assert_same_set(&answers[i], &alone(&camera, &targets[i], &seen[i], &sigmas[i])));
        } else {
            assert_eq!(answers[i], untouched[i], "{i}");
        }
    }
    for last in 0..20 {
        let pixels = &clean[..last];
        assert_eq!(together_of_three(&Views { pixels, ..views }), untouched[..last]);
    }
}

/// One camera a view, by number, two of them with a lens that the lanes do not know: the same answers as each camera's views alone.
#[test]
fn cameras_of_each_view() {
    let (points, sigma) = (points(), [0.3; 4]);
    let wide = |factor: f64| {
        let CameraMatrix { fx_px, fy_px, cx_px, cy_px } = MATRIX;
        CameraMatrix { fx_px: factor * fx_px, fy_px: factor * fy_px, cx_px, cy_px }
    };
    let bent = |factor: f64| {
        BrownConrady::new(wide(factor), &[-0.05, 0.01, 0.0, 0.0]).expect("a lens that is one").into()
    };
    let lenses = [wide(1.0), wide(1.1), wide(0.9)].map(|matrix| Lens::Pinhole(Pinhole { matrix }));
    let lenses = lenses.into_iter().chain([bent(1.0), bent(1.1)]);
    let cameras: Vec<Camera> = lenses.map(|lens| Camera { lens, size: None }).collect();
    let pixels = pixels(11, 600, (2.0, 6.0), 0.3, &points);
    let numbers: Vec<u32> = (0..pixels.len() as u32).map(|i| (i * i + i / 7) % 5).collect();
    let (points_in_target, sigma_px) = (Given::Shared(&points), Given::Shared(&sigma));
    let camera = Given::Numbered { values: &cameras, numbers: &numbers };
    let answers = together(&Views { camera, points_in_target, pixels: &pixels, sigma_px });
    for (number, camera) in cameras.iter().enumerate() {
        let is_its = |i: &usize| numbers[*i] as usize == number;
        let own: Vec<usize> = (0..pixels.len()).filter(is_its).collect();
        let seen: Vec<[Pixel; 4]> = own.iter().map(|i| pixels[*i]).collect();
        let camera = Given::Shared(camera);
        let alone = together(&Views { camera, points_in_target, pixels: &seen, sigma_px });
        assert!(50 < own.len());
        for (i, answer) in own.iter().zip(&alone) {
            assert_eq!(&answers[*i], answer, "camera {number}, view {i}");
        }
    }
    let camera = Given::Numbered { values: &cameras, numbers: &numbers[1..] };
    let short = Views { camera, points_in_target, pixels: &pixels, sigma_px };
    assert!(matches!(locate_each(&short, &mut Vec::new()), Err(Error::CountMismatch { what: "camera", .. })));
}
