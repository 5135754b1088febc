//! Kalibr's grid in two fisheye photographs (TUM-VI) and one of EuRoC, with the intrinsics published for those cameras.

use crate::real_support::*;
use crate::recorded::recorded;
use resight::GrayImage;
use resight::core::correspondence::Detection;
use resight::core::target::AprilGrid;
use resight::core::{Camera, Target};
use resight::detect::Detector;
use std::collections::HashSet;
use std::path::Path;

fn cameras(folder: &Path) -> [Camera; 2] {
    let truth = json(&folder.join("truth.json"));
    let (tum, euroc) = (&truth["tum_vi_cam0_kb4_1024"], &truth["euroc_cam0_radtan"]);
    [
        kannala_brandt(matrix_of_four(&tum["fx_fy_cx_cy"]), &tum["k1k2k3k4"]),
        brown_conrady(matrix_of_four(&euroc["fx_fy_cx_cy"]), &euroc["k1k2p1p2"]),
    ]
}

/// Residual bars: 0.12 px (fisheye), 0.25 px (EuRoC). The reference's own corners are other corners: the poses may differ by
/// about two standard deviations of ours, 0.06° and 1 mm. Of EuRoC it used 16 of the 36 tags; compared on those.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn grids_fit_to_a_tenth_of_a_pixel() {
    let folder = recorded("aprilgrid_tumvi_euroc");
    let [fisheye, euroc] = cameras(&folder);
    let target = Target::AprilGrid(AprilGrid {
        family: "tag36h11".into(),
        rows: 6,
        columns: 6,
        tag_size_m: 0.088,
        tag_spacing_ratio: 0.3,
        first_id: 0,
    });
    let mut detector = Detector::new(&target).unwrap();
    let listed = table(&folder.join("detections.csv"));
    for row in table(&folder.join("poses.csv")) {
        let (camera, bar_px) = if row["model"] == "kb4" { (&fisheye, 0.12) } else { (&euroc, 0.25) };
        let inliers = listed.iter().filter(|r| r["image"] == row["image"] && r["inlier"] == "1");
        let used: HashSet<u32> = inliers.map(|r| r["tag"].parse().unwrap()).collect();
        let corners = detector.detect(&GrayImage::read(folder.join(&row["image"])).unwrap()).unwrap();
        let whole = located(&corners, &target, camera);
        let common: Vec<Detection> =
            corners.iter().filter(|d| used.contains(&d.feature.id)).copied().collect();
        let estimate = located(&common, &target, camera);
        let reference = pose_of(&row, "").unwrap();
        let (angle, distance) = apart(&estimate.cam_from_target, &reference);
        let (angle_whole, distance_whole) = apart(&whole.cam_from_target, &reference);
        println!(
            "aprilgrid {}: {} corners, rms {:.4} px (bar {bar_px}); {} common corners {angle:.3}° {distance:.2} mm from the \
             reference, all {angle_whole:.3}° {distance_whole:.2} mm",
            row["image"],
            corners.len(),
            whole.rms_px,
            common.len()
        );
        assert_eq!(corners.len(), 144);
        assert!(whole.rms_px < bar_px, "{}: {} px", row["image"], whole.rms_px);
        assert!(!is_inconsistent(&whole), "{}", row["image"]);
        assert!(angle < 0.1 && distance < 1.0, "{}: {angle}° {distance} mm", row["image"]);
        assert!(angle_whole < 0.4 && distance_whole < 2.0, "{}", row["image"]);
    }
}
