//! Intrinsics of four webcams whose board stays small and near the middle of the image. Needs the folder named by RESIGHT_DATA.

use crate::intrinsics::{at, report};
use resight_core::camera::ImageSize;
use resight_core::multiview::intrinsics::*;
use resight_core::{Correspondence, Pixel, Point};

/// A webcam's board that stays small and near the middle: coefficients that it cannot show stay those of a lens, and both halves agree within
/// their errors, which OpenCV's do with k3 of −12 and −152.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn coefficients_that_views_cannot_show_stay_those_of_a_lens() {
    let folder = std::env::var("RESIGHT_DATA").expect("the folder of recordings");
    let path = std::path::Path::new(&folder).join("caliscope_4cam_charuco/detections.csv");
    let text = std::fs::read_to_string(path).expect("the recording");
    let size = ImageSize { width_px: 1280, height_px: 720 };
    for camera in ["0", "1", "2", "3"] {
        let mut views: std::collections::BTreeMap<u32, Vec<Correspondence>> = Default::default();
        for row in text.lines().map(|line| line.split(',').collect::<Vec<_>>()).filter(|row| row[1] == camera)
        {
            let number = |i: usize| row[i].parse::<f64>().expect("a number");
            let (x, pixel) = (Point::new(number(3), number(4), 0.0), Pixel::new(number(6), number(7)));
            views.entry(row[0].parse().expect("a frame")).or_default().push(at(x, pixel, 0.5));
        }
        let views: Vec<Vec<Correspondence>> = views.into_values().collect();
        let of_size =
            |part: &[Vec<Correspondence>]| match solve_intrinsics(part, size, &IntrinsicsConfig::default())
                .expect("good numbers")
            {
                IntrinsicsOutcome::Solved(solved) => *solved,
                IntrinsicsOutcome::Refused(refusal) => panic!("camera {camera}: {refusal:?}"),
            };
        let half = |odd: usize| views.iter().skip(odd).step_by(2).cloned().collect::<Vec<_>>();
        let [all, a, b] = [of_size(&views), of_size(&half(0)), of_size(&half(1))];
        report(&format!("webcam {camera}"), &all);
        let f = |found: &SolvedIntrinsics| (found.camera.parameters()[0].1, found.sigmas()[0]);
        let z = (f(&a).0 - f(&b).0) / f(&a).1.hypot(f(&b).1);
        println!("   halves {:?} {:?}: {z:+.1} sigma", f(&a), f(&b));
        assert!(z.abs() < 3.0 && all.severity() == Severity::Remark, "camera {camera}: {z}");
        for found in [&all, &a, &b] {
            // At the corner of the image, in parts of its radius.
            let corner = 0.5 * 1280f64.hypot(720.0) / f(found).0;
            for (name, value) in found.camera.parameters().iter().filter(|(name, _)| name.starts_with('k')) {
                let order: i32 = name[1..].parse().expect("a number");
                assert!((value * corner.powi(2 * order)).abs() < 1.5, "camera {camera}: {name} {value}");
            }
        }
    }
}
