//! The single-pose path for a machine without an operating system. That it compiles is the proof: no std is there to supply
//! the panic handler below (a second one would be an error), and no allocator is there to be called.
#![no_std]

use core::panic::PanicInfo;
use nalgebra::{Vector2, Vector3};
use resight_core::camera::{CameraMatrix, Pinhole};
use resight_core::locate::{Config, locate};
use resight_core::{Camera, Correspondence, Lens};

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    loop {}
}

/// Four points (x, y, z, u, v each) and a pinhole (fx, fy, cx, cy) in; rotation (by rows) and translation out. Returns whether there
/// is a pose.
#[unsafe(no_mangle)]
pub extern "C" fn resight_locate_four(points: &[[f64; 5]; 4], pinhole: &[f64; 4], pose: &mut [f64; 12]) -> bool {
    let [fx_px, fy_px, cx_px, cy_px] = *pinhole;
    let Ok(model) = Pinhole::new(CameraMatrix { fx_px, fy_px, cx_px, cy_px }) else { return false };
    let camera = Camera { lens: Lens::Pinhole(model), size: None };
    let seen = points.map(|[x, y, z, u, v]| {
        Correspondence::new(&camera, Vector3::new(x, y, z), Vector2::new(u, v), 0.5)
    });
    let [Ok(a), Ok(b), Ok(c), Ok(d)] = seen else { return false };
    let Ok(estimate) = locate(&[a, b, c, d], &camera, &Config::default()) else { return false };
    let numbers = estimate.cam_from_target.rotation.transpose();
    for (out, x) in pose.iter_mut().zip(numbers.iter().chain(estimate.cam_from_target.translation.iter())) {
        *out = *x;
    }
    true
}
