//! One image of each camera to a rig: `cargo run -p resight --example rig -- TARGET CAMERA IMAGE CAMERA IMAGE…`.

use resight::GrayImage;
use resight::rig::{CameraImage, RigRequest};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [target, files @ ..] = &arguments[..] else { return Err("TARGET CAMERA IMAGE… are needed".into()) };
    let (mut request, mut images) = (RigRequest::default(), Vec::new());
    request.read_target(None, target.as_ref())?;
    for (number, pair) in files.chunks_exact(2).enumerate() {
        let name = format!("camera{number}");
        request.read_camera(Some(&name), &pair[0])?;
        images.push(CameraImage::in_memory(name, "the only view", GrayImage::read(pair[1].as_ref())?));
    }
    let answer = resight::rig_from_images(&images, &Default::default(), &request)?;
    println!("{}", serde_json::to_string_pretty(&answer)?);
    Ok(())
}
