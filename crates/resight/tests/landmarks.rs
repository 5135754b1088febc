//! Landmarks: the turn since a reference picture against truth, and how sure it is.

mod landmarks_support;

use landmarks_support::{camera, exposed, picture, turned};
use nalgebra::Matrix3;
use resight::landmarks::Landmarks;
use resight::render::Pcg;

#[test]
fn experiment() {
    let camera = camera(1280, 960, 1100.0);
    let mut chance = Pcg::new(1);
    let truth = picture(&camera, &Matrix3::identity(), 7);
    let reference = exposed(&camera, &truth, 1.0, 2.0, &mut chance);
    let t = std::time::Instant::now();
    let landmarks = Landmarks::new(&reference, &camera).expect("landmarks");
    println!("{} landmarks, {:?}", landmarks.count(), t.elapsed());
    for degrees in [[0.0; 3], [0.02, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.5], [1.0, 2.0, 1.0], [0.0, 5.0, 0.0], [0.0, 0.0, 5.0], [3.0, -5.0, 8.0]] {
        let now_from_reference = turned(degrees);
        let seen = picture(&camera, &now_from_reference, 7);
        let image = exposed(&camera, &seen, 0.8, 2.0, &mut chance);
        for near in [None, Some(now_from_reference)] {
            let t = std::time::Instant::now();
            match landmarks.sight(&image, near.as_ref()) {
                Ok(s) => {
                    let t = t.elapsed();
                    let (v, c) = s.turn.old_from_new();
                    let err = (v.map(f64::to_degrees) - nalgebra::Vector3::from(degrees)).as_slice().to_vec();
                    let sig = c.diagonal().map(|x| x.sqrt().to_degrees());
                    println!("{degrees:?} err {err:.5?} sig {:.5?} used {}/{}/{} s2 {:.2} k2 {:.2} rms {:.3} {t:?}", sig.as_slice(), s.turn.used.len(), s.found.len(), s.in_view, s.turn.noise_factor, s.turn.coherence, s.turn.rms_px);
                }
                Err(e) => println!("{degrees:?} {e}"),
            }
        }
    }
}
