// Where a camera is mounted on a robot's gripper: `cargo run -p resight --example hand_eye`.
use resight::rig::{
    Detections, HandEyeRequest, HandEyeViews, ObservedRig, RigRequest, RobotFile, read_robot_file,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut request = RigRequest::default();
    request.read_camera(Some("cam"), "examples/robot/camera.toml")?;
    let files = ["examples/robot/corners.csv".into()];
    let observed = ObservedRig::from_detections(&Detections::files(&files), &request)?;
    let RobotFile { robot, remarks, .. } =
        read_robot_file("examples/robot/motions.csv", &Default::default(), None)?;
    let views = HandEyeViews::Points(Box::new(observed));
    let answer = resight::hand_eye(HandEyeRequest { robot, views, config: Default::default(), remarks })?;
    println!("{}", serde_json::to_string_pretty(&answer)?);
    Ok(())
}
