//! Real recordings of rigs: lenses as their files say, and the corners that came with them. Needs the folder named by RESIGHT_DATA.

use nalgebra::{Matrix3, Vector3};
use resight_core::camera::BrownConrady;
use resight_core::multiview::pose_graph::{PairNoise, RelativePose};
use resight_core::multiview::rig::{
    FrameStamps, Observation, RigConfig, RigProblem, RigSolution, TimeOffsets, solve_rig, time_offsets,
};
use resight_core::{Camera, CameraMatrix, Correspondence, Error, Lens, Pixel, Point, Pose};
use std::collections::BTreeMap;
use std::path::Path;

/// A recording: its cameras and what they saw (place on the board, pixel) by view and camera, views counted from 0 in the order of time.
#[derive(Clone)]
pub struct Recording {
    pub name: &'static str,
    pub cameras: Vec<Camera>,
    pub n_views: usize,
    pub seen: BTreeMap<(usize, usize), Vec<(Point, Pixel)>>,
    pub sigma_px: f64,
    /// When frames were taken, s, by view and camera, where this is known.
    pub stamps_s: BTreeMap<(usize, usize), f64>,
}

/// All numbers of a text.
fn numbers(text: &str) -> Vec<f64> {
    let is_part = |c: char| c.is_ascii_digit() || "+-.eE".contains(c);
    text.split(|c| !is_part(c)).filter_map(|word| word.parse().ok()).collect()
}

/// The numbers of the bracketed list that follows `key`.
fn list(text: &str, key: &str) -> Vec<f64> {
    let after = text.split_once(key).unwrap_or_else(|| panic!("{key} is missing")).1;
    let from = after.find('[').expect("a list");
    let mut depth = 0;
    let end = after[from..].find(|c| {
        depth += i32::from(c == '[') - i32::from(c == ']');
        depth == 0
    });
    numbers(&after[from..from + end.expect("an end")])
}

fn camera(k: &[f64], distortion: &[f64]) -> Camera {
    let matrix = CameraMatrix { fx_px: k[0], fy_px: k[4], cx_px: k[2], cy_px: k[5] };
    let lens = BrownConrady::new(matrix, distortion).expect("a lens");
    Camera { lens: Lens::BrownConrady(lens), size: None }
}

/// Rows of a table, camera and view in the given columns, x, y, z, u, v from `first` on.
fn recording(
    name: &'static str,
    file: &Path,
    cameras: Vec<Camera>,
    camera_of: impl Fn(&str) -> usize,
    [view_at, camera_at, first]: [usize; 3],
    sigma_px: f64,
) -> Recording {
    let text = std::fs::read_to_string(file).expect("the corners");
    let mut by_name: BTreeMap<(u32, usize), Vec<(Point, Pixel)>> = BTreeMap::new();
    for row in text.lines().skip(1) {
        let cells: Vec<&str> = row.split(',').collect();
        // Some numbers were written with their type's name, which ends in 64, around them.
        let value = |i: usize| -> f64 {
            let cell = cells[first + i].trim_start_matches("np.float64(").trim_end_matches(')');
            cell.parse().expect("a number")
        };
        let (x, u) = (Point::new(value(0), value(1), value(2)), Pixel::new(value(3), value(4)));
        let view = cells[view_at].parse().expect("a view");
        by_name.entry((view, camera_of(cells[camera_at]))).or_default().push((x, u));
    }
    let mut views: Vec<u32> = by_name.keys().map(|k| k.0).collect();
    views.dedup();
    let view_of = |v: u32| views.binary_search(&v).expect("a view");
    let seen = by_name.into_iter().map(|((view, camera), seen)| ((view_of(view), camera), seen)).collect();
    Recording { name, cameras, n_views: views.len(), seen, sigma_px, stamps_s: BTreeMap::new() }
}

/// A camera whose parameters are changed by their names.
pub fn with_parameters(camera: &Camera, change: impl Fn(&str, f64) -> f64) -> Camera {
    let values: Vec<f64> = camera.parameters().iter().map(|(name, value)| change(name, *value)).collect();
    camera.with_parameters(&values).expect("a lens")
}

/// Two cameras before a chessboard.
pub fn chessboard(root: &Path, sigma_px: f64) -> Recording {
    let folder = root.join("opencv_stereo_chessboard");
    let truth = std::fs::read_to_string(folder.join("truth.json")).expect("the truth");
    let own = truth.split_once("\"reference_calibration_opencv5\"").expect("the lenses").1;
    let right = own.split_once("\"right\"").expect("the right camera").1;
    let cameras = [own, right].map(|text| camera(&list(text, "\"K\""), &list(text, "\"D")));
    let side = |name: &str| usize::from(name == "right");
    recording("chessboard", &folder.join("detections.csv"), cameras.into(), side, [1, 0, 5], sigma_px)
}

/// Four webcams that are not synchronised.
pub fn webcams(root: &Path, sigma_px: f64) -> Recording {
    let folder = root.join("caliscope_4cam_charuco");
    let file = std::fs::read_to_string(folder.join("camera_array.toml")).expect("the lenses");
    let cameras = (0..4).map(|i| {
        let text = file.split_once(&format!("[cameras.{i}]")).expect("a camera").1;
        camera(&list(text, "matrix ="), &list(text, "distortions ="))
    });
    let index = |name: &str| name.parse().expect("a camera");
    let mut webcams =
        recording("webcams", &folder.join("detections.csv"), cameras.collect(), index, [0, 1, 3], sigma_px);
    let times = std::fs::read_to_string(folder.join("timestamps.csv")).expect("the stamps");
    let stamp = |row: &str| {
        let [view, camera, t_s] = row.split(',').collect::<Vec<_>>()[..] else { panic!("{row}") };
        let view: usize = view.parse().expect("a view");
        ((view - FIRST_VIEW, index(camera)), t_s.parse().expect("a time"))
    };
    webcams.stamps_s = times.lines().skip(1).map(stamp).collect();
    webcams
}

/// The webcams' frames are counted from here.
const FIRST_VIEW: usize = 416;

impl Recording {
    pub fn observations(&self) -> Vec<Observation> {
        let observation = |(&(view, camera), seen): (&(usize, usize), &Vec<(Point, Pixel)>)| {
            let lens = &self.cameras[camera];
            let point = |(x, u): &(Point, Pixel)| Correspondence::new(lens, *x, *u, self.sigma_px).ok();
            Observation { camera, view, target: 0, seen: seen.iter().filter_map(point).collect() }
        };
        self.seen.iter().map(observation).collect()
    }

    /// # Errors
    /// Those of `solve_rig`.
    pub fn solve(&self, config: &RigConfig) -> Result<RigSolution, Error> {
        solve_rig(&self.problem(&self.observations()), config)
    }

    fn problem<'a>(&'a self, observations: &'a [Observation]) -> RigProblem<'a> {
        RigProblem { cameras: &self.cameras, body_of_target: &[0], n_views: self.n_views, observations }
    }

    /// The solution with the time offsets that the stamps and the motion of the board show, and these.
    ///
    /// # Errors
    /// Those of `time_offsets` and `solve_rig`.
    pub fn solve_in_time(&self, config: &RigConfig) -> Result<(RigSolution, TimeOffsets), Error> {
        let observations = self.observations();
        let stamps_s: Vec<f64> =
            observations.iter().map(|seen| self.stamps_s[&(seen.view, seen.camera)]).collect();
        let stamps = FrameStamps { stamps_s: &stamps_s, line_time: false };
        let offsets = time_offsets(&self.problem(&observations), config, &stamps)?.ok_or(Error::EmptyRig)?;
        let config = RigConfig { time_offsets: Some(&offsets), ..*config };
        Ok((solve_rig(&self.problem(&offsets.observations), &config)?, offsets))
    }

    /// Some of the views.
    pub fn part(&self, takes: impl Fn(usize) -> bool) -> Recording {
        let mut part = self.clone();
        part.seen.retain(|(view, _), _| takes(*view));
        part
    }

    /// Some of the cameras, in the order given.
    pub fn of_cameras(&self, cameras: &[usize]) -> Recording {
        let place = |(view, camera): (usize, usize)| Some((view, cameras.iter().position(|c| *c == camera)?));
        let seen = self.seen.iter().filter_map(|(key, seen)| Some((place(*key)?, seen.clone())));
        let lenses = cameras.iter().map(|c| self.cameras[*c].clone()).collect();
        Recording { cameras: lenses, seen: seen.collect(), ..self.clone() }
    }
}

/// The recorded room of eleven cameras: its pairs with the errors that its file states.
pub fn room_of_pairs(root: &Path) -> (usize, Vec<RelativePose>) {
    let file = root.join("caliscope_pose_graph/main_stereocal_all_results.json");
    let text = std::fs::read_to_string(file).expect("the pairs");
    let mut names: Vec<u32> = Vec::new();
    let mut pairs = Vec::new();
    for entry in text.split("\"stereo_").skip(1) {
        let (name, rest) = entry.split_once('"').expect("a name");
        let cameras: Vec<u32> = name.split('_').map(|camera| camera.parse().expect("a number")).collect();
        let (rotation, translation) = (list(rest, "\"rotation\""), list(rest, "\"translation\""));
        let error = numbers(rest.split_once("\"RMSE\":").expect("an error").1)[0];
        let pose = Pose::new(Matrix3::from_row_slice(&rotation), Vector3::from_row_slice(&translation));
        names.extend(&cameras);
        pairs.push((cameras[0], cameras[1], pose, error));
    }
    names.sort_unstable();
    names.dedup();
    let index = |name: u32| names.binary_search(&name).expect("a camera");
    let pair = |(a, b, b_from_a, error): (u32, u32, Pose, f64)| RelativePose {
        a: index(a),
        b: index(b),
        b_from_a,
        noise: PairNoise::Error(error),
    };
    (names.len(), pairs.into_iter().map(pair).collect())
}
