//! Times tag detection in one process, for `benches/peers`: `bench_tag_pose IMAGE FAMILY ID RUNS`.
//! Prints one JSON object: median and best milliseconds of a detection in the decoded image, and the corners.

use resight::GrayImage;
use resight::core::Target;
use resight::core::target::Tag;
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
    let mut detections = detector.detect(&image)?;
    let mut times_ms = Vec::new();
    for _ in 0..runs.parse::<usize>()?.max(1) {
        let start = Instant::now();
        detections = detector.detect(&image)?;
        times_ms.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times_ms.sort_by(f64::total_cmp);
    let corners: Vec<[f64; 2]> = detections.iter().map(|d| [d.pixel.x, d.pixel.y]).collect();
    println!(
        "{{\"median_ms\": {}, \"best_ms\": {}, \"corners\": {corners:?}}}",
        times_ms[times_ms.len() / 2],
        times_ms[0]
    );
    Ok(())
}
