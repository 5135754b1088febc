//! Boards in real images: halves of a board's corners, and both cameras of a stereo pair, must differ by what their covariances say. Needs
//! the folder named by RESIGHT_DATA.
//!
//! The noise stated is the detector's smallest, 0.15 px. Left out: halves whose points leave two poses.

use crate::common::rooms;
use crate::recorded::recorded;
use resight_core::camera::{BrownConrady, KannalaBrandt};
use resight_core::locate::choose::Ambiguity;
use resight_core::locate::{Config, PoseEstimate, locate};
use resight_core::multiview::rig::{Observation, RigConfig, RigProblem, solve_rig};
use resight_core::{Camera, CameraMatrix, Correspondence, Lens, Matrix6, Pixel, Point};
use std::collections::BTreeMap;
use std::path::Path;

const SIGMA_PX: f64 = 0.15;

/// The numbers of the bracketed list that follows `key`, however deep its brackets.
fn list(text: &str, key: &str) -> Vec<f64> {
    let after = text.split_once(key).unwrap_or_else(|| panic!("{key} is missing")).1;
    let from = after.find('[').expect("a list");
    let mut depth = 0;
    let end = after[from..].find(|c| {
        depth += i32::from(c == '[') - i32::from(c == ']');
        depth == 0
    });
    let is_part = |c: char| c.is_ascii_digit() || "+-.eE".contains(c);
    let words = after[from..from + end.expect("an end")].split(|c| !is_part(c));
    words.filter_map(|word| word.parse().ok()).collect()
}

fn matrix(fx_px: f64, fy_px: f64, cx_px: f64, cy_px: f64) -> CameraMatrix {
    CameraMatrix { fx_px, fy_px, cx_px, cy_px }
}

fn brown(k: &[f64], distortion: &[f64]) -> Camera {
    let lens = BrownConrady::new(matrix(k[0], k[4], k[2], k[5]), distortion).expect("a lens");
    Camera { lens: Lens::BrownConrady(lens), size: None }
}

/// An image: which camera took it, its name, and its corners.
struct Observed {
    camera: usize,
    view: String,
    points: Vec<Correspondence>,
}

struct Set {
    name: &'static str,
    cameras: Vec<Camera>,
    images: Vec<Observed>,
}

/// Rows of a table: which camera and which view a row belongs to, and the column of x, y, z, u, v; none for a row that is left out.
fn set(
    name: &'static str,
    file: &Path,
    cameras: Vec<Camera>,
    first: usize,
    key: impl Fn(&[&str]) -> Option<(usize, String)>,
) -> Set {
    let text = std::fs::read_to_string(file).expect("the corners");
    let mut found: BTreeMap<(String, usize), Vec<Correspondence>> = BTreeMap::new();
    for row in text.lines().skip(1) {
        let cells: Vec<&str> = row.split(',').collect();
        let Some((camera, view)) = key(&cells) else { continue };
        // Some numbers were written with their type's name around them.
        let value = |i: usize| -> f64 {
            let cell = cells[first + i].trim_start_matches("np.float64(").trim_end_matches(')');
            cell.parse().expect("a number")
        };
        let (x, u) = (Point::new(value(0), value(1), value(2)), Pixel::new(value(3), value(4)));
        let point = Correspondence::new(&cameras[camera], x, u, SIGMA_PX).expect("in the field");
        found.entry((view, camera)).or_default().push(point);
    }
    let images =
        found.into_iter().map(|((view, camera), points)| Observed { camera, view, points }).collect();
    Set { name, cameras, images }
}

fn chessboard(root: &Path) -> Set {
    let folder = root.join("opencv_stereo_chessboard");
    let truth = std::fs::read_to_string(folder.join("truth.json")).expect("the truth");
    let own = truth.split_once("\"reference_calibration_opencv5\"").expect("the lenses").1;
    let right = own.split_once("\"right\"").expect("the right camera").1;
    let cameras = [own, right].map(|text| brown(&list(text, "\"K\""), &list(text, "\"D")));
    let key = |cells: &[&str]| Some((usize::from(cells[0] == "right"), cells[1].to_string()));
    set("chessboard", &folder.join("detections.csv"), cameras.into(), 5, key)
}

fn webcams(root: &Path) -> Set {
    let folder = root.join("caliscope_4cam_charuco");
    let file = std::fs::read_to_string(folder.join("camera_array.toml")).expect("the lenses");
    let cameras = (0..4).map(|i| {
        let text = file.split_once(&format!("[cameras.{i}]")).expect("a camera").1;
        brown(&list(text, "matrix ="), &list(text, "distortions ="))
    });
    let key = |cells: &[&str]| Some((cells[1].parse().expect("a camera"), cells[0].to_string()));
    set("webcams", &folder.join("detections.csv"), cameras.collect(), 3, key)
}

fn april_grid(root: &Path) -> Set {
    let folder = root.join("aprilgrid_tumvi_euroc");
    let truth = std::fs::read_to_string(folder.join("truth.json")).expect("the truth");
    let lens = |name: &str, coefficients: &str| {
        let text = truth.split_once(name).expect("a camera").1;
        let f = list(text, "\"fx_fy_cx_cy\"");
        (matrix(f[0], f[1], f[2], f[3]), list(text, coefficients))
    };
    let (tum, k) = lens("\"tum_vi_cam0_kb4_1024\"", "\"k1k2k3k4\"");
    let (euroc, d) = lens("\"euroc_cam0_radtan\"", "\"k1k2p1p2\"");
    let fisheye = KannalaBrandt::new(tum, &k).expect("a lens");
    let brown = BrownConrady::new(euroc, &d).expect("a lens");
    let cameras = [Lens::KannalaBrandt(fisheye), Lens::BrownConrady(brown)];
    let cameras = cameras.map(|lens| Camera { lens, size: None });
    let key = |cells: &[&str]| {
        (cells[8] == "1").then(|| (usize::from(cells[0] == "euroc.png"), cells[0].to_string()))
    };
    set("AprilGrid", &folder.join("detections.csv"), cameras.into(), 3, key)
}

fn solve(points: &[Correspondence], camera: &Camera, shared_errors: bool) -> Option<PoseEstimate> {
    let config = Config { shared_errors, ..Config::default() };
    locate(points, camera, &config).ok().filter(|e| matches!(e.ambiguity, Ambiguity::Unique { .. }))
}

/// Fewer corners than this show nothing that they share.
const TELLING: usize = 12;

/// How a board is parted.
#[derive(Debug, Clone, Copy)]
enum Parted {
    LeftRight,
    UpperLower,
    Alternating,
}

/// Which half each point is in.
fn halves(points: &[Correspondence], parted: Parted) -> [Vec<Correspondence>; 2] {
    let along = |c: &Correspondence| match parted {
        Parted::LeftRight => c.x_in_target.x,
        _ => c.x_in_target.y,
    };
    let mut places: Vec<f64> = points.iter().map(along).collect();
    places.sort_by(f64::total_cmp);
    let middle = 0.5 * (places[0] + places[places.len() - 1]);
    let is_first = |(i, c): (usize, &Correspondence)| match parted {
        Parted::Alternating => i % 2 == 0,
        _ => along(c) < middle - 1e-6,
    };
    let mut parts = [Vec::new(), Vec::new()];
    for (i, c) in points.iter().enumerate() {
        parts[usize::from(!is_first((i, c)))].push(*c);
    }
    parts
}

/// Means of squared differences of halves in units of their covariances, with shared errors and without; how many differences.
fn between_halves(set: &Set, parted: Parted) -> (f64, f64, usize) {
    let (mut with, mut without, mut n) = (0.0, 0.0, 0);
    for image in &set.images {
        let camera = &set.cameras[image.camera];
        let parts = halves(&image.points, parted);
        if parts.iter().any(|part| part.len() < 6) {
            continue;
        }
        let pair =
            |shared: bool| Some((solve(&parts[0], camera, shared)?, solve(&parts[1], camera, shared)?));
        let (Some((a, b)), Some((c, d))) = (pair(true), pair(false)) else { continue };
        let apart = (a.cam_from_target * b.cam_from_target.inverse()).log();
        with += rooms::nees(&apart, &(a.covariance + b.covariance));
        without += rooms::nees(&apart, &(c.covariance + d.covariance));
        n += 1;
    }
    let telling = set.images.iter().filter(|i| 2 * TELLING <= i.points.len()).count();
    let (with, without) = (with / n as f64, without / n as f64);
    println!(
        "{}, {parted:?}: NEES {with:.1}, without shared errors {without:.1}, {n} images ({telling} with {TELLING} corners in a half)",
        set.name
    );
    (with, without, n)
}

#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn halves_of_a_board_agree() {
    let root = recorded("");
    for set in [chessboard(&root), webcams(&root), april_grid(&root)] {
        for parted in [Parted::LeftRight, Parted::UpperLower, Parted::Alternating] {
            let (with, without, n) = between_halves(&set, parted);
            match (set.name, parted) {
                // Halves of twelve corners are too small to show anything: as before.
                ("webcams", _) => assert!(n == 0 || with == without),
                // What alternating corners share moves both halves alike, so that they differ by less than stated.
                (_, Parted::Alternating) => assert!(with < 6.0),
                _ => assert!(
                    2.5 < with && with < 9.5 && 3.0 * with < without,
                    "{} {parted:?}: {with}",
                    set.name
                ),
            }
        }
    }
}

/// Each pair of images says where the right camera is; so do all views together.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn pairs_of_cameras_agree_with_the_rig() {
    let root = recorded("");
    let set = chessboard(&root);
    let views: Vec<&str> = {
        let mut names: Vec<&str> = set.images.iter().map(|i| i.view.as_str()).collect();
        names.dedup();
        names
    };
    let of_view = |name: &str| views.iter().position(|v| *v == name).expect("a view");
    let observation = |i: &Observed| Observation {
        camera: i.camera,
        view: of_view(&i.view),
        target: 0,
        seen: i.points.clone(),
    };
    let observations: Vec<Observation> = set.images.iter().map(observation).collect();
    let problem = RigProblem {
        cameras: &set.cameras,
        body_of_target: &[0],
        n_views: views.len(),
        observations: &observations,
    };
    let rig = solve_rig(&problem, &RigConfig::default()).expect("a rig");
    let known = &rig.cameras[1];
    let mut sums = [0.0, 0.0];
    let mut n = 0;
    for view in &views {
        let images: Vec<&Observed> = set.images.iter().filter(|i| i.view == *view).collect();
        let &[left, right] = images.as_slice() else { continue };
        for (sum, shared) in sums.iter_mut().zip([true, false]) {
            let of =
                |image: &Observed| solve(&image.points, &set.cameras[image.camera], shared).expect("a pose");
            let (l, r) = (of(left), of(right));
            let right_from_left = r.cam_from_target * l.cam_from_target.inverse();
            let adjoint = right_from_left.adjoint();
            let covariance: Matrix6 = r.covariance + adjoint * l.covariance * adjoint.transpose();
            let apart = (right_from_left * known.cam_from_rig.inverse()).log();
            *sum += rooms::nees(&apart, &(covariance + known.covariance));
        }
        n += 1;
    }
    let [with, without] = sums.map(|s| s / n as f64);
    println!("stereo pairs against the rig: NEES {with:.1}, without shared errors {without:.1}, {n} pairs");
    assert!(n == 13 && 3.0 * with < without, "{with} {without} {n}");
}
