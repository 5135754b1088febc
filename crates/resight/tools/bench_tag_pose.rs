//! Times a tag image to its pose in one process, for `benches/peers`: `bench_tag_pose IMAGE FAMILY ID RUNS`.
//! Prints one JSON object: median and best milliseconds from the decoded image to the pose with its covariance and
//! ambiguity, the corners, and the distance to the tag in metres.

use resight::GrayImage;
use resight::core::camera::{CameraMatrix, Pinhole};
use resight::core::correspondence::{Correspondence, Detection, correspond};
use resight::core::locate::{Config, PoseEstimate, locate};
use resight::core::target::Tag;
use resight::core::{Camera, Lens, Target};
use resight::detect::Detector;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [image, family, id, runs] = arguments.as_slice() else {
        return Err("usage: bench_tag_pose IMAGE FAMILY ID RUNS".into());
    };
    let image = GrayImage::read(Path::new(image))?;
    let target = Target::Tag(Tag { family: family.clone(), id: id.parse()?, size_m: 0.1 });
    let mut detector = Detector::new(&target)?;
    let camera = camera()?;
    let mut last = tag_pose(&mut detector, &image, &target, &camera)?;
    let mut times_ms = Vec::new();
    for _ in 0..runs.parse::<usize>()?.max(1) {
        let start = Instant::now();
        last = tag_pose(&mut detector, &image, &target, &camera)?;
        times_ms.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times_ms.sort_by(f64::total_cmp);
    let corners: Vec<[f64; 2]> = last.0.iter().map(|d| [d.pixel.x, d.pixel.y]).collect();
    println!(
        "{{\"median_ms\": {}, \"best_ms\": {}, \"corners\": {corners:?}, \"distance_m\": {}}}",
        times_ms[times_ms.len() / 2],
        times_ms[0],
        last.1.cam_from_target.translation.norm()
    );
    Ok(())
}

/// The camera of the image that `tag_pose.py` draws.
fn camera() -> Result<Camera, Box<dyn Error>> {
    let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 639.5, cy_px: 479.5 };
    Ok(Camera { lens: Lens::Pinhole(Pinhole::new(matrix)?), size: None })
}

fn tag_pose(
    detector: &mut Detector,
    image: &GrayImage,
    target: &Target,
    camera: &Camera,
) -> Result<(Vec<Detection>, PoseEstimate), Box<dyn Error>> {
    let detections = detector.detect(image)?;
    let (seen, _) = correspond(&detections, target, camera);
    let seen: Vec<Correspondence> = seen.into_iter().map(|(_, correspondence)| correspondence).collect();
    let pose = locate(&seen, camera, &Config::default())?;
    Ok((detections, pose))
}
