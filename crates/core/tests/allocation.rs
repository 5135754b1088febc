//! No closed form, refinement or `locate` touches the heap: a counting allocator says so.
#![allow(unsafe_code)] // An allocator is `unsafe` by its trait; nothing else here is.

use crate::common::{Rng, views};
use nalgebra::Vector3;
use resight_core::correspondence::PixelCovariance;
use resight_core::line::{ImageLine, LineCorrespondence};
use resight_core::locate::known_rotation::{KnownRotation, position_with_rotation};
use resight_core::locate::lines::locate_lines;
use resight_core::locate::loss::Loss;
use resight_core::locate::prior::Prior;
use resight_core::locate::problem::Problem;
use resight_core::locate::refine::refine;
use resight_core::locate::{Config, Method, locate};
use resight_core::multiview::rig_pose::{RigView, locate_rig};
use resight_core::solve::line_plus_one::line_plus_one;
use resight_core::solve::p3p::p3p;
use resight_core::solve::planar::planar;
use resight_core::solve::pure_rotation::{DirectionPair, pure_rotation};
use resight_core::solve::sqpnp::sqpnp;
use resight_core::solve::upright_p2p::upright_p2p;
use resight_core::solve::vanishing::{rotations, vanishing_point};
use resight_core::solve::wang2004::wang2004;
use resight_core::{Correspondence, Matrix6, Point, Pose};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;

/// The system's allocator, counting each thread's own calls: other tests run beside this one.
struct Counting;

thread_local! {
    static CALLS: Cell<usize> = const { Cell::new(0) };
}

fn count() {
    // A thread that is ending has no counter any more; nothing is measured then.
    let _ = CALLS.try_with(|calls| calls.set(calls.get() + 1));
}

// SAFETY: every method hands its arguments unchanged to `System`, whose contract is therefore kept; counting neither
// allocates (the cell is const-initialised and has no destructor) nor unwinds.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promise about `layout` is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: `block` came from `System` through `alloc` or `realloc` with this layout.
        unsafe { System.dealloc(block, layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: as for `dealloc`; the caller's promise about `size` is passed on.
        unsafe { System.realloc(block, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// How often the heap is touched.
fn allocations<T>(run: impl FnOnce() -> T) -> usize {
    let before = CALLS.with(Cell::get);
    black_box(run());
    CALLS.with(Cell::get) - before
}

fn exact(points: &[Point]) -> Vec<Correspondence> {
    views::seen_from(&views::oblique(), points, 0.3)
}

/// Without it every test below would pass with an allocator that is not installed.
#[test]
fn the_counter_counts() {
    assert_eq!(allocations(|| vec![1, 2, 3]), 1);
    assert_eq!(allocations(|| 1 + 1), 0);
}

#[test]
fn closed_forms_do_not_allocate() {
    let four = exact(&views::line_plus_one());
    let (bearings, points) =
        ([0, 1, 2, 3].map(|i| four[i].bearing), [0, 1, 2, 3].map(|i| four[i].x_in_target));
    assert_eq!(allocations(|| line_plus_one(&bearings, &points)), 0);
    assert_eq!(allocations(|| wang2004(&bearings, &points)), 0);
    let three = exact(&views::three());
    let (bearings, points) = ([0, 1, 2].map(|i| three[i].bearing), [0, 1, 2].map(|i| three[i].x_in_target));
    assert_eq!(allocations(|| p3p(&bearings, &points)), 0);
    let (flat, space) = (exact(&views::planar()), exact(&views::general()));
    assert_eq!(allocations(|| planar(&flat)), 0);
    assert_eq!(allocations(|| sqpnp(&space)), 0);
    assert_eq!(allocations(|| refine(&views::oblique(), &flat, &views::camera())), 0);
}

/// `n` points: the eight of the suite, then random ones, flat or not.
fn many(n: usize, thickness: f64) -> Vec<Point> {
    let mut rng = Rng::new(n as u64);
    let any = |rng: &mut Rng| {
        Point::new(rng.uniform(0.0, 1.0), rng.uniform(0.0, 1.0), rng.uniform(-thickness, thickness))
    };
    (0..n).map(|_| any(&mut rng)).collect()
}

#[test]
fn locating_does_not_allocate_with_any_configuration_or_method() {
    let mut scenes: Vec<_> = views::all().map(|(_, points)| points).into();
    scenes.extend([4, 5, 8, 16, 33, 64].map(|n| many(n, 0.0)));
    scenes.extend([4, 6, 33, 64].map(|n| many(n, 0.5)));
    let camera = views::camera();
    let intrinsics: Vec<f64> = (0..16).map(|i| if i % 5 == 0 { 1.0 } else { 0.0 }).collect();
    let mut rng = Rng::new(5);
    let mut answered = 0;
    for points in &scenes {
        let mut seen = views::disturbed(&mut rng, &exact(points));
        for sigma_m in [0.0, 1e-3] {
            seen.iter_mut().for_each(|c| c.sigma_m = sigma_m);
            for method in [
                Method::Auto,
                Method::LinePlusOne,
                Method::Wang2004,
                Method::P3p,
                Method::Planar,
                Method::Sqpnp,
            ] {
                let config = Config { method, intrinsics_covariance: Some(&intrinsics), ..Config::default() };
                answered += usize::from(locate(&seen, &camera, &config).is_ok());
                let touched = allocations(|| locate(&seen, &camera, &config));
                assert_eq!(touched, 0, "{} points, {method:?}", points.len());
            }
        }
    }
    assert!(2 * scenes.len() < answered, "{answered}");
}

/// Also with uncertain cameras, and refused.
#[test]
fn a_rig_does_not_allocate() {
    let (camera, mut rng) = (views::camera(), Rng::new(6));
    let covariance = Matrix6::identity() * 1e-6;
    for points in [views::three(), views::planar(), views::general(), many(64, 0.5)] {
        let seen = views::disturbed(&mut rng, &exact(&points));
        let lens: [f64; 16] = core::array::from_fn(|i| if i % 5 == 0 { 4.0 } else { 0.0 });
        for (cam_from_rig_covariance, intrinsics_covariance) in
            [(None, None), (Some(covariance), None), (Some(covariance), Some(&lens[..]))]
        {
            let view = |seen| RigView {
                camera: &camera,
                cam_from_rig: Pose::identity(),
                cam_from_rig_covariance,
                intrinsics_covariance,
                seen,
            };
            let (one, other) = seen.split_at(seen.len() / 2);
            let (rig, single) = ([view(one), view(other)], [view(&seen)]);
            assert!(locate_rig(&rig).is_ok() && locate_rig(&single).is_ok());
            assert_eq!(allocations(|| locate_rig(&rig)) + allocations(|| locate_rig(&single)), 0);
            assert_eq!(allocations(|| locate_rig(&[view(&seen[..2])])), 0);
        }
    }
}

/// Refusals are answers too.
#[test]
fn refusing_does_not_allocate() {
    let mut seen = exact(&views::general());
    seen[3].pixel.x = f64::NAN;
    assert_eq!(allocations(|| locate(&seen, &views::camera(), &Config::default())), 0);
    let garbled: Vec<_> = (0..8)
        .map(|i| Correspondence { x_in_target: views::general()[7 - i], ..exact(&views::general())[i] })
        .collect();
    assert_eq!(allocations(|| locate(&garbled, &views::camera(), &Config::default())), 0);
}

/// The solvers that know something of the rotation, and those of lines.
#[test]
fn upright_rotations_and_lines_do_not_allocate() {
    let pose = views::oblique();
    let x = exact(&views::general());
    let down = nalgebra::Vector3::z_axis();
    let down_in_cam = nalgebra::Unit::new_normalize(pose.rotation * down.into_inner());
    let (bearings, points) = ([x[0].bearing, x[1].bearing], [x[0].x_in_target, x[1].x_in_target]);
    assert_eq!(allocations(|| upright_p2p(&bearings, &points, &down, &down_in_cam)), 0);
    let pairs = [0, 1, 2].map(|i: usize| {
        let in_second = nalgebra::Unit::new_normalize(pose.rotation * x[i].bearing.into_inner());
        DirectionPair { in_first: x[i].bearing, in_second, sigma_rad: 1e-3 }
    });
    assert_eq!(allocations(|| pure_rotation(&pairs)), 0);
    assert_eq!(allocations(|| rotations(&pairs)), 0);
    let rotation = KnownRotation { cam_from_target: pose.rotation, covariance: nalgebra::Matrix3::zeros() };
    assert_eq!(allocations(|| position_with_rotation(&rotation, &x[..2], &[], &views::camera(), &[])), 0);
    let line = |[i, j]: [usize; 2]| {
        let seen = ImageLine::new(&views::camera(), [x[i].pixel, x[j].pixel], 0.3).expect("a line");
        let along = x[j].x_in_target - x[i].x_in_target;
        let direction_in_target = nalgebra::Unit::new_normalize(along);
        LineCorrespondence { point_in_target: Some(x[i].x_in_target), direction_in_target, seen }
    };
    let lines = [line([0, 2]), line([1, 3]), line([5, 7]), line([0, 1])];
    let camera = views::camera();
    assert!(locate_lines(&lines, &Problem::new(&x, &camera)).is_ok());
    assert_eq!(allocations(|| locate_lines(&lines, &Problem::new(&x, &camera))), 0);
    assert_eq!(allocations(|| vanishing_point(&lines.map(|l| l.seen))), 0);
}

/// Priors, contradictions, losses and ellipses, from one point up.
#[test]
fn priors_and_losses_do_not_allocate() {
    let (camera, truth) = (views::camera(), views::oblique());
    let down = Vector3::new(0.0, 0.6, 0.8);
    let gravity = |down_in_cam| Prior::Gravity { down_in_target: down, down_in_cam, sigma_rad: 0.01 };
    let (level, wrong) = (gravity(truth.rotation * down), gravity(-down));
    let pose = Prior::Pose { cam_from_target: truth, covariance: Matrix6::identity() * 1e-4 };
    let ellipse = PixelCovariance { uu_px2: 1.0, uv_px2: 0.3, vv_px2: 0.2 };
    let losses = [Loss::Squared, Loss::Huber { sigmas: 1.5 }, Loss::Truncated { sigmas: 4.0 }];
    let mut answered = 0;
    for n in [1, 2, 4, 8] {
        let mut seen = exact(&views::general()[..n]);
        seen.iter_mut().for_each(|c| *c = c.with_covariance(ellipse));
        for priors in [vec![pose], vec![level, pose], vec![level], vec![wrong, pose]] {
            for loss in losses {
                let config = Config { priors: &priors, loss, ..Config::default() };
                answered += usize::from(locate(&seen, &camera, &config).is_ok());
                assert_eq!(allocations(|| locate(&seen, &camera, &config)), 0, "{n} points, {priors:?}");
            }
        }
    }
    assert!(24 < answered, "{answered}");
}
