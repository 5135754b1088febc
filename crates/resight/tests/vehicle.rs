//! A camera on a vehicle, from rendered images of a street: ground and facades, a body that pitches.

use crate::vehicle_support::{FRAME_S, HEIGHT_M, MOUNTED, SPEED_M_S, camera, drive};
use resight::GrayImage;
use resight::answer::{Status, VehicleAnswer};
use resight::core::Camera;
use resight::locate::IntrinsicsCovariance;
use resight::vehicle::{
    SpeedSample, VehicleFrame, VehicleRequest, describe, read_speeds, vehicle_from_frames,
};
use std::collections::BTreeMap;

/// Twelve seconds: 41 frames.
const FRAMES: usize = 41;

fn frames(images: impl IntoIterator<Item = GrayImage>) -> Vec<Result<VehicleFrame, resight::Error>> {
    let frame = |(i, image)| Ok(VehicleFrame { t_s: i as f64 * FRAME_S, image });
    images.into_iter().enumerate().map(frame).collect()
}

fn request() -> VehicleRequest {
    let speed = |i: usize| SpeedSample { t_s: i as f64, speed_m_s: SPEED_M_S };
    VehicleRequest { every_s: FRAME_S, speeds: (0..40).map(speed).collect(), ..VehicleRequest::new(camera()) }
}

fn solved(images: impl IntoIterator<Item = GrayImage>, request: &VehicleRequest) -> VehicleAnswer {
    vehicle_from_frames(frames(images), "street", request).expect("an answer")
}

/// Yaw, pitch, roll less the truth, degrees.
fn off(answer: &VehicleAnswer) -> [f64; 3] {
    let found = [answer.yaw_rad, answer.pitch_rad, answer.roll_rad];
    [0, 1, 2].map(|i| (found[i].expect("determined") - MOUNTED[i]).to_degrees())
}

/// The mounting is found, and a principal point that is uncertain by 3 px shifts yaw by 3 px over the focal length, wholly: the part `lens` of the
/// budget says so, and the same drive with another principal point does so.
#[test]
fn vehicle_rendered_street_gives_the_mounting_and_what_the_lens_adds() {
    let by_name = BTreeMap::from([("cx_px".to_string(), 3.0)]);
    let intrinsics = Some(IntrinsicsCovariance::independent(&by_name, &camera()).expect("a covariance"));
    let answer = solved(drive(FRAMES), &VehicleRequest { intrinsics, ..request() });
    println!("{}", describe(&answer));
    assert_eq!(answer.status, Status::Ok, "{}", answer.message);
    let [yaw, pitch, roll] = off(&answer);
    println!("off by {yaw:.3}° {pitch:.3}° {roll:.3}°");
    assert!(yaw.abs() < 0.05 && pitch.abs() < 0.1, "{yaw} {pitch}");
    let [pitch_sigma, roll_sigma] =
        [answer.pitch_sigma_rad, answer.roll_sigma_rad].map(|sigma| sigma.expect("determined").to_degrees());
    assert!(pitch.abs() < 4.0 * pitch_sigma, "{pitch_sigma}");
    assert!(roll.abs() < 3.0 * roll_sigma && answer.roll_by_ground.is_some(), "{roll} {roll_sigma}");
    let (height_m, sigma_m) = (answer.height_m.expect("height"), answer.height_sigma_m.expect("height"));
    assert!((height_m - HEIGHT_M).abs() < 3.0 * sigma_m && sigma_m < 0.06, "{height_m} ± {sigma_m}");
    assert_eq!(answer.alarm.as_ref().expect("an alarm's state").state, "too_short");

    let shift = 3.0 / 320.0 * MOUNTED[0].cos().powi(2);
    let json = serde_json::to_value(&answer).expect("JSON");
    let lens = json["budget"].as_array().expect("parts").iter().find(|part| part["part"] == "lens");
    let lens = lens.expect("a lens")["sigma"][0].as_f64().expect("a number");
    assert!((lens / shift - 1.0).abs() < 0.1, "{lens} {shift}");
    assert!(answer.remarks.is_empty() && lens < answer.yaw_sigma_rad.expect("determined"));

    let values: Vec<f64> =
        camera().parameters().iter().map(|(name, x)| x + if *name == "cx_px" { 3.0 } else { 0.0 }).collect();
    let moved: Camera = camera().with_parameters(&values).expect("a camera");
    let other = solved(drive(FRAMES), &VehicleRequest { camera: moved, ..request() });
    let by = other.yaw_rad.expect("determined") - answer.yaw_rad.expect("determined");
    assert!((by / -shift - 1.0).abs() < 0.1, "{by} {shift}");
    assert!(other.remarks.iter().any(|remark| remark.contains("intrinsics_sigma")), "{:?}", other.remarks);
}

/// The lower middle of the image is a truck that drives ahead: other pixels than these alone decide, or nothing does.
#[test]
fn vehicle_behind_a_truck_is_right_or_refused() {
    let truck = drive(1).remove(0);
    let covered = |mut image: GrayImage| {
        let (w, h) = (image.width_px as usize, image.height_px as usize);
        for y in h / 5..h {
            let row = y * w + w / 5..y * w + 4 * w / 5;
            image.data[row.clone()].copy_from_slice(&truck.data[row]);
        }
        image
    };
    let answer = solved(drive(FRAMES).into_iter().map(covered), &request());
    println!("{}", describe(&answer));
    match answer.status {
        Status::Ok => {
            let [yaw, pitch, _] = off(&answer);
            assert!(yaw.abs() < 0.1 && pitch.abs() < 0.15, "{yaw} {pitch}");
        }
        _ => assert!(answer.yaw_rad.is_none() && answer.message.contains("traffic"), "{}", answer.message),
    }
}

/// A camera that stands still while a third of its view drives past.
#[test]
fn vehicle_still_before_traffic_has_no_direction() {
    let still = drive(1).remove(0);
    let w = still.width_px as usize;
    let passing = drive(12).into_iter().map(|moving| {
        let mut image = still.clone();
        for y in 0..image.height_px as usize {
            let row = y * w..y * w + w / 3;
            image.data[row.clone()].copy_from_slice(&moving.data[row]);
        }
        image
    });
    let answer = solved(passing, &request());
    println!("{}", describe(&answer));
    assert!(answer.moving_s == 0.0 && answer.yaw_rad.is_none(), "{answer:?}");
}

#[test]
fn vehicle_names_what_frames_do_not_show() {
    let no_speed = VehicleRequest { speeds: Vec::new(), ..request() };
    let undecided = |images: Vec<GrayImage>, says: &[&str]| {
        let answer = solved(images, &no_speed);
        assert_eq!(answer.status, Status::Undecided);
        assert!(says.iter().all(|word| answer.message.contains(word)), "{}", answer.message);
        assert!(answer.yaw_rad.is_none() && answer.undetermined.len() == 3, "{answer:?}");
        answer
    };
    let [first, second]: [GrayImage; 2] = drive(2).try_into().expect("two frames");
    undecided(vec![first.clone()], &["0 s of motion", "1 frame in 0 s", "longer video"]);
    undecided(vec![first.clone(), second], &["2 frames in 0.3 s", "longer video"]);
    // A frame that is equal to the one before has another time than its image.
    let parked = undecided(vec![first.clone(); 40], &["39 of 40 frames are equal to the one before"]);
    assert!(parked.remarks[0].contains("39 frames of 40"), "{:?}", parked.remarks);
    let flat = |i: usize| GrayImage { data: vec![100 + i as u8; first.data.len()], ..first.clone() };
    undecided((0..40).map(flat).collect(), &["39 of 39", "dark, covered, blurred or empty"]);
    let rotated =
        Camera { size: Some(resight::core::camera::ImageSize { width_px: 320, height_px: 480 }), ..camera() };
    let refused = vehicle_from_frames(frames([first]), "street", &VehicleRequest::new(rotated));
    assert!(refused.expect_err("another size").to_string().contains("rotated by 90°"));
}

#[test]
fn vehicle_speeds_that_cannot_be_are_refused() {
    let path = std::env::temp_dir().join(format!("resight_vehicle_speed_{}.csv", std::process::id()));
    for (rows, named) in [("0,3.5\n1,400\n", "400"), ("0,NaN\n", "NaN"), ("", "no rows")] {
        std::fs::write(&path, format!("t_s,speed_m_s\n{rows}")).expect("a file");
        let reason = read_speeds(&path).expect_err("no speeds").to_string();
        assert!(reason.contains(named), "{reason}");
    }
    std::fs::remove_file(&path).expect("the file");
    let refused = |speeds: Vec<SpeedSample>, n: usize| {
        let answer = vehicle_from_frames(frames(drive(n)), "street", &VehicleRequest { speeds, ..request() });
        answer.expect_err("speeds").to_string()
    };
    let mut unsorted = request().speeds;
    unsorted.swap(1, 2);
    assert!(refused(unsorted, 0).contains("in order of time"));
    assert!(refused(vec![SpeedSample { t_s: f64::NAN, speed_m_s: 1.0 }], 0).contains("numbers"));
    let of_another_clock =
        (0..9).map(|i| SpeedSample { t_s: 1.7e9 + f64::from(i), speed_m_s: 8.0 }).collect();
    let reason = refused(of_another_clock, 3);
    assert!(reason.contains("0 s to 0.6 s") && reason.contains("from the first frame"), "{reason}");
}
