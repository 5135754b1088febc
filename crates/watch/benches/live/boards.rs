//! Four cameras that see boards: three boards that stay, one that is taken away twice in two seconds and comes back elsewhere.

use crate::cameras::RATE_HZ;
use crate::live_support::{Pace, Replay, film, tag_pose, trembling, watched};
use resight::core::target::{AprilGrid, Charuco, Chessboard};
use resight::core::{Point, Pose, Target};
use resight_watch::live::LiveCamera;

/// Images of the board that is taken away: so many here, so many without it, as many there, and again without it.
const SHOWN: usize = 24;
const AWAY: usize = 8;
const ROUND: u64 = 2 * (SHOWN + AWAY) as u64;
/// Images of each board that stays.
const PICTURES: usize = 16;
/// The camera whose board is taken away.
pub const TAKEN: usize = 3;

/// Whether a camera's image is without its board.
pub fn is_away(camera: usize, number: u64) -> bool {
    camera == TAKEN && SHOWN as u64 <= number % (ROUND / 2)
}

pub fn target(camera: usize) -> Target {
    let (family, dictionary) = ("tag36h11".to_string(), "DICT_4X4_50".to_string());
    match camera {
        0 => Target::AprilGrid(AprilGrid {
            family,
            rows: 6,
            columns: 6,
            tag_size_m: 0.08,
            tag_spacing_ratio: 0.3,
            first_id: 0,
        }),
        1 => Target::Charuco(Charuco {
            rows: 7,
            columns: 10,
            square_m: 0.08,
            marker_m: 0.06,
            dictionary,
            legacy_pattern: false,
        }),
        _ => Target::Chessboard(Chessboard { rows: 6, columns: 9, square_m: 0.08 }),
    }
}

/// The board with its middle so many pixels from the image's, `edge_px` to 0.16 m.
fn pose(target: &Target, edge_px: f64, u_px: f64, v_px: f64) -> Pose {
    let points: Vec<Point> =
        target.features().into_iter().filter_map(|f| target.point(f)).map(|p| p.position).collect();
    let middle = points.iter().sum::<Point>() / points.len() as f64;
    // An AprilGrid's z points to the viewer.
    let upright = match target {
        Target::AprilGrid(_) => [std::f64::consts::PI, 0.0, 0.0, 0.0, 0.0, 0.0],
        _ => [0.0; 6],
    };
    tag_pose(edge_px, u_px, v_px)
        * Pose::exp(&upright.into())
        * Pose::exp(&[0.0, 0.0, 0.0, -middle.x, -middle.y, 0.0].into())
}

pub fn poses(camera: usize, target: &Target) -> Vec<Pose> {
    match camera {
        0 => trembling(pose(target, 75.0, 150.0, -60.0), PICTURES),
        1 => trembling(pose(target, 75.0, -180.0, 90.0), PICTURES),
        2 => trembling(pose(target, 75.0, -240.0, 120.0), PICTURES),
        _ => {
            let away = Pose::exp(&[0.0, 0.0, 0.0, 0.0, 0.0, -5.0].into());
            let shown = |u_px, v_px| trembling(pose(target, 70.0, u_px, v_px), SHOWN);
            let parts = [shown(-260.0, 120.0), vec![away; AWAY], shown(260.0, -140.0), vec![away; AWAY]];
            parts.concat()
        }
    }
}

pub fn from_memory(seconds: f64) -> Vec<LiveCamera> {
    let n_frames = (seconds * RATE_HZ) as u64;
    let camera = |i: usize| {
        let target = target(i);
        let pictures = film(&target, &poses(i, &target), 5000 * i as u64);
        watched(&target, Replay::new(&pictures, Pace::Live, RATE_HZ, n_frames))
    };
    (0..=TAKEN).map(camera).collect()
}
