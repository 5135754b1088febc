#[path = "../tests/common/mod.rs"]
mod common;
use common::Rng;
use nalgebra::{Vector2, Vector3};
use resight_core::{Camera, Correspondence, Point, Pose, solve::{planar::planar, sqpnp::sqpnp}};
fn scene(r: &mut Rng, layout: &str, n: usize, near: bool, sigma: f64) -> Option<(Vec<Correspondence>, Pose)> {
    let camera = Camera::normalized();
    let mut x: Vec<Point> = match layout {
        "general" => (0..n).map(|_| Point::new(r.uniform(-0.5, 0.5), r.uniform(-0.5, 0.5), r.uniform(-0.5, 0.5))).collect(),
        "square" => vec![Point::new(-0.5, 0.5, 0.0), Point::new(0.5, 0.5, 0.0), Point::new(0.5, -0.5, 0.0), Point::new(-0.5, -0.5, 0.0)],
        "planar" => (0..n).map(|_| Point::new(r.uniform(-0.5, 0.5), r.uniform(-0.5, 0.5), 0.0)).collect(),
        "wang" => vec![Point::new(-0.5, 0.0, 0.0), Point::new(0.0, 0.0, 0.0), Point::new(0.5, 0.0, 0.0), Point::new(-0.4, 0.6, 0.0)],
        "thin" => (0..n).map(|_| Point::new(r.uniform(-0.5, 0.5), r.uniform(-0.02, 0.02), r.uniform(-0.02, 0.02))).collect(),
        _ => panic!(),
    };
    let rot = r.rotation();
    let z = if near { r.uniform(1.5, 3.0) } else { r.uniform(5.0, 20.0) };
    let t = Vector3::new(r.uniform(-0.4, 0.4) * z, r.uniform(-0.3, 0.3) * z, z);
    if layout != "general" && layout != "thin" { let nrm = rot.column(2); if nrm.dot(&t).abs() / t.norm() < 0.25 { return None; } }
    let q = r.rotation(); let o = Vector3::new(r.normal(), r.normal(), r.normal());
    for p in &mut x { *p = q * *p + o; }
    let pose = Pose::new(rot, t) * Pose::new(q, o).inverse();
    let mut out = vec![];
    for p in &x { let px = camera.project(&(pose * *p))?; out.push(Correspondence::new(&camera, *p, px + Vector2::new(r.normal(), r.normal()) * (sigma / 1000.0), 1.0).ok()?); }
    Some((out, pose))
}
fn main() {
    for (layout, n) in [("general", 3), ("general", 4), ("general", 5), ("general", 6), ("general", 10), ("general", 100), ("general", 1000), ("square", 4), ("wang", 4), ("planar", 5), ("planar", 10), ("planar", 100), ("thin", 6)] {
        for (near, sigma) in [(false, 0.0), (true, 0.0), (false, 0.5)] {
            let trials = if n >= 100 { 2000 } else { 20000 };
            let mut r = Rng::new(3);
            let (mut total, mut miss, mut miss_best, mut nsol, mut pmiss, mut pempty, mut worst, mut pworst) = (0, 0, 0, 0, 0, 0, 0.0f64, 0.0f64);
            let mut kept = vec![];
            while total < trials {
                let Some((c, truth)) = scene(&mut r, layout, n, near, sigma) else { continue };
                total += 1;
                let err = |p: &Pose| (p.rotation - truth.rotation).norm();
                let limit = if sigma == 0.0 { 1e-3 } else { 0.5 };
                let s = sqpnp(&c);
                nsol += s.len();
                let best = s.iter().map(err).fold(f64::INFINITY, f64::min);
                if !(best < limit) { miss += 1; } else { worst = worst.max(best); }
                if s.is_empty() || !(err(&s[0]) < limit) { miss_best += 1; }
                if layout != "general" && layout != "thin" {
                    let s = planar(&c);
                    let best = s.iter().map(err).fold(f64::INFINITY, f64::min);
                    if !(best < limit) { pmiss += 1; } else { pworst = pworst.max(best); }
                    if s.is_empty() { pempty += 1; }
                }
                if kept.len() < 200 { kept.push(c); }
            }
            let time = |f: &dyn Fn(&[Correspondence]) -> usize| { let mut b = f64::INFINITY; for _ in 0..8 { let t = std::time::Instant::now(); for c in &kept { std::hint::black_box(f(c)); } b = b.min(t.elapsed().as_nanos() as f64 / kept.len() as f64); } b };
            let ts = time(&|c| sqpnp(c).len()); let tp = time(&|c| planar(c).len());
            println!("{layout:8} n {n:4} near {near:5} sigma {sigma} sqpnp: miss {miss} notfirst {miss_best} sols {:.2} worst {worst:.1e} {:.2} us | planar miss {pmiss} empty {pempty} worst {pworst:.1e} {:.2} us", nsol as f64 / total as f64, ts / 1e3, tp / 1e3);
        }
    }
}
