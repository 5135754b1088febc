// Images of two cameras to their relative pose: `cargo run -p resight --example rig`.
use resight::GrayImage;
use resight::rig::{CameraImage, RigRequest};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut request = RigRequest::default();
    request.read_target(None, "examples/photo/board.toml")?;
    let mut images = Vec::new();
    for name in ["left", "right"] {
        request.read_camera(Some(name), format!("examples/photo/{name}.yml"))?;
        for view in ["01", "03", "04", "05"] {
            let image = GrayImage::read(format!("examples/photo/{name}{view}.jpg"))?;
            images.push(CameraImage::in_memory(name, view, image));
        }
    }
    let answer = resight::rig_from_images(&images, &Default::default(), &request)?;
    println!("{}", serde_json::to_string_pretty(&answer)?);
    Ok(())
}
