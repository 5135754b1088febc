//! Never confidently wrong: hundreds of drawn scenes, good ones, ones with a slipped decimal point, ones whose control points stand on a line.

use crate::common::Rng;
use crate::common::surveys::{Drawn, Known, ring, row};
use nalgebra::Vector3;
use resight_core::camera::Pinhole;
use resight_core::multiview::network::{
    Adjusted, Constraint, NetworkCamera, NetworkProblem, NetworkStatus, Query, adjust,
};
use resight_core::multiview::triangulate::isotropic;
use resight_core::{Camera, CameraMatrix, Error, Lens, Pixel};

fn scenes(count: usize) -> usize {
    std::env::var("RESIGHT_SCENES").ok().and_then(|n| n.parse().ok()).unwrap_or(count)
}

/// Standard deviations that no right answer is off by.
const FAR: f64 = 6.0;

/// Answers that are off by more than six standard deviations, of a network that is called good.
fn wrong(scene: &Drawn, adjusted: &Adjusted) -> usize {
    let is_off = |(query, truth): &(Query, f64)| {
        adjusted.measure(query).is_ok_and(|m| FAR * m.sigma + 1e-9 < (m.value - truth).abs())
    };
    if adjusted.status() != NetworkStatus::Ok {
        0
    } else {
        scene.queries().iter().filter(|q| is_off(q)).count()
    }
}

/// Cameras below the road they photograph: the frame is upside down.
fn below(adjusted: &Adjusted, scene: &Drawn) -> usize {
    let (normal, offset_m) = adjusted.plane(0).unwrap_or((Vector3::z(), f64::NEG_INFINITY));
    let is_below = |p: &usize| {
        adjusted.cam_from_world(*p).is_some_and(|pose| {
            normal.dot(&pose.origin()) < offset_m || pose.origin().z < adjusted.point(0).map_or(0.0, |x| x.z)
        })
    };
    (0..scene.photos.len()).filter(is_below).count()
}

#[derive(Debug, Default)]
struct Count {
    scenes: usize,
    ok: usize,
    ambiguous: usize,
    inconsistent: usize,
    degenerate: usize,
    refused: usize,
    wrong: usize,
    below: usize,
}

impl Count {
    fn add(&mut self, scene: &Drawn, found: &Result<Adjusted, Error>) {
        self.scenes += 1;
        let Ok(adjusted) = found else {
            self.refused += 1;
            return;
        };
        match adjusted.status() {
            NetworkStatus::Ok => self.ok += 1,
            NetworkStatus::Ambiguous => self.ambiguous += 1,
            NetworkStatus::Inconsistent => self.inconsistent += 1,
            NetworkStatus::Degenerate => self.degenerate += 1,
        }
        self.wrong += usize::from(0 < wrong(scene, adjusted));
        self.below += usize::from(0 < below(adjusted, scene));
    }
}

fn solved(scene: &Drawn) -> Result<Adjusted, Error> {
    let cameras = scene.cameras();
    adjust(&scene.network(&cameras))
}

/// Photographs, control points, what is known of them.
const LAYOUTS: [(usize, usize, Known); 9] = [
    (1, 4, Known::Tapes(6)),
    (2, 4, Known::Tapes(6)),
    (2, 4, Known::Tapes(5)),
    (3, 4, Known::Tapes(5)),
    (3, 5, Known::Tapes(10)),
    (4, 4, Known::Tapes(6)),
    (1, 4, Known::Coordinates),
    (2, 4, Known::Coordinates),
    (3, 3, Known::Tapes(3)),
];

/// Good scenes are called good, the cameras stand above the road, and no answer is wrong. One network in a thousand may suspect something
/// without reason.
#[test]
fn good_scenes_are_good() {
    let (mut all, n) = (Count::default(), scenes(20));
    for (i, (n_photos, n_control_points, known)) in LAYOUTS.iter().enumerate() {
        let mut count = Count::default();
        for k in 0..n {
            let mut rng = Rng::new((10_000 * i + k) as u64);
            let highest_m = if k % 3 == 2 { 8.0 } else { 3.0 };
            let scene = Drawn::new(&mut rng, *n_photos, known, highest_m, |rng| ring(rng, *n_control_points));
            let found = solved(&scene);
            if !found.as_ref().is_ok_and(|a| {
                a.status() == NetworkStatus::Ok && below(a, &scene) == 0 && wrong(&scene, a) == 0
            }) {
                let said = found.as_ref().map(|a| {
                    (
                        a.status(),
                        a.chi2,
                        a.degrees_of_freedom,
                        a.alternative_delta_chi2,
                        a.on_line,
                        a.suspects.len(),
                        a.undetermined.len(),
                    )
                });
                println!("layout {i} scene {k}: {said:?}");
            }
            count.add(&scene, &found);
            all.add(&scene, &found);
        }
        println!("{n_photos} photographs, {n_control_points} control points: {count:?}");
    }
    println!("all: {all:?}");
    assert_eq!((all.refused, all.wrong, all.below, all.degenerate), (0, 0, 0, 0));
    assert!(all.inconsistent <= 1 + all.scenes / 300, "false alarms");
    assert!(all.ambiguous <= all.scenes / 100, "needless doubts");
}

/// One tape of some scenes each (forty with `RESIGHT_SCENES=40`) with its decimal point slipped by one place: every one is named, with the right power of ten.
#[test]
fn a_slipped_decimal_is_recognised() {
    let n = scenes(8);
    for (i, (n_photos, n_control_points, n_tapes)) in
        [(1, 4, 6), (1, 4, 5), (2, 4, 6), (2, 4, 5), (3, 5, 10), (4, 4, 6)].into_iter().enumerate()
    {
        let (mut named, mut ok, mut refused) = (0, 0, 0);
        for k in 0..n {
            let mut rng = Rng::new((70_000 + 1000 * i + k) as u64);
            let mut scene = Drawn::new(&mut rng, n_photos, &Known::Tapes(n_tapes), 3.0, |rng| {
                ring(rng, n_control_points)
            });
            let tapes = scene.tapes();
            let (tape, power) = (tapes[rng.index(tapes.len())], if k % 2 == 0 { 1 } else { -1 });
            if let Constraint::Distance { distance_m, .. } = &mut scene.constraints[tape] {
                *distance_m *= 10f64.powi(power);
            }
            let found = solved(&scene);
            let is_named = found.as_ref().is_ok_and(|a| {
                a.suspects
                    .first()
                    .is_some_and(|s| s.constraint == tape && s.slip.is_some_and(|s| s.power_of_ten == power))
            });
            if !is_named {
                let said = found.as_ref().map(|a| {
                    (
                        a.status(),
                        a.chi2,
                        a.degrees_of_freedom,
                        a.left_out.clone(),
                        a.suspects.clone(),
                        a.undetermined.clone(),
                    )
                });
                println!("layout {i} scene {k}, constraint {tape} × 10^{power}: {said:?}");
            }
            named += usize::from(is_named);
            ok += usize::from(found.as_ref().is_ok_and(|a| a.status() == NetworkStatus::Ok));
            refused += usize::from(found.is_err());
        }
        println!(
            "{n_photos} photographs, {n_control_points} control points, {n_tapes} tapes: named {named} of {n}, ok {ok}, refused {refused}"
        );
        assert_eq!((named, ok, refused), (n, 0, 0));
    }
}

/// Control points on a line, or off it by up to 0.4 m of 9: never called good and wrong; exactly on it never called good at all.
#[test]
fn control_points_on_a_line_are_named() {
    let n = scenes(3);
    for width_m in [0.0, 0.01, 0.05, 0.15, 0.4] {
        for (n_photos, known) in [
            (1, Known::Tapes(6)),
            (1, Known::Coordinates),
            (2, Known::Tapes(6)),
            (2, Known::Coordinates),
            (3, Known::Tapes(5)),
        ] {
            let mut count = Count::default();
            for k in 0..n {
                let mut rng = Rng::new((90_000 + k) as u64);
                let scene = Drawn::new(&mut rng, n_photos, &known, 3.0, |rng| row(rng, 4, width_m));
                let found = solved(&scene);
                if let Err(reason) = &found
                    && !matches!(reason, Error::ControlPointsOnLine { .. })
                {
                    println!("   {reason}");
                }
                if found.as_ref().is_ok_and(|a| {
                    0 < wrong(&scene, a) || (width_m < 0.05 && a.status() == NetworkStatus::Ok)
                }) {
                    let said = found.as_ref().map(|a| {
                        (
                            a.status(),
                            a.chi2,
                            a.degrees_of_freedom,
                            a.alternative_delta_chi2,
                            a.on_line,
                            below(a, &scene),
                        )
                    });
                    println!("   {k}: {said:?}");
                }
                count.add(&scene, &found);
            }
            println!("± {width_m} m, {n_photos} photographs: {count:?}");
            assert_eq!(count.wrong, 0);
            assert!(0.05 <= width_m || count.ok == 0);
        }
    }
}

/// Lengths between road points that no dash touches.
fn between(scene: &Drawn) -> [(Query, f64); 3] {
    let n = scene.n_control_points;
    [(n, n + 1), (n + 1, n + 2), (n, n + 2)]
        .map(|(a, b)| (Query::Distance { a, b }, (scene.points[a] - scene.points[b]).norm()))
}

/// Separate dashes of known length on a road: enough for every other length on it, and 95 % of the intervals hold the truth.
#[test]
fn separate_dashes_give_a_road_its_scale() {
    for (n_photos, lines_m, on_each) in
        [(1, &[-1.75, 1.75][..], 3), (1, &[-5.25, -1.75, 1.75][..], 3), (2, &[-1.75, 1.75][..], 2)]
    {
        let (n, mut ok, mut held, mut all, mut far, mut relative) = (scenes(20), 0, 0, 0, 0, 0.0);
        for k in 0..n {
            let mut rng = Rng::new(120_000 + k as u64);
            let scene = Drawn::dashes(&mut rng, n_photos, lines_m, on_each);
            let found = solved(&scene);
            let Some(adjusted) = found.as_ref().ok().filter(|a| a.status() == NetworkStatus::Ok) else {
                println!(
                    "   {k}: {:?}",
                    found.as_ref().map(|a| (
                        a.status(),
                        a.chi2,
                        a.degrees_of_freedom,
                        a.alternative_delta_chi2,
                        a.on_line
                    ))
                );
                continue;
            };
            ok += 1;
            for (query, truth) in between(&scene) {
                let m = adjusted.measure(&query).expect("a length");
                held += usize::from((m.low..=m.high).contains(&truth));
                far += usize::from(FAR * m.sigma < (m.value - truth).abs());
                relative += m.sigma / truth;
                all += 1;
            }
        }
        let part = held as f64 / all.max(1) as f64;
        println!(
            "{n_photos} photographs, {} lines of {on_each} dashes: ok {ok} of {n}, {far} far off, intervals hold {part:.3}, σ {:.1} %",
            lines_m.len(),
            100.0 * relative / all.max(1) as f64
        );
        assert!(far == 0 && n * 9 <= ok * 10);
        // Three lengths of one scene go together: at the worst one counts.
        assert!((part - 0.95).abs() < 4.0 * (0.05 * 0.95 / ok as f64).sqrt());
    }
}

/// All dashes on one lane line leave a rotation about it free.
#[test]
fn dashes_on_one_line_are_refused_by_name() {
    let mut count = Count::default();
    for k in 0..scenes(20) {
        let scene = Drawn::dashes(&mut Rng::new(130_000 + k as u64), 1, &[0.0], 4);
        let found = solved(&scene);
        let is_named = match &found {
            Ok(adjusted) => adjusted.on_line.is_some(),
            Err(reason) => matches!(reason, Error::ControlPointsOnLine { .. }),
        };
        if !is_named {
            println!(
                "   {k}: {:?}",
                found.as_ref().map(|a| (
                    a.status(),
                    a.chi2,
                    a.degrees_of_freedom,
                    a.alternative_delta_chi2,
                    a.on_line
                ))
            );
        }
        count.add(&scene, &found);
    }
    println!("dashes on one line: {count:?}");
    assert_eq!(count.ok, 0);
}

/// Photograph, point, pixel of a valid scene of three photographs without a plane.
#[rustfmt::skip]
const CLICKS: [(usize, usize, [f64; 2]); 31] = [
    (0, 0, [667.436, 463.064]),
    (0, 1, [583.884, 518.075]),
    (0, 2, [448.741, 659.282]),
    (0, 3, [1069.088, 706.035]),
    (0, 4, [922.735, 554.396]),
    (0, 5, [588.373, 609.875]),
    (0, 6, [770.415, 486.625]),
    (0, 7, [389.407, 592.688]),
    (0, 8, [719.242, 538.775]),
    (0, 9, [576.463, 439.732]),
    (0, 10, [580.438, 428.903]),
    (1, 0, [1237.867, 566.642]),
    (1, 1, [1020.259, 517.245]),
    (1, 2, [720.367, 470.789]),
    (1, 3, [462.267, 614.903]),
    (1, 4, [834.713, 635.507]),
    (1, 5, [776.897, 505.872]),
    (1, 6, [1123.553, 601.446]),
    (1, 8, [764.208, 493.387]),
    (1, 9, [895.219, 411.424]),
    (1, 10, [775.681, 375.029]),
    (2, 0, [378.976, 586.816]),
    (2, 1, [656.913, 638.681]),
    (2, 2, [1161.901, 679.937]),
    (2, 3, [1147.057, 387.175]),
    (2, 4, [810.051, 419.889]),
    (2, 5, [1004.309, 602.513]),
    (2, 6, [533.384, 502.516]),
    (2, 8, [965.056, 471.141]),
    (2, 9, [841.933, 499.6]),
    (2, 11, [784.616, 525.482]),
];
/// Its tapes: points, metres.
#[rustfmt::skip]
const TAPES: [(usize, usize, f64); 10] = [(0, 1, 2.8618), (0, 2, 7.3601), (0, 3, 9.2273), (0, 4, 5.295), (1, 2, 4.5441), (1, 3, 7.3565), (1, 4, 4.2966), (2, 3, 5.5028), (2, 4, 5.5297), (3, 4, 4.1962)];
/// Lengths as they are.
const TRUTH: [(usize, usize, f64); 2] = [(5, 6, 5.069), (8, 9, 2.191)];

/// Five control points on a flat road that nothing states to be flat: how high each stands over three others, the tapes hardly say.
#[test]
fn control_points_that_tapes_leave_nearly_flat_are_solved() {
    let matrix = CameraMatrix { fx_px: 1300.0, fy_px: 1300.0, cx_px: 799.5, cy_px: 532.5 };
    let camera = Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None };
    let covariance = crate::common::accident::intrinsics([15.0, 15.0, 6.0, 6.0]);
    let cameras = [NetworkCamera { camera: &camera, intrinsics_covariance: Some(&covariance) }];
    let image_point = |(photo, point, [u, v]): (usize, usize, [f64; 2])| Constraint::ImagePoint {
        photo,
        point,
        pixel: Pixel::new(u, v),
        covariance_px2: isotropic(1.0),
    };
    let tape =
        |(a, b, distance_m): (usize, usize, f64)| Constraint::Distance { a, b, distance_m, sigma_m: 0.01 };
    let constraints: Vec<Constraint> = CLICKS.map(image_point).into_iter().chain(TAPES.map(tape)).collect();
    let network = NetworkProblem {
        cameras: &cameras,
        camera_of_photo: &[0; 3],
        n_points: 12,
        planes: &[],
        constraints: &constraints,
    };
    let adjusted = adjust(&network).expect("places");
    println!("{:?} χ² {:.1} for {}", adjusted.status(), adjusted.chi2, adjusted.degrees_of_freedom);
    assert_eq!(adjusted.status(), NetworkStatus::Ok);
    for (a, b, truth) in TRUTH {
        let m = adjusted.measure(&Query::Distance { a, b }).expect("a length");
        assert!((m.value - truth).abs() < FAR * m.sigma, "{a}–{b}: {m:?} {truth}");
    }
}

/// The same by the hundred: two or three photographs, no plane stated.
#[test]
fn good_scenes_without_a_plane_are_good() {
    for (n_photos, n_control_points, n_tapes) in [(3, 5, 10), (3, 4, 6), (2, 5, 10)] {
        let mut count = Count::default();
        for k in 0..scenes(20) {
            let mut rng = Rng::new((150_000 + k) as u64);
            let mut scene = Drawn::new(&mut rng, n_photos, &Known::Tapes(n_tapes), 8.0, |rng| {
                ring(rng, n_control_points)
            });
            scene.planes.clear();
            scene.constraints.retain(|f| f.plane().is_none());
            let found = solved(&scene);
            if !found.as_ref().is_ok_and(|a| a.status() == NetworkStatus::Ok && wrong(&scene, a) == 0) {
                let said = found.as_ref().map(|a| {
                    (a.status(), a.chi2, a.degrees_of_freedom, a.alternative_delta_chi2, a.undetermined.len())
                });
                println!("   {k}: {said:?}");
            }
            count.add(&scene, &found);
        }
        println!("no plane, {n_photos} photographs, {n_control_points} control points: {count:?}");
        assert_eq!((count.refused, count.wrong, count.degenerate), (0, 0, 0));
        assert!(count.inconsistent <= 1 + count.scenes / 300, "false alarms");
    }
}
