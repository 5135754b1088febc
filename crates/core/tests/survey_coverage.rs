//! Do 95 % intervals contain the truth 95 times in 100? Pixels, intrinsics, distances, coordinates and the road's unevenness drawn
//! from their stated sigmas.

use crate::budget::assert_parts;
use crate::common::Rng;
use crate::common::accident::{Scene, intrinsics, photos};
use nalgebra::{Matrix1, Matrix6, Vector3};
use resight_core::Point;
use resight_core::budget::ErrorSource;
use resight_core::multiview::network::{Constraint, Plane, Query, adjust};

/// How often each query's interval covered, by name.
struct Count {
    name: String,
    truth: fn(&[Point]) -> f64,
    query: Query,
    covered: usize,
    covered_linear: usize,
    below: usize,
    profiles: usize,
}

fn count(name: &str, query: Query, truth: fn(&[Point]) -> f64) -> Count {
    Count { name: name.to_string(), truth, query, covered: 0, covered_linear: 0, below: 0, profiles: 0 }
}

/// Draws in the suite; `RESIGHT_DRAWS` takes more for the figures of docs/math/survey.md.
fn draws() -> usize {
    std::env::var("RESIGHT_DRAWS").ok().and_then(|n| n.parse().ok()).unwrap_or(400)
}

fn run(name: &str, scene: &Scene, seed: u64, mut counts: Vec<Count>) {
    let n = draws();
    let mut rng = Rng::new(seed);
    let cameras = scene.cameras();
    let (mut chi2, mut lost) = (0.0, 0);
    for _ in 0..n {
        let drawn = scene.drawn(&mut rng);
        let network = scene.network(&cameras, &drawn.constraints);
        let adjusted = adjust(&network).expect("places");
        chi2 += adjusted.chi2 / adjusted.degrees_of_freedom as f64;
        for c in &mut counts {
            let Ok(found) = adjusted.measure(&c.query) else {
                lost += 1;
                continue;
            };
            let truth = (c.truth)(&drawn.points);
            c.covered += usize::from((found.low..=found.high).contains(&truth));
            c.covered_linear += usize::from((found.value - truth).abs() < 1.96 * found.sigma);
            c.below += usize::from(truth < found.low);
            c.profiles += usize::from(found.is_profile);
        }
    }
    println!("{name}: {n} draws, χ²/dof {:.3}, {lost} lost", chi2 / n as f64);
    let part = |k: usize| k as f64 / n as f64;
    // Five standard deviations of a binomial at 95 %.
    let slack = 5.0 * (0.05 * 0.95 / n as f64).sqrt();
    let mut total = 0.0;
    for c in &counts {
        println!(
            "  {:28} covers {:.4} (below {:.4}); value ± 1.96 σ {:.4}; profiles {:.4}",
            c.name,
            part(c.covered),
            part(c.below),
            part(c.covered_linear),
            part(c.profiles)
        );
        assert!((part(c.covered) - 0.95).abs() < slack, "{name}, {}: {}", c.name, part(c.covered));
        total += part(c.covered) / counts.len() as f64;
    }
    println!("  all: {total:.4}");
    assert!(lost == 0 && (total - 0.95).abs() < slack);
}

fn length(x: &[Point], a: usize, b: usize) -> f64 {
    (x[a] - x[b]).norm()
}

/// Two photographs of an accident with tapes along the road, all on its plane.
fn accident() -> Scene {
    let mut scene = Scene::new(photos());
    scene.intrinsics = Some(intrinsics([6.0, 6.0, 4.0, 4.0]));
    scene.image_point_all(&[0, 1, 2, 3, 4, 5, 6, 7, 8], 1.0);
    for (a, b) in [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3)] {
        scene.distance(a, b, 0.01);
    }
    scene.on_plane(&[0, 1, 2, 3, 4, 5, 6], 0.01);
    scene
}

/// The two photographs of an accident: everything at once.
#[test]
fn two_photographs_with_known_distances() {
    let scene = accident();
    run(
        "two photographs",
        &scene,
        51,
        vec![
            count("distance on the road", Query::Distance { a: 4, b: 5 }, |x| length(x, 4, 5)),
            count("distance road to vehicle", Query::Distance { a: 6, b: 7 }, |x| length(x, 6, 7)),
            count("distance on the vehicle", Query::Distance { a: 7, b: 8 }, |x| length(x, 7, 8)),
            count("polyline", Query::Polyline { points: vec![4, 6, 5, 7] }, |x| {
                length(x, 4, 6) + length(x, 6, 5) + length(x, 5, 7)
            }),
            count("angle", Query::Angle { a: 4, vertex: 6, b: 7 }, |x| (x[4] - x[6]).angle(&(x[7] - x[6]))),
            count("area", Query::Area { points: vec![4, 6, 5] }, |x| {
                (x[6] - x[4]).cross(&(x[5] - x[4])).norm() / 2.0
            }),
        ],
    );
}

/// One photograph, road points by their rays at grazing angles up to 12 m away, the height of a post.
#[test]
fn one_photograph_on_a_known_plane() {
    let mut scene = Scene::new(photos()[..1].to_vec());
    scene.intrinsics = Some(intrinsics([6.0, 6.0, 4.0, 4.0]));
    scene.planes = vec![Plane::Known { normal_in_world: Vector3::z(), offset_m: 0.0 }];
    scene.image_point_all(&[0, 1, 2, 3, 4, 5, 6, 9], 2.0);
    (0..4).for_each(|p| scene.place(p, 0.01));
    scene.on_plane(&[4, 5, 6], 0.01);
    scene.constraints.push(Constraint::Upright { plane: 0, foot: 4, top: 9, sigma_rad: 0.02 });
    run(
        "one photograph",
        &scene,
        52,
        vec![
            count("distance", Query::Distance { a: 4, b: 5 }, |x| length(x, 4, 5)),
            count("distance to a control point", Query::Distance { a: 6, b: 0 }, |x| length(x, 6, 0)),
            count("area", Query::Area { points: vec![4, 6, 5] }, |x| {
                (x[6] - x[4]).cross(&(x[5] - x[4])).norm() / 2.0
            }),
            count("position x", Query::Coordinate { point: 4, axis: 0 }, |x| x[4].x),
            count("position y", Query::Coordinate { point: 4, axis: 1 }, |x| x[4].y),
            count("height", Query::Height { plane: 0, point: 9 }, |x| x[9].z),
        ],
    );
}

/// A far point on the road, seen under 3°: its distance is known to a fifth, and the interval is bent.
#[test]
fn bent_intervals_cover_too() {
    let mut scene = Scene::new(photos()[..1].to_vec());
    scene.planes = vec![Plane::Known { normal_in_world: Vector3::z(), offset_m: 0.0 }];
    scene.points[4] = Point::new(9.0, 22.0, 0.0);
    scene.image_point_all(&[0, 1, 2, 3, 4, 6], 4.0);
    (0..4).for_each(|p| scene.place(p, 0.01));
    scene.on_plane(&[4, 6], 0.01);
    run(
        "far point",
        &scene,
        53,
        vec![
            count("distance", Query::Distance { a: 4, b: 0 }, |x| length(x, 4, 0)),
            count("area", Query::Area { points: vec![4, 6, 0] }, |x| {
                (x[6] - x[4]).cross(&(x[0] - x[4])).norm() / 2.0
            }),
        ],
    );
}

/// Image points, coordinates, tapes, a road, a known pose and a lens: every one has its part in measurements, points and photographs, the parts
/// add up, and the residuals have one where the stated sigmas are too small. In control points' own frame too, where some coordinates are held.
#[test]
fn the_parts_of_measurements_add_up() {
    let mut scene = accident();
    let without_frame = scene.constraints.len();
    (0..4).for_each(|p| scene.place(p, 0.01));
    let (cam_from_world, covariance) = (scene.photos[0], Some(Matrix6::identity() * 1e-4));
    scene.constraints.push(Constraint::Pose { photo: 0, cam_from_world, covariance });
    let cameras = scene.cameras();
    let queries = [
        Query::Distance { a: 4, b: 5 },
        Query::Angle { a: 4, vertex: 6, b: 7 },
        Query::Area { points: vec![4, 6, 5] },
        Query::Height { plane: 0, point: 8 },
        Query::Coordinate { point: 7, axis: 1 },
    ];
    let all = [
        ErrorSource::Pixels,
        ErrorSource::CameraPoses,
        ErrorSource::Lens,
        ErrorSource::ControlPoints,
        ErrorSource::Distances,
        ErrorSource::Priors,
    ];
    let mut rng = Rng::new(61);
    for (n, times) in [(scene.constraints.len(), 1.0), (without_frame, 1.0), (scene.constraints.len(), 6.0)] {
        let mut drawn = scene.drawn(&mut rng).constraints;
        drawn.truncate(n);
        for constraint in &mut drawn {
            if let Constraint::ImagePoint { pixel, .. } = constraint {
                *pixel += nalgebra::Vector2::new(rng.normal(), rng.normal()) * (times - 1.0);
            }
        }
        let adjusted = adjust(&scene.network(&cameras, &drawn)).expect("places");
        let budgets = adjusted.budgets();
        for query in &queries {
            let sigma = adjusted.measure(query).expect("a value").sigma;
            let budget = budgets.of_query(query).expect("its parts");
            assert_parts(&budget, &Matrix1::new(sigma * sigma), &format!("{query:?}"));
            if n != without_frame && matches!(query, Query::Distance { .. }) {
                assert!(all.iter().all(|source| budget.has(*source)), "{budget:?}");
            }
            assert_eq!(budget.has(ErrorSource::Residuals), 1.0 < adjusted.noise_scale);
        }
        assert_eq!(1.0 < times, 1.0 < adjusted.noise_scale, "{}", adjusted.noise_scale);
        for point in 0..9 {
            let whole = adjusted.point_covariance_m2(point).expect("a covariance");
            assert_parts(&budgets.of_point(point).expect("its parts"), &whole, &format!("point {point}"));
        }
        for photo in 0..2 {
            let whole = adjusted.photo_covariance(photo).expect("a covariance");
            assert_parts(&budgets.of_photo(photo).expect("its parts"), &whole, &format!("photo {photo}"));
        }
    }
}
