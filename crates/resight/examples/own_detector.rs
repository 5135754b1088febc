// Points of your own detector to a pose with its uncertainty: `cargo run -p resight --example own_detector`.
use resight::core::{Correspondence, Pixel, Point};
use resight::{locate::NamedPoint, locate_points, read_camera};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let camera = read_camera("examples/marks/camera.toml")?;
    // Name, metres in the target's frame, pixels: what the detector found.
    let found = [
        ("a", [-2.0, 8.0, 0.0], [436.67, 583.03]),
        ("b", [2.5, 9.0, 0.0], [868.09, 541.42]),
        ("c", [0.5, 12.0, 0.4], [675.77, 427.39]),
        ("d", [-3.0, 15.0, 0.0], [465.58, 399.70]),
    ];
    let point = |(name, x, uv): (&str, [f64; 3], [f64; 2])| {
        let seen = Correspondence::new(&camera, Point::from(x), Pixel::from(uv), 0.3)?; // 0.3 px: one standard deviation.
        Ok::<_, resight::Error>(NamedPoint { name: name.into(), line: None, seen })
    };
    let points = found.into_iter().map(point).collect::<Result<Vec<_>, _>>()?;
    println!(
        "{}",
        serde_json::to_string_pretty(&locate_points("gate", &points, &camera, &Default::default()))?
    );
    Ok(())
}
