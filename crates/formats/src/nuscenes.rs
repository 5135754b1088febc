//! nuScenes tables `calibrated_sensor.json` and `sensor.json`.
//!
//! `translation` and `rotation` (w, x, y, z) are the sensor's pose in the vehicle: x_ego = R x_sensor + t, metres. Images are
//! undistorted, so `camera_intrinsic` is all of the lens; it is empty for laser and radar. The image size is elsewhere
//! (`sample_data.json`). A sensor has a name (its channel) only in `sensor.json`.

use super::document::{Document, Fault, Value};
use super::emit::{list, quoted};
use super::entry::Entry;
use super::frames::Frames;
use super::lens::{self, LensNumbers};
use super::{
    CameraFile, CameraFormat, Contents, Format, NamedCamera, OutFile, Placement, Reads, WriteError, Writer,
    Written, checks, opencv,
};
use crate::FileError;
use crate::core::Pose;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::NuScenes,
    words: &["nuscenes"],
    reads: Some(Reads {
        recognises: |document| first(document).is_some_and(|e| is_calibration(&e) || is_sensor(&e)),
        read: |document| read(document, &[]),
        together: Some(together),
    }),
    write: Some(Writer::Rig(write)),
    traps: &[
        "translation and rotation are the sensor's pose in the vehicle (x_ego = R x_sensor + t): the inverse of OpenCV's \
            extrinsics; rotation is w, x, y, z.",
        "The images are undistorted already; undistorting them again spoils them.",
        "One vehicle has many entries of one channel, one a drive; take that of the sample (sample_data's \
            calibrated_sensor_token).",
    ],
};

const EGO: &str = "ego";

fn first(document: &Document) -> Option<Entry<'_>> {
    document.entry().items().ok()?.into_iter().next()
}

fn is_calibration(e: &Entry<'_>) -> bool {
    e.has("sensor_token") && e.has("translation") && e.has("rotation")
}

fn is_sensor(e: &Entry<'_>) -> bool {
    e.has("token") && e.has("channel") && e.has("modality")
}

/// Token and channel of every sensor.
type Channels = [(String, String)];

fn together(documents: &[&Document]) -> Result<Contents, FileError> {
    let mut channels = Vec::new();
    let mut contents = Contents::default();
    for document in documents.iter().filter(|d| first(d).is_some_and(|e| is_sensor(&e))) {
        channels.extend(sensors(document).map_err(|fault| fault.in_file(&document.path))?);
    }
    for document in documents.iter().filter(|d| first(d).is_some_and(|e| is_calibration(&e))) {
        let more = read(document, &channels).map_err(|fault| fault.in_file(&document.path))?;
        contents.cameras.extend(more.cameras);
        contents.relations.extend(more.relations);
        contents.warnings.extend(more.warnings);
    }
    Ok(contents)
}

fn sensors(document: &Document) -> Result<Vec<(String, String)>, Fault> {
    let text = |e: &Entry<'_>, key: &str| Ok(e.need(key)?.text()?.to_owned());
    document.entry().items()?.iter().map(|e| Ok((text(e, "token")?, text(e, "channel")?))).collect()
}

fn read(document: &Document, channels: &Channels) -> Result<Contents, Fault> {
    let mut contents = Contents::default();
    let entries = document.entry().items()?;
    if entries.first().is_some_and(is_sensor) {
        return Err(document
            .entry()
            .fault("names sensors only; give calibrated_sensor.json, or the folder of both"));
    }
    let names = names(&entries, channels)?;
    for (entry, name) in entries.iter().zip(names) {
        let placement = placement(entry, &name)?;
        let k = entry
            .get("camera_intrinsic")
            .filter(|k| !matches!(&k.node.value, Value::List(rows) if rows.is_empty()));
        match k {
            None => contents.relations.push(placement),
            Some(k) => {
                let matrix = checks::camera_matrix(&k)?;
                let camera = lens::camera(&k, &LensNumbers::Pinhole, matrix, None, &mut contents.warnings)?;
                contents.cameras.push(NamedCamera::new(name, camera, Some(placement)));
            }
        }
    }
    if channels.is_empty() {
        contents
            .notes
            .push("Sensors go by their tokens here; sensor.json beside this file has their channels.".into());
    }
    contents.warnings.push("the file states no image size (sample_data.json does)".into());
    Ok(contents)
}

/// The channel where `sensor.json` says it and it is the only one, else with the beginning of the token.
fn names(entries: &[Entry<'_>], channels: &Channels) -> Result<Vec<String>, Fault> {
    let mut known = Vec::new();
    for entry in entries {
        let (sensor, token) = (entry.need("sensor_token")?.text()?, entry.need("token")?.text()?);
        let channel = channels.iter().find(|(token, _)| token == sensor).map(|(_, channel)| channel.as_str());
        known.push((channel.unwrap_or(sensor), token));
    }
    let alone = |name: &str| known.iter().filter(|(other, _)| *other == name).count() == 1;
    let short = |token: &str| token.chars().take(8).collect::<String>();
    let name = |(name, token): &(&str, &str)| {
        if alone(name) { (*name).to_owned() } else { format!("{name}/{}", short(token)) }
    };
    Ok(known.iter().map(name).collect())
}

fn placement(entry: &Entry<'_>, name: &str) -> Result<Placement, Fault> {
    let rotation = entry.need("rotation")?;
    let q = rotation.exactly(4, "w, x, y, z")?;
    let translation = checks::vector3(&entry.need("translation")?)?;
    let b_from_a = checks::quaternion_pose(&rotation, [q[0], q[1], q[2], q[3]], translation)?;
    Ok(Placement { b: EGO.into(), a: name.to_owned(), b_from_a, covariance: None })
}

/// Cameras, and of the other frames those whose names say that they are laser scanners or radars.
fn write(rig: &CameraFile) -> Written {
    let frames = Frames::of_rig(rig);
    let ego = frames.common(&rig.cameras, &[EGO, "base_link", "body", "imu"], Format::NuScenes)?;
    let (mut calibrations, mut sensors) = (Vec::new(), Vec::new());
    for camera in &rig.cameras {
        let ego_from_cam = frames.between(&ego, &camera.name).unwrap_or_else(Pose::identity);
        calibrations.push(calibration(&camera.name, &ego_from_cam, &intrinsic(camera)?));
        sensors.push(sensor(&camera.name, "camera"));
    }
    for (frame, ego_from_frame) in frames.seen_from(&ego) {
        if let Some(modality) = modality(&frame).filter(|_| rig.cameras.iter().all(|c| c.name != frame)) {
            calibrations.push(calibration(&frame, &ego_from_frame, "[]"));
            sensors.push(sensor(&frame, modality));
        }
    }
    let file = |name: &str, entries: Vec<String>| OutFile {
        name: name.to_owned(),
        text: format!("[\n{}\n]\n", entries.join(",\n")),
    };
    Ok(vec![file("calibrated_sensor.json", calibrations), file("sensor.json", sensors)])
}

fn modality(frame: &str) -> Option<&'static str> {
    let lower = frame.to_lowercase();
    let says = |words: &[&str]| words.iter().any(|w| lower.contains(w));
    if says(&["lidar", "velo", "laser"]) {
        Some("lidar")
    } else if lower.contains("radar") {
        Some("radar")
    } else {
        None
    }
}

fn intrinsic(camera: &NamedCamera) -> Result<String, WriteError> {
    let (k, numbers) = lens::numbers_of(&camera.camera)?;
    if numbers != LensNumbers::Pinhole {
        return Err(WriteError(format!(
            "{}: has distortion, but nuScenes holds undistorted cameras; undistort the images first",
            camera.name
        )));
    }
    let rows = opencv::matrix_rows(&k);
    Ok(format!("[{}, {}, {}]", list(&rows[..3]), list(&rows[3..6]), list(&rows[6..])))
}

fn calibration(name: &str, ego_from_sensor: &Pose, intrinsic: &str) -> String {
    format!(
        "  {{\n    \"token\": \"{}\",\n    \"sensor_token\": \"{}\",\n    \"translation\": {},\n    \"rotation\": {},\n    \
            \"camera_intrinsic\": {intrinsic}\n  }}",
        token("calibrated_sensor", name),
        token("sensor", name),
        list(ego_from_sensor.translation.as_slice()),
        list(&ego_from_sensor.quaternion_wxyz())
    )
}

fn sensor(name: &str, modality: &str) -> String {
    let token = token("sensor", name);
    format!(
        "  {{\n    \"token\": \"{token}\",\n    \"channel\": {},\n    \"modality\": \"{modality}\"\n  }}",
        quoted(name)
    )
}

/// 32 hexadecimal digits that depend on table and name alone (FNV-1a, 128 bits), so that files are reproducible.
fn token(table: &str, name: &str) -> String {
    const OFFSET: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    const PRIME: u128 = 0x0000_0000_0100_0000_0000_0000_0000_013b;
    let bytes = table.bytes().chain([0]).chain(name.bytes());
    let hash = bytes.fold(OFFSET, |hash, byte| (hash ^ u128::from(byte)).wrapping_mul(PRIME));
    format!("{hash:032x}")
}
