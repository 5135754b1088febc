// Points of your own detector to a pose with its uncertainty: `cargo run -p resight --example own_detector`.
use resight::core::{Correspondence, Pixel, Point};
use resight::{locate::NamedPoint, locate_points, read_camera};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let camera = read_camera("examples/marks/camera.toml")?;
    // Metres in the target's frame, and pixels: what the detector found.
    let found = [
        ([-2.0, 8.0, 0.0], [436.67, 583.03]),
        ([2.5, 9.0, 0.0], [868.09, 541.42]),
        ([0.5, 12.0, 0.4], [675.77, 427.39]),
        ([-3.0, 15.0, 0.0], [465.58, 399.70]),
    ];
    let mut points = Vec::new();
    for (i, (x, uv)) in found.into_iter().enumerate() {
        let seen = Correspondence::new(&camera, Point::from(x), Pixel::from(uv), 0.3)?; // 0.3 px: one sigma.
        points.push(NamedPoint { name: i.to_string(), line: None, seen });
    }
    let answer = locate_points("gate", &points, &camera, &Default::default());
    println!("{}", serde_json::to_string_pretty(&answer)?);
    Ok(())
}
