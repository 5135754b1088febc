//! The jobs that solve rigs, pose graphs and hand–eye calibrations, called as other programs call them. How exact their answers are is
//! tested in core; what the command line makes of them in cli.

use nalgebra::{DMatrix, DVector};
use resight::core::camera::Pinhole;
use resight::core::multiview::pose_graph::{PairNoise, PairSigma, RelativePose};
use resight::core::statistics::SplitMix64;
use resight::core::{Camera, CameraMatrix, Lens, Matrix6, Point, Pose, Vector6};
use resight::formats::NamedCamera;
use resight::intrinsics::{IntrinsicsRequest, IntrinsicsSource, Models};
use resight::rig::pairs::PairFile;
use resight::rig::{
    CameraDistance, CameraImage, DetectionRow, Detections, FrameTimes, HandEyeRequest, HandEyeViews,
    ImageOptions, KeptDetections, ObservedRig, PoseGraphRequest, RigRequest, RobotFile, RobotPose,
    read_robot_file,
};
use resight::rig_pose::{KnownCamera, RigPoseRequest, read_rig_points, rig_poses};
use resight::{Error, GrayImage, HandEyeAnswer, RigAnswer, Status};
use serde_json::Value;
use std::path::{Path, PathBuf};

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata").join(file)
}

fn two_cameras() -> RigRequest {
    let mut request = RigRequest::default();
    request.read_camera(None, data("rig/cameras.toml")).unwrap();
    request
}

/// The shipped detections, cell by cell.
fn cells() -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(data("rig/detections.csv")).unwrap();
    text.lines().skip(1).map(|line| line.split(',').map(str::to_string).collect()).collect()
}

fn rows(cells: &[Vec<String>]) -> Vec<DetectionRow<'_>> {
    let number = |text: &String| text.parse().unwrap();
    let row = |c: &'_ Vec<String>| -> (f64, f64, f64, f64, f64, f64) {
        (number(&c[3]), number(&c[4]), number(&c[5]), number(&c[6]), number(&c[7]), number(&c[8]))
    };
    let rows = cells.iter().map(|c| {
        let (x, y, z, u, v, sigma) = row(c);
        DetectionRow {
            camera: &c[0],
            view: &c[1],
            id: Some(&c[2]),
            position_m: Some([x, y, z]),
            image_px: [u, v],
            sigma_px: Some(sigma),
            ..DetectionRow::default()
        }
    });
    rows.collect()
}

fn json(answer: &RigAnswer) -> Value {
    serde_json::to_value(answer).unwrap()
}

fn reason<T>(result: Result<T, Error>) -> String {
    result.err().expect("a request that is refused").to_string()
}

/// Two doors, one answer: rows in memory and the file that they stand in. Without a command line and without files to name, the answer
/// names none.
#[test]
fn rows_and_files_give_the_same_rig() {
    let files = [data("rig/detections.csv")];
    let from_files = resight::rig_from_detections(&Detections::files(&files), &two_cameras()).unwrap();
    let cells = cells();
    let from_rows = resight::rig_from_detections(&Detections::rows(&rows(&cells)), &two_cameras()).unwrap();
    let (mut a, mut b) = (json(&from_files), json(&from_rows));
    assert_eq!(a["status"], "ok");
    assert_eq!(a["inputs"].as_array().unwrap().len(), 2);
    assert_eq!(b["inputs"].as_array().unwrap().len(), 1);
    assert!(b.get("command").is_none() && b.get("joint_covariance").is_none());
    a["inputs"] = Value::Null;
    b["inputs"] = Value::Null;
    assert_eq!(a, b);
    let request = RigRequest {
        command: Some("resight rig".into()),
        joint_covariance: true,
        reference: Some("right".into()),
        ..two_cameras()
    };
    let answer = json(&resight::rig_from_detections(&Detections::rows(&rows(&cells)), &request).unwrap());
    assert_eq!((&answer["command"], &answer["reference"]), (&"resight rig".into(), &"right".into()));
    assert_eq!(answer["joint_covariance"]["matrix"].as_array().unwrap().len(), 12);
}

/// Rows that are equal to the last digit are one observation, and the answer says so.
#[test]
fn equal_detections_count_once() {
    let (cells, doubled) = (cells(), [cells(), cells()].concat());
    let [once, twice] = [&cells, &doubled].map(|cells| {
        json(&resight::rig_from_detections(&Detections::rows(&rows(cells)), &two_cameras()).unwrap())
    });
    assert_eq!((&once["status"], &once["cameras"]), (&"ok".into(), &twice["cameras"]));
    let observed = ObservedRig::from_detections(&Detections::rows(&rows(&doubled)), &two_cameras()).unwrap();
    let (n, remarks) = (cells.len(), observed.remarks.join("; "));
    assert!(remarks.contains(&format!("{n} of {} rows repeat another", 2 * n)), "{remarks}");
}

/// The simulated right camera is where the file's truth says, within four of the answer's own standard deviations.
#[test]
fn the_shipped_rig_is_found() {
    let files = [data("rig/detections.csv")];
    let answer = resight::rig_from_detections(&Detections::files(&files), &two_cameras()).unwrap();
    let right = &answer.solved().unwrap().run.solution.cameras[1];
    let truth = Pose {
        translation: Point::new(-0.12, 0.002, 0.01),
        ..Pose::exp(&Vector6::new(0.02, 0.15, 0.01, 0.0, 0.0, 0.0))
    };
    let off = (truth * right.cam_from_rig.inverse()).log();
    for k in 0..6 {
        let sigma = right.covariance[(k, k)].sqrt();
        assert!(off[k].abs() < 4.0 * sigma, "{k}: {} ± {sigma}", off[k]);
    }
}

/// What cannot be solved is an answer; what was asked wrongly is an error that says which word was wrong.
#[test]
fn refusals_and_wrong_requests_stay_apart() {
    let cells = cells();
    let all = rows(&cells);
    let left: Vec<DetectionRow> = all.iter().filter(|row| row.camera == "left").copied().collect();
    let answer = resight::rig_from_detections(&Detections::rows(&left), &two_cameras()).unwrap();
    assert_eq!(answer.status(), Status::NotConnected);
    assert_eq!(json(&answer)["groups"], serde_json::json!([["left"], ["right"]]));
    assert!(answer.solved().is_none());

    let ask = |request: RigRequest| reason(resight::rig_from_detections(&Detections::rows(&all), &request));
    assert!(ask(RigRequest::default()).contains("no camera is given"));
    let named = |name: &str| Some(name.to_string());
    assert!(ask(RigRequest { reference: named("rihgt"), ..two_cameras() }).contains("did you mean `right`?"));
    assert!(ask(RigRequest { world: named("wall"), ..two_cameras() }).contains("no target `wall`"));
    let distance = |b: &str, distance_m| {
        let distance = CameraDistance { a: "left".into(), b: b.into(), distance_m, sigma_m: 1e-4 };
        ask(RigRequest { known_distances: vec![distance], ..two_cameras() })
    };
    assert!(distance("left", 0.1).contains("a distance is between two"));
    assert!(distance("right", f64::NAN).contains("positive numbers"));
    assert!(ask(RigRequest { sync_tolerance_s: Some(-1.0), ..two_cameras() }).contains("positive"));
    let mut twice = two_cameras();
    twice.cameras.push(twice.cameras[0].clone());
    assert!(ask(twice).contains("two cameras are called `left`"));
}

/// One axis in millimetres for one of two cameras leaves no rig, and the message names it.
#[test]
fn a_rig_without_a_solution_names_the_usual_fault() {
    let mut cells = cells();
    for row in cells.iter_mut().filter(|row| row[0] == "right") {
        row[4] = (1e3 * row[4].parse::<f64>().unwrap()).to_string();
    }
    let answer = resight::rig_from_detections(&Detections::rows(&rows(&cells)), &two_cameras()).unwrap();
    assert_eq!(answer.status(), Status::Error);
    let message = json(&answer)["message"].to_string();
    assert!(message.contains("the points agree for right with y divided by 1000"), "{message}");
}

/// Two cameras lose the views in which they disagree in turn, so that neither loses many: what tears them apart is a contradiction, however few
/// views they share.
#[test]
fn cameras_that_agree_in_one_view_alone_are_inconsistent() {
    for views in 2..=5 {
        for (fault, change) in [
            ("no fault", (|_| ()) as fn(&mut Vec<String>)),
            ("y reversed", |row| row[4] = format!("-{}", row[4])),
            ("x reversed", |row| row[3] = format!("-{}", row[3])),
            ("x and y exchanged", |row| row.swap(3, 4)),
        ] {
            let mut cells = cells();
            cells.retain(|row| row[1].parse::<usize>().unwrap() <= views);
            cells.iter_mut().filter(|row| row[0] == "right").for_each(change);
            let answer =
                resight::rig_from_detections(&Detections::rows(&rows(&cells)), &two_cameras()).unwrap();
            let is_right = fault == "no fault";
            assert_eq!(
                answer.status() == Status::Ok,
                is_right,
                "{fault}, {views} views: {}",
                json(&answer)["message"]
            );
        }
    }
}

/// A row is named by its number, a point that comes twice by its name: nothing bad gets as far as the solver.
#[test]
fn wrong_rows_are_named() {
    let cells = cells();
    let refused = |change: &dyn Fn(&mut DetectionRow)| {
        let mut rows = rows(&cells);
        change(&mut rows[6]);
        reason(resight::rig_from_detections(&Detections::rows(&rows), &two_cameras()))
    };
    let text = refused(&|row| row.camera = "middle");
    assert!(text.starts_with("detection 7: camera is `middle`: there is no camera"), "{text}");
    for (wrong, change) in [
        ("u_px is NaN", (|row| row.image_px[0] = f64::NAN) as fn(&mut DetectionRow)),
        ("z_m is 1e300", |row| row.position_m = Some([0.0, 0.0, 1e300])),
        ("sigma_px is 0", |row| row.sigma_px = Some(0.0)),
        ("sigma_m is -1", |row| row.sigma_m = Some(-1.0)),
        ("view is empty", |row| row.view = ""),
        ("t_s is inf", |row| row.t_s = Some(f64::INFINITY)),
        ("target is `target`, of which no", |row| row.position_m = None),
    ] {
        let text = refused(&change);
        assert!(text.starts_with(&format!("detection 7: {wrong}")), "{text}");
    }
    assert!(refused(&|row| row.id = Some("5")).contains("point 5 of target target is there twice"));
}

/// Images in memory and images of files are the same rig; frame times pair frames whose names differ.
#[test]
fn images_of_any_source_give_the_same_rig() {
    let mut request = RigRequest::default();
    request.read_target(Some("grid"), data("demo/grid.toml")).unwrap();
    for camera in ["left", "right"] {
        let file = data(&format!("demo/{camera}.toml"));
        request.read_camera(Some(camera), file).unwrap();
    }
    let image = |camera: &str| data(&format!("demo/{camera}.png"));
    let in_memory = ["left", "right"]
        .map(|camera| CameraImage::in_memory(camera, "1", GrayImage::read(image(camera)).unwrap()));
    let memory = resight::rig_from_images(&in_memory, &ImageOptions::default(), &request).unwrap();
    assert_eq!(memory.status(), Status::Ok);

    let files = ["left", "right"].map(|camera| CameraImage::file(camera, image(camera)));
    let apart = resight::rig_from_images(&files, &ImageOptions::default(), &request).unwrap();
    assert_eq!(apart.status(), Status::NotConnected, "left.png and right.png are two views");

    let mut times = FrameTimes::default();
    assert!(times.insert("left", "left", 10.0) && times.insert("right", "right", 10.004));
    let options = ImageOptions { times: Some(times.clone()), ..ImageOptions::default() };
    let timed = RigRequest { sync_tolerance_s: Some(0.01), ..request.clone() };
    let found = resight::rig_from_images(&files, &options, &timed).unwrap();
    let places = |answer: &RigAnswer| answer.solved().unwrap().run.solution.cameras.clone();
    assert_eq!(places(&found), places(&memory));

    assert!(!times.insert("left", "left", 11.0), "a second time of one frame");
    times.insert("middle", "left", 10.0);
    let options = ImageOptions { times: Some(times), ..ImageOptions::default() };
    assert!(reason(resight::rig_from_images(&files, &options, &timed)).contains("no camera `middle`"));
    let stranger = [CameraImage::file("middle", image("left"))];
    let text = reason(resight::rig_from_images(&stranger, &ImageOptions::default(), &request));
    assert!(text.contains("no camera `middle`"), "{text}");
}

/// What is kept is what a search finds, to the last bit; another program, target or image is searched, and so is one whose entry is damaged.
#[test]
fn kept_detections_are_those_of_a_search() {
    let folder = std::env::temp_dir().join(format!("resight_kept_{}", std::process::id()));
    let entries = || {
        let all = std::fs::read_dir(&folder).into_iter().flatten().flatten();
        all.map(|entry| entry.path()).collect::<std::collections::BTreeSet<_>>()
    };
    let observed = |target: &str, program: Option<&str>| {
        let mut request = RigRequest::default();
        request.read_target(Some("grid"), data(target)).unwrap();
        request.read_camera(Some("left"), data("demo/left.toml")).unwrap();
        let kept = program.map(|program| KeptDetections::new(&folder, program));
        let options = ImageOptions { kept, ..ImageOptions::default() };
        let images = [
            CameraImage::file("left", data("demo/left.png")),
            CameraImage::file("left", data("demo/right.png")),
        ];
        format!("{:?}", ObservedRig::from_images(&images, &options, &request).unwrap())
    };
    let searched = observed("demo/grid.toml", None);
    assert_eq!(observed("demo/grid.toml", Some("1")), searched);
    let kept = entries();
    assert_eq!(kept.len(), 2);
    assert_eq!((observed("demo/grid.toml", Some("1")), entries()), (searched.clone(), kept.clone()));
    observed("demo/grid.toml", Some("2"));
    observed("demo/dots.toml", Some("1"));
    assert_eq!(entries().len(), 6);

    // An entry is what is read; one that is cut off is made again.
    let entry = kept.iter().next().unwrap();
    let whole = std::fs::read_to_string(entry).unwrap();
    let mut other: Value = serde_json::from_str(&whole).unwrap();
    other["targets"] = serde_json::json!([{ "Err": "kept" }]);
    std::fs::write(entry, other.to_string()).unwrap();
    assert!(observed("demo/grid.toml", Some("1")).contains("kept"));
    std::fs::write(entry, &whole[..whole.len() / 2]).unwrap();
    assert_eq!(observed("demo/grid.toml", Some("1")), searched);
    assert_eq!(std::fs::read_to_string(entry).unwrap(), whole);
    std::fs::remove_dir_all(&folder).unwrap();
}

fn shift(x_m: f64) -> Pose {
    Pose { translation: Point::new(x_m, 0.0, 0.0), ..Pose::identity() }
}

fn pair(a: usize, b: usize, x_m: f64) -> RelativePose {
    RelativePose { a, b, b_from_a: shift(x_m), noise: PairNoise::Error(1.0) }
}

/// A pair of cameras that are not there, a sigma that is none: errors, not panics. Cameras that no pair joins: an answer.
#[test]
fn pose_graphs_check_what_they_are_given() {
    let request = |pairs: Vec<RelativePose>| {
        let cameras = ["a", "b", "c", "d"].map(String::from).to_vec();
        PoseGraphRequest::new(PairFile { cameras, pairs })
    };
    assert!(reason(resight::pose_graph(&request(vec![]))).contains("no pair"));
    assert!(reason(resight::pose_graph(&request(vec![pair(0, 4, 1.0)]))).contains("of which there are 4"));
    let all = vec![pair(0, 1, 1.0), pair(1, 2, 1.0), pair(0, 2, 2.001), pair(2, 3, 1.0)];
    for sigma_rad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let median_sigma = Some(PairSigma { sigma_rad, sigma_m: 1e-3 });
        let text = reason(resight::pose_graph(&PoseGraphRequest { median_sigma, ..request(all.clone()) }));
        assert!(text.contains("positive numbers"), "{text}");
    }
    let mut torn = all.clone();
    torn[1].b_from_a.translation.x = f64::NAN;
    assert_eq!(resight::pose_graph(&request(torn)).unwrap().status(), Status::Error, "no NaN comes out");
    let apart = resight::pose_graph(&request(vec![pair(0, 1, 1.0), pair(2, 3, 1.0)])).unwrap();
    assert_eq!(apart.status(), Status::NotConnected);
    let found = resight::pose_graph(&request(all)).unwrap();
    let solved = found.solved().unwrap();
    assert_eq!((found.status(), solved.agreements().len()), (Status::Ok, 4));
    assert!((solved.cam_from_rig[3].0.translation.x - 3.0).abs() < 0.01);
    let value = serde_json::to_value(&found).unwrap();
    assert!(value.get("joint_covariance").is_none());
    assert_eq!(value["pairs"][2]["residual_m"].as_f64(), Some(solved.agreements()[2].residual_m));
}

/// The mounting is where the simulation put it; an answer on a rig that contradicts itself is never called ok, whatever the views say.
#[test]
fn hand_eye_is_no_better_than_its_rig() {
    let mut request = RigRequest::default();
    request.read_camera(Some("cam"), data("hand_eye/camera.toml")).unwrap();
    let files = [data("hand_eye/detections.csv")];
    let observed = ObservedRig::from_detections(&Detections::files(&files), &request).unwrap();
    let robot = read_robot_file(data("hand_eye/motions.csv"), &Default::default(), None).unwrap().robot;
    let views = HandEyeViews::Points(Box::new(observed));
    let config = Default::default();
    let request = HandEyeRequest { robot, views, config, remarks: Vec::new() };
    let mut torn = request.clone();
    torn.robot[3].base_from_gripper.translation.y = f64::INFINITY;
    assert_eq!(resight::hand_eye(torn).unwrap().status(), Status::Error, "no NaN comes out");
    let mut strange = request.clone();
    strange.robot.iter_mut().for_each(|pose| pose.view.as_mut().unwrap().push_str("-other"));
    let strange = resight::hand_eye(strange).unwrap();
    assert_eq!(strange.status(), Status::Degenerate);
    let why = serde_json::to_value(&strange).unwrap()["message"].to_string();
    assert!(why.contains("18 views took no part") && why.contains("no row of the motions"), "{why}");
    let answer = resight::hand_eye(request).unwrap();
    assert_eq!(answer.status(), Status::Ok);
    let HandEyeAnswer::Solved(mut solved) = answer else { panic!("{answer:?}") };
    let truth = Pose {
        translation: Point::new(0.03, -0.05, 0.08),
        ..Pose::exp(&Vector6::new(0.2, -0.1, 1.2, 0.0, 0.0, 0.0))
    };
    let off = (truth * solved.solution.cam_from_carrier.inverse()).log();
    assert!((0..6).all(|k| off[k].abs() < 4.0 * solved.solution.carrier_covariance[(k, k)].sqrt()), "{off}");

    solved.rig_contradiction = Some("left does not agree with right".into());
    let value = serde_json::to_value(&solved).unwrap();
    assert_eq!((solved.status(), &value["status"]), (Status::Inconsistent, &"inconsistent".into()));
    assert!(value["message"].as_str().unwrap().contains("left does not agree with right"), "{value}");
}

/// Cameras, detections and robot poses of a rig of two on a gripper: each lens off by a draw from its covariance, all else exact but 0.3 px
/// of noise.
struct RigOnGripper {
    chance: SplitMix64,
    /// Standard deviations of f and of the principal point, px.
    sigma_px: [f64; 2],
}

/// Of the rig on the gripper, and of the board in the base.
fn mounting() -> [Pose; 2] {
    let at = |w: [f64; 3], t: [f64; 3]| Pose {
        translation: Point::from(t),
        ..Pose::exp(&Vector6::new(w[0], w[1], w[2], 0.0, 0.0, 0.0))
    };
    [at([0.1, -0.2, 0.4], [0.03, -0.05, 0.08]), at([0.1, 0.05, 0.2], [0.2, -0.1, 0.0])]
}

impl RigOnGripper {
    /// Log of the answer's two poses from the truth, and the joint covariance.
    fn solved(&mut self, stated: bool) -> (DVector<f64>, DMatrix<f64>) {
        let [cam_from_gripper, base_from_board] = mounting();
        let second = Pose::exp(&Vector6::new(0.02, -0.3, 0.01, -0.25, 0.01, 0.04));
        let [f_sigma, c_sigma] = self.sigma_px;
        let (mut request, mut took) = (RigRequest::default(), Vec::new());
        for name in ["a", "b"] {
            let matrix = CameraMatrix { fx_px: 800.0, fy_px: 800.0, cx_px: 639.5, cy_px: 479.5 };
            let camera = Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None };
            let f = f_sigma * self.chance.normal();
            let by = [f, f, c_sigma * self.chance.normal(), c_sigma * self.chance.normal()];
            let values: Vec<f64> = camera.parameters().iter().zip(by).map(|(p, by)| p.1 + by).collect();
            took.push(camera.with_parameters(&values).unwrap());
            let (f, c) = (f_sigma * f_sigma, c_sigma * c_sigma);
            let rows = [f, f, 0.0, 0.0, f, f, 0.0, 0.0, 0.0, 0.0, c, 0.0, 0.0, 0.0, 0.0, c];
            request.cameras.push(NamedCamera {
                name: name.into(),
                camera,
                placement: None,
                intrinsics_covariance: stated.then(|| DMatrix::from_row_slice(4, 4, &rows)),
            });
        }
        let (mut robot, mut cells) = (Vec::new(), Vec::new());
        for view in 0..8 {
            let k = f64::from(view);
            // The board as the first camera sees it: tilted to all sides, half a metre to one metre away.
            let cam_from_board = Pose {
                translation: Point::new(0.08 * (1.3 * k).sin(), 0.06 * (2.1 * k).cos(), 0.75 + 0.2 * k.sin()),
                ..Pose::exp(&Vector6::new(
                    0.5 * (0.9 * k).cos(),
                    0.5 * (1.7 * k).sin(),
                    0.6 * k.sin(),
                    0.0,
                    0.0,
                    0.0,
                ))
            };
            let base_from_gripper = base_from_board * cam_from_board.inverse() * cam_from_gripper;
            robot.push(RobotPose {
                view: Some(view.to_string()),
                base_from_gripper,
                written: None,
                covariance: Some(Matrix6::zeros()),
            });
            for (name, (lens, place)) in ["a", "b"].iter().zip(took.iter().zip([Pose::identity(), second])) {
                for i in 0..12 {
                    let x = Point::new(0.06 * f64::from(i % 4) - 0.09, 0.07 * f64::from(i / 4) - 0.07, 0.0);
                    let pixel = lens.project(&(place * cam_from_board * x)).unwrap();
                    let noise = [self.chance.normal(), self.chance.normal()].map(|n| 0.3 * n);
                    let image = [pixel.x + noise[0], pixel.y + noise[1]];
                    cells.push((*name, view.to_string(), i.to_string(), x, image));
                }
            }
        }
        let rows: Vec<DetectionRow> =
            cells.iter().map(|(camera, view, id, x, image)| detection(camera, view, id, x, *image)).collect();
        let observed = ObservedRig::from_detections(&Detections::rows(&rows), &request).unwrap();
        let views = HandEyeViews::Points(Box::new(observed));
        let answer = resight::hand_eye(HandEyeRequest {
            robot,
            views,
            config: Default::default(),
            remarks: Vec::new(),
        })
        .unwrap();
        let HandEyeAnswer::Solved(solved) = answer else { panic!("{answer:?}") };
        let found = &solved.solution;
        let off = |found: &Pose, truth: Pose| (*found * truth.inverse()).log();
        let camera = off(&found.cam_from_carrier, cam_from_gripper);
        let board = off(&found.holder_from_target, base_from_board);
        let both = DVector::from_iterator(12, camera.iter().chain(&board).copied());
        (both, found.joint_covariance.clone())
    }
}

fn detection<'a>(
    camera: &'a str,
    view: &'a str,
    id: &'a str,
    x: &Point,
    image_px: [f64; 2],
) -> DetectionRow<'a> {
    let position_m = Some([x.x, x.y, x.z]);
    let sigma_px = Some(0.3);
    DetectionRow { camera, view, id: Some(id), position_m, image_px, sigma_px, ..DetectionRow::default() }
}

/// Lenses off by a draw from the covariance that their files state, one for all views: the mounting of a rig lies within its ± as often as it
/// should, and far outside it where the lenses are taken as exact. `RESIGHT_SCENES` asks for more rigs.
#[test]
fn hand_eye_of_a_rig_holds_what_its_lenses_do() {
    let n: usize = std::env::var("RESIGHT_SCENES").ok().and_then(|n| n.parse().ok()).unwrap_or(8);
    let mean = |stated: bool, n: usize| {
        let mut rigs = RigOnGripper { chance: SplitMix64::new(5), sigma_px: [2.0, 1.5] };
        let nees = |_| {
            let (off, covariance) = rigs.solved(stated);
            0.5 * off.dot(&covariance.cholesky().expect("positive definite").solve(&off))
        };
        (0..n).map(nees).sum::<f64>() / n as f64
    };
    let (stated, unstated) = (mean(true, n), mean(false, 4));
    println!("NEES of six: {stated:.2} with the lenses' covariance, {unstated:.1} without");
    // Twelve numbers of 8 rigs: 6 ± 0.9 by chance; 0.32 with 60.
    let (least, most) = if n < 60 { (3.4, 8.6) } else { (4.0, 7.0) };
    assert!((least..most).contains(&stated), "{stated}");
    assert!(30.0 < unstated, "{unstated}");
}

/// Factors on the lengths of the shipped boards of 0.15 m: a microscope's slide, the board itself, a mast of 20 m, marks of a pitch of 120 m,
/// all of which exist, and a board of 0.3 m in millimetres.
const EXTENTS: [(f64, Status); 5] = [
    (1e-3, Status::Ok),
    (1.0, Status::Ok),
    (400.0 / 3.0, Status::Ok),
    (800.0, Status::Ok),
    (2000.0, Status::Implausible),
];

/// The shipped detections of a job with all positions multiplied.
fn scaled(job: &str, factor: f64) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(data(&format!("{job}/detections.csv"))).unwrap();
    let row = |line: &str| {
        let mut cells: Vec<String> = line.split(',').map(str::to_string).collect();
        for cell in &mut cells[3..6] {
            *cell = (factor * cell.parse::<f64>().unwrap()).to_string();
        }
        cells
    };
    text.lines().skip(1).map(row).collect()
}

/// A rig of any size that exists is `ok`; one whose board hardly exists is not, nor is any of its cameras, nor the file of the rig.
#[test]
fn a_rig_from_a_board_that_hardly_exists_is_implausible() {
    for (factor, status) in EXTENTS {
        let cells = scaled("rig", factor);
        let answer = resight::rig_from_detections(&Detections::rows(&rows(&cells)), &two_cameras()).unwrap();
        let value = json(&answer);
        assert_eq!(answer.status(), status, "× {factor}: {}", value["message"]);
        assert_eq!((&value["status"], &value["contradiction"]), (&status.name().into(), &Value::Null));
        assert_eq!(value["cameras"]["left"]["status"], status.name());
        assert_eq!(value["message"].as_str().unwrap().contains("in millimetres ("), status != Status::Ok);
        let solved = answer.solved().unwrap();
        let file = solved.file().unwrap();
        assert!(file.starts_with(&format!("status = \"{}\"", status.name())), "{file}");
        let path = std::env::temp_dir().join(format!("resight-sizes-{}-{factor}.toml", std::process::id()));
        std::fs::write(&path, file).unwrap();
        let read = resight::formats::read_cameras(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        assert_eq!(read.contradiction, None);
        let is_said = read.warnings.iter().any(|warning| warning.contains("implausible"));
        assert_eq!(is_said, status != Status::Ok, "{:?}", read.warnings);
        let page = resight::report::rig_page(&solved.run);
        assert_eq!(page.contains("are they in millimetres ("), status != Status::Ok);
    }
}

/// So is the mounting of a camera on a robot whose positions are in the unit of the board. A robot whose positions alone hardly exist is implausible too.
#[test]
fn a_mounting_in_lengths_that_hardly_exist_is_implausible() {
    let solve = |factor: f64, round: bool| {
        let mut request = RigRequest::default();
        request.read_camera(Some("cam"), data("hand_eye/camera.toml")).unwrap();
        let cells = scaled("hand_eye", factor);
        let observed = ObservedRig::from_detections(&Detections::rows(&rows(&cells)), &request).unwrap();
        let RobotFile { mut robot, remarks, .. } =
            read_robot_file(data("hand_eye/motions.csv"), &Default::default(), None).unwrap();
        for pose in &mut robot {
            pose.base_from_gripper.translation *= factor;
            if round {
                pose.base_from_gripper.translation.apply(|x| *x = (10.0 * *x).round() / 10.0);
            }
            let scale = Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, factor, factor, factor));
            // A stated noise of decimetres would explain round positions in metres.
            pose.covariance = pose.covariance.filter(|_| !round).map(|c| scale * c * scale);
        }
        let views = HandEyeViews::Points(Box::new(observed));
        resight::hand_eye(HandEyeRequest { robot, views, config: Default::default(), remarks }).unwrap()
    };
    for (factor, status) in EXTENTS {
        let answer = solve(factor, false);
        let value = serde_json::to_value(&answer).unwrap();
        assert_eq!(answer.status(), status, "× {factor}: {}", value["message"]);
        assert_eq!(value["status"], status.name());
        assert_eq!(value["message"].as_str().unwrap().contains("in millimetres ("), status != Status::Ok);
    }
    // The robot's positions in tenths of a millimetre; this board is not round.
    let robot_alone = solve(999.9, true);
    let message = serde_json::to_value(&robot_alone).unwrap()["message"].to_string();
    assert_eq!(robot_alone.status(), Status::Implausible, "{message}");
    assert!(message.contains("motions: the points lie over"), "{message}");
}

/// The intrinsics do not depend on the board's size: they are returned, and the same, while the status says what the poses depend on.
#[test]
fn intrinsics_from_a_board_that_hardly_exists_are_implausible() {
    let mut focal_px = Vec::new();
    for (factor, status) in EXTENTS {
        let cells = scaled("hand_eye", factor);
        let rows = rows(&cells);
        let size = resight::core::camera::ImageSize { width_px: 640, height_px: 480 };
        let source = IntrinsicsSource::Detections { detections: Detections::rows(&rows), size };
        let request =
            IntrinsicsRequest { models: Models::Named("pinhole"), ..IntrinsicsRequest::new(source) };
        let answer = resight::intrinsics(&request).unwrap();
        assert_eq!(
            (answer.status, answer.cameras[0].status),
            (status, status),
            "{}",
            answer.cameras[0].message
        );
        assert_eq!(answer.cameras[0].message.contains("in millimetres ("), status != Status::Ok);
        focal_px.push(answer.reliable()[0].camera.parameters()[0].1);
    }
    assert!(focal_px.iter().all(|f| (f - focal_px[0]).abs() < 1e-3 * f), "{focal_px:?}");
}

/// A table of motions with semicolons says so in the answer, not only on the terminal.
#[test]
fn how_the_motions_are_read_is_in_the_answer() {
    let folder = std::env::temp_dir().join(format!("resight-motions-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let text = std::fs::read_to_string(data("hand_eye/motions.csv")).unwrap();
    for (mark, n) in [(",", 0), (";", 1)] {
        let path = folder.join("motions.csv");
        let lines: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
        std::fs::write(&path, lines.join("\n").replace(',', mark)).unwrap();
        let RobotFile { robot, remarks, .. } = read_robot_file(&path, &Default::default(), None).unwrap();
        let mut request = RigRequest::default();
        request.read_camera(Some("cam"), data("hand_eye/camera.toml")).unwrap();
        let files = [data("hand_eye/detections.csv")];
        let observed = ObservedRig::from_detections(&Detections::files(&files), &request).unwrap();
        let views = HandEyeViews::Points(Box::new(observed));
        let answer =
            resight::hand_eye(HandEyeRequest { robot, views, config: Default::default(), remarks }).unwrap();
        let value = serde_json::to_value(&answer).unwrap();
        let said = value["remarks"].as_array().unwrap();
        assert_eq!((answer.status(), said.len()), (Status::Ok, n), "{said:?}");
        assert!(said.iter().all(|text| text.as_str().unwrap().contains("separated by semicolons")));
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

/// Two cameras above six marks of a floor: with x and y exchanged the rig is as far below them, and fits as well; a table with semicolons is
/// remarked on.
#[test]
fn a_rig_below_points_of_one_level_is_remarked_on() {
    let matrix = CameraMatrix { fx_px: 900.0, fy_px: 900.0, cx_px: 640.0, cy_px: 480.0 };
    let lens = Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None };
    let known = |(name, x_m): (&str, f64)| KnownCamera {
        named: NamedCamera {
            name: name.into(),
            camera: lens.clone(),
            placement: None,
            intrinsics_covariance: None,
        },
        cam_from_rig: Pose { translation: Point::new(x_m, 0.0, 0.0), ..Pose::identity() },
        covariance: None,
    };
    let rig: Vec<KnownCamera> = [("a", 0.0), ("b", -0.5)].map(known).into();
    let rig_from_floor = Pose {
        rotation: nalgebra::Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, -1.0, -1.0)),
        translation: Point::new(0.1, 0.2, 4.0),
    };
    let floor = [[0.0, 0.0], [1.5, 0.1], [1.4, 1.2], [-0.3, 0.9], [0.6, 0.5], [0.9, -0.4]];
    let path = std::env::temp_dir().join(format!("resight-floor-{}.csv", std::process::id()));
    let solve = |exchanged: bool, mark: &str| {
        let mut text = "camera,x_m,y_m,z_m,u_px,v_px\n".to_string();
        for camera in &rig {
            for [x, y] in floor {
                let seen = camera.cam_from_rig * rig_from_floor * Point::new(x, y, 0.0);
                let pixel = lens.project(&seen).unwrap();
                let [x, y] = if exchanged { [y, x] } else { [x, y] };
                text += &format!("{},{x},{y},0,{},{}\n", camera.named.name, pixel.x, pixel.y);
            }
        }
        std::fs::write(&path, text.replace(',', mark)).unwrap();
        let views = read_rig_points(&path, &rig).unwrap();
        rig_poses(&rig, &views, &RigPoseRequest::default()).remove(0)
    };
    let right = solve(false, ",");
    assert_eq!((right.status, right.remarks.len()), (Status::Ok, 0), "{:?}", right.remarks);
    let below = solve(true, ";");
    assert_eq!((below.status, below.remarks.len()), (Status::Ok, 2), "{:?}", below.remarks);
    assert!(below.remarks[0].contains("separated by semicolons"), "{:?}", below.remarks);
    assert!(below.remarks[1].contains("the rig is 4.00 m below the points"), "{:?}", below.remarks);
    std::fs::remove_file(&path).unwrap();
}
