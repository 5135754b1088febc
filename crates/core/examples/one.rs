#[path = "../tests/common/mod.rs"]
mod common;
use common::Rng;
use nalgebra::Vector3;
use resight_core::camera::Pinhole;
use resight_core::locate::*;
use resight_core::*;
fn main() {
    let which = std::env::args().nth(1).unwrap();
    let reps: usize = std::env::args().nth(2).unwrap().parse().unwrap();
    let camera = Camera {
        lens: Lens::Pinhole(Pinhole {
            matrix: CameraMatrix { fx_px: 1000., fy_px: 1000., cx_px: 640., cy_px: 480. },
        }),
        size: None,
    };
    let mut rng = Rng::new(6);
    let pts = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mut ps: Vec<(Pose, Vec<Correspondence>)> = vec![];
    while ps.len() < 1000 {
        let z = rng.uniform(2., 6.);
        let c = Vector3::new(rng.uniform(-0.5, 0.5) * z, rng.uniform(-0.4, 0.4) * z, z);
        let r = rng.rotation();
        let p = Pose::new(r, c - r * Vector3::new(0.75, 0.25, 0.));
        let s: Option<Vec<_>> = pts
            .iter()
            .map(|x| {
                let q = camera.project(&(p * Point::from(*x)))?
                    + nalgebra::Vector2::new(rng.normal(), rng.normal()) * 0.3;
                Correspondence::new(&camera, Point::from(*x), q, 0.3).ok()
            })
            .collect();
        if let Some(s) = s {
            ps.push((p, s));
        }
    }
    let t = std::time::Instant::now();
    let mut n = 0usize;
    let cfg = Config::default();
    for _ in 0..reps {
        for (p, s) in &ps {
            match which.as_str() {
                "locate" => n += locate(s, &camera, &cfg).is_ok() as usize,
                "classify" => n += solve::configuration::classify(s).is_ok() as usize,
                "refine" => n += refine::refine(p, s, &camera).is_ok() as usize,
                "closed" => {
                    let b = [0, 1, 2, 3].map(|i| s[i].bearing);
                    let x = [0, 1, 2, 3].map(|i| s[i].x_in_target);
                    n += solve::line_plus_one::line_plus_one(&b, &x).len()
                }
                "wang" => {
                    let b = [0, 1, 2, 3].map(|i| s[i].bearing);
                    let x = [0, 1, 2, 3].map(|i| s[i].x_in_target);
                    n += solve::wang2004::wang2004(&b, &x).is_ok() as usize
                }
                _ => {}
            }
        }
    }
    eprintln!("{which} {n} {:.1} ns", t.elapsed().as_nanos() as f64 / (reps as f64 * 1000.0));
}
