//! Faults × scenes × stated sigmas of the clicks from 0.2 to 2 px: an answer beyond three standard deviations, which the fault moved, is not
//! called right unless the answer states that nothing checks what was wrong, or that an error of this size would not be noticed; and scenes
//! without a fault are right. One to three simulated photographs, most with one; a ninth of the scenes by default, all with RESIGHT_RUNS=1.

use crate::common::Rng;
use crate::common::surveys::{Drawn, Known, ring};
use nalgebra::Vector3;
use resight_core::camera::Pinhole;
use resight_core::multiview::network::{
    Adjusted, Constraint, ErrorSource, NetworkCamera, NetworkStatus, adjust,
};
use resight_core::multiview::triangulate::isotropic;
use resight_core::{Camera, CameraMatrix, Error, Lens, Point};

/// True standard deviation of a click.
const TRUE_PX: f64 = 0.5;

/// A scene with a click of TRUE_PX, stated as `sigma_px`.
struct Case {
    scene: Drawn,
    camera: Camera,
    covariance: Option<Vec<f64>>,
}

/// Photographs, control points, what is known of them.
const LAYOUTS: [(usize, usize, Known); 6] = [
    (1, 4, Known::Tapes(6)),
    (1, 6, Known::Tapes(10)),
    (2, 4, Known::Tapes(6)),
    (1, 5, Known::Coordinates),
    (3, 4, Known::Tapes(5)),
    (1, 7, Known::Tapes(15)),
];

fn drawn(seed: u64, layout: usize) -> Drawn {
    let (n_photos, n_control_points, known) = &LAYOUTS[layout];
    let mut scene =
        Drawn::new(&mut Rng::new(seed), *n_photos, known, 5.0, |rng| ring(rng, *n_control_points));
    // Drawn with one pixel.
    for i in 0..scene.constraints.len() {
        let Constraint::ImagePoint { photo, point, pixel, .. } = scene.constraints[i] else { continue };
        let seen = scene.camera.project(&(scene.photos[photo] * scene.points[point])).expect("in front");
        let moved = seen + (pixel - seen) * TRUE_PX;
        if let Constraint::ImagePoint { pixel, .. } = &mut scene.constraints[i] {
            *pixel = moved;
        }
    }
    scene
}

impl Case {
    fn new(seed: u64, layout: usize) -> Self {
        let scene = drawn(seed, layout);
        let camera = scene.camera.clone();
        // Every other camera states 0.3 % and 0.2 % of its focal length.
        let covariance =
            seed.is_multiple_of(2).then(|| crate::common::accident::intrinsics([4.5, 4.5, 3.0, 3.0]));
        Case { scene, camera, covariance }
    }

    fn solved(&self, sigma_px: f64) -> Result<Adjusted, Error> {
        let mut constraints = self.scene.constraints.clone();
        for constraint in &mut constraints {
            if let Constraint::ImagePoint { covariance_px2, .. } = constraint {
                *covariance_px2 = isotropic(sigma_px);
            }
        }
        let cameras =
            [NetworkCamera { camera: &self.camera, intrinsics_covariance: self.covariance.as_deref() }];
        adjust(&resight_core::multiview::network::NetworkProblem {
            constraints: &constraints,
            ..self.scene.network(&cameras)
        })
    }

    /// Index of the click of a point in a photograph.
    fn click(&self, photo: usize, point: usize) -> usize {
        let is_it = |c: &Constraint| matches!(c, Constraint::ImagePoint { photo: p, point: x, .. } if (*p, *x) == (photo, point));
        self.scene.constraints.iter().position(is_it).expect("a click")
    }

    /// Moves the clicks of a point as if it were elsewhere.
    fn seen_at(&mut self, point: usize, x: Point) {
        for photo in 0..self.scene.photos.len() {
            let at = self.click(photo, point);
            let project =
                |x: Point| self.scene.camera.project(&(self.scene.photos[photo] * x)).expect("in front");
            let by = project(x) - project(self.scene.points[point]);
            if let Constraint::ImagePoint { pixel, .. } = &mut self.scene.constraints[at] {
                *pixel += by;
            }
        }
        self.scene.points[point] = x;
    }

    fn move_click(&mut self, photo: usize, point: usize, by: [f64; 2]) -> Vec<ErrorSource> {
        let at = self.click(photo, point);
        if let Constraint::ImagePoint { pixel, .. } = &mut self.scene.constraints[at] {
            *pixel += nalgebra::Vector2::from(by);
        }
        vec![ErrorSource::Constraint(at)]
    }

    fn tape(&mut self, k: usize, change: impl Fn(f64) -> f64) -> Vec<ErrorSource> {
        let tapes = self.scene.tapes();
        let at = tapes[k % tapes.len()];
        if let Constraint::Distance { distance_m, .. } = &mut self.scene.constraints[at] {
            *distance_m = change(*distance_m);
        }
        vec![ErrorSource::Constraint(at)]
    }

    fn set_lens(&mut self, focal: f64, centre: [f64; 2]) -> Vec<ErrorSource> {
        let matrix = self.camera.matrix().expect("a matrix");
        let matrix = CameraMatrix {
            fx_px: matrix.fx_px * focal,
            fy_px: matrix.fy_px * focal,
            cx_px: matrix.cx_px + centre[0],
            cy_px: matrix.cy_px + centre[1],
        };
        self.camera = Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None };
        vec![ErrorSource::Focal(0)]
    }

    fn exchange_clicks(&mut self, a: usize, b: usize) -> Vec<ErrorSource> {
        let (a, b) = (self.click(0, a), self.click(0, b));
        let pixel_of = |c: &Constraint| match c {
            Constraint::ImagePoint { pixel, .. } => *pixel,
            _ => unreachable!("a click"),
        };
        let [of_a, of_b] = [a, b].map(|i| pixel_of(&self.scene.constraints[i]));
        for (i, new) in [(a, of_b), (b, of_a)] {
            if let Constraint::ImagePoint { pixel, .. } = &mut self.scene.constraints[i] {
                *pixel = new;
            }
        }
        vec![ErrorSource::Constraint(a), ErrorSource::Constraint(b)]
    }

    fn on_plane(&self, point: usize) -> Vec<ErrorSource> {
        let is_it = |c: &Constraint| matches!(c, Constraint::OnPlane { point: x, .. } if *x == point);
        self.scene.constraints.iter().position(is_it).map(ErrorSource::Constraint).into_iter().collect()
    }
}

/// Applies a fault and returns the constraints or the lens that are wrong with it; none where the scene has nothing for it.
type Fault = fn(&mut Case) -> Vec<ErrorSource>;

fn faults() -> Vec<(&'static str, Fault)> {
    fn n(case: &Case) -> usize {
        case.scene.n_control_points
    }
    fn has_tapes(case: &Case) -> bool {
        !case.scene.tapes().is_empty()
    }
    vec![
        ("click of a control point 25 σ off", |c| c.move_click(0, 1, [10.0, -7.5])),
        ("click of a control point 100 σ off", |c| c.move_click(0, 2, [-30.0, 40.0])),
        ("click of a road point 25 σ off", |c| c.move_click(0, n(c), [10.0, 7.5])),
        ("click of a road point 100 σ off", |c| c.move_click(0, n(c) + 1, [40.0, -30.0])),
        ("click of a post 50 σ off", |c| {
            let last = c.scene.points.len() - 1;
            c.move_click(0, last, [3.0, 25.0])
        }),
        ("road point 0.4 m high", |c| {
            let point = n(c) + 1;
            let x = c.scene.points[point] + Vector3::z() * 0.4;
            c.seen_at(point, x);
            c.on_plane(point)
        }),
        ("control point 0.4 m high", |c| {
            let x = c.scene.points[1] + Vector3::z() * 0.4;
            let tapes: Vec<usize> = c.scene.tapes();
            let old = c.scene.points[1];
            c.seen_at(1, x);
            // Tapes and coordinates are those of the point where it is.
            for i in tapes {
                if let Constraint::Distance { a, b, distance_m, .. } = &mut c.scene.constraints[i] {
                    let other = match (*a, *b) {
                        (1, b) => b,
                        (a, 1) => a,
                        _ => continue,
                    };
                    let from = c.scene.points[other];
                    *distance_m += (x - from).norm() - (old - from).norm();
                }
            }
            for constraint in &mut c.scene.constraints {
                if let Constraint::Place { point: 1, x_in_world, .. } = constraint {
                    x_in_world.z += 0.4;
                }
            }
            c.on_plane(1)
        }),
        ("tape 0.1 m too long", |c| if has_tapes(c) { c.tape(1, |d| d + 0.1) } else { Vec::new() }),
        ("tape 0.5 m too short", |c| if has_tapes(c) { c.tape(2, |d| d - 0.5) } else { Vec::new() }),
        ("tape in feet", |c| if has_tapes(c) { c.tape(0, |d| d / 0.3048) } else { Vec::new() }),
        ("tape slipped", |c| if has_tapes(c) { c.tape(3, |d| 10.0 * d) } else { Vec::new() }),
        ("tape of other points", |c| {
            if !has_tapes(c) {
                return Vec::new();
            }
            let tapes = c.scene.tapes();
            let of = |c: &Case, i: usize| match c.scene.constraints[i] {
                Constraint::Distance { distance_m, .. } => distance_m,
                _ => 0.0,
            };
            let (first, second) = (of(c, tapes[0]), of(c, tapes[1]));
            let mut sources = c.tape(0, |_| second);
            sources.extend(c.tape(1, |_| first));
            sources
        }),
        ("focal length + 20 %", |c| c.set_lens(1.2, [0.0; 2])),
        ("focal length − 20 %", |c| c.set_lens(0.8, [0.0; 2])),
        ("focal length + 5 %", |c| c.set_lens(1.05, [0.0; 2])),
        ("centre 100 px off", |c| {
            c.set_lens(1.0, [80.0, -60.0]);
            // A centre is no error that reliability names.
            vec![ErrorSource::Focal(usize::MAX)]
        }),
        ("two control points exchanged", |c| c.exchange_clicks(0, 1)),
        ("a control point and a road point exchanged", |c| c.exchange_clicks(1, n(c))),
        ("two road points exchanged", |c| c.exchange_clicks(n(c), n(c) + 1)),
        ("control point typed wrong", |c| {
            let at = c.scene.constraints.iter().position(|x| matches!(x, Constraint::Place { point: 1, .. }));
            if let Some(Constraint::Place { x_in_world, .. }) = at.map(|at| &mut c.scene.constraints[at]) {
                x_in_world.x += 1.0;
            }
            at.map(ErrorSource::Constraint).into_iter().collect()
        }),
        ("control point typed 0.1 m wrong", |c| {
            let at = c.scene.constraints.iter().position(|x| matches!(x, Constraint::Place { point: 2, .. }));
            if let Some(Constraint::Place { x_in_world, .. }) = at.map(|at| &mut c.scene.constraints[at]) {
                x_in_world.y -= 0.1;
            }
            at.map(ErrorSource::Constraint).into_iter().collect()
        }),
    ]
}

/// The answers that are wrong although the network is called right: those that state that they may be, and those that do not.
fn wrong(
    case: &Case,
    found: &Adjusted,
    right: &Adjusted,
    sources: &[ErrorSource],
) -> (Vec<String>, Vec<String>) {
    let (mut stated, mut silent) = (Vec::new(), Vec::new());
    let reliability = found.reliability();
    for (query, truth) in case.scene.queries() {
        let (Ok(m), Ok(own)) = (found.measure(&query), right.measure(&query)) else { continue };
        let error = (m.value - truth).abs();
        let moved = (m.value - own.value).abs();
        if error <= 3.0 * m.sigma || moved <= m.sigma.max(0.003) {
            continue;
        }
        let says = reliability.of_query(&query).expect("an answer");
        let is_open = sources.iter().any(|s| says.unchecked.contains(s) || says.partly_checked.contains(s));
        let is_small = error < says.largest_error_of_checked + 3.0 * m.sigma;
        let line = format!(
            "{query:?} {:.3} ± {:.3} m, {error:.3} off ({:.1} σ), moved {moved:.3}; unchecked {:?} partly {:?} largest {:?} source {sources:?}",
            m.value,
            m.sigma,
            error / m.sigma,
            says.unchecked,
            says.partly_checked,
            says.largest_error_of_checked
        );
        if is_open || is_small { stated.push(line) } else { silent.push(line) }
    }
    (stated, silent)
}

#[test]
fn an_answer_that_is_wrong_is_not_called_right() {
    let is_all = std::env::var_os("RESIGHT_RUNS").is_some();
    let (mut n, mut n_ok, mut n_stated, mut n_right, mut n_refused) = (0, 0, 0, 0, 0);
    let (mut alarms, mut silent) = (Vec::new(), Vec::new());
    for layout in (0..LAYOUTS.len()).filter(|i| is_all || i % 3 == 0) {
        for seed in 0..if is_all { 3 } else { 1 } {
            for sigma_px in [0.2, 0.5, 1.0, 2.0] {
                let what = format!("layout {layout}.{seed}, {sigma_px} px");
                let of = || Case::new(5000 + 10 * layout as u64 + seed, layout);
                let right = of().solved(sigma_px).expect("an answer");
                n_right += 1;
                println!("{what}: {:?} χ² {:.1} of {}", right.status(), right.chi2, right.degrees_of_freedom);
                if right.status() != NetworkStatus::Ok {
                    alarms.push(format!(
                        "{what}: {:?} χ² {:.1} of {}",
                        right.warnings(),
                        right.chi2,
                        right.degrees_of_freedom
                    ));
                }
                for (fault, apply) in faults() {
                    let mut case = of();
                    let sources = apply(&mut case);
                    if sources.is_empty() {
                        continue;
                    }
                    n += 1;
                    let found = match case.solved(sigma_px) {
                        Ok(found) => found,
                        Err(reason) => {
                            n_refused += 1;
                            println!("{what}, {fault}: refused {reason}");
                            continue;
                        }
                    };
                    println!(
                        "{what}, {fault}: {:?} χ² {:.1} of {}",
                        found.status(),
                        found.chi2,
                        found.degrees_of_freedom
                    );
                    if found.status() != NetworkStatus::Ok {
                        continue;
                    }
                    n_ok += 1;
                    let (said, unsaid) = wrong(&case, &found, &right, &sources);
                    n_stated += usize::from(!said.is_empty() && unsaid.is_empty());
                    said.iter().for_each(|line| println!("   STATED {what}, {fault}: {line}"));
                    for line in unsaid {
                        println!("   WRONG {what}, {fault}: {line}");
                        silent.push(format!("{what}, {fault}: {line}"));
                    }
                }
            }
        }
    }
    println!(
        "of {n} faults {n_ok} are ok ({n_refused} refused), {n_stated} of them wrong and stated, {} wrong answers not; of {n_right} right scenes {} are not",
        silent.len(),
        alarms.len()
    );
    assert!(silent.is_empty() && 20 * alarms.len() <= n_right, "{alarms:#?} {silent:#?}");
}
