//! The gate between one pose and two, on the random views of the bar: line-plus-one, 2–4 m away, tilted less than 73°, 0.3 px.
//!
//! Leaves out views outside that box; `weak_views.rs` has the planes and lines where it fails most.

use crate::common::Rng;
use nalgebra::{Matrix3, Vector2, Vector3};
use resight_core::camera::Pinhole;
use resight_core::locate::choose::Ambiguity;
use resight_core::locate::{Config, locate};
use resight_core::{Camera, CameraMatrix, Correspondence, Error, Lens, Point, Pose};

const N: usize = 40_000;
const SIGMA_PX: f64 = 0.3;
const LARGEST_TILT_RAD: f64 = 73.0 * std::f64::consts::PI / 180.0;
/// Another minimum, not noise: as in the tables of docs/math/line_plus_one.md.
const GROSS_RAD: f64 = 0.2;

/// The line 1 m long, D's foot at 0.4 and 0.6 m off: its critical plane crosses the views.
const ONE_METRE: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [1.0, 0.0, 0.0], [0.4, 0.6, 0.0]];
/// The layout of the bars of accuracy: 2 m long, D over an end.
const TWO_METRES: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// The target's middle within the image, its normal less than 73° from the line of sight, either face. Directions are uniform on the
/// sphere, or their angles are, which gives more frontal views.
fn view(rng: &mut Rng, uniform_on_sphere: bool) -> Pose {
    let sight = Vector3::new(rng.uniform(-0.5, 0.5), rng.uniform(-0.4, 0.4), 1.0).normalize();
    let tilt = match uniform_on_sphere {
        true => rng.uniform(LARGEST_TILT_RAD.cos(), 1.0).acos(),
        false => rng.uniform(0.0, LARGEST_TILT_RAD),
    };
    let across = rng.unit_vector().cross(&sight).normalize();
    let face = if rng.index(2) == 0 { 1.0 } else { -1.0 };
    let normal = (sight * tilt.cos() + across * tilt.sin()) * face;
    let x = rng.unit_vector().cross(&normal).normalize();
    let rotation = Matrix3::from_columns(&[x, normal.cross(&x), normal]);
    Pose::new(rotation, sight * rng.uniform(2.0, 4.0) - rotation * Vector3::new(0.5, 0.25, 0.0))
}

#[derive(Debug, Default)]
struct Count {
    unique: usize,
    unique_and_wrong: usize,
    ambiguous: usize,
    neither_right: usize,
    refused: usize,
}

fn count(seed: u64, layout: [[f64; 3]; 4], uniform_on_sphere: bool) -> Count {
    let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 639.5, cy_px: 479.5 };
    let camera = Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None };
    let (mut rng, mut count) = (Rng::new(seed), Count::default());
    for _ in 0..N {
        let truth = view(&mut rng, uniform_on_sphere);
        let seen = layout.map(Point::from).map(|x| {
            let pixel = camera.project(&(truth * x)).expect("in front");
            let pixel = pixel + Vector2::new(rng.normal(), rng.normal()) * SIGMA_PX;
            Correspondence::new(&camera, x, pixel, SIGMA_PX).expect("in the field")
        });
        let e = match locate(&seen, &camera, &Config::default()) {
            Ok(e) => e,
            // Known to a radian only: refused by name.
            Err(Error::DegenerateView { .. }) => {
                count.refused += 1;
                continue;
            }
            Err(other) => panic!("{other}"),
        };
        let wrong = |pose: &Pose| GROSS_RAD < pose.angle_to_rad(&truth);
        match &e.ambiguity {
            Ambiguity::Unique { .. } => {
                count.unique += 1;
                // Wrong against what it claims: a wide covariance is an honest answer.
                let sigma = e.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt();
                let beyond = 5.0 * sigma < e.cam_from_target.angle_to_rad(&truth);
                count.unique_and_wrong += usize::from(wrong(&e.cam_from_target) && beyond);
            }
            Ambiguity::Ambiguous { .. } => {
                count.ambiguous += 1;
                let all_wrong =
                    e.minima().filter(|h| h.is_alternative).all(|h| wrong(&h.minimum.cam_from_target));
                count.neither_right += usize::from(all_wrong);
            }
        }
    }
    println!("D at {:?}, uniform on the sphere: {uniform_on_sphere}, {N} views: {count:?}", layout[3]);
    assert!(count.refused <= N / 2000, "{} refused", count.refused);
    count
}

/// The share of unique answers and of those that are wrong, against the bar: 97 % and 0.05 %.
fn meets_the_bar(seed: u64, layout: [[f64; 3]; 4]) {
    let c = count(seed, layout, true);
    assert!(0.97 * N as f64 <= c.unique as f64, "{} unique", c.unique);
    assert!(c.unique_and_wrong as f64 <= 5e-4 * c.unique as f64, "{} wrong", c.unique_and_wrong);
}

#[test]
fn a_gate_of_nine_keeps_97_percent_and_passes_one_in_two_thousand_wrong() {
    meets_the_bar(71, ONE_METRE);
    meets_the_bar(72, TWO_METRES);
}

/// One in 280,000 such views once had no answer: two minima about to part made Gauss–Newton leap from side to side.
#[test]
fn more_frontal_views_all_have_an_answer_and_a_true_verdict() {
    let over_the_end = [ONE_METRE[0], ONE_METRE[1], ONE_METRE[2], [0.0, 0.6, 0.0]];
    let c = count(71, over_the_end, false);
    assert!(c.unique_and_wrong as f64 <= 5e-4 * c.unique as f64, "{} wrong", c.unique_and_wrong);
}
