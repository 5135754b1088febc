//! A camera on a gripper: `cargo run -p resight --example hand_eye -- MOTIONS.csv CAMERA DETECTIONS.csv`.

use resight::rig::{Detections, HandEyeRequest, HandEyeViews, ObservedRig, RigRequest, read_robot_poses};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [motions, camera, detections] = &arguments[..] else { return Err("three files are needed".into()) };
    let mut request = RigRequest::default();
    request.read_camera(Some("cam"), camera)?;
    let observed = ObservedRig::from_detections(&Detections::files(&[detections.into()]), &request)?;
    let robot = read_robot_poses(motions.as_ref(), None)?;
    let views = HandEyeViews::Points(Box::new(observed));
    let answer = resight::hand_eye(HandEyeRequest { robot, views, config: Default::default() })?;
    println!("{}", serde_json::to_string_pretty(&answer)?);
    Ok(())
}
