//! Photographs of a field whose tags are not quite where its layout says, rendered; what a layout leaves out; lengths that are not metres.
//!
//! f = 900 px, 1280 × 800 px, tags of 165.1 mm at 2.5–5 m, three to seven in view.

use resight::GrayImage;
use resight::core::camera::{CameraMatrix, ImageSize, Pinhole};
use resight::core::locate::Config;
use resight::core::locate::consistency::Consistency;
use resight::core::multiview::tag_map::{TargetPose, locate_target};
use resight::core::target::{MapTag, TagMap};
use resight::core::{Camera, Lens, Point, Pose, Target, Vector6};
use resight::detect::Detector;
use resight::detect::absent::instead_of;
use resight::formats::{
    Field, TagOptions, plausible, read_target, read_target_from_bytes, read_target_with, write_field_layout,
};
use resight::render::{Finish, Pcg, Scene, Style, render};
use resight::report::verdict::{self, Status};
use std::path::{Path, PathBuf};

fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 900.0, fy_px: 900.0, cx_px: 639.5, cy_px: 399.5 };
    let size = Some(ImageSize { width_px: 1280, height_px: 800 });
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size }
}

/// Upright, facing a horizontal direction of a world whose z is up.
fn tag(id: u32, place: [f64; 3], faces: [f64; 2]) -> MapTag {
    let n = Point::new(faces[0], faces[1], 0.0).normalize();
    let rotation = nalgebra::Matrix3::from_columns(&[Point::z().cross(&n), -Point::z(), -n]);
    let world_from_tag = Pose::new(rotation, Point::from(place));
    MapTag { id, size_m: 0.1651, world_from_tag, sigma_m: 0.010, sigma_rad: 0.014 }
}

/// Two walls and an island, read back from a WPILib layout: family, size and tolerance are the defaults.
fn layout() -> Target {
    let tags = vec![
        tag(1, [0.0, -1.2, 1.2], [1.0, 0.0]),
        tag(2, [0.0, -0.6, 1.45], [1.0, 0.0]),
        tag(3, [0.0, 0.5, 1.45], [1.0, 0.0]),
        tag(4, [0.0, 1.3, 1.1], [1.0, 0.2]),
        tag(5, [0.8, 1.9, 1.3], [0.2, -1.0]),
        tag(6, [1.6, 1.9, 0.9], [0.3, -1.0]),
        tag(7, [0.9, -1.5, 0.8], [0.6, 0.8]),
    ];
    let map = Target::TagMap(TagMap { family: "tag36h11".into(), tags, joint_covariance: None });
    let field = Field { length_m: 16.541, width_m: 8.211, keys_of_2027: false };
    let text = write_field_layout(&map, &field).unwrap().text;
    assert!(!text.contains("sigma"), "the defaults are not written");
    let read = read_target_from_bytes(Path::new("layout.json"), text.into_bytes()).unwrap();
    assert_eq!(read.warnings.len(), 1, "{:?}", read.warnings);
    read.target
}

fn tags_of(target: &Target) -> &[MapTag] {
    match target {
        Target::TagMap(map) => &map.tags,
        _ => unreachable!(),
    }
}

fn with(target: &Target, change: impl FnMut(&mut MapTag)) -> Target {
    let Target::TagMap(mut map) = target.clone() else { unreachable!() };
    map.tags.iter_mut().for_each(change);
    Target::TagMap(map)
}

fn uniform(chance: &mut Pcg, low: f64, high: f64) -> f64 {
    low + (high - low) * chance.uniform()
}

fn direction(chance: &mut Pcg) -> Point {
    loop {
        let v = Point::from_fn(|_, _| uniform(chance, -1.0, 1.0));
        if 0.1 < v.norm() && v.norm() < 1.0 {
            return v.normalize();
        }
    }
}

/// A tag where it really is: moved by so many metres, rotated by so many radians, in any direction.
fn hung(chance: &mut Pcg, tag: &mut MapTag, off_m: f64, rotation_rad: f64) {
    let (by, turn) = (direction(chance) * off_m, direction(chance) * rotation_rad);
    let turn = Pose::exp(&Vector6::new(turn.x, turn.y, turn.z, 0.0, 0.0, 0.0)).rotation;
    let at = tag.world_from_tag;
    tag.world_from_tag = Pose::new(turn * at.rotation, at.translation + by);
}

fn view(chance: &mut Pcg) -> Pose {
    let centre = Point::new(uniform(chance, 2.6, 4.2), uniform(chance, -1.0, 0.8), uniform(chance, 0.5, 1.1));
    let at = Point::new(0.3, uniform(chance, -0.3, 0.3), 1.2);
    let z = (at - centre).normalize();
    let x = z.cross(&Point::z()).normalize();
    let rotation = nalgebra::Matrix3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()]);
    Pose::new(rotation, -(rotation * centre))
}

fn photograph(real: &Target, cam_from_world: &Pose, seed: u64) -> GrayImage {
    let scene = Scene::of(real.clone(), *cam_from_world, Style::default());
    render(&scene, &camera(), &Finish { seed, ..Finish::default() }).unwrap()
}

fn located(image: &GrayImage, target: &Target) -> TargetPose {
    let found = Detector::new(target).unwrap().detect_with_camera(image, &camera()).unwrap();
    locate_target(&found, target, &camera(), &Config::default())
}

fn status(found: &TargetPose) -> Status {
    verdict::of_target(found, |i| format!("{:?}", found.features[i])).status
}

/// Tags 5–20 mm and up to 1° from where the layout says: `ok` with the tolerance that layouts get, not with a map that counts as exact.
#[test]
fn good_photographs_of_a_real_field_are_ok() {
    let (target, mut chance) = (layout(), Pcg::new(7));
    let exact = with(&target, |tag| (tag.sigma_m, tag.sigma_rad) = (0.0, 0.0));
    let (mut ok, mut ok_exact, mut sum) = (0, 0, 0.0);
    const N: u64 = 15;
    for seed in 0..N {
        let real = with(&target, |tag| {
            let (off_m, rotation_rad) =
                (uniform(&mut chance, 0.005, 0.020), uniform(&mut chance, 0.0, 0.017));
            hung(&mut chance, tag, off_m, rotation_rad);
        });
        let truth = view(&mut chance);
        let image = photograph(&real, &truth, seed);
        let (found, as_exact) = (located(&image, &target), located(&image, &exact));
        let e = found.estimate.as_ref().expect("a pose");
        let error = (e.cam_from_target * truth.inverse()).log();
        let nees = error.dot(&(e.covariance.try_inverse().unwrap() * error));
        sum += nees;
        let (now, before) = (status(&found), status(&as_exact));
        println!("{} tags, {now:?}, NEES {nees:.1}; as exact {before:?}", found.seen.len() / 4);
        ok += usize::from(now == Status::Ok && found.left_out.is_empty());
        let is_as_before = before == Status::Ok && as_exact.left_out.is_empty();
        ok_exact += usize::from(is_as_before);
    }
    println!("{ok} of {N} ok, {ok_exact} as exact, mean NEES {:.2}", sum / N as f64);
    assert_eq!(ok, N as usize);
    assert!(ok_exact <= 5, "the displacements do not matter: {ok_exact} ok without tolerance");
    assert!(sum / (N as f64) < 9.0, "mean NEES {}", sum / N as f64);
}

/// One tag 80 mm from its place: it is named with its distance, and the pose is that of the others.
#[test]
fn tag_out_of_place_is_named() {
    let (target, mut chance) = (layout(), Pcg::new(11));
    for seed in 0..4 {
        let real = with(&target, |tag| {
            let off_m = if tag.id == 3 { 0.0 } else { uniform(&mut chance, 0.0, 0.010) };
            hung(&mut chance, tag, off_m, 0.005);
            if tag.id == 3 {
                tag.world_from_tag.translation += Point::new(0.0, 0.08, 0.0);
            }
        });
        let truth = view(&mut chance);
        let found = located(&photograph(&real, &truth, seed), &target);
        let said = verdict::of_target(&found, |_| String::new());
        assert_eq!(said.status, Status::Ok, "{}", said.message);
        let ids: Vec<u32> = found.left_out.iter().map(|tag| tag.id).collect();
        assert_eq!(ids, [3], "{}", said.message);
        let distance_m = found.left_out[0].distance_m.unwrap();
        assert!((distance_m - 0.08).abs() < 0.035, "{distance_m}");
        let start = format!("tag 3 is {:.0} mm", 1e3 * distance_m);
        assert!(said.message.starts_with(&start) && said.message.contains("left out"), "{}", said.message);
        let e = found.estimate.unwrap();
        assert!((e.cam_from_target.origin() - truth.origin()).norm() < 0.1);
    }
}

/// Two tags, one of them out of place: both are named, and the answer is not `ok`.
#[test]
fn two_tags_that_contradict_are_named() {
    let keep = |target: &Target| -> Target {
        let Target::TagMap(mut map) = target.clone() else { unreachable!() };
        map.tags.retain(|tag| [2, 3].contains(&tag.id));
        Target::TagMap(map)
    };
    let target = keep(&layout());
    let real = with(&target, |tag| {
        if tag.id == 3 {
            tag.world_from_tag.translation += Point::new(0.0, 0.0, 0.25);
        }
    });
    let found = located(&photograph(&real, &view(&mut Pcg::new(3)), 1), &target);
    let said = verdict::of_target(&found, |_| String::new());
    assert_eq!((said.status, found.contradicting.as_slice()), (Status::Inconsistent, [2, 3].as_slice()));
    assert!(said.message.starts_with("tags 2 and 3 contradict each other"), "{}", said.message);
    assert!(matches!(found.estimate.unwrap().consistency, Consistency::Inconsistent { .. }));
}

/// Labels exchanged in the map, a map in millimetres, tags of another size: none of them is `ok`, unless the tags at fault are named.
#[test]
fn wrong_maps_are_not_ok() {
    let (target, mut chance) = (layout(), Pcg::new(5));
    let image = photograph(&target, &view(&mut chance), 1);
    let swapped = with(&target, |tag| tag.id = [0, 1, 3, 2, 4, 5, 6, 7][tag.id as usize]);
    let found = located(&image, &swapped);
    let ids: Vec<u32> = found.left_out.iter().map(|tag| tag.id).collect();
    assert_eq!(ids, [2, 3], "{:?}", found.left_out);
    let millimetres = with(&target, |tag| tag.world_from_tag.translation *= 1000.0);
    assert!(plausible::of_target(&millimetres)[0].contains("millimetres"));
    let found = located(&image, &millimetres);
    assert_ne!(status(&found), Status::Ok, "{:?}", found.left_out);
    let large = with(&target, |tag| tag.size_m = 0.25);
    let found = located(&image, &large);
    assert_eq!(status(&found), Status::Inconsistent, "{:?}", found.left_out);
}

/// Tags that are there but not those looked for are said to be.
#[test]
fn other_tags_in_the_image_are_named() {
    let (target, mut chance) = (layout(), Pcg::new(5));
    let image = photograph(&target, &view(&mut chance), 1);
    let foreign = with(&target, |tag| tag.id += 100);
    assert!(located(&image, &foreign).seen.is_empty());
    let said = instead_of(&foreign, &image).expect("tags are there");
    assert!(said.contains("tag36h11") && said.contains(" 2, "), "{said}");
    let Target::TagMap(map) = target.clone() else { unreachable!() };
    let tags = map.tags.into_iter().filter(|tag| tag.id < 30).collect();
    let other = Target::TagMap(TagMap { family: "tag16h5".into(), tags, joint_covariance: None });
    let said = instead_of(&other, &image).expect("tags are there");
    assert!(said.contains("tag36h11") && said.contains("--tag-family"), "{said}");
    let empty = GrayImage::filled(320, 240, 128);
    assert_eq!(instead_of(&target, &empty), None);
}

fn testdata() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata")
}

#[test]
fn what_a_layout_leaves_out_can_be_stated() {
    let path = testdata().join("formats/wpilib_2024.json");
    let options = TagOptions { family: Some("tag16h5".into()), size_m: Some(0.1524), sigma_m: Some(0.003) };
    let file = read_target_with(&path, &options).unwrap();
    let Target::TagMap(map) = &file.target else { unreachable!() };
    assert_eq!((map.family.as_str(), map.tags[1].size_m, map.tags[0].sigma_m), ("tag16h5", 0.1524, 0.003));
    assert_eq!(file.warnings, Vec::<String>::new());
    let half = TagOptions { family: None, ..options.clone() };
    assert!(read_target_with(&path, &half).unwrap().warnings[0].contains("no tag family"));
    // What a file states itself is not overruled.
    let own = testdata().join("formats/target_tag_map.toml");
    let refused = |options: TagOptions| read_target_with(&own, &options).unwrap_err().to_string();
    assert!(refused(TagOptions { size_m: Some(0.1), ..TagOptions::default() }).contains("--tag-size-m"));
    assert!(
        refused(TagOptions { family: Some("x".into()), ..TagOptions::default() }).contains("--tag-family")
    );
    let board = testdata().join("formats/target_chessboard.toml");
    assert!(read_target_with(&board, &options).unwrap_err().to_string().contains("maps of tags"));
}

#[test]
fn own_maps_state_tolerances() {
    let text = "kind = \"tag_map\"\nsigma_m = 0.004\n[[tag]]\nid = 1\nsize_m = 0.1\n\
        world_from_tag = { rotation_wxyz = [1, 0, 0, 0], translation_m = [0, 0, 0] }\n[[tag]]\nid = 2\nsize_m = 0.1\n\
        sigma_m = 0.02\nsigma_rad = 0.01\nworld_from_tag = { rotation_wxyz = [1, 0, 0, 0], translation_m = [1, 0, 0] }\n";
    let read = |text: &str| read_target_from_bytes(Path::new("map.toml"), text.as_bytes().to_vec());
    let target = read(text).unwrap().target;
    let sigmas: Vec<_> = tags_of(&target).iter().map(|tag| (tag.sigma_m, tag.sigma_rad)).collect();
    assert_eq!(sigmas, [(0.004, 0.0), (0.02, 0.01)]);
    let field = Field { length_m: 3.0, width_m: 2.0, keys_of_2027: false };
    assert!(write_field_layout(&target, &field).unwrap_err().0.contains("one tolerance"));
    let same = with(&target, |tag| (tag.sigma_m, tag.sigma_rad) = (0.004, 0.0));
    let back = write_field_layout(&same, &field).unwrap().text;
    let back = read_target_from_bytes(Path::new("x.json"), back.into_bytes()).unwrap().target;
    assert_eq!((tags_of(&back)[0].sigma_m, tags_of(&back)[0].sigma_rad), (0.004, 0.0));
    for wrong in ["-0.1", "nan", "inf"] {
        let refusal = read(&text.replace("0.004", wrong)).unwrap_err().to_string();
        assert!(refusal.contains("sigma_m"), "{refusal}");
    }
    assert!(read(&text.replace("0.004", "4.0")).unwrap().warnings[0].contains("did you mean 0.004?"));
}

/// Every file below a folder.
fn below(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for path in entries.flatten().map(|entry| entry.path()) {
        if path.is_dir() { below(&path, found) } else { found.push(path) }
    }
}

/// The points of a table with columns x_m, y_m, z_m.
fn points(path: &Path) -> Option<Vec<Point>> {
    let text = std::fs::read_to_string(path).ok()?;
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next()?.split(',').map(str::trim).collect();
    let column = |name: &str| header.iter().position(|c| *c == name);
    let columns = [column("x_m")?, column("y_m")?, column("z_m")?];
    let row = |line: &str| -> Option<Point> {
        let cells: Vec<&str> = line.split(',').collect();
        let [x, y, z] = columns.map(|i| cells.get(i).and_then(|cell| cell.trim().parse().ok()));
        Some(Point::new(x?, y?, z?))
    };
    Some(lines.filter_map(row).collect())
}

/// No target and no table that is shipped looks like another unit.
#[test]
fn no_shipped_file_is_remarked_on() {
    let mut files = Vec::new();
    below(&testdata(), &mut files);
    if let Some(data) = std::env::var_os("RESIGHT_DATA") {
        below(Path::new(&data), &mut files);
    }
    let (mut targets, mut tables) = (0, 0);
    for path in &files {
        let is_target =
            ["toml", "yaml", "json"].iter().any(|end| path.extension().is_some_and(|e| e == *end));
        if let Some(Ok(file)) = is_target.then(|| read_target(path)) {
            targets += 1;
            assert_eq!(plausible::of_target(&file.target), Vec::<String>::new(), "{}", path.display());
        }
        let is_table = path.extension().is_some_and(|e| e == "csv");
        if let Some(points) = is_table.then(|| points(path)).flatten() {
            tables += 1;
            assert_eq!(plausible::of_points(&points), None, "{}", path.display());
        }
    }
    println!("{targets} targets, {tables} tables of points");
    assert!(12 <= targets && 1 <= tables, "{targets} targets, {tables} tables");
}
