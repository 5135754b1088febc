//! A COLMAP text model: `cameras.txt`, `images.txt`, `rigs.txt` and `frames.txt` of one folder, read together.
//!
//! `images.txt` holds cam_from_world, `rigs.txt` sensor_from_rig (the rig frame is its reference sensor's), `frames.txt`
//! rig_from_world; quaternions w x y z. Where frames and images disagree COLMAP itself goes by the frames.

use super::cameras::{camera_line, finite};
use super::tables::{Table, lines, table_of};
use crate::FileError;
use crate::core::{Point, Pose};
use crate::document::{Document, Fault, Node, Value};
use crate::entry::Entry;
use crate::{Contents, NamedCamera, Placement, checks};
use std::collections::BTreeMap;

/// Two poses of one image agree when they are nearer than this, rad and parts of the distance.
const AGREE: f64 = 1e-6;

#[derive(Default)]
struct Model {
    /// By CAMERA_ID, in file order; the name is the id.
    cameras: Vec<NamedCamera>,
    images: Vec<Image>,
    sensors: Vec<Sensor>,
    frames: Vec<Frame>,
    warnings: Vec<String>,
}

struct Image {
    id: String,
    camera_id: String,
    name: String,
    cam_from_world: Pose,
}

struct Sensor {
    rig_id: String,
    kind: String,
    id: String,
    /// None where the file says that it is not known.
    sensor_from_rig: Option<Pose>,
}

struct Frame {
    rig_id: String,
    rig_from_world: Pose,
    image_ids: Vec<String>,
}

/// Several tables of one model; the cameras of a file alone are `super::read`'s.
pub(super) fn read(documents: &[&Document]) -> Result<Contents, FileError> {
    let mut model = Model::default();
    for document in documents {
        model.add(document).map_err(|fault| fault.in_file(&document.path))?;
    }
    model.contents().map_err(|reason| {
        let images = documents.iter().find(|d| table_of(&d.text) == Some(Table::Images));
        FileError::new(&images.unwrap_or(&documents[0]).path, reason)
    })
}

/// `images.txt` or `rigs.txt` alone: poses without intrinsics.
pub(super) fn read_alone(document: &Document) -> Result<Contents, Fault> {
    let mut model = Model::default();
    model.add(document)?;
    let mut contents = Contents { warnings: model.warnings, ..Contents::default() };
    contents.relations.extend(model.images.into_iter().map(|image| Placement {
        b: image.name,
        a: "world".into(),
        b_from_a: image.cam_from_world,
        covariance: None,
    }));
    let names = rig_names(&model.sensors);
    contents.relations.extend(model.sensors.iter().filter_map(|s| s.placement(&s.frame_name(), &names)));
    Ok(contents)
}

impl Model {
    fn add(&mut self, document: &Document) -> Result<(), Fault> {
        match table_of(&document.text) {
            Some(Table::Cameras) => {
                for (line, words) in lines(&document.text) {
                    self.cameras.push(camera_line(line, &words, &mut self.warnings)?);
                }
            }
            Some(Table::Images) => self.images.extend(images(&document.text)?),
            Some(Table::Rigs) => {
                for (line, words) in lines(&document.text) {
                    self.sensors.extend(rig_line(line, &words)?);
                }
            }
            Some(Table::Frames) => {
                for (line, words) in lines(&document.text) {
                    self.frames.push(frame_line(line, &words)?);
                }
            }
            Some(Table::Points) | None => {}
        }
        Ok(())
    }

    fn contents(mut self) -> Result<Contents, String> {
        for image in &self.images {
            if self.cameras.iter().all(|c| c.name != image.camera_id) {
                let (name, id) = (&image.name, &image.camera_id);
                return Err(format!(
                    "image {name} was taken by camera {id}, which cameras.txt does not list"
                ));
            }
        }
        let contradiction = self.use_frames();
        self.warnings.extend(contradiction);
        let moves = self.cameras.iter().any(|c| 1 < self.images_of(&c.name).count());
        let is_rig = self.sensors.iter().any(|s| s.sensor_from_rig.is_some() && !s.is_reference());
        Ok(if moves && is_rig || self.images.is_empty() { self.rig() } else { self.views() })
    }

    fn images_of(&self, camera_id: &str) -> impl Iterator<Item = &Image> {
        self.images.iter().filter(move |i| i.camera_id == camera_id)
    }

    /// Poses of images from rig and frame, as COLMAP takes them; one sentence when `images.txt` says otherwise.
    fn use_frames(&mut self) -> Option<String> {
        let mut contradicted = Vec::new();
        let frames: BTreeMap<&str, &Frame> =
            self.frames.iter().flat_map(|f| f.image_ids.iter().map(move |id| (id.as_str(), f))).collect();
        for image in &mut self.images {
            let Some(frame) = frames.get(image.id.as_str()) else { continue };
            let mut sensors = self.sensors.iter();
            let of_image = |s: &&Sensor| s.rig_id == frame.rig_id && s.id == image.camera_id && s.is_camera();
            let Some(sensor_from_rig) = sensors.find(of_image).and_then(|s| s.sensor_from_rig) else {
                continue;
            };
            let pose = sensor_from_rig * frame.rig_from_world;
            let away = (pose.translation - image.cam_from_world.translation).norm();
            let turned = pose.angle_to_rad(&image.cam_from_world);
            if AGREE < turned || AGREE * (1.0 + pose.translation.norm()) < away {
                contradicted.push(image.name.clone());
                image.cam_from_world = pose;
            }
        }
        (!contradicted.is_empty()).then(|| {
            format!(
                "images.txt contradicts rigs.txt and frames.txt in the pose of {}; the frames are used, as \
                    COLMAP does",
                contradicted.join(", ")
            )
        })
    }

    /// Each image is a camera that stands in the world; several may share a CAMERA_ID and with it a lens.
    fn views(self) -> Contents {
        let mut contents = Contents { warnings: self.warnings, ..Contents::default() };
        for image in &self.images {
            let lens = self.cameras.iter().find(|c| c.name == image.camera_id);
            contents.cameras.extend(lens.map(|c| {
                NamedCamera::new(
                    image.name.clone(),
                    c.camera.clone(),
                    Some(Placement {
                        b: image.name.clone(),
                        a: "world".into(),
                        b_from_a: image.cam_from_world,
                        covariance: None,
                    }),
                )
            }));
        }
        let taken = |c: &NamedCamera| self.images.iter().any(|i| i.camera_id == c.name);
        contents.cameras.extend(self.cameras.iter().filter(|c| !taken(c)).cloned());
        contents
    }

    /// Each CAMERA_ID is a camera of its rig; where the rig went is not part of a calibration.
    fn rig(self) -> Contents {
        let mut contents = Contents::default();
        let names = rig_names(&self.sensors);
        for camera in &self.cameras {
            let name = self.folder_of(&camera.name).unwrap_or_else(|| camera.name.clone());
            let sensor = self.sensors.iter().find(|s| s.is_camera() && s.id == camera.name);
            let placement = sensor.and_then(|s| s.placement(&name, &names));
            contents.cameras.push(NamedCamera::new(name, camera.camera.clone(), placement));
        }
        let others = self.sensors.iter().filter(|s| !s.is_camera());
        contents.relations.extend(others.filter_map(|s| s.placement(&s.frame_name(), &names)));
        if !self.frames.is_empty() {
            let n = self.frames.len();
            contents.notes.push(format!("The poses of the rig in {n} frames are left out: the rig moved."));
        }
        contents.warnings = self.warnings;
        contents
    }

    /// COLMAP keeps the images of each camera of a rig in a folder of its own: `left/0001.jpg`.
    fn folder_of(&self, camera_id: &str) -> Option<String> {
        let mut folders =
            self.images_of(camera_id).map(|i| i.name.rsplit_once('/').map(|(folder, _)| folder));
        let first = folders.next()??;
        folders.all(|f| f == Some(first)).then(|| first.to_owned())
    }
}

impl Sensor {
    fn is_camera(&self) -> bool {
        self.kind == "CAMERA"
    }

    fn is_reference(&self) -> bool {
        self.sensor_from_rig == Some(Pose::identity())
    }

    fn frame_name(&self) -> String {
        if self.is_camera() { self.id.clone() } else { format!("{}{}", self.kind.to_lowercase(), self.id) }
    }

    fn placement(&self, name: &str, rig_names: &[(String, String)]) -> Option<Placement> {
        let rig = rig_names.iter().find(|(id, _)| *id == self.rig_id).map(|(_, name)| name.clone())?;
        self.sensor_from_rig.map(|b_from_a| Placement {
            b: name.to_owned(),
            a: rig,
            b_from_a,
            covariance: None,
        })
    }
}

/// `rig`, or `rig1`, `rig2` where there are several.
fn rig_names(sensors: &[Sensor]) -> Vec<(String, String)> {
    let mut ids: Vec<&String> = sensors.iter().map(|s| &s.rig_id).collect();
    ids.dedup();
    let only = ids.len() == 1;
    ids.into_iter().map(|id| (id.clone(), if only { "rig".into() } else { format!("rig{id}") })).collect()
}

/// Two lines an image: its pose, then its points, which may be an empty line.
fn images(text: &str) -> Result<Vec<Image>, Fault> {
    let mut images = Vec::new();
    let mut rest = text.lines().enumerate();
    while let Some((i, line)) = rest.next() {
        let words: Vec<&str> = line.split_whitespace().collect();
        if words.is_empty() || words[0].starts_with('#') {
            continue;
        }
        images.push(image_line(i + 1, &words)?);
        rest.next();
    }
    Ok(images)
}

fn image_line(line: usize, words: &[&str]) -> Result<Image, Fault> {
    let [id, pose @ ..] = words else { return Err(Fault::at(line, "an empty line")) };
    if words.len() < 10 {
        return Err(Fault::at(
            line,
            format!(
                "{} words; IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME are needed, then a line of points, which \
                    may be empty",
                words.len()
            ),
        ));
    }
    let at = format!("image {id}");
    let cam_from_world = pose_of(line, &at, &pose[..7])?;
    let (camera_id, name) = (words[8].to_owned(), words[9..].join(" "));
    Ok(Image { id: (*id).to_owned(), camera_id, name, cam_from_world })
}

fn rig_line(line: usize, words: &[&str]) -> Result<Vec<Sensor>, Fault> {
    let [id, count, sensors @ ..] = words else {
        return Err(Fault::at(line, "RIG_ID NUM_SENSORS are needed"));
    };
    let count = whole(line, count)?;
    let sensor = |kind: &str, sensor_id: &str, sensor_from_rig| Sensor {
        rig_id: (*id).to_owned(),
        kind: kind.to_owned(),
        id: sensor_id.to_owned(),
        sensor_from_rig,
    };
    let mut found = Vec::new();
    let mut rest = sensors;
    if let [kind, reference, others @ ..] = rest {
        found.push(sensor(kind, reference, Some(Pose::identity())));
        rest = others;
    }
    while let [kind, sensor_id, has_pose, others @ ..] = rest {
        let known = *has_pose == "1";
        let (pose, others) = if known { others.split_at(others.len().min(7)) } else { (&[][..], others) };
        let at = format!("rig {id}, sensor {kind} {sensor_id}");
        found.push(sensor(kind, sensor_id, known.then(|| pose_of(line, &at, pose)).transpose()?));
        rest = others;
    }
    if !rest.is_empty() || found.len() != count {
        let seen = found.len();
        return Err(Fault::at(line, format!("rig {id}: {count} sensors are announced, {seen} follow")));
    }
    Ok(found)
}

fn frame_line(line: usize, words: &[&str]) -> Result<Frame, Fault> {
    let [id, rig_id, pose_and_data @ ..] = words else {
        return Err(Fault::at(line, "FRAME_ID RIG_ID are needed"));
    };
    if pose_and_data.len() < 8 {
        return Err(Fault::at(
            line,
            format!("frame {id}: a pose of seven numbers and NUM_DATA_IDS are needed"),
        ));
    }
    let rig_from_world = pose_of(line, &format!("frame {id}"), &pose_and_data[..7])?;
    let (count, data) = (whole(line, pose_and_data[7])?, &pose_and_data[8..]);
    // A count that is announced may be any number: three times it need not be one.
    if !data.len().is_multiple_of(3) || data.len() / 3 != count {
        let seen = data.len();
        return Err(Fault::at(
            line,
            format!("frame {id}: {count} data ids take three words each; there are {seen}"),
        ));
    }
    let image_ids = data.chunks(3).filter(|d| d[0] == "CAMERA").map(|d| d[2].to_owned()).collect();
    Ok(Frame { rig_id: (*rig_id).to_owned(), rig_from_world, image_ids })
}

/// QW QX QY QZ TX TY TZ.
fn pose_of(line: usize, what: &str, words: &[&str]) -> Result<Pose, Fault> {
    let node = Node { line, value: Value::Null };
    let at = Entry::called(what, &node);
    let n = words.iter().map(|w| finite(&at, w)).collect::<Result<Vec<f64>, Fault>>()?;
    let [w, x, y, z, tx, ty, tz] = n[..] else {
        return Err(at.fault(format!("{} numbers of a pose; qw qx qy qz tx ty tz are needed", n.len())));
    };
    checks::quaternion_pose(&at, [w, x, y, z], Point::new(tx, ty, tz))
}

fn whole(line: usize, word: &str) -> Result<usize, Fault> {
    word.parse().map_err(|_| Fault::at(line, format!("`{word}` is not a count")))
}
