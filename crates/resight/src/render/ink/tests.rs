use super::*;
use crate::detect::families::APRILTAG_FAMILIES;
use crate::render::Pcg;
use resight_core::target::{AprilGrid, Charuco, Chessboard, CircleGrid, LinePlusOne, Tag};

fn is_inside(outline: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let edges = outline.iter().zip(outline.iter().cycle().skip(1));
    edges
        .filter(|(a, b)| (y < a[1]) != (y < b[1]) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
        .count()
        % 2
        == 1
}

fn is_black(ink: &Ink, at: [f64; 2]) -> bool {
    match ink {
        Ink::Area(outlines) => outlines.iter().filter(|o| is_inside(o, at)).count() % 2 == 1,
        Ink::Disc { centre_m: c, radius_m } => (at[0] - c[0]).hypot(at[1] - c[1]) < *radius_m,
    }
}

/// A target of every kind, tags of every family among them.
fn targets() -> Vec<Target> {
    let tag = |family: &str, id: u32| Target::Tag(Tag { family: family.into(), id, size_m: 0.1 });
    let family = || "tag36h11".to_owned();
    let turned = Pose::exp(&resight_core::Vector6::new(0.0, 0.0, 0.4, 0.3, 0.1, 0.0));
    let map_tag = |id: u32, world_from_tag: Pose| resight_core::target::MapTag {
        id,
        size_m: 0.1,
        world_from_tag,
        sigma_m: 0.0,
        sigma_rad: 0.0,
    };
    let tags = vec![map_tag(3, Pose::identity()), map_tag(8, turned)];
    let mut all: Vec<Target> = APRILTAG_FAMILIES.iter().map(|family| tag(family, 5)).collect();
    all.extend(
        ["DICT_4X4_50", "DICT_5X5_100", "DICT_7X7_1000", "DICT_APRILTAG_36h11"].map(|family| tag(family, 5)),
    );
    all.extend([
        Target::LinePlusOne(LinePlusOne { line_m: [0.0, 0.1, 0.15], off_m: [0.0, 0.15] }),
        Target::AprilGrid(AprilGrid {
            family: family(),
            rows: 2,
            columns: 3,
            tag_size_m: 0.06,
            tag_spacing_ratio: 0.3,
            first_id: 7,
        }),
        Target::Chessboard(Chessboard { rows: 3, columns: 4, square_m: 0.03 }),
        Target::CircleGrid(CircleGrid {
            rows: 5,
            columns: 3,
            spacing_m: 0.02,
            diameter_m: Some(0.012),
            asymmetric: true,
        }),
        Target::TagMap(resight_core::target::TagMap { family: family(), tags, joint_covariance: None }),
    ]);
    all.extend([(5, 4, false), (4, 5, true), (5, 5, true)].map(|(rows, columns, legacy_pattern)| {
        let (square_m, marker_m, dictionary) = (0.04, 0.03, "DICT_5X5_100".to_owned());
        Target::Charuco(Charuco { rows, columns, square_m, marker_m, dictionary, legacy_pattern })
    }));
    all
}

/// Evaluates the pattern that `render` samples, at a position in the target's frame.
fn is_rendered_black(target: &Target, [x, y]: [f64; 2]) -> bool {
    let style = Style { margin_m: Some(0.0), ..Style::default() };
    let ray = Point::new(x, y, 1.0);
    let placed = crate::render::Placed {
        target: target.clone(),
        cam_from_target: Pose::new(nalgebra::Matrix3::identity(), Point::new(0.0, 0.0, 1.0)),
        style,
    };
    // An AprilGrid is seen from its other side: the print is the same pattern, mirrored by the view.
    let flipped = crate::render::Placed {
        cam_from_target: Pose::exp(&resight_core::Vector6::new(
            std::f64::consts::PI,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
        )),
        ..placed.clone()
    };
    let (placed, ray) = match target {
        Target::AprilGrid(_) => {
            let cam_from_target = Pose::new(flipped.cam_from_target.rotation, Point::new(0.0, 0.0, 1.0));
            (crate::render::Placed { cam_from_target, ..flipped }, Point::new(x, -y, 1.0))
        }
        _ => (placed, ray),
    };
    let patches = pattern::patches(&placed).expect("patches");
    let mut nearest = (0.0, style.paper.unwrap_or(255.0));
    for patch in &patches {
        if let Some((nearness, grey)) = patch.hit(&ray)
            && nearest.0 < nearness
        {
            nearest = (nearness, grey);
        }
    }
    nearest.1 == style.ink
}

/// Print and image agree: at random positions over the sheet and slightly beyond, the outlines are black exactly where the renderer is.
#[test]
fn outlines_hold_what_the_renderer_draws() {
    let mut random = Pcg::new(7);
    for target in targets() {
        let sheet = sheet(&target, &Style::default()).expect("a sheet");
        let mut n_black = 0;
        for _ in 0..1500 {
            let at = [0, 1].map(|i| {
                let span = sheet.high_m[i] - sheet.low_m[i];
                sheet.low_m[i] + span * (1.1 * random.uniform() - 0.05)
            });
            let black = sheet.ink.iter().any(|ink| is_black(ink, at));
            n_black += usize::from(black);
            assert_eq!(black, is_rendered_black(&target, at), "{target:?} at {at:?}");
        }
        assert!((20..1480).contains(&n_black), "{target:?}: {n_black} of 1500 places are black");
    }
}

/// No two outlines share an edge: along each, black is on one side only.
#[test]
fn cells_that_share_an_edge_are_one_outline() {
    let sheet = sheet(&targets()[0], &Style::default()).expect("a sheet");
    let Some(Ink::Area(outlines)) = sheet.ink.first() else { panic!("a tag is an area") };
    for outline in outlines {
        for (a, b) in outline.iter().zip(outline.iter().cycle().skip(1)) {
            let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
            let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
            let off = 1e-4 / dx.hypot(dy);
            let side = |s: f64| is_black(&sheet.ink[0], [middle[0] - s * dy * off, middle[1] + s * dx * off]);
            assert!(side(1.0) && !side(-1.0), "an edge at {middle:?} has black on both sides or on none");
        }
    }
}
