//! A camera on a vehicle, from rendered images of a street: ground and facades, a body that pitches.

use crate::vehicle_support::{FRAME_S, HEIGHT_M, MOUNTED, SPEED_M_S, camera, frame};
use resight::answer::Status;
use resight::vehicle::{
    SpeedSample, VehicleFrame, VehicleRequest, describe, read_speeds, vehicle_from_frames,
};

fn frames(n: usize, speed_m_s: f64) -> impl Iterator<Item = Result<VehicleFrame, resight::Error>> {
    (0..n).map(move |i| {
        let t_s = i as f64 * FRAME_S;
        Ok(VehicleFrame { t_s, image: frame(t_s, speed_m_s) })
    })
}

fn request() -> VehicleRequest {
    let speed = |i: usize| SpeedSample { t_s: i as f64, speed_m_s: SPEED_M_S };
    VehicleRequest { every_s: FRAME_S, speeds: (0..40).map(speed).collect(), ..VehicleRequest::new(camera()) }
}

#[test]
fn vehicle_rendered_street_gives_the_mounting() {
    let answer = vehicle_from_frames(frames(48, SPEED_M_S), "street", &request()).expect("an answer");
    println!("{}{answer:?}", describe(&answer));
    assert_eq!(answer.status, Status::Ok, "{}", answer.message);
    let off = |found: Option<f64>, truth: f64| (found.expect("determined") - truth).to_degrees();
    let [yaw, pitch, roll] = [(answer.yaw_rad, 0), (answer.pitch_rad, 1), (answer.roll_rad, 2)]
        .map(|(found, i)| off(found, MOUNTED[i]));
    println!("off by {yaw:.3}° {pitch:.3}° {roll:.3}°");
    assert!(yaw.abs() < 0.05 && pitch.abs() < 0.1, "{yaw} {pitch}");
    let [yaw_sigma, pitch_sigma, roll_sigma] =
        [answer.yaw_sigma_rad, answer.pitch_sigma_rad, answer.roll_sigma_rad]
            .map(|sigma| sigma.expect("determined").to_degrees());
    assert!(yaw.abs() < 4.0 * yaw_sigma && pitch.abs() < 4.0 * pitch_sigma, "{yaw_sigma} {pitch_sigma}");
    assert!(roll.abs() < 3.0 * roll_sigma && answer.roll_by_ground.is_some(), "{roll} {roll_sigma}");
    let (height_m, sigma_m) = (answer.height_m.expect("height"), answer.height_sigma_m.expect("height"));
    assert!((height_m - HEIGHT_M).abs() < 3.0 * sigma_m && sigma_m < 0.06, "{height_m} ± {sigma_m}");
    assert_eq!(answer.alarm.expect("an alarm's state").state, "too_short");
}

#[test]
fn vehicle_that_stands_still_is_named() {
    let answer = vehicle_from_frames(frames(6, 0.0), "parked", &request()).expect("an answer");
    assert_eq!(answer.status, Status::Undecided);
    assert!(answer.message.contains("stands still"), "{}", answer.message);
    assert!(answer.yaw_rad.is_none() && answer.undetermined.len() == 3, "{answer:?}");
}

#[test]
fn vehicle_speeds_that_cannot_be_are_refused() {
    let path = std::env::temp_dir().join("resight_vehicle_speed.csv");
    std::fs::write(&path, "t_s,speed_m_s\n0,3.5\n1,400\n").expect("a file");
    let reason = read_speeds(&path).expect_err("too fast").to_string();
    assert!(reason.contains("400") && reason.contains("m/s"), "{reason}");
    let mut unsorted = request();
    unsorted.speeds.swap(1, 2);
    assert!(vehicle_from_frames(frames(2, 1.0), "street", &unsorted).is_err());
}
