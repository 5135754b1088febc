//! Measuring in photographs: exact constraints give exact places; what is undetermined or contradictory is named.

use crate::common::Rng;
use crate::common::accident::{Scene, looking_at, photos};
use nalgebra::Vector3;
use resight_core::multiview::network::{
    Adjusted, Constraint, Frame, Item, NetworkProblem, Plane, Query, adjust,
};
use resight_core::{Error, Pixel, Point};

fn solve(scene: &Scene, constraints: &[Constraint]) -> Result<Adjusted, Error> {
    adjust(&scene.network(&scene.cameras(), constraints))
}

fn measured(adjusted: &Adjusted, query: &Query) -> f64 {
    adjusted.measure(query).expect("a value").value
}

/// Two photographs, four control points by their six distances, everything else clicked in both.
fn by_distances() -> Scene {
    let mut scene = Scene::new(photos());
    scene.image_point_all(&[0, 1, 2, 3, 4, 5, 6, 7, 8, 9], 0.5);
    for (a, b) in [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3)] {
        scene.distance(a, b, 0.01);
    }
    scene.on_plane(&[0, 1, 2, 3, 4, 5, 6], 0.005);
    scene
}

fn all_distances_match(scene: &Scene, adjusted: &Adjusted, points: &[usize], tolerance_m: f64) {
    for a in points {
        for b in points.iter().filter(|b| a < b) {
            let truth = (scene.points[*a] - scene.points[*b]).norm();
            let found = measured(adjusted, &Query::Distance { a: *a, b: *b });
            assert!((found - truth).abs() < tolerance_m, "{a}–{b}: {found} {truth}");
        }
    }
}

/// 1e-6 m: the loop ends 3·10⁻⁴ standard deviations of centimetres from the minimum.
#[test]
fn exact_constraints_give_exact_places() {
    let scene = by_distances();
    let adjusted = solve(&scene, &scene.constraints).expect("places");
    println!("{:?} after {} steps, dof {}", adjusted.frame, adjusted.steps, adjusted.degrees_of_freedom);
    assert_eq!(adjusted.frame, Frame::ControlPoints([0, 1, 2]));
    assert!(adjusted.undetermined.is_empty() && adjusted.suspects.is_empty() && adjusted.chi2 < 1e-6);
    all_distances_match(&scene, &adjusted, &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9], 1e-5);
    // First mark at the origin, second on x, third in the plane, heights up.
    let [a, b, c] = [0, 1, 2].map(|p| adjusted.point(p).expect("placed"));
    assert!(a.norm() == 0.0 && 0.0 < b.x && b.y == 0.0 && b.z == 0.0 && c.z == 0.0);
    let height = measured(&adjusted, &Query::Height { plane: 0, point: 7 });
    assert!((height - 1.1).abs() < 1e-5, "{height}");
    let seen_from_above = adjusted.point(7).expect("placed").z;
    assert!((seen_from_above - 1.1).abs() < 1e-4, "z is up, not down: {seen_from_above}");
}

/// Area, angle, polyline, coordinates against plain formulas on the truth.
#[test]
fn every_query_gives_its_quantity() {
    let scene = by_distances();
    let adjusted = solve(&scene, &scene.constraints).expect("places");
    let x = |p: usize| scene.points[p];
    let polyline = (x(0) - x(1)).norm() + (x(1) - x(7)).norm() + (x(7) - x(8)).norm();
    assert!((measured(&adjusted, &Query::Polyline { points: vec![0, 1, 7, 8] }) - polyline).abs() < 1e-5);
    let angle = (x(1) - x(0)).angle(&(x(7) - x(0)));
    assert!((measured(&adjusted, &Query::Angle { a: 1, vertex: 0, b: 7 }) - angle).abs() < 1e-6);
    // Shoelace formula of the control points' plan.
    let plan = [0, 1, 2, 3].map(x);
    let shoelace: f64 =
        (0..4).map(|i| plan[i].x * plan[(i + 1) % 4].y - plan[(i + 1) % 4].x * plan[i].y).sum::<f64>() / 2.0;
    let area = measured(&adjusted, &Query::Area { points: vec![0, 1, 2, 3] });
    assert!((area - shoelace).abs() < 1e-5, "{area} {shoelace}");
    let along = measured(&adjusted, &Query::Coordinate { point: 1, axis: 0 });
    assert!((along - (x(1) - x(0)).norm()).abs() < 1e-5);
}

/// Coordinates instead of distances, a known plane, one photograph: road points by their rays, a post by its foot.
#[test]
fn one_photograph_of_a_known_plane_suffices() {
    let mut scene = Scene::new(photos()[..1].to_vec());
    scene.planes = vec![Plane::Known { normal_in_world: Vector3::z(), offset_m: 0.0 }];
    scene.image_point_all(&[0, 1, 2, 3, 4, 5, 6, 9, 7], 0.5);
    (0..4).for_each(|p| scene.place(p, 0.0));
    scene.on_plane(&[4, 5, 6], 0.003);
    scene.constraints.push(Constraint::Upright { plane: 0, foot: 4, top: 9, sigma_rad: 0.01 });
    let adjusted = solve(&scene, &scene.constraints).expect("places");
    assert_eq!(adjusted.frame, Frame::Given);
    for p in [4, 5, 6, 9] {
        assert!((adjusted.point(p).expect("placed") - scene.points[p]).norm() < 1e-4, "{p}");
    }
    // The vehicle's corner was seen once and lies on no plane; 8 was never seen.
    let named = |item: Item| adjusted.undetermined.iter().find(|u| u.0 == item).map(|u| u.1.to_string());
    assert!(named(Item::Point(7)).expect("named").contains("seen once"), "{:?}", adjusted.undetermined);
    assert!(named(Item::Point(8)).expect("named").contains("no photograph"), "{:?}", adjusted.undetermined);
    let refused = adjusted.measure(&Query::Distance { a: 4, b: 7 });
    assert!(matches!(refused, Err(Error::Undetermined { what: "point", index: 7, .. })), "{refused:?}");
}

/// Four sides and one diagonal leave a mirrored quadrilateral: the photographs decide.
#[test]
fn a_mirrored_arrangement_is_reported_by_the_photographs() {
    let mut scene = Scene::new(photos());
    scene.image_point_all(&[0, 1, 2, 3, 6], 0.5);
    [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2)].iter().for_each(|(a, b)| scene.distance(*a, *b, 0.01));
    scene.on_plane(&[0, 1, 2, 3, 6], 0.005);
    let adjusted = solve(&scene, &scene.constraints).expect("places");
    all_distances_match(&scene, &adjusted, &[0, 1, 2, 3, 6], 1e-5);
    assert!(
        adjusted.alternative_delta_chi2.is_none_or(|d| 100.0 < d),
        "{:?}",
        adjusted.alternative_delta_chi2
    );
}

/// Control points in space, no plane at all.
#[test]
fn control_points_in_space_need_no_plane() {
    let mut scene = Scene::new(photos());
    scene.planes.clear();
    scene.image_point_all(&[0, 1, 2, 7, 8, 3], 0.5);
    for (a, b) in [(0, 1), (1, 2), (0, 2), (0, 7), (1, 7), (2, 7)] {
        scene.distance(a, b, 0.01);
    }
    let adjusted = solve(&scene, &scene.constraints).expect("places");
    all_distances_match(&scene, &adjusted, &[0, 1, 2, 3, 7, 8], 1e-5);
}

/// Cameras of a rig with their poses; no control point at all.
#[test]
fn given_poses_need_no_control_points() {
    let mut scene = Scene::new(photos());
    scene.planes.clear();
    scene.image_point_all(&[4, 7, 8], 0.5);
    for photo in 0..2 {
        let covariance = (photo == 1).then(|| resight_core::Matrix6::identity() * 1e-6);
        scene.constraints.push(Constraint::Pose { photo, cam_from_world: scene.photos[photo], covariance });
    }
    let adjusted = solve(&scene, &scene.constraints).expect("places");
    assert_eq!(adjusted.frame, Frame::Given);
    for p in [4, 7, 8] {
        assert!((adjusted.point(p).expect("placed") - scene.points[p]).norm() < 1e-6, "{p}");
    }
}

/// A sloping road and a plumb post: gravity in one photograph gives the vertical, not the road's normal.
#[test]
fn gravity_gives_the_vertical() {
    let mut scene = Scene::new(photos());
    let slope = Vector3::new(0.1f64.sin(), 0.0, 0.1f64.cos());
    // The post on 4 leans against the road by the slope.
    scene.points[9] = scene.points[4] + slope * 1.4;
    scene.planes = vec![Plane::Unknown, Plane::Unknown];
    scene.image_point_all(&[0, 1, 2, 3], 0.5);
    [4, 9].iter().for_each(|p| scene.image_point(0, *p, 0.5));
    for (a, b) in [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3)] {
        scene.distance(a, b, 0.01);
    }
    scene.on_plane(&[0, 1, 2, 3, 4], 0.005);
    let down_in_cam = -(scene.photos[0].rotation * slope);
    scene.constraints.push(Constraint::Gravity { plane: 1, photo: 0, down_in_cam, sigma_rad: 0.005 });
    scene.constraints.push(Constraint::Upright { plane: 1, foot: 4, top: 9, sigma_rad: 0.005 });
    let adjusted = solve(&scene, &scene.constraints).expect("places");
    let length = measured(&adjusted, &Query::Distance { a: 4, b: 9 });
    assert!((length - 1.4).abs() < 1e-4, "{length} {:?}", adjusted.undetermined);
}

/// Distances between control points on a known plane: a rotation and a shift in the plane stay free and are held; lengths do not care.
#[test]
fn a_free_turn_is_held() {
    let mut scene = by_distances();
    scene.planes = vec![Plane::Known { normal_in_world: Vector3::z(), offset_m: 0.0 }];
    let adjusted = solve(&scene, &scene.constraints).expect("places");
    assert_eq!(adjusted.frame, Frame::Held);
    all_distances_match(&scene, &adjusted, &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9], 1e-5);
    // Half of everything known about lengths is the same as in the frame of the control points.
    let free = by_distances();
    let other = solve(&free, &free.constraints).expect("places");
    let sigma = |a: &Adjusted| a.measure(&Query::Distance { a: 4, b: 7 }).expect("a value").sigma;
    let (held, control_points) = (sigma(&adjusted), sigma(&other));
    assert!((held / control_points - 1.0).abs() < 1e-6, "{held} {control_points}");
}

/// What an image point more would give is what it gives: a road point clicked once adds nothing to the rest. The plane's flatness for it, 10 µm,
/// is all that differs.
#[test]
fn one_more_image_point_is_foreseen() {
    let mut scene = by_distances();
    scene.intrinsics = Some(crate::common::accident::intrinsics([6.0, 6.0, 4.0, 4.0]));
    scene.constraints.retain(|f| f.points()[0] != Some(5));
    let before = solve(&scene, &scene.constraints).expect("places");
    scene.image_point(1, 5, 0.5);
    scene.on_plane(&[5], 1e-5);
    let after = solve(&scene, &scene.constraints).expect("places");
    let x = after.point(5).expect("placed");
    let predicted = before.image_point_on_plane_covariance_m2(1, 0, &x, 0.5).expect("a covariance");
    let found = after.point_covariance_m2(5).expect("a covariance");
    assert!((predicted - found).norm() < 1e-3 * found.norm(), "{predicted}{found}");
}

/// One wrong image point, one wrong distance: each is named, with the size of its error.
#[test]
fn the_worst_constraint_is_named() {
    let scene = by_distances();
    let mut rng = Rng::new(11);
    for wrong in [3usize, 14, 20, 23] {
        let mut constraints = scene.drawn(&mut rng).constraints;
        let off = match &mut constraints[wrong] {
            Constraint::ImagePoint { pixel, .. } => {
                pixel.x += 60.0;
                60.0
            }
            Constraint::Distance { distance_m, .. } => {
                *distance_m += 0.15;
                0.15
            }
            _ => 0.0,
        };
        match solve(&scene, &constraints) {
            Ok(adjusted) => {
                assert!(
                    adjusted.is_inconsistent,
                    "{wrong}: {} {} {:?} {:?}",
                    adjusted.chi2, adjusted.degrees_of_freedom, adjusted.undetermined, adjusted.suspects
                );
                let worst = adjusted.suspects.first().expect("a suspect");
                // Of two image points of one point either may be the wrong one.
                assert_eq!(
                    constraints[worst.constraint].points(),
                    constraints[wrong].points(),
                    "{:?}",
                    adjusted.suspects
                );
                assert!((worst.off / off - 1.0).abs() < 0.4, "{worst:?}");
            }
            Err(other) => panic!("{wrong}: {other}"),
        }
    }
}

/// A wrong pixel, a wrong distance, a slipped decimal point, two exchanged labels and two exchanged columns are explained alike where forty points
/// that nothing checks are clicked besides, and these have their positions: docs/math/survey.md eq. (28).
#[test]
fn points_that_nothing_checks_explain_nothing() {
    let wrong: [&Fault; 5] = [
        &|constraints| moved_px(&mut constraints[14], 60.0),
        &|constraints| stretched(&mut constraints[23], 1.05),
        &|constraints| stretched(&mut constraints[20], 10.0),
        &|constraints| exchanged_px(constraints, 1, 3),
        &|constraints| {
            for constraint in constraints {
                if let Constraint::ImagePoint { photo: 0, pixel, .. } = constraint {
                    *pixel = Pixel::new(pixel.y, pixel.x);
                }
            }
        },
    ];
    let (few, mut many) = (by_distances(), by_distances());
    for k in 0..40 {
        many.points.push(Point::new(0.1 * k as f64 - 2.0, 0.3 + 0.05 * k as f64, 0.0));
        many.image_point(0, many.points.len() - 1, 0.5);
        many.on_plane(&[many.points.len() - 1], 0.005);
    }
    let n = few.constraints.len();
    for (k, wrong) in wrong.into_iter().enumerate() {
        let mut of_few = few.drawn(&mut Rng::new(11)).constraints;
        let mut of_many = many.drawn(&mut Rng::new(12)).constraints;
        of_many[..n].copy_from_slice(&of_few);
        wrong(&mut of_few);
        wrong(&mut of_many);
        let [a, b] =
            [(&few, of_few), (&many, of_many)].map(|(scene, constraints)| solve(scene, &constraints));
        let (a, b) = (a.expect("few"), b.expect("many"));
        println!("{k}: {:?} {:?} {:?}", a.suspects, a.left_out, a.exchanged);
        assert!(a.is_inconsistent && b.is_inconsistent && (a.suspects.len() + a.exchanged.len()) != 0);
        assert_eq!((&a.left_out, &a.exchanged), (&b.left_out, &b.exchanged), "{k}");
        let of = |found: &Adjusted| found.suspects.iter().map(|s| s.constraint).collect::<Vec<_>>();
        assert_eq!(of(&a), of(&b), "{k}");
        for photo in 0..2 {
            let [here, there] = [&a, &b].map(|found| found.cam_from_world(photo).expect("a pose"));
            assert!((here * there.inverse()).log().norm() < 1e-4, "{k}");
        }
        assert!((10..50).all(|p| b.point(p).is_some()), "{k}: {:?}", b.undetermined);
    }
}

/// What a fault does to the constraints.
type Fault = dyn Fn(&mut [Constraint]);

fn moved_px(constraint: &mut Constraint, by_px: f64) {
    let Constraint::ImagePoint { pixel, .. } = constraint else { panic!("no image point") };
    pixel.x += by_px;
}

fn stretched(constraint: &mut Constraint, times: f64) {
    let Constraint::Distance { distance_m, .. } = constraint else { panic!("no distance") };
    *distance_m *= times;
}

fn exchanged_px(constraints: &mut [Constraint], a: usize, b: usize) {
    let pixel_of = |constraint: &Constraint| match constraint {
        Constraint::ImagePoint { pixel, .. } => *pixel,
        _ => panic!("no image point"),
    };
    let pixels = [b, a].map(|i| pixel_of(&constraints[i]));
    for (i, new) in [a, b].into_iter().zip(pixels) {
        if let Constraint::ImagePoint { pixel, .. } = &mut constraints[i] {
            *pixel = new;
        }
    }
}

/// Before any photograph: a triangle and a fourth control point whose distances cannot all be true.
#[test]
fn contradictory_distances_are_named_without_photographs() {
    let mut scene = Scene::new(Vec::new());
    for (a, b) in [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3), (4, 0), (4, 1), (4, 2), (4, 3)] {
        scene.distance(a, b, 0.01);
    }
    scene.on_plane(&[0, 1, 2, 3, 4], 0.005);
    if let Constraint::Distance { distance_m, .. } = &mut scene.constraints[6] {
        *distance_m += 0.3;
    }
    let refused = solve(&scene, &scene.constraints);
    assert!(
        matches!(refused, Err(Error::InconsistentDistances { constraint: 6, off_m, .. }) if (off_m - 0.3).abs() < 0.1),
        "{refused:?}"
    );
}

#[test]
fn no_length_and_no_triangle_are_named() {
    let mut scene = Scene::new(photos());
    scene.image_point_all(&[0, 1, 2, 3, 4], 0.5);
    assert!(matches!(solve(&scene, &scene.constraints), Err(Error::NoLength)));
    scene.distance(0, 1, 0.01);
    let refused = solve(&scene, &scene.constraints).expect_err("one length makes no triangle");
    assert!(refused.to_string().contains("no three points"), "{refused}");
}

/// Photographs from one place show no parallax: the vehicle's points have no place, the road's have.
#[test]
fn points_without_parallax_are_undetermined() {
    let middle = Point::new(3.2, 3.2, 0.3);
    let centre = Point::new(-2.5, -6.0, 1.7);
    let eyes = [looking_at(centre, middle), looking_at(centre + Vector3::new(0.001, 0.0, 0.0), middle)];
    let mut scene = Scene::new(eyes.to_vec());
    scene.image_point_all(&[0, 1, 2, 3, 4, 7], 0.5);
    [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3)].iter().for_each(|(a, b)| scene.distance(*a, *b, 0.01));
    scene.on_plane(&[0, 1, 2, 3, 4], 0.005);
    let adjusted = solve(&scene, &scene.constraints).expect("places");
    assert!(adjusted.point(4).is_some(), "{:?}", adjusted.undetermined);
    assert!(adjusted.point(7).is_none(), "{:?}", adjusted.point_covariance_m2(7));
    assert!(adjusted.undetermined.iter().any(|u| u.0 == Item::Point(7)), "{:?}", adjusted.undetermined);
}

/// Constraints that cannot be right are refused with their number.
#[test]
fn impossible_constraints_are_refused() {
    let scene = by_distances();
    let damages: [fn(&mut Vec<Constraint>); 5] = [
        |f| {
            f[0] = Constraint::ImagePoint {
                photo: 9,
                point: 0,
                pixel: Default::default(),
                covariance_px2: resight_core::multiview::triangulate::isotropic(1.0),
            }
        },
        |f| {
            f[0] = Constraint::ImagePoint {
                photo: 0,
                point: 99,
                pixel: Default::default(),
                covariance_px2: resight_core::multiview::triangulate::isotropic(1.0),
            }
        },
        |f| f[0] = Constraint::Distance { a: 0, b: 1, distance_m: f64::NAN, sigma_m: 0.1 },
        |f| f[0] = Constraint::Distance { a: 0, b: 0, distance_m: 1.0, sigma_m: 0.1 },
        |f| f[0] = Constraint::OnPlane { plane: 0, point: 1, sigma_m: 0.0 },
    ];
    for damage in damages {
        let mut constraints = scene.constraints.clone();
        damage(&mut constraints);
        let refused = solve(&scene, &constraints);
        assert!(matches!(refused, Err(Error::InvalidConstraint { constraint: 0, .. })), "{refused:?}");
    }
    let empty =
        NetworkProblem { cameras: &[], camera_of_photo: &[], n_points: 0, planes: &[], constraints: &[] };
    assert!(matches!(adjust(&empty), Err(Error::NoLength)));
}
