//! A rig whose numbers are simulated, not solved: cameras on an arc, a board waved before them, noise and wrong points.
//!
//! What reports and scene files draw does not depend on how the numbers were found; that real solutions are drawn the same way,
//! `a_solved_rig_is_reported` says.

pub mod page;

use nalgebra::{DMatrix, Vector2};
use resight::core::camera::{BrownConrady, CameraMatrix, ImageSize};
use resight::core::multiview::rig::{
    BodyInView, CameraInRig, Observation, ObservationResult, RejectedObservation, RigSolution, RigVerdict,
    SharedViews, TargetOnBody, TargetScale, WeakestLink,
};
use resight::core::target::Chessboard;
use resight::core::{Camera, Correspondence, Matrix6, Point, Pose, Target, Vector6};
use resight::formats::NamedCamera;
use resight::rig::{InputFile, NamedRig, NamedTarget, RigRun};

pub const WIDTH_PX: u32 = 1280;
pub const HEIGHT_PX: u32 = 960;
pub const SQUARE_M: f64 = 0.05;
const COLUMNS: u32 = 8;
const ROWS: u32 = 6;
const SIGMA_PX: f64 = 0.3;

/// 64-bit congruence with a literal seed; twelve uniforms make a normal.
pub struct Chance(pub u64);

impl Chance {
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

pub fn lens() -> Camera {
    let matrix = CameraMatrix { fx_px: 900.0, fy_px: 905.0, cx_px: 645.0, cy_px: 475.0 };
    let lens = BrownConrady::new(matrix, &[-0.12, 0.03, 0.0002, -0.0001, 0.0]).unwrap();
    Camera::new(lens, Some(ImageSize { width_px: WIDTH_PX, height_px: HEIGHT_PX })).unwrap()
}

/// Cameras on an arc of 2 m about the point 2 m before the first, looking at it, some higher than others.
pub fn cam_from_rig(camera: usize, n_cameras: usize) -> Pose {
    let step_rad = 1.9 / n_cameras.max(2) as f64;
    let turn = Pose::exp(&Vector6::new(0.0, camera as f64 * step_rad, 0.0, 0.0, 0.0, 0.0));
    let lift = Pose::exp(&Vector6::new(-0.07 * (camera % 3) as f64, 0.0, 0.0, 0.0, 0.0, 0.0));
    let middle = |z: f64| Pose::exp(&Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, z));
    middle(2.0) * lift * turn * middle(-2.0)
}

pub fn rig_from_board(view: usize, chance: &mut Chance) -> Pose {
    let mut between = |reach: f64| reach * (2.0 * chance.uniform() - 1.0);
    let turn = Vector6::new(between(0.5), 0.8 + between(0.7), between(0.4), 0.0, 0.0, 0.0);
    let place = Vector6::new(0.0, 0.0, 0.0, between(0.5), between(0.35), 2.0 + between(0.4));
    let centre = Vector6::new(0.0, 0.0, 0.0, -3.5 * SQUARE_M, -2.5 * SQUARE_M, 0.0);
    let _ = view;
    Pose::exp(&place) * Pose::exp(&turn) * Pose::exp(&centre)
}

fn board_points() -> Vec<Point> {
    (0..COLUMNS * ROWS)
        .map(|i| Point::new(f64::from(i % COLUMNS) * SQUARE_M, f64::from(i / COLUMNS) * SQUARE_M, 0.0))
        .collect()
}

/// Names of cameras, by number.
pub fn camera_name(camera: usize) -> String {
    ["centre", "left", "right", "rear", "top", "gantry", "door", "hand"]
        .get(camera)
        .map_or(format!("camera{camera:03}"), |name| name.to_string())
}

/// The question: what each camera sees of the board, with noise and one wrong point in forty.
pub fn question(n_cameras: usize, n_views: usize, seed: u64) -> (NamedRig, Vec<Pose>) {
    let mut chance = Chance(seed);
    let lens = lens();
    let mut boards = Vec::new();
    let mut observations = Vec::new();
    for view in 0..n_views {
        let rig_from_target = rig_from_board(view, &mut chance);
        boards.push(rig_from_target);
        for camera in 0..n_cameras {
            let seen = seen_by(&lens, &(cam_from_rig(camera, n_cameras) * rig_from_target), &mut chance);
            if COLUMNS as usize <= seen.len() {
                observations.push(Observation { camera, view, target: 0, seen });
            }
        }
    }
    let board = Target::Chessboard(Chessboard { rows: ROWS, columns: COLUMNS, square_m: SQUARE_M });
    let camera = |i| NamedCamera {
        name: camera_name(i),
        camera: lens.clone(),
        placement: None,
        intrinsics_covariance: None,
    };
    let rig = NamedRig {
        cameras: (0..n_cameras).map(camera).collect(),
        lenses: vec![lens.clone(); n_cameras],
        views: (0..n_views).map(|i| format!("{i:04}")).collect(),
        targets: vec![NamedTarget { name: "board".into(), target: Some(board), body: 0 }],
        body_of_target: vec![0],
        observations,
    };
    (rig, boards)
}

fn seen_by(lens: &Camera, cam_from_target: &Pose, chance: &mut Chance) -> Vec<Correspondence> {
    let mut seen = Vec::new();
    for x in board_points() {
        let mut error = Vector2::new(chance.normal(), chance.normal()) * SIGMA_PX;
        if chance.uniform() < 0.025 {
            error += Vector2::new(12.0 * chance.normal(), 12.0 * chance.normal());
        }
        let Some(pixel) = lens.project(&(*cam_from_target * x)) else { continue };
        if lens.contains(&pixel) {
            seen.extend(Correspondence::new(lens, x, pixel + error, SIGMA_PX));
        }
    }
    seen
}

/// Question and an answer put together from the truth.
pub fn simulated(n_cameras: usize, n_views: usize, seed: u64) -> RigRun {
    let (rig, boards) = question(n_cameras, n_views, seed);
    let mut observations: Vec<ObservationResult> =
        rig.observations.iter().map(|s| result_of(s, &boards[s.view], n_cameras)).collect();
    if let Some(last) = observations.last_mut() {
        last.rejected = Some(RejectedObservation::Contradicts { rms_px: 41.5 });
        last.residuals_px.iter_mut().flatten().for_each(|r| r.1 = false);
    }
    let cameras = (0..n_cameras).map(|i| camera_in_rig(i, n_cameras, &rig, &observations)).collect();
    let used = |r: &&(Vector2<f64>, bool)| r.1;
    let all: Vec<f64> = observations
        .iter()
        .flat_map(|s| s.residuals_px.iter().flatten())
        .filter(used)
        .map(|r| r.0.norm_squared())
        .collect();
    let n_seen = rig.observations.iter().map(|s| s.seen.len()).sum();
    let bodies = boards.iter().enumerate().map(|(view, pose)| body(view, *pose)).collect();
    let solution = RigSolution {
        reference: 0,
        cameras,
        budgets: vec![],
        targets: vec![TargetOnBody { body_from_target: Pose::identity(), covariance: Matrix6::zeros() }],
        bodies,
        observations,
        shared: shared(&rig, n_cameras),
        weakest_link: (1 < n_cameras).then(|| WeakestLink {
            camera: n_cameras - 1,
            with: n_cameras - 2,
            n_shared_views: 7,
            sigma_rad: 0.0002,
            sigma_m: 0.0008,
        }),
        scales: vec![TargetScale { ratio: 1.004, sigma: 0.0005, extent_m: 0.43 }],
        rms_px: (all.iter().sum::<f64>() / all.len().max(1) as f64).sqrt(),
        chi2: all.iter().sum::<f64>() / (SIGMA_PX * SIGMA_PX),
        degrees_of_freedom: (2 * all.len()).saturating_sub(6 * (n_cameras - 1 + n_views)),
        n_seen,
        n_used: all.len(),
        joint_covariance: Some(joint(n_cameras)),
        joint_targets: None,
        noise_scale: 1.0,
        view_scale: 1.0,
        lens_sigma_m: None,
        explanations: Vec::new(),
        steps: 7,
        verdict: RigVerdict::default(),
    };
    let inputs = vec![InputFile { path: "detections.csv".into(), sha256: "3f".repeat(32) }];
    let command =
        "resight rig --camera rig.toml --target board.toml --detections detections.csv -o out.toml".into();
    RigRun { rig, solution, lenses: vec![], times: None, inputs, command: Some(command) }
}

fn result_of(observation: &Observation, rig_from_target: &Pose, n_cameras: usize) -> ObservationResult {
    let cam_from_target = cam_from_rig(observation.camera, n_cameras) * *rig_from_target;
    let lens = lens();
    let residual = |c: &Correspondence| {
        let error = c.pixel - lens.project(&(cam_from_target * c.x_in_target))?;
        Some((error, error.norm() < 4.0 * SIGMA_PX))
    };
    ObservationResult { residuals_px: observation.seen.iter().map(residual).collect(), rejected: None }
}

pub fn covariance_of(camera: usize) -> Matrix6 {
    if camera == 0 {
        return Matrix6::zeros();
    }
    let (turn, shift) = (4e-5 * camera as f64, 1.5e-4 * camera as f64);
    let mut covariance = Matrix6::from_diagonal(
        &Vector6::new(turn, 2.0 * turn, turn, shift, 0.5 * shift, 3.0 * shift).map(|s| s * s),
    );
    covariance[(3, 5)] = 0.8 * shift * shift;
    covariance[(5, 3)] = covariance[(3, 5)];
    covariance
}

/// All cameras share a third of what is uncertain about each.
fn joint(n_cameras: usize) -> DMatrix<f64> {
    let mut joint = DMatrix::zeros(6 * n_cameras, 6 * n_cameras);
    for a in 0..n_cameras {
        for b in 0..n_cameras {
            let share = if a == b { 1.0 } else { 1.0 / 3.0 };
            let block = covariance_of(a.min(b)) * share;
            joint.view_mut((6 * a, 6 * b), (6, 6)).copy_from(&block);
        }
    }
    joint
}

fn camera_in_rig(
    camera: usize,
    n_cameras: usize,
    rig: &NamedRig,
    results: &[ObservationResult],
) -> CameraInRig {
    let own = || rig.observations.iter().zip(results).filter(|(s, _)| s.camera == camera);
    let used: Vec<f64> = own()
        .flat_map(|(_, r)| r.residuals_px.iter().flatten())
        .filter(|r| r.1)
        .map(|r| r.0.norm_squared())
        .collect();
    CameraInRig {
        cam_from_rig: cam_from_rig(camera, n_cameras),
        covariance: covariance_of(camera),
        n_views: own().count(),
        n_seen: own().map(|(s, _)| s.seen.len()).sum(),
        n_used: used.len(),
        rms_px: (used.iter().sum::<f64>() / used.len().max(1) as f64).sqrt(),
    }
}

fn body(view: usize, rig_from_body: Pose) -> BodyInView {
    let covariance = Matrix6::from_diagonal(&Vector6::new(1e-7, 1e-7, 1e-7, 1e-7, 1e-7, 4e-7));
    BodyInView { view, body: 0, rig_from_body, covariance, n_used: 90, rms_px: 0.4 }
}

fn shared(rig: &NamedRig, n_cameras: usize) -> SharedViews {
    let sees =
        |camera: usize, view: usize| rig.observations.iter().any(|s| s.camera == camera && s.view == view);
    let seen: Vec<Vec<bool>> =
        (0..n_cameras).map(|c| (0..rig.views.len()).map(|v| sees(c, v)).collect()).collect();
    let both = |a: usize, b: usize| seen[a].iter().zip(&seen[b]).filter(|(x, y)| **x && **y).count();
    let counts = (0..n_cameras).map(|a| (0..n_cameras).map(|b| both(a, b)).collect()).collect();
    SharedViews { counts, groups: vec![(0..n_cameras).collect()] }
}
