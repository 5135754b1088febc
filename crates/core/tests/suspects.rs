//! The usual faults of points and intrinsics: each alone and two at once, in space and in a plane, and none where the files are right.

use nalgebra::Vector3;
use resight_core::camera::{BrownConrady, ImageSize, Pinhole};
use resight_core::locate::consistency::Consistency;
use resight_core::locate::suspects::{Explanation, Fault, Origin, explanations};
use resight_core::locate::{Config, PoseEstimate, locate};
use resight_core::statistics::random::SplitMix64;
use resight_core::{Camera, CameraMatrix, Correspondence, Error, Pixel, Point, Pose, Vector6};
use std::f64::consts::TAU;

const SIZE: ImageSize = ImageSize { width_px: 1280, height_px: 960 };
const COEFFICIENTS: [f64; 4] = [-0.28, 0.07, 0.0005, -0.0003];
const SIGMA_PX: f64 = 0.5;

/// Inputs of one kind: fifty for the figures of docs/math/suspects.md (RESIGHT_RUNS=50).
fn n_seeds() -> u64 {
    std::env::var("RESIGHT_RUNS").ok().and_then(|n| n.parse().ok()).unwrap_or(16)
}

/// A camera whose principal point is off the middle, so that a mirrored image differs from mirrored points.
fn camera(is_distorted: bool) -> Camera {
    let matrix = CameraMatrix { fx_px: 900.0, fy_px: 903.0, cx_px: 665.0, cy_px: 441.0 };
    match is_distorted {
        false => Camera::new(Pinhole { matrix }, Some(SIZE)).expect("a camera"),
        true => Camera::new(BrownConrady::new(matrix, &COEFFICIENTS).expect("a lens"), Some(SIZE))
            .expect("a camera"),
    }
}

/// Points, the camera as its file states it, and the true pose.
struct View {
    points: Vec<(Point, Pixel)>,
    camera: Camera,
    cam_from_target: Pose,
}

impl View {
    /// Points that fill the image, with noise.
    fn new(random: &mut SplitMix64, n: usize, is_planar: bool, is_distorted: bool) -> Self {
        let camera = camera(is_distorted);
        let (tilt, about) = (random.between(0.35, 0.8), random.between(0.0, TAU));
        let rotation = [tilt * about.cos(), tilt * about.sin(), random.between(-0.5, 0.5)];
        let translation =
            Vector3::new(random.between(-0.2, 0.2), random.between(-0.2, 0.2), random.between(2.6, 3.4));
        let rotated = Pose::exp(&Vector6::new(rotation[0], rotation[1], rotation[2], 0.0, 0.0, 0.0));
        let cam_from_target = Pose { translation, ..rotated };
        let mut points = Vec::new();
        while points.len() < n {
            let z = if is_planar { 0.0 } else { random.between(-0.9, 0.9) };
            let x = Point::new(random.between(-1.8, 1.8), random.between(-1.3, 1.3), z);
            let seen = camera.project(&(cam_from_target * x)).filter(|pixel| camera.contains(pixel));
            let noise = Pixel::from(random.normal_pair()) * SIGMA_PX;
            points.extend(seen.map(|pixel| (x, pixel + noise)));
        }
        View { points, camera, cam_from_target }
    }

    fn correspondences(&self, sigma_px: f64) -> Vec<Correspondence> {
        let seen = |(x, pixel): &(Point, Pixel)| {
            let bearing = self.camera.bearing(pixel).unwrap_or(Vector3::z_axis());
            Correspondence {
                x_in_target: *x,
                pixel: *pixel,
                bearing,
                sigma_px,
                covariance_px2: None,
                sigma_m: 0.0,
            }
        };
        self.points.iter().map(seen).collect()
    }

    /// As `resight solve`: a pixel outside the field of the lens is an error, with its explanations.
    fn solved(&self, sigma_px: f64) -> (Result<PoseEstimate, Error>, Vec<Explanation>) {
        let seen = self.correspondences(sigma_px);
        let outside = self.points.iter().find_map(|(_, pixel)| self.camera.bearing(pixel).err());
        let found = outside.map_or_else(|| locate(&seen, &self.camera, &Config::default()), Err);
        let named = explanations(found.as_ref(), &seen, &self.camera, &Config::default(), Origin::Table);
        (found, named)
    }

    fn set_matrix(&mut self, change: impl Fn(&mut [f64])) {
        let mut values: Vec<f64> = self.camera.parameters().iter().map(|(_, value)| *value).collect();
        change(&mut values);
        self.camera = self.camera.with_parameters(&values).expect("a camera");
    }

    fn set_coefficients(&mut self, coefficients: Option<[f64; 4]>) {
        let (matrix, size) = (self.camera.matrix().expect("a matrix"), self.camera.size);
        let lens = match coefficients {
            None => Pinhole { matrix }.into(),
            Some(c) => BrownConrady::new(matrix, &c).expect("a lens").into(),
        };
        self.camera = Camera { lens, size };
    }

    fn apply(&mut self, fault: Kind) {
        let points = &mut self.points;
        match fault {
            Kind::Exchanged => points.iter_mut().for_each(|(_, p)| *p = Pixel::new(p.y, p.x)),
            Kind::Upwards => points.iter_mut().for_each(|(_, p)| p.y = 959.0 - p.y),
            Kind::Leftwards => points.iter_mut().for_each(|(_, p)| p.x = 1279.0 - p.x),
            Kind::Reversed => points.iter_mut().for_each(|(x, _)| x.y = -x.y),
            Kind::Millimetres => points.iter_mut().for_each(|(x, _)| x.y *= 1000.0),
            Kind::Half => self.camera = self.camera.scaled_to(640, 480).expect("half"),
            Kind::Focal => self.set_matrix(|values| values[..2].iter_mut().for_each(|f| *f *= 1.37)),
            Kind::Crop => self.set_matrix(|values| {
                values[2] -= 300.0;
                values[3] += 170.0;
            }),
            Kind::Order => {
                let [k1, k2, p1, p2] = COEFFICIENTS;
                self.set_coefficients(Some([p1, p2, k1, k2]));
            }
            Kind::Undistorted => {
                let plain = camera(false);
                let straight =
                    |p: &Pixel| plain.project(&self.camera.bearing(p).expect("inside").into_inner());
                points.iter_mut().for_each(|(_, p)| *p = straight(p).expect("in front"));
            }
            Kind::Distorted => self.set_coefficients(None),
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    // In the order in which they come about: pixels undistorted, the file, the axes of image and points.
    Undistorted,
    Order,
    Distorted,
    Half,
    Focal,
    Crop,
    Upwards,
    Leftwards,
    Reversed,
    Millimetres,
    Exchanged,
}

impl Kind {
    const ALL: [Kind; 11] = [
        Kind::Undistorted,
        Kind::Order,
        Kind::Distorted,
        Kind::Half,
        Kind::Focal,
        Kind::Crop,
        Kind::Upwards,
        Kind::Leftwards,
        Kind::Reversed,
        Kind::Millimetres,
        Kind::Exchanged,
    ];

    fn is_of_coefficients(self) -> bool {
        matches!(self, Kind::Undistorted | Kind::Order | Kind::Distorted)
    }

    fn mirrors(self) -> bool {
        matches!(self, Kind::Upwards | Kind::Leftwards | Kind::Reversed)
    }

    /// Whether the image of a plane remains projective.
    fn is_projective(self) -> bool {
        !self.is_of_coefficients() && self != Kind::Millimetres
    }

    /// In a plane, y in millimetres is x in kilometres.
    fn is_found(self, fault: &Fault) -> bool {
        matches!(
            (self, fault),
            (Kind::Exchanged, Fault::PixelsExchanged)
                | (Kind::Upwards, Fault::RowsUpwards)
                | (Kind::Leftwards, Fault::ColumnsLeftwards)
                | (Kind::Reversed, Fault::AxisReversed | Fault::AxesExchanged)
                | (Kind::Millimetres, Fault::AxisUnit { axis: 0 | 1, .. })
                | (Kind::Half, Fault::OtherResolution { size: SIZE })
                | (Kind::Focal, Fault::OtherFocalLength { .. })
                | (Kind::Crop, Fault::OtherCrop { .. })
                | (Kind::Order, Fault::CoefficientOrder)
                | (Kind::Undistorted, Fault::UndistortedAlready)
                | (Kind::Distorted, Fault::Distorted { .. })
        )
    }
}

/// What the answers to one kind of input were.
#[derive(Debug, Default)]
struct Row {
    n_contradicted: usize,
    n_first: usize,
    n_named: usize,
    /// Consistent with a pose that is wrong by more than three standard deviations.
    n_wrong: usize,
}

fn row(kinds: &[Kind], is_planar: bool) -> Row {
    let mut row = Row::default();
    for seed in 0..n_seeds() {
        let mut random = SplitMix64::scattered(seed);
        let n = 12 + (seed as usize * 28) / (n_seeds() as usize - 1);
        let is_distorted = kinds.iter().any(|kind| kind.is_of_coefficients());
        let mut view = View::new(&mut random, n, is_planar, is_distorted);
        kinds.iter().for_each(|kind| view.apply(*kind));
        let (found, named) = view.solved(SIGMA_PX);
        if let Some(e) = found.ok().filter(|e| e.consistency == Consistency::Consistent) {
            row.n_wrong += usize::from(3.0 < off_sigmas(&e, &view.cam_from_target));
            continue;
        }
        let is_right = |e: &Explanation| {
            let has = |kind: &Kind| e.faults.iter().any(|fault| kind.is_found(fault));
            e.faults.len() == kinds.len() && kinds.iter().all(has)
        };
        row.n_contradicted += 1;
        row.n_first += usize::from(named.first().is_some_and(is_right));
        row.n_named += usize::from(named.iter().any(is_right));
    }
    println!("{kinds:?} {} {row:?}", if is_planar { "plane" } else { "space" });
    row
}

fn off_sigmas(e: &PoseEstimate, cam_from_target: &Pose) -> f64 {
    let off = (*cam_from_target * e.cam_from_target.inverse()).log();
    (0..6).map(|i| off[i].abs() / e.covariance[(i, i)].sqrt()).fold(0.0, f64::max)
}

/// The most probable explanation comes first, and its motion leads from the pose of the points as stated to the true one.
#[test]
fn an_explanation_states_its_probability_and_motion() {
    for kind in [Kind::Half, Kind::Focal, Kind::Exchanged] {
        let mut view = View::new(&mut SplitMix64::scattered(3), 30, false, false);
        view.apply(kind);
        let (found, named) = view.solved(SIGMA_PX);
        let probabilities: Vec<f64> = named.iter().map(|e| e.probability).collect();
        assert!(probabilities.is_sorted_by(|a, b| b <= a), "{kind:?}: {probabilities:?}");
        assert!(0.5 < probabilities[0] && probabilities.iter().sum::<f64>() <= 1.0 + 1e-12, "{kind:?}");
        assert_eq!(named[0].motion.is_some(), found.is_ok(), "{kind:?}");
        let Some((stated, motion)) = found.ok().zip(named[0].motion) else { continue };
        let off = |pose: &Pose| (*pose * view.cam_from_target.inverse()).log().norm();
        let (before, after) =
            (off(&stated.cam_from_target), off(&(Pose::exp(&motion) * stated.cam_from_target)));
        assert!(0.1 < before && after < 0.03, "{kind:?}: {before} before, {after} after");
    }
}

/// Pairs that can be in one input.
fn pairs() -> Vec<[Kind; 2]> {
    let all = Kind::ALL;
    let pairs = all.iter().enumerate().flat_map(|(i, a)| all[i + 1..].iter().map(|b| [*a, *b]));
    let is_possible = |[a, b]: &[Kind; 2]| {
        !(a.is_of_coefficients() && b.is_of_coefficients()) && [*a, *b] != [Kind::Half, Kind::Focal]
    };
    pairs.filter(is_possible).collect()
}

/// Other faults explain these as well, docs/math/suspects.md section 3.
fn has_equivalent([a, b]: [Kind; 2], is_planar: bool) -> bool {
    let in_space = (a.mirrors() || a == Kind::Crop) && b.mirrors() || [a, b] == [Kind::Half, Kind::Crop];
    in_space || is_planar && a.is_projective() && b.is_projective()
}

fn check(rows: &[Row], least_first: f64) {
    let count = |of: fn(&Row) -> usize| rows.iter().map(of).sum::<usize>() as f64;
    let (contradicted, first) = (count(|row| row.n_contradicted), count(|row| row.n_first));
    println!("first {first} of {contradicted}");
    assert_eq!(count(|row| row.n_wrong), 0.0);
    assert!(0.98 * contradicted <= first, "{first} of {contradicted}");
    for row in rows {
        assert_eq!(row.n_contradicted as u64, n_seeds());
        // Of a few inputs one more is missed by chance.
        assert!(least_first * row.n_contradicted as f64 - 1.0 < row.n_first as f64, "{row:?}");
    }
}

#[test]
fn one_fault_is_named_first() {
    let of_plane =
        Kind::ALL.into_iter().filter(|kind| *kind != Kind::Reversed).map(|kind| row(&[kind], true));
    let rows: Vec<Row> = Kind::ALL.into_iter().map(|kind| row(&[kind], false)).chain(of_plane).collect();
    check(&rows, 0.95);
}

/// In a plane a reversed axis is no contradiction.
#[test]
fn two_faults_are_named_first() {
    let pairs = pairs();
    let in_space = pairs.iter().filter(|pair| !has_equivalent(**pair, false)).map(|pair| row(pair, false));
    let is_seen = |pair: &&[Kind; 2]| !has_equivalent(**pair, true) && !pair.contains(&Kind::Reversed);
    let in_plane = pairs.iter().filter(is_seen).map(|pair| row(pair, true));
    let rows: Vec<Row> = in_space.chain(in_plane).collect();
    check(&rows, 0.85);
}

/// Where two explanations are one to the points, both are named: in nineteen of twenty inputs of each kind.
#[test]
fn equivalent_faults_are_all_named() {
    for pair in pairs().into_iter().filter(|pair| has_equivalent(*pair, false)) {
        let row = row(&pair, false);
        assert_eq!(row.n_contradicted as u64, n_seeds(), "{pair:?}");
        assert!(0.95 * row.n_contradicted as f64 - 1.0 < row.n_named as f64, "{pair:?}: {row:?}");
    }
}

/// Wrong points, and noise stated twice too small or too large, are no fault of this kind.
#[test]
fn right_files_have_no_fault() {
    let (mut n_named, mut n) = (0, 0);
    for (is_planar, is_distorted) in [(false, false), (false, true), (true, false), (true, true)] {
        for (sigma_px, n_wrong) in
            [(0.25, 0), (0.25, 1), (0.25, 2), (0.5, 1), (0.5, 2), (1.0, 0), (1.0, 1), (1.0, 2)]
        {
            for seed in 0..2 * n_seeds() {
                let mut random = SplitMix64::scattered(1000 + seed);
                let n_points = 12 + (seed as usize * 28) / (2 * n_seeds() as usize - 1);
                let mut view = View::new(&mut random, n_points, is_planar, is_distorted);
                for _ in 0..n_wrong {
                    let (size_px, about) = (10f64.powf(random.between(0.5, 2.5)), random.between(0.0, TAU));
                    let pixel = &mut view.points[random.below(n_points)].1;
                    *pixel += Pixel::new(about.cos(), about.sin()) * size_px;
                }
                n_named += usize::from(!view.solved(sigma_px).1.is_empty());
                n += 1;
            }
        }
    }
    println!("{n_named} of {n}");
    assert!(100 * n_named <= n, "{n_named} of {n}");
}
