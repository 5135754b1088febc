#[path = "../tests/common/mod.rs"]
mod common;
use common::Rng;
use nalgebra::{Unit, Vector3};
use resight_core::{Bearing, Point, Pose, solve::p3p::p3p};
type Problem = ([Bearing; 3], [Point; 3], Pose);
fn generic(r: &mut Rng) -> Problem {
    let pose = Pose::new(r.rotation(), Vector3::new(r.normal(), r.normal(), r.normal()));
    let lim = (37.5f64).to_radians().tan();
    let mut b = [Unit::new_unchecked(Vector3::z()); 3]; let mut x = [Point::zeros(); 3];
    for i in 0..3 {
        b[i] = Unit::new_normalize(Vector3::new(r.uniform(-lim, lim), r.uniform(-lim, lim), 1.0));
        let d = r.uniform(0.1, 10.0);
        x[i] = pose.inverse() * (b[i].into_inner() * d);
    }
    (b, x, pose)
}
fn see(x: [Point; 3], pose: Pose) -> Problem {
    (x.map(|x| Unit::new_normalize(pose * x)), x, pose)
}
fn cube(r: &mut Rng) -> Problem {
    let x = [0; 3].map(|_| Point::new(r.uniform(-0.5, 0.5), r.uniform(-0.5, 0.5), r.uniform(-0.5, 0.5)));
    let rot = r.rotation();
    let z = r.uniform(5.0, 20.0);
    let t = Vector3::new(r.uniform(-0.4, 0.4) * z, r.uniform(-0.3, 0.3) * z, z);
    see(x, Pose::new(rot, t))
}
fn thin(r: &mut Rng) -> Problem {
    let a = Point::new(r.uniform(-0.5, 0.5), r.uniform(-0.5, 0.5), r.uniform(-0.5, 0.5));
    let e = r.unit_vector();
    let m = e.cross(&r.unit_vector()).normalize();
    let h = 10f64.powf(r.uniform(-6.0, -1.0));
    let s = r.uniform(0.1, 0.9);
    let x = [a, a + e, a + e * s + m * h];
    let rot = r.rotation();
    let z = r.uniform(5.0, 20.0);
    let t = Vector3::new(r.uniform(-0.4, 0.4) * z, r.uniform(-0.3, 0.3) * z, z);
    let mut p = [0, 1, 2]; for i in (1..3).rev() { p.swap(i, r.index(i + 1)); }
    see([x[p[0]], x[p[1]], x[p[2]]], Pose::new(rot, t))
}
fn cylinder(r: &mut Rng) -> Problem {
    // triangle on the unit circle, camera on the cylinder
    loop {
        let ang = [0; 3].map(|_| r.uniform(0.0, std::f64::consts::TAU));
        let x = ang.map(|a| Point::new(a.cos(), a.sin(), 0.0));
        let ca = r.uniform(0.0, std::f64::consts::TAU);
        let origin = Point::new(ca.cos(), ca.sin(), r.uniform(0.3, 5.0));
        let rot = r.rotation();
        return see(x, Pose::new(rot, -(rot * origin)));
    }
}
fn right_angle(r: &mut Rng) -> Problem {
    let z = r.uniform(1.0, 10.0);
    let (w, h) = (r.uniform(0.1, 2.0), r.uniform(0.1, 2.0));
    let (x, y) = (r.uniform(-2.0, 2.0).round() * 0.5, r.uniform(-2.0, 2.0).round() * 0.5);
    let x = [Point::new(x, y, 0.0), Point::new(x + w, y, 0.0), Point::new(x, y + h, 0.0)];
    see(x, Pose::new(nalgebra::Matrix3::identity(), Vector3::new(0.0, 0.0, z)))
}
fn main() {
    for (name, f) in [("generic", generic as fn(&mut Rng) -> Problem), ("cube", cube), ("thin", thin), ("cylinder", cylinder), ("right", right_angle)] {
        let n: usize = std::env::args().nth(1).map_or(200_000, |a| a.parse().unwrap());
        let mut r = Rng::new(7);
        let problems: Vec<Problem> = (0..n).map(|_| f(&mut r)).collect();
        let (mut miss6, mut miss3, mut miss_rep, mut bad, mut dup, mut none, mut nsol, mut worst) = (0, 0, 0, 0, 0, 0, 0, 0.0f64);
        let (mut worst_rep, mut worst_ortho) = (0.0f64, 0.0f64);
        let mut shown = 0;
        for (b, x, truth) in &problems {
            let sols = p3p(b, x);
            nsol += sols.len();
            none += (sols.is_empty()) as usize;
            let err = |p: &Pose| (p.rotation - truth.rotation).norm() + (p.translation - truth.translation).norm() / truth.translation.norm();
            let best = sols.iter().map(err).fold(f64::INFINITY, f64::min);
            let rep = |p: &Pose| (0..3).map(|i| { let d = p * &x[i]; (d.normalize() - b[i].into_inner()).norm() }).fold(0.0, f64::max);
            let best_rep = sols.iter().map(rep).fold(f64::INFINITY, f64::min);
            if !(best < 1e-6) { miss6 += 1; if shown < 3 && name != "cylinder" { shown += 1; println!("   miss {name}: best {best:.2e} rep {best_rep:.1e} n {}", sols.len());
              if std::env::var("V").is_ok() { for p in &sols { println!("      err {:.3e} rep {:.1e} depths {:?}", err(p), rep(p), x.map(|x| (p * &x).norm())); } println!("      truth depths {:?} rep {:.1e} b {:?}\n x {:?}", x.map(|x| (truth * &x).norm()), rep(truth), b.map(|b| [b.x,b.y,b.z]), x.map(|b| [b.x,b.y,b.z]));
              let j = nalgebra::Matrix6::from_fn(|i, k| { let (pt, ax) = (i / 2, i % 2); let y = truth * &x[pt]; let mut xi = nalgebra::Vector6::zeros(); xi[k] = 1.0; let w: Vector3<f64> = xi.fixed_rows::<3>(0).into(); let v: Vector3<f64> = xi.fixed_rows::<3>(3).into(); let d = w.cross(&y) + v; let bb = y.normalize(); let e1 = bb.cross(&Vector3::new(0.3,0.5,0.8)).normalize(); let e2 = bb.cross(&e1); [e1, e2][ax].dot(&d) / y.norm() });
              println!("      sing {:?}", j.singular_values().as_slice()); }
            } }
            if !(best < 1e-3) { miss3 += 1; }
            if !(best_rep < 1e-9) { miss_rep += 1; }
            worst = worst.max(best);
            for (i, p) in sols.iter().enumerate() {
                let e = rep(p);
                worst_rep = worst_rep.max(e);
                worst_ortho = worst_ortho.max((p.rotation.transpose() * p.rotation - nalgebra::Matrix3::identity()).norm());
                if !(e < 1e-6) { bad += 1; if bad < 3 { println!("bad {e:.1e} err {:.1e} {:?} {:?} depths {:?}", err(p), b.map(|b| [b.x, b.y, b.z]), x.map(|b| [b.x, b.y, b.z]), x.map(|x| (p * &x).norm())); } }
                for q in &sols[..i] { if (p.rotation - q.rotation).norm() < 1e-8 { dup += 1; } }
            }
        }
        let mut best_ns = f64::INFINITY;
        for _ in 0..15 {
            let t = std::time::Instant::now();
            let mut c = 0;
            for (b, x, _) in &problems[..n.min(20_000)] { c += std::hint::black_box(p3p(b, x)).len(); }
            std::hint::black_box(c);
            best_ns = best_ns.min(t.elapsed().as_nanos() as f64 / n.min(20_000) as f64);
        }
        println!("{name:9} n {n} miss6 {miss6} miss3 {miss3} missrep9 {miss_rep} none {none} bad {bad} dup {dup} sols {:.3} worst {worst:.1e} worst_rep {worst_rep:.1e} ortho {worst_ortho:.1e}  {best_ns:.0} ns", nsol as f64 / n as f64);
    }
}
