//! COLMAP's text models: several images with one lens, rigs that moved, frames that win, files that are refused.

use crate::support::{assert_golden, assert_says, cameras, refusal, round_trip, seen_points};
use resight_formats::core::Point;
use resight_formats::{
    CameraFile, Format, OutFile, WriteError, read_cameras_from_bytes, read_rig, write_cameras,
};
use std::path::{Path, PathBuf};

#[test]
fn colmap_round_trips() {
    let read = round_trip("placed_rig.toml", Format::Colmap, "colmap", &[]);
    assert_eq!(read.cameras[0].placement.as_ref().unwrap().a, "world");
    assert!(read.warnings.is_empty(), "{:?}", read.warnings);
    round_trip("placed_wide.toml", Format::Colmap, "colmap_wide", &[]);
    assert_says(&refusal("basalt.json", Format::Colmap), &["COLMAP"]);
}

/// A folder of its own, removed at the end.
struct Model(PathBuf);

impl Model {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("resight-colmap-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let model = Model(folder);
        model.put("cameras.txt", "1 SIMPLE_RADIAL 640 480 500 320 240 -0.1\n2 PINHOLE 64 48 50 51 32 24\n");
        model
    }

    fn put(&self, name: &str, text: &str) {
        std::fs::write(self.0.join(name), text).unwrap();
    }

    fn read(&self) -> CameraFile {
        read_rig(std::slice::from_ref(&self.0)).unwrap()
    }

    #[track_caller]
    fn refuses(&self, name: &str, text: &str, words: &[&str]) {
        self.put(name, text);
        assert_says(&read_rig(std::slice::from_ref(&self.0)).unwrap_err().to_string(), words);
    }
}

impl Drop for Model {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Two images share camera 1: both are cameras that stand in the world, with one lens.
#[test]
fn images_that_share_a_camera() {
    let model = Model::new("shared");
    model.put(
        "images.txt",
        "# comment\n7 0.8 0 0.6 0 1 2 3 1 a/1.jpg\n10 20 -1 30 40 5\n9 1 0 0 0 -1 0 0 1 a/2.jpg\n\n",
    );
    let read = model.read().cameras;
    let names: Vec<&str> = read.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["a/1.jpg", "a/2.jpg", "2"]);
    assert_eq!(read[0].camera, read[1].camera);
    let p = read[0].placement.as_ref().unwrap();
    assert_eq!((p.b.as_str(), p.a.as_str()), ("a/1.jpg", "world"));
    // R turns by 2 atan(0.6/0.8) about y: x' = 0.28 x + 0.96 z + 1.
    let x = p.b_from_a * Point::new(1.0, 0.0, 2.0);
    assert!((x - Point::new(0.28 + 1.92 + 1.0, 2.0, -0.96 + 0.56 + 3.0)).norm() < 1e-12, "{x}");
}

/// The rig moved: its sensors are the cameras, called after the folders of their images.
#[test]
fn a_rig_that_moved_is_its_sensors() {
    let model = Model::new("moved");
    model.put("rigs.txt", "1 3 CAMERA 1 CAMERA 2 1 1 0 0 0 -0.5 0 0 IMU 7 1 1 0 0 0 0 0 0.25\n");
    model.put(
        "images.txt",
        "1 1 0 0 0 0 0 0 1 l/1.jpg\n\n2 1 0 0 0 -0.5 0 0 2 r/1.jpg\n\n3 1 0 0 0 1 0 0 1 l/2.jpg\n\n",
    );
    let read = model.read();
    let names: Vec<&str> = read.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["l", "r"]);
    let right = read.cameras[1].placement.as_ref().unwrap();
    assert_eq!((right.a.as_str(), right.b_from_a.translation), ("rig", Point::new(-0.5, 0.0, 0.0)));
    assert_eq!((read.relations[0].b.as_str(), read.relations[0].a.as_str()), ("imu7", "rig"));
}

#[test]
fn frames_win_over_images_and_it_is_said() {
    let model = Model::new("frames");
    model.put("rigs.txt", "1 2 CAMERA 1 CAMERA 2 1 1 0 0 0 -0.5 0 0\n");
    model.put("images.txt", "1 1 0 0 0 0 0 0 1 l/1.jpg\n\n2 1 0 0 0 -0.7 0 0 2 r/1.jpg\n\n");
    model.put("frames.txt", "1 1 1 0 0 0 0 0 4 2 CAMERA 1 1 CAMERA 2 2\n");
    let read = model.read();
    assert_says(&read.warnings.join(" "), &["images.txt contradicts", "l/1.jpg, r/1.jpg"]);
    let moved = read.cameras[1].placement.as_ref().unwrap().b_from_a.translation;
    assert_eq!(moved, Point::new(-0.5, 0.0, 4.0));
}

#[test]
fn broken_tables_are_refused_by_line() {
    let model = Model::new("broken");
    model.refuses("images.txt", "1 0.9 0 0 0 0 0 0 1 l.jpg\n\n", &["images.txt:1: image 1", "length 0.9"]);
    model.refuses("images.txt", "1 1 0 0 0 0 0 0 5 l.jpg\n\n", &["camera 5", "cameras.txt does not list"]);
    model.put("images.txt", "1 1 0 0 0 0 0 0 1 l.jpg\n\n");
    model.refuses(
        "rigs.txt",
        "1 2 CAMERA 1 CAMERA 2 1 1 0 0 0 -0.5 0\n",
        &["rigs.txt:1:", "6 numbers of a pose"],
    );
    model.refuses(
        "rigs.txt",
        "1 3 CAMERA 1 CAMERA 2 0\n",
        &["rigs.txt:1:", "3 sensors are announced, 2 follow"],
    );
    model.put("rigs.txt", "1 2 CAMERA 1 CAMERA 2 0\n");
    model.refuses(
        "frames.txt",
        "1 1 1 0 0 0 0 0 4 2 CAMERA 1 1 CAMERA 2\n",
        &["frames.txt:1:", "2 data ids take three words each; there are 5"],
    );
}

/// Every model of COLMAP's that we read, with our pixels for the judge.
#[test]
fn colmap_models_project_as_in_colmap() {
    let models = cameras("colmap_models.txt");
    assert_eq!(models.len(), 13);
    let mut text = String::from("rig,camera,x_m,y_m,z_m,u_px,v_px\n");
    for camera in &models {
        for (x, pixel) in seen_points(camera) {
            let name = &camera.name;
            text +=
                &format!("colmap_models,{name},{:?},{:?},{:?},{:?},{:?}\n", x.x, x.y, x.z, pixel.x, pixel.y);
        }
    }
    assert_golden("colmap_models", &[OutFile { name: "pixels.csv".into(), text }]);
    // Written as the most general model of each kind, they are the same lenses.
    let mut unplaced = models.clone();
    unplaced.iter_mut().for_each(|c| c.placement = None);
    let files = write_cameras(&unplaced, Format::Colmap).unwrap();
    let back = read_cameras_from_bytes(Path::new("x"), files[0].text.clone().into_bytes()).unwrap();
    for (a, b) in back.cameras.iter().zip(&models) {
        for (x, pixel) in seen_points(b) {
            assert!((a.camera.project(&x).unwrap() - pixel).norm() < 1e-9, "{}", b.name);
        }
    }
}

#[test]
fn colmap_alone_and_without_poses() {
    let intrinsics = write_cameras(&cameras("kalibr_camchain.yaml")[..2], Format::Colmap).unwrap();
    assert_eq!(intrinsics.len(), 5);
    let mut unplaced = cameras("placed_rig.toml");
    unplaced.iter_mut().for_each(|c| c.placement = None);
    let files = write_cameras(&unplaced, Format::Colmap).unwrap();
    assert_eq!(files.iter().map(|f| f.name.as_str()).collect::<Vec<_>>(), ["cameras.txt"]);
    unplaced[0].placement = cameras("placed_rig.toml")[0].placement.clone();
    let WriteError(reason) = write_cameras(&unplaced, Format::Colmap).unwrap_err();
    assert_says(&reason, &["no pose joins camera `right` to `world`"]);
    let mut blank = cameras("placed_rig.toml");
    blank[1].name = "front right".into();
    blank[1].placement.as_mut().unwrap().b = "front right".into();
    assert_says(&write_cameras(&blank, Format::Colmap).unwrap_err().0, &["`front right`", "blanks"]);
}
