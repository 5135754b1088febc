// A program of one's own: a photograph to a pose with its uncertainty, and the answer as JSON.
use resight::{GrayImage, locate_image, read_camera, read_target, report::words::position_sigma_m};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (camera, target) = (read_camera("examples/photo/left.yml")?, read_target("examples/photo/board.toml")?);
    let image = GrayImage::read("examples/photo/left03.jpg")?;
    let answer = locate_image(&image, &camera, &target, &Default::default())?;
    let pose = answer.estimate.as_ref().ok_or("no pose")?;
    let (x, sigma) = (pose.cam_from_target.origin(), position_sigma_m(&pose.cam_from_target, &pose.covariance));
    println!("{:.4} m ± {:.4} m\n{}", x[2], sigma[2], serde_json::to_string(&answer)?);
    Ok(())
}
