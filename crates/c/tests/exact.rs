//! Every number that reaches C is that of the Rust functions, to the last bit, and every JSON is theirs.

use crate::build::{Library, compiled, folder, root, run, sanitizers};
use resight::answer::RigPoseAnswer;
use resight::core::camera::{BrownConrady, ImageSize};
use resight::core::correspondence::Detection;
use resight::core::locate::choose::Ambiguity;
use resight::core::multiview::rig_pose::RigAmbiguity;
use resight::core::{Camera, CameraMatrix, Matrix6, Point, Pose};
use resight::detect::Detector;
use resight::detect::job::detect_target;
use resight::formats::{self, NamedCamera};
use resight::locate::{ImageLocator, IntrinsicsCovariance, LocateOptions, PointRows, PointsOptions};
use resight::rig_pose::{RigPoint, RigPointsView, RigPoseRequest, read_known_rig, rig_poses};
use resight::{GrayImage, PoseAnswer, Status};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A point, its pixel, sigma_px, sigma_m and its camera.
type Row = [f64; 8];

/// What `exact.c` prints.
#[derive(Default)]
struct Printed(String);

impl Printed {
    fn line(&mut self, line: &str) {
        self.0 += line;
        self.0.push('\n');
    }

    fn numbers<'a>(&mut self, name: &str, numbers: impl IntoIterator<Item = &'a f64>) {
        let mut line = name.to_string();
        for x in numbers {
            write!(line, " {:016x}", x.to_bits()).expect("text");
        }
        self.line(&line);
    }

    fn ended(&mut self, job: &str, status: Status, message: &str, answer: &impl serde::Serialize) {
        self.line(&format!("{job} {} {message}", number(status)));
        self.line(&serde_json::to_string(answer).expect("JSON"));
    }

    fn pose(&mut self, b_from_a: &Pose, covariance: &Matrix6, fit: [f64; 2]) {
        self.numbers("rotation_wxyz", &b_from_a.quaternion_wxyz());
        self.numbers("translation_m", b_from_a.translation.iter());
        self.numbers("matrix", b_from_a.matrix().as_flattened());
        self.numbers("covariance", covariance.transpose().iter());
        self.numbers("fit", &fit);
    }

    fn pose_answer(&mut self, job: &str, answer: &PoseAnswer, found: &[Detection], residuals: &[[f64; 2]]) {
        self.ended(job, answer.status(), &answer.verdict.message, answer);
        if let Some(e) = &answer.estimate {
            self.pose(&e.cam_from_target, &e.covariance, [e.rms_px, e.chi2]);
            if let Ambiguity::Ambiguous { other, .. } = &e.ambiguity {
                self.pose(&other.cam_from_target, &other.covariance, [other.rms_px, other.chi2]);
            }
        }
        for d in found {
            let own = [d.pixel.x, d.pixel.y, d.sigma_px, d.lens_sigma_px];
            self.numbers(&format!("{}.{}", d.feature.id, d.feature.corner), &own);
        }
        self.numbers("residuals", residuals.as_flattened());
    }

    fn rig_pose(&mut self, answer: &RigPoseAnswer) {
        self.ended("rig_pose", answer.status, &answer.message, answer);
        let e = answer.estimate.as_ref().expect("a pose");
        self.pose(&e.rig_from_target, &e.covariance, [e.rms_px, e.chi2]);
        if let RigAmbiguity::Ambiguous { other, .. } = &e.ambiguity {
            self.pose(&other.rig_from_target, &other.covariance, [other.rms_px, other.chi2]);
        }
        self.numbers("residuals", &[]);
    }
}

/// The status of the header.
fn number(status: Status) -> i32 {
    resight_c::status::Status::from(status) as i32
}

/// Points on two planes with errors; the fifth was not observed.
fn points(camera: &Camera, n: usize) -> Vec<Row> {
    let pose = Pose::exp(&[0.2, -0.4, 0.1, 0.02, 0.03, 1.2].into());
    let row = |i: usize| {
        let k = i as f64;
        let x = [0.07 * k - 0.3, 0.07 * ((3 * i) % 5) as f64, 0.05 * (i % 2) as f64];
        let pixel = camera.project(&(pose * Point::from(x))).expect("in front");
        let [u, v] =
            if i == 4 { [f64::NAN; 2] } else { [pixel.x + 0.3 * k.sin(), pixel.y + 0.3 * (2.0 * k).cos()] };
        [x[0], x[1], x[2], u, v, 0.3 + 0.01 * k, 1e-4 * k, 0.0]
    };
    (0..n).map(row).collect()
}

fn written(folder: &Path, name: &str, rows: &[Row]) -> PathBuf {
    let path = folder.join(name);
    let line = |row: &Row| row.map(|x| format!("{x:?}")).join(" ") + "\n";
    std::fs::write(&path, rows.iter().map(line).collect::<String>()).expect("written");
    path
}

/// The cameras of `exact.c`: of a file, of a text with uncertain intrinsics, of numbers.
fn cameras() -> [(NamedCamera, Vec<String>); 3] {
    let file = root().join("examples/photo/left.yml");
    let of_file = formats::read_camera_with_remarks(file.display().to_string()).expect("a camera");
    let text = "model = 'pinhole'\nfx_px = 530.0\nfy_px = 531.0\ncx_px = 319.5\ncy_px = 239.5\n\
                width_px = 640\nheight_px = 480\nintrinsics_sigma = { fx_px = 2.0, fy_px = 2.0 }\n";
    let of_text = formats::read_camera_from_bytes("camera", text.into(), None).expect("a camera");
    let matrix = CameraMatrix { fx_px: 530.0, fy_px: 531.0, cx_px: 319.5, cy_px: 239.5 };
    let lens = BrownConrady::new(matrix, &[-0.28, 0.07, 1e-4, -2e-4]).expect("a lens");
    let camera = Camera::new(lens, Some(ImageSize { width_px: 640, height_px: 480 })).expect("a camera");
    let of_numbers = NamedCamera { name: "camera".into(), camera, ..of_text.0.clone() };
    let of_numbers = NamedCamera { intrinsics_covariance: None, ..of_numbers };
    [of_file, of_text, (of_numbers, Vec::new())]
}

fn solve(printed: &mut Printed, rows: &[Row]) {
    let points_m: Vec<[f64; 3]> = rows.iter().map(|r| [r[0], r[1], r[2]]).collect();
    let pixels: Vec<[f64; 2]> = rows.iter().map(|r| [r[3], r[4]]).collect();
    let sigma_px: Vec<f64> = rows.iter().map(|r| r[5]).collect();
    let sigma_m: Vec<f64> = rows.iter().map(|r| r[6]).collect();
    let given = PointRows {
        points_m: &points_m,
        pixels: &pixels,
        sigma_px: &sigma_px,
        sigma_m: &sigma_m,
        names: None,
    };
    for (known, remarks) in cameras() {
        let seen = given.seen(&known.camera).expect("points");
        let options =
            PointsOptions { intrinsics: IntrinsicsCovariance::of(&known), ..PointsOptions::default() };
        let mut answer = seen.locate("view", &known.camera, &options);
        answer.remarks.extend(remarks);
        let pose = answer.estimate.as_ref().map(|e| e.cam_from_target);
        let residuals = pose.map_or_else(Vec::new, |pose| seen.residuals_px(&known.camera, &pose));
        printed.pose_answer("solve", &answer, &[], &residuals);
    }
}

fn images(printed: &mut Printed, image: &GrayImage) {
    let (known, remarks) = &cameras()[0];
    let file = formats::read_target(root().join("examples/photo/board.toml")).expect("a target");
    let intrinsics = IntrinsicsCovariance::of(known);
    let options = LocateOptions { intrinsics, ..LocateOptions::default() };
    for view in ["examples/photo/left03.jpg", "memory"] {
        let mut locator = ImageLocator::new(&known.camera, &file.target, &options).expect("a locator");
        let mut located = locator.locate(image, view.to_string());
        located.answer.remarks.splice(..0, file.warnings.iter().chain(remarks).cloned());
        printed.pose_answer("locate", &located.answer, &located.detections, &[]);
        let mut detector = Detector::new(&file.target).expect("a detector");
        let found = detect_target(&mut detector, &file.target, view, image);
        printed.ended("detect", found.status, found.message.as_deref().unwrap_or_default(), &found);
        for d in &found.detections {
            let own = [d.u_px, d.v_px, d.sigma_px, d.lens_sigma_px];
            printed.numbers(&format!("{}.{}", d.id, d.corner), &own);
        }
        printed.numbers("residuals", &[]);
    }
}

/// The second view of the example's detections.
fn rig_rows(names: &[String]) -> Vec<Row> {
    let text = std::fs::read_to_string(root().join("examples/rig/detections.csv")).expect("the table");
    let cells = |line: &str| line.split(',').map(str::to_string).collect::<Vec<_>>();
    let first: Vec<Vec<String>> = text.lines().skip(1).map(cells).filter(|row| row[1] == "01").collect();
    let row = |cells: &Vec<String>| {
        let camera = names.iter().position(|name| *name == cells[0]).expect("a camera");
        let [x, y, z, u, v, sigma_px] =
            [3, 4, 5, 6, 7, 8].map(|i: usize| cells[i].parse().expect("a number"));
        [x, y, z, u, v, sigma_px, 0.0, camera as f64]
    };
    first.iter().map(row).collect()
}

fn rig_pose(printed: &mut Printed) -> Vec<Row> {
    let rig = read_known_rig(root().join("examples/rig/rig.toml")).expect("a rig");
    let names: Vec<String> = rig.iter().map(|known| known.named.name.clone()).collect();
    names.iter().for_each(|name| printed.line(&format!("camera {name}")));
    let rows = rig_rows(&names);
    let cameras: std::collections::BTreeSet<usize> = rows.iter().map(|row| row[7] as usize).collect();
    assert!(8 < rows.len() && 1 < cameras.len(), "{} points in {} cameras", rows.len(), cameras.len());
    let point = |(i, r): (usize, &Row)| RigPoint {
        line: i as u64 + 1,
        camera: r[7] as usize,
        name: i.to_string(),
        x_in_target: [r[0], r[1], r[2]],
        image: [r[3], r[4]],
        sigma_px: Some(r[5]),
        sigma_m: Some(r[6]),
    };
    let view = RigPointsView {
        name: "view".into(),
        rows: rows.iter().enumerate().map(point).collect(),
        how_read: None,
    };
    printed.rig_pose(&rig_poses(&rig, &[view], &RigPoseRequest::default())[0]);
    rows
}

/// Nine points have one pose, three several.
#[test]
fn numbers_and_json_are_those_of_rust_to_the_last_bit() {
    let image = GrayImage::read(root().join("examples/photo/left03.jpg")).expect("an image");
    let folder = folder("exact");
    let pixels = folder.join("pixels");
    std::fs::write(&pixels, &image.data).expect("written");
    let source = root().join("crates/c/tests/programs/exact.c");
    let mut n_poses = Vec::new();
    for (library, flags, n) in [(Library::Shared, sanitizers(), 9), (Library::Static, &[][..], 3)] {
        let mut expected = Printed::default();
        let rows = points(&cameras()[2].0.camera, n);
        solve(&mut expected, &rows);
        images(&mut expected, &image);
        let rig = rig_pose(&mut expected);
        let program = compiled(&source, library, flags);
        let mut command = Command::new(program);
        command.current_dir(root()).arg(root()).arg(written(&folder, "points", &rows)).arg(&pixels);
        let printed = run(command.arg(written(&folder, "rig", &rig)));
        for (seen, wanted) in printed.lines().zip(expected.0.lines()) {
            assert_eq!(seen, wanted);
        }
        assert_eq!(printed.lines().count(), expected.0.lines().count());
        n_poses.push(printed.lines().filter(|line| line.starts_with("rotation_wxyz")).count());
    }
    // Of three cameras, twice of the photograph, of the rig; of three points more.
    assert!(n_poses[0] == 6 && 6 < n_poses[1], "{n_poses:?}");
}
