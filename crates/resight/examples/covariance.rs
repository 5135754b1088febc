// The covariance of a pose carried on to what you want to know: `cargo run -p resight --example covariance`.
use resight::{GrayImage, locate_image, read_camera, read_target};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let camera = read_camera("examples/photo/left.yml")?;
    let target = read_target("examples/photo/board.toml")?;
    let image = GrayImage::read("examples/photo/left03.jpg")?;
    let answer = locate_image(&image, &camera, &target, &Default::default())?;
    let pose = answer.estimate.ok_or(answer.verdict.message)?;
    // A point of the target in the camera's frame: its small motion is [-[x]×, I] · [rotation; translation].
    let x_in_cam = pose.cam_from_target * nalgebra::Vector3::new(0.1, 0.1, 0.0);
    let mut jacobian = nalgebra::Matrix3x6::identity();
    jacobian.fixed_columns_mut::<3>(0).copy_from(&-x_in_cam.cross_matrix());
    jacobian.fixed_columns_mut::<3>(3).fill_with_identity();
    let sigma_m = (jacobian * pose.covariance * jacobian.transpose()).diagonal().map(f64::sqrt);
    for i in 0..3 {
        println!("{} {:+.4} m ± {:.4} m", ["x", "y", "z"][i], x_in_cam[i], sigma_m[i]);
    }
    Ok(())
}
