// Known points and their pixels in a CSV file to a pose: `cargo run -p resight --example points`.
use resight::report::words::position_sigma_m;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let camera = resight::read_camera("examples/marks/camera.toml")?;
    for answer in resight::locate_table("examples/marks/marks.csv", &camera, &Default::default())? {
        println!("{} {}: {}", answer.view, answer.status().name(), answer.verdict.message);
        if let Some(pose) = &answer.estimate {
            let sigma_m = position_sigma_m(&pose.cam_from_target, &pose.covariance);
            println!(
                "camera at {:.3} m ± {:.3} m",
                pose.cam_from_target.origin().transpose(),
                sigma_m.transpose()
            );
        }
    }
    Ok(())
}
