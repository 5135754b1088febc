//! What is wrong with tables, units and clocks is reported, with its line, and does not stop the others; and what is new since yesterday.

use crate::support::{day, folder, solved, solver, written};
use resight::Status;
use resight::core::camera::Pinhole;
use resight::core::target::Chessboard;
use resight::core::{Camera, CameraMatrix, Lens, Point, Pose, Target, Vector6};
use resight_fleet::assess::{AssessConfig, Found, assess, assess_since};
use resight_fleet::cameras::FleetCamera;
use resight_fleet::job::{BatchRequest, News, batch};
use resight_fleet::simulate::Fate;
use resight_fleet::solve::{Numbers, ViewColumns};
use resight_fleet::{Cameras, Solver};
use std::sync::Mutex;

const HEAD: &str = "camera,fx_px,fy_px,cx_px,cy_px,x0_m,y0_m,z0_m,x1_m,y1_m,z1_m,x2_m,y2_m,z2_m";

#[test]
fn a_bad_row_of_cameras_is_named_with_its_line_and_left_out() {
    let folder = folder("bad-row");
    let file = folder.join("cameras.csv");
    let row = |name: &str, fx: &str| format!("{name},{fx},900,640,480,0,0,0,1,0,0,0,1,0");
    let lines = [HEAD, "# surveyed in May", &row("a", "900"), &row("b", "oops"), "c,900", &row("d", "900")];
    std::fs::write(&file, lines.join("\r\n")).expect("written");
    let cameras = Cameras::read(&file).expect("two cameras");
    assert_eq!(cameras.names(), ["a", "d"]);
    let reasons: Vec<String> = cameras.rejected.iter().map(|(_, reason)| reason.clone()).collect();
    assert!(reasons[0].contains("cameras.csv:4: column `fx_px` is `oops`"), "{reasons:?}");
    assert!(reasons[1].contains("cameras.csv:5: 2 cells"), "{reasons:?}");
    // A second row of a name is bad, the first is used.
    let lines = [HEAD, &row("a", "900"), &row("b", "800"), &row("a", "700")];
    std::fs::write(&file, lines.join("\n")).expect("written");
    let cameras = Cameras::read(&file).expect("two cameras");
    assert_eq!(cameras.names(), ["a", "b"]);
    assert!(matches!(&cameras.cameras()[0].lens, Lens::Pinhole(lens) if lens.matrix.fx_px == 900.0));
    let reason = "cameras.csv:4: column `camera` is `a` as in line 2";
    assert!(cameras.rejected.len() == 1 && cameras.rejected[0].1.contains(reason), "{:?}", cameras.rejected);
    std::fs::write(&file, [HEAD, &row("b", "oops")].join("\n")).expect("written");
    assert!(Cameras::read(&file).is_err_and(|reason| reason.to_string().contains("cameras.csv:2: ")));
}

#[test]
fn units_get_a_remark() {
    let folder = folder("units");
    let file = folder.join("cameras.csv");
    let row = "a,900,900,640,480,0,0,0,2000,0,0,0,1500,0";
    std::fs::write(&file, [HEAD, row].join("\n")).expect("written");
    // Of three points too few coordinates are not zero to be round by more than chance.
    assert!(Cameras::read(&file).expect("a camera").warnings.is_empty());
    let row = "a,900,900,640,480,100,200,300,2000,100,500,400,1500,100";
    std::fs::write(&file, [HEAD, row].join("\n")).expect("written");
    let warnings = Cameras::read(&file).expect("a camera").warnings;
    assert!(warnings[0].contains("camera a: ") && warnings[0].contains("millimetres"), "{warnings:?}");
    std::fs::write(&file, [&HEAD.replace("_m,", "_mm,"), row].join("\n")).expect("written");
    let warnings = Cameras::read(&file).expect("a camera").warnings;
    assert!(warnings[0].contains("`x0_mm`") && warnings[0].contains("divide by 1000"), "{warnings:?}");
}

/// Points of rows in millimetres, and columns that say so.
#[test]
fn units_of_rows_get_a_remark() {
    let folder = folder("units-of-rows");
    let pixels = "u0_px,v0_px,u1_px,v1_px,u2_px,v2_px,";
    let numbers = "a,0,700,480,900,490,720,700,100,200,300,2000,100,500,400,1500,100";
    std::fs::write(folder.join("cameras.csv"), "camera,fx_px,fy_px,cx_px,cy_px\na,900,900,640,480\n")
        .expect("written");
    for (unit, said) in [("m", "are they in millimetres ("), ("mm", "`x0_mm` is not read")] {
        let points =
            HEAD.split_once("x0").map_or("", |(_, points)| points).replace("_m", &format!("_{unit}"));
        let file = folder.join(format!("{unit}.csv"));
        std::fs::write(&file, format!("camera,time_s,{pixels}x0{points}\n{numbers}\n")).expect("written");
        let remarks = Mutex::new(Vec::new());
        let request = BatchRequest {
            inputs: vec![file.display().to_string()],
            cameras: folder.join("cameras.csv"),
            target: None,
            output: folder.join("poses.parquet"),
            drift: None,
            sigma_px: 0.3,
            period_s: 900.0,
            threads: 1,
        };
        let done = batch(&request, &|news| {
            if let News::Warning(text) = news {
                remarks.lock().expect("a lock").push(text);
            }
            true
        });
        assert!(done.is_ok());
        let remarks = remarks.into_inner().expect("a lock");
        assert!(remarks.iter().any(|text| text.contains(said)), "{unit}: {remarks:?}");
    }
}

/// Milliseconds as seconds: a remark, and no verdict about motion.
#[test]
fn times_in_milliseconds_get_a_remark() {
    let folder = folder("milliseconds");
    let mut fleet = day(3, 1.0, 30.0, 2);
    fleet.simulation.begin_s *= 1e3;
    let inputs = written(&fleet, &folder);
    let (remarks, drift) = (Mutex::new(Vec::new()), folder.join("drift.jsonl"));
    let request = BatchRequest {
        inputs: inputs.iter().map(|path| path.display().to_string()).collect(),
        cameras: folder.join("cameras.csv"),
        target: None,
        output: folder.join("poses.parquet"),
        drift: Some(drift.clone()),
        sigma_px: 0.3,
        period_s: 900.0,
        threads: 1,
    };
    let answer = batch(&request, &|news| {
        if let News::Warning(text) = news {
            remarks.lock().expect("a lock").push(text);
        }
        true
    });
    assert!(!answer.expect("an answer").is_damaged());
    let remarks = remarks.into_inner().expect("a lock");
    assert!(
        remarks.iter().any(|text| text.contains("milliseconds") && text.contains("2026-05-28")),
        "{remarks:?}"
    );
    let drift = std::fs::read_to_string(drift).expect("lines");
    assert!(drift.lines().filter(|line| line.contains(r#""found":"clock""#)).count() == 3, "{drift}");
}

/// Yesterday's motion is known today; one since then is new. Two cameras of a site that moved at one time are a mast.
#[test]
fn what_is_new_since_yesterday() {
    let folder = folder("since");
    let mut fleet = day(4, 48.0, 60.0, 17);
    let motion = resight::core::Vector6::new(0.01, 0.004, 0.0, 0.0, 0.0, 0.0);
    for (camera, at_h) in fleet.cameras.iter_mut().zip([10.0, 30.0, 30.0, 1e6]) {
        camera.fate = Fate::Step { at_s: 3600.0 * at_h, motion };
        camera.map_points = camera.points;
    }
    let (inputs, solver) = (written(&fleet, &folder), solver(&fleet));
    let state = |files: &[std::path::PathBuf], name: &str| solved(files, &solver, &folder.join(name), 2).1;
    let (yesterday, today) = (state(&inputs[..24], "1.parquet"), state(&inputs[24..], "2.parquet"));
    let config = AssessConfig::default();
    let judged = assess_since(today, yesterday, Some(&*solver.cameras), &config).expect("verdicts");
    let found =
        |n: usize| judged.cameras.iter().find(|v| v.camera == fleet.cameras[n].name).expect("a verdict");
    let words: Vec<&str> = (0..4).map(|n| found(n).found.name()).collect();
    assert_eq!(words, ["steady", "moved", "moved", "steady"], "{}", found(0).message);
    assert!(found(0).message.contains("before that"), "{}", found(0).message);
    let changes = judged.changes.as_ref().expect("changes");
    let moved: Vec<(Option<Found>, Found)> =
        changes.cameras.iter().map(|c| (c.1, c.2)).filter(|c| c.1 == Found::Moved).collect();
    assert_eq!(moved, [(Some(Found::Steady), Found::Moved); 2]);
    assert!(judged.together.len() == 1 && judged.together[0].cameras.len() == 2, "{:?}", judged.together);
    let again = (state(&inputs[24..], "3.parquet"), state(&inputs[..24], "4.parquet"));
    assert!(
        assess_since(again.1, again.0, None, &config)
            .is_err_and(|reason| reason.to_string().contains("begin at"))
    );
    let alone = assess(state(&inputs[24..], "5.parquet"), Some(&*solver.cameras), &config).expect("verdicts");
    assert!(alone.cameras.iter().all(|v| v.found != Found::Moved || v.camera != fleet.cameras[0].name));
}

/// Four marks, in units of a metre, and a camera four metres in front of them; all lengths are multiplied.
struct Marks {
    factor: f64,
    camera: Camera,
}

impl Marks {
    const PLACES: [[f64; 3]; 4] = [[0.1, 0.1, 0.2], [1.5, 0.1, 0.1], [1.4, 1.2, 0.3], [0.2, 0.9, 0.4]];

    fn of(factor: f64) -> Self {
        let matrix = CameraMatrix { fx_px: 900.0, fy_px: 900.0, cx_px: 640.0, cy_px: 480.0 };
        Marks { factor, camera: Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None } }
    }

    fn points(&self) -> Vec<Point> {
        Self::PLACES.map(|x| Point::from(x) * self.factor).into()
    }

    /// Columns and rows of the pixels.
    fn pixels(&self) -> Vec<f64> {
        let turned = Pose::exp(&Vector6::new(0.3, -0.4, 0.1, 0.0, 0.0, 0.0));
        let cam_from_target = Pose { translation: Point::new(-0.5, -0.4, 4.0) * self.factor, ..turned };
        let seen = self.points().into_iter().map(|x| self.camera.project(&(cam_from_target * x)));
        seen.flat_map(|pixel| pixel.map_or([f64::NAN; 2], |p| [p.x, p.y])).collect()
    }

    /// The status of the view with the points in the row, or with those of the camera.
    fn solved(&self, in_row: bool) -> (Status, Option<String>) {
        let own = (!in_row).then(|| self.points());
        let camera = FleetCamera { name: "a".into(), camera: self.camera.clone(), points: own, site: None };
        let solver = Solver { cameras: Cameras::of(vec![camera]).expect("a camera").into(), sigma_px: 0.3 };
        let points: Vec<f64> = self.points().iter().flat_map(|x| [x.x, x.y, x.z]).collect();
        let views = ViewColumns {
            camera: &[0],
            pixels: Numbers::Rows { values: &self.pixels(), width: 8 },
            points_m: in_row.then_some(Numbers::Rows { values: &points, width: 12 }),
            sigma_px: None,
        };
        let answers = solver.solve(&views);
        assert!(answers.pose(0).is_some(), "{:?}", answers.reasons);
        (answers.status[0], answers.reasons.get(&0).cloned())
    }
}

/// Marks of a microscope's slide, of a room, of a mast of 20 m, of a field that a drone sees from 400 m are `ok`; a room in millimetres is
/// `implausible`, with its pose and its reason, wherever its points are stated.
#[test]
fn points_that_hardly_exist_make_a_row_implausible() {
    for in_row in [true, false] {
        for factor in [1e-4, 1.0, 40.0 / 3.0, 123.4] {
            assert_eq!(Marks::of(factor).solved(in_row), (Status::Ok, None), "× {factor}");
        }
        let (status, reason) = Marks::of(1000.0).solved(in_row);
        assert_eq!(status, Status::Implausible);
        assert!(reason.is_some_and(|reason| reason.contains("are they in millimetres (")));
    }
}

/// The points of a target that hardly exists, for cameras that have none of their own.
#[test]
fn a_target_that_hardly_exists_is_a_remark_on_all_cameras() {
    let of = |points| FleetCamera { name: "a".into(), camera: Marks::of(1.0).camera, points, site: None };
    for (square_m, own, is_plausible) in
        [(0.1, None, true), (25.0, None, false), (25.0, Some(Marks::of(1.0).points()), true)]
    {
        let target = Target::Chessboard(Chessboard { rows: 6, columns: 9, square_m });
        let cameras = Cameras::of(vec![of(own)]).and_then(|cameras| cameras.with_target(&target));
        let remark = cameras.expect("a camera").size_remark(0).map(str::to_string);
        assert_eq!(remark.is_none(), is_plausible, "{remark:?}");
    }
}
