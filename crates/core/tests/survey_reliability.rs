//! The smallest error that a network states it would notice is noticed, and what nothing checks is listed.

use crate::common::Rng;
use crate::common::accident::{Scene, intrinsics, photos};
use resight_core::multiview::network::{Adjusted, Constraint, ErrorSource, NetworkStatus, Query, adjust};

const DRAWS: usize = 300;
const ROAD: [usize; 7] = [0, 1, 2, 3, 4, 5, 6];

/// Control points 0–3 with all their distances but one, every point on the road clicked in each photograph.
fn scene(n_photos: usize) -> Scene {
    let mut scene = Scene::new(photos()[..n_photos].to_vec());
    scene.intrinsics = Some(intrinsics([4.0, 4.0, 3.0, 3.0]));
    for [a, b] in [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]] {
        scene.distance(a, b, 0.01);
    }
    scene.on_plane(&ROAD, 0.005);
    scene.image_point_all(&ROAD, 1.0);
    scene
}

fn adjusted(scene: &Scene, constraints: &[Constraint]) -> Adjusted {
    adjust(&scene.network(&scene.cameras(), constraints)).expect("a network")
}

/// Control points known to 2 cm and a tape across: few explanations of a contradiction are tried, so that hundreds of scenes can be drawn.
#[test]
fn the_smallest_error_is_noticed_in_four_of_five() {
    let (mut scene, mut rng) = (Scene::new(photos()), Rng::new(77));
    scene.distance(0, 2, 0.01);
    (0..4).for_each(|point| scene.place(point, 0.02));
    scene.image_point_all(&ROAD[..4], 1.0);
    let tape = ErrorSource::Constraint(0);
    let exact = adjusted(&scene, &scene.constraints);
    let smallest = exact.reliability().smallest_noticed_error(tape).expect("checked");
    let mut noticed = [0usize; 2];
    for _ in 0..DRAWS {
        for (size, count) in [smallest, 0.0].into_iter().zip(&mut noticed) {
            let mut constraints = scene.drawn(&mut rng).constraints;
            if let Constraint::Distance { distance_m, .. } = &mut constraints[0] {
                *distance_m += size;
            }
            *count += usize::from(adjusted(&scene, &constraints).status() != NetworkStatus::Ok);
        }
    }
    println!(
        "a tape wrong by {smallest:.3} m: noticed in {} of {DRAWS}; right: in {}",
        noticed[0], noticed[1]
    );
    assert!((0.70..0.92).contains(&(noticed[0] as f64 / DRAWS as f64)), "{noticed:?}");
    assert!(noticed[1] <= 3, "{noticed:?}");
}

/// In one photograph a road point has as many rows as unknowns; a second photograph checks it.
#[test]
fn a_road_point_of_one_photograph_is_checked_by_nothing() {
    let query = Query::Distance { a: 4, b: 5 };
    let one = scene(1);
    let alone = adjusted(&one, &one.constraints).reliability().of_query(&query).expect("an answer");
    assert_eq!(alone.largest_unnoticed_error, None);
    let is_click_or_plane = |source: &ErrorSource| match source {
        ErrorSource::Constraint(i) => {
            one.constraints[*i].points().iter().flatten().all(|p| [4, 5].contains(p))
        }
        ErrorSource::Focal(_) => false,
    };
    assert!(!alone.unchecked.is_empty() && alone.unchecked.iter().all(is_click_or_plane), "{alone:?}");
    let two = scene(2);
    let checked = adjusted(&two, &two.constraints).reliability().of_query(&query).expect("an answer");
    assert!(
        checked.unchecked.is_empty() && checked.largest_unnoticed_error.is_some_and(|e| e < 1.0),
        "{checked:?}"
    );
}

/// What an error of the smallest noticed size does to an answer by eq. (31) is what it does to exact measurements.
#[test]
fn an_unnoticed_error_moves_an_answer_as_predicted() {
    let scene = scene(2);
    let query = Query::Distance { a: 4, b: 5 };
    let exact = adjusted(&scene, &scene.constraints);
    let reliability = exact.reliability().of_query(&query).expect("an answer");
    let (largest, value) = (
        reliability.largest_unnoticed_error.expect("checked"),
        exact.measure(&query).expect("a value").value,
    );
    let mut worst = 0f64;
    for (i, constraint) in scene.constraints.iter().enumerate() {
        let Some(smallest) = exact.reliability().smallest_noticed_error(ErrorSource::Constraint(i)) else {
            continue;
        };
        let mut constraints = scene.constraints.clone();
        match (&mut constraints[i], constraint) {
            (Constraint::Distance { distance_m, .. }, _) => *distance_m += 0.1 * smallest,
            (Constraint::ImagePoint { pixel, .. }, _) => pixel.x += 0.1 * smallest,
            _ => continue,
        }
        let moved = adjusted(&scene, &constraints).measure(&query).expect("a value").value - value;
        worst = worst.max(10.0 * moved.abs());
    }
    assert!(0.2 * largest < worst && worst < 1.1 * largest, "{worst} of {largest}");
}
