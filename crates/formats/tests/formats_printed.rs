//! Our own target file, written and read back; the printed scale in it.

use resight_formats::core::target::{
    AprilGrid, Charuco, Chessboard, CircleGrid, LinePlusOne, MapTag, NamedPoint, PrintedScale, Tag, TagMap,
};
use resight_formats::core::{Point, Pose, Target, Vector6};
use resight_formats::{explain_from_bytes, own_target_file, read_target_from_bytes, write_field_layout};

fn targets() -> Vec<Target> {
    let pose = Pose::exp(&Vector6::new(0.1, -0.2, 0.3, 1.0 / 3.0, 2e-7, 12.5));
    let tag = |id, world_from_tag, sigma_m| MapTag {
        id,
        size_m: 0.1651,
        world_from_tag,
        sigma_m,
        sigma_rad: 0.5 * sigma_m,
    };
    let family = || "tag16h5".to_owned();
    vec![
        Target::LinePlusOne(LinePlusOne { line_m: [-0.1, 1.0 / 7.0, 3.0], off_m: [1e-9, -0.15] }),
        Target::Tag(Tag { family: family(), id: 29, size_m: 0.1 + 0.2 }),
        Target::AprilGrid(AprilGrid {
            family: family(),
            rows: 6,
            columns: 7,
            tag_size_m: 0.088,
            tag_spacing_ratio: 0.3,
            first_id: 4,
        }),
        Target::Chessboard(Chessboard { rows: 6, columns: 9, square_m: 1.0 / 30.0 }),
        Target::Charuco(Charuco {
            rows: 5,
            columns: 8,
            square_m: 0.03,
            marker_m: 0.022,
            dictionary: "DICT_4X4_50".into(),
            legacy_pattern: true,
        }),
        Target::CircleGrid(CircleGrid {
            rows: 11,
            columns: 4,
            spacing_m: 1.0 / 30.0,
            diameter_m: Some(0.01),
            asymmetric: true,
        }),
        Target::CircleGrid(CircleGrid {
            rows: 7,
            columns: 9,
            spacing_m: 0.02,
            diameter_m: None,
            asymmetric: false,
        }),
        Target::TagMap(TagMap {
            family: family(),
            tags: vec![tag(3, pose, 0.01), tag(1, Pose::identity(), 0.0)],
            joint_covariance: None,
        }),
        Target::Points(vec![
            NamedPoint {
                name: "north \"gate\"".into(),
                position: Point::new(1e3, -0.0, 1.0 / 3.0),
                sigma_m: 0.002,
            },
            NamedPoint { name: "b".into(), position: Point::zeros(), sigma_m: 0.0 },
        ]),
    ]
}

fn read(text: &str) -> Result<Target, String> {
    read_target_from_bytes("board.toml", text.as_bytes().to_vec())
        .map(|file| file.target)
        .map_err(|e| e.to_string())
}

/// Positions to the last bit, but where a rotation passes through its quaternion.
fn assert_same(read: &Target, written: &Target) {
    assert_eq!(read.features(), written.features());
    for feature in written.features() {
        let (a, b) = (read.point(feature).unwrap(), written.point(feature).unwrap());
        let rounding = if written.has_tag_corners() { 1e-14 } else { 0.0 };
        assert!(
            (a.position - b.position).norm() <= rounding && a.sigma_m == b.sigma_m,
            "{written:?}: {a:?} {b:?}"
        );
    }
    if !matches!(written.design(), Target::TagMap(_)) {
        assert_eq!(read, written);
    }
}

#[test]
fn every_kind_reads_back_as_written() {
    let scale = PrintedScale { ratio: [0.9964, 1.0 + 1.0 / 300.0], sigma: [1e-3 / 3.0, 2e-7] };
    for target in targets() {
        let text = own_target_file(&target, "two\nlines");
        assert!(text.starts_with("# two\n# lines\nkind = "), "{text}");
        assert_same(&read(&text).unwrap(), &target);
        if matches!(target, Target::Points(_)) || target.kind() == "tag_map" {
            continue;
        }
        let printed = target.printed_at(scale);
        let back = read(&own_target_file(&printed, "")).unwrap();
        assert_same(&back, &printed);
        assert_eq!(back.printed_scale(), Some(&scale));
    }
    let flat = |id: u32, x: f64| MapTag {
        id,
        size_m: 0.05,
        world_from_tag: Pose::exp(&Vector6::new(0.0, 0.0, 0.0, x, 0.0, 0.0)),
        sigma_m: 0.0,
        sigma_rad: 0.0,
    };
    let sheet = Target::TagMap(TagMap {
        family: "tag36h11".into(),
        tags: vec![flat(0, 0.0), flat(1, 0.08)],
        joint_covariance: None,
    });
    let printed = sheet.printed_at(scale);
    assert_same(&read(&own_target_file(&printed, "")).unwrap(), &printed);
}

#[test]
fn a_scale_that_cannot_be_is_refused_with_its_reason() {
    let chess = "kind = \"chessboard\"\nrows = 6\ncolumns = 9\nsquare_m = 0.03\n";
    for (scale, needed) in [
        ("{ x = 0.99, y = 1.0 }", "`sigma_x` is missing"),
        ("{ x = 0.9, y = 1.0, sigma_x = 0.0, sigma_y = 0.0 }", "within 5 %"),
        ("{ x = nan, y = 1.0, sigma_x = 0.0, sigma_y = 0.0 }", "finite number"),
        ("{ x = 1.0, y = 1.0, sigma_x = -1e-3, sigma_y = 0.0 }", "standard deviation"),
        ("{ x = 1.0, y = 1.0, sigma_x = 0.0, sigma_y = 0.0, z = 1.0 }", "z"),
        ("1.01", "table of keys"),
    ] {
        let reason = read(&format!("{chess}printed_scale = {scale}\n")).unwrap_err();
        assert!(reason.contains(needed) && reason.contains("board.toml"), "{scale}: {reason}");
    }
    let points = "kind = \"points\"\nprinted_scale = { x = 1.0, y = 1.0, sigma_x = 0.0, sigma_y = 0.0 }\n[[point]]\nname = \"a\"\nposition_m = [0, 0, 0]\n";
    assert!(read(points).unwrap_err().contains("printed_scale"));
}

#[test]
fn a_printed_scale_is_explained_and_not_lost() {
    let scale = PrintedScale { ratio: [0.996, 1.002], sigma: [1e-3, 5e-4] };
    let board = targets()[3].printed_at(scale);
    let text = own_target_file(&board, "");
    let said = explain_from_bytes("board.toml", text.into_bytes()).unwrap();
    assert!(said.contains("-0.400 % ± 0.100 % along x and +0.200 % ± 0.050 % along y"), "{said}");
    let map = targets()[5].printed_at(scale);
    let field = resight_formats::Field { length_m: 16.0, width_m: 8.0, keys_of_2027: false };
    let reason = write_field_layout(&map, &field).expect_err("no place for it").to_string();
    assert!(reason.contains("printed scale"), "{reason}");
}
