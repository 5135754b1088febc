// Known points and their pixels in a CSV file to a pose: `cargo run -p resight --example points`.
use resight::report::words::position_sigma_m;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let camera = resight::read_camera("examples/marks/camera.toml")?;
    for answer in resight::locate_table("examples/marks/marks.csv", &camera, &Default::default())? {
        println!("{} {}: {}", answer.view, answer.status().name(), answer.verdict.message);
        if let Some(pose) = &answer.estimate {
            let (x, sigma) =
                (pose.cam_from_target.origin(), position_sigma_m(&pose.cam_from_target, &pose.covariance));
            for (axis, i) in [("x", 0), ("y", 1), ("z", 2)] {
                println!("camera at {axis} {:+.3} ± {:.3} m", x[i], sigma[i]);
            }
        }
    }
    Ok(())
}
