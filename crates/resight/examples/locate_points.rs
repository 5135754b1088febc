//! Points of one's own detector to one pose: `cargo run -p resight --example locate_points`.

use resight::core::{Camera, CameraMatrix, Correspondence, Lens, Pixel, Point, camera::Pinhole};
use resight::locate::{NamedPoint, PointsOptions, locate_points};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let matrix = CameraMatrix { fx_px: 800.0, fy_px: 800.0, cx_px: 319.5, cy_px: 239.5 };
    let camera = Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None };
    // Metres in the target's frame, and pixels: the detector's.
    let seen = [
        ("a", [0.0, 0.0], [280.1, 239.6]),
        ("b", [0.1, 0.0], [359.4, 239.2]),
        ("c", [0.15, 0.0], [398.9, 239.4]),
        ("d", [0.0, 0.15], [280.3, 358.8]),
    ];
    let point = |(name, [x, y], [u, v]): (&str, [f64; 2], [f64; 2])| -> Result<NamedPoint, resight::Error> {
        let seen = Correspondence::new(&camera, Point::new(x, y, 0.0), Pixel::new(u, v), 0.3)?;
        Ok(NamedPoint { name: name.into(), line: None, seen })
    };
    let points = seen.into_iter().map(point).collect::<Result<Vec<_>, _>>()?;
    let answer = locate_points("first view".into(), &points, &camera, &PointsOptions::default());
    println!("{}", serde_json::to_string_pretty(&answer)?);
    Ok(())
}
