//! `solve_hand_eye` on the pixels of sessions, for `benches/peers`: `bench_hand_eye SESSION.csv…`; nothing is stated about the robot's noise.
//!
//! The file is that of `hand_eye.py`: the noise, a row `c` with the matrix of the camera, a row `h` a view (which pose of the gripper was reported, as
//! a quaternion and a position), a row `s` a point (view, point in the target, pixel), `target_on_hand` where the target moves.
//! Prints one JSON object a session: both poses as rows of `[R | t]`, the seconds, the estimated noise and whether the answer is to be believed.

use nalgebra::{Vector2, Vector3};
use resight_core::camera::{BrownConrady, CameraMatrix};
use resight_core::multiview::hand_eye::{HandEye, HandEyeConfig, HandEyeView, Mounting, solve_hand_eye};
use resight_core::multiview::rig_pose::RigView;
use resight_core::{Camera, Correspondence, Lens, Point, Pose};
use std::error::Error;
use std::time::Instant;

#[derive(Default)]
struct Session {
    mounting: Mounting,
    camera: Option<Camera>,
    base_from_gripper: Vec<Pose>,
    seen: Vec<Vec<Correspondence>>,
}

fn main() -> Result<(), Box<dyn Error>> {
    for path in std::env::args().skip(1) {
        let session = read(&std::fs::read_to_string(&path)?).map_err(|reason| format!("{path}: {reason}"))?;
        let start = Instant::now();
        let found = solved(&session)?;
        println!("{}", as_json(start.elapsed().as_secs_f64(), &found));
    }
    Ok(())
}

fn solved(session: &Session) -> Result<HandEye, Box<dyn Error>> {
    let camera = session.camera.as_ref().ok_or("no camera")?;
    let cam_from_rig = Pose::identity();
    let rig = |seen| {
        [RigView { camera, cam_from_rig, cam_from_rig_covariance: None, intrinsics_covariance: None, seen }]
    };
    let rigs: Vec<[RigView; 1]> = session.seen.iter().map(|seen| rig(seen.as_slice())).collect();
    let view = |(base_from_gripper, seen)| HandEyeView {
        base_from_gripper,
        gripper_covariance: None,
        written: None,
        candidates: Vec::new(),
        seen,
    };
    let views: Vec<HandEyeView> =
        session.base_from_gripper.iter().copied().zip(rigs.iter().map(|rig| &rig[..])).map(view).collect();
    Ok(solve_hand_eye(&views, &HandEyeConfig { mounting: session.mounting, ..HandEyeConfig::default() })?)
}

fn as_json(seconds: f64, found: &HandEye) -> String {
    let rows = |pose: &Pose| format!("{:?}", &pose.matrix()[..3]);
    let noise = found.gripper_noise.map_or([0.0; 2], |noise| [noise.sigma_rad, noise.sigma_m]);
    format!(
        "{{\"seconds\": {seconds}, \"cam_from_carrier\": {}, \"holder_from_target\": {}, \"hand_noise\": {noise:?}, \"n_used\": {}, \"is_inconsistent\": {}}}",
        rows(&found.cam_from_carrier),
        rows(&found.holder_from_target),
        found.n_used,
        found.is_inconsistent
    )
}

fn read(text: &str) -> Result<Session, Box<dyn Error>> {
    let (mut sigma_px, mut session) = (1.0, Session::default());
    for line in text.lines() {
        let (kind, rest) = line.split_once(',').unwrap_or((line, ""));
        if kind == "target_on_hand" {
            session.mounting = Mounting::TargetOnGripper;
            continue;
        }
        let numbers = rest.split(',').map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        match (kind, numbers.as_slice()) {
            ("sigma_px", &[sigma]) => sigma_px = sigma,
            ("c", &[fx_px, fy_px, cx_px, cy_px]) => {
                let lens = BrownConrady::new(CameraMatrix { fx_px, fy_px, cx_px, cy_px }, &[0.0; 4])?;
                session.camera = Some(Camera { lens: Lens::BrownConrady(lens), size: None });
            }
            ("h", &[w, i, j, k, x, y, z]) => {
                let pose = Pose::from_quaternion_wxyz([w, i, j, k], Vector3::new(x, y, z));
                session.base_from_gripper.push(pose);
                session.seen.push(Vec::new());
            }
            ("s", &[view, x, y, z, u, v]) => {
                let camera = session.camera.as_ref().ok_or("the camera comes before points")?;
                let c = Correspondence::new(camera, Point::new(x, y, z), Vector2::new(u, v), sigma_px)?;
                session.seen.get_mut(view as usize).ok_or("gripper poses come before points")?.push(c);
            }
            _ => return Err(format!("not understood: {line}").into()),
        }
    }
    Ok(session)
}
