// An image to a pose: `cargo run -p resight --example locate_image` in the root of the repository.
use resight::{GrayImage, locate_image, read_camera, read_target, report::words::position_sigma_m};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let camera = read_camera("examples/photo/left.yml")?;
    let target = read_target("examples/photo/board.toml")?;
    let image = GrayImage::read("examples/photo/left03.jpg")?;
    let answer = locate_image(&image, &camera, &target, &Default::default())?;
    println!("{}: {}", answer.status().name(), answer.verdict.message);
    if let Some(pose) = &answer.estimate {
        let camera_m = pose.cam_from_target.origin(); // Position of the camera in the target's frame,
        let sigma_m = position_sigma_m(&pose.cam_from_target, &pose.covariance); // 1σ along the same axes.
        for (axis, (x, sigma)) in ["x", "y", "z"].iter().zip(camera_m.iter().zip(&sigma_m)) {
            println!("{axis} {x:+.4} ± {sigma:.4} m");
        }
    }
    Ok(())
}
