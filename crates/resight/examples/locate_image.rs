//! One image to one pose: `cargo run -p resight --example locate_image -- IMAGE CAMERA TARGET`.

use resight::report::words::place_sigma_m;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [image, camera, target] = &arguments[..] else { return Err("IMAGE CAMERA TARGET are needed".into()) };
    let (camera, target) = (resight::read_camera(camera)?, resight::read_target(target)?);
    let image = resight::GrayImage::read(image.as_ref())?;
    let answer = resight::locate_image(&image, &camera, &target, &Default::default())?;
    println!("{}: {}", answer.status().name(), answer.verdict.message);
    if let Some(pose) = &answer.estimate {
        let (place_m, sigma_m) =
            (pose.cam_from_target.origin(), place_sigma_m(&pose.cam_from_target, &pose.covariance));
        println!("camera in the target's frame: {:?} ± {:?} m", place_m.as_slice(), sigma_m.as_slice());
    }
    Ok(())
}
