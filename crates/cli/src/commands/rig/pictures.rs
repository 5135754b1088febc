//! Targets found in images and videos.

mod views;

use super::{Collected, Frame, LeftOut, ObservationArgs, named};
use crate::table::Table;
use anyhow::{Context, Result, bail};
use resight::GrayImage;
use resight::core::correspondence::{Detection, Skipped, correspond};
use resight::core::target::Feature;
use resight::core::{Camera, Correspondence, Target};
use resight::detect::Detector;
use resight::formats::check_image_size;
use resight::source::video::{Video, is_video};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use views::Picture;

/// When each frame of each camera was taken, s.
type Times = HashMap<(usize, String), f64>;

/// A camera and its video file.
type CameraVideo = (usize, PathBuf);

/// A frame to look at.
struct Job {
    camera: usize,
    name: String,
    image: Source,
}

enum Source {
    File(PathBuf),
    Memory(GrayImage),
}

/// What was found in one frame.
struct Seen {
    camera: usize,
    name: String,
    found: Result<Sight, String>,
}

/// Targets in an image of a certain size.
struct Sight {
    /// The camera at the image's size.
    lens: Camera,
    targets: Vec<(usize, Vec<(String, Correspondence)>)>,
    skipped: Vec<(String, String)>,
}

/// Looks for every target in every frame.
pub fn look(args: &ObservationArgs, collected: &mut Collected) -> Result<()> {
    if collected.targets.is_empty() {
        bail!("--images needs --target FILE: what is to be found in them");
    }
    let times = args.timestamps.as_deref().map(|path| times(path, collected)).transpose()?;
    let (pictures, videos) = sources(&args.images, collected)?;
    let (names, remark) = views::names(&pictures, times.is_some())?;
    collected.remarks.extend(remark);
    let jobs = pictures.into_iter().zip(names).map(|(picture, name)| Job {
        camera: picture.camera,
        name,
        image: Source::File(picture.path),
    });
    let mut jobs: Vec<Job> = jobs.collect();
    jobs.sort_by(|a, b| a.camera.cmp(&b.camera).then_with(|| resight::rig::names::natural(&a.name, &b.name)));
    let mut lenses = vec![None; collected.cameras.len()];
    detect(args, &jobs, &mut lenses, collected)?;
    for (camera, path) in videos {
        watch(args, camera, &path, &mut lenses, collected)?;
    }
    for (camera, lens) in collected.cameras.iter_mut().zip(lenses) {
        camera.camera = lens.unwrap_or_else(|| camera.camera.clone());
    }
    times.map_or(Ok(()), |times| stamp(&times, collected))
}

/// Images and videos of each `NAME=GLOB`; a video belongs to one camera.
fn sources(arguments: &[String], collected: &mut Collected) -> Result<(Vec<Picture>, Vec<CameraVideo>)> {
    let (mut pictures, mut videos): (Vec<Picture>, Vec<CameraVideo>) = Default::default();
    let names: Vec<String> = collected.cameras.iter().map(|camera| camera.name.clone()).collect();
    for argument in arguments {
        let (Some(name), pattern) = named::split(argument) else {
            bail!("--images {argument}: say which camera took them, e.g. --images {}={argument}", names[0]);
        };
        let Some(camera) = names.iter().position(|known| known == name) else {
            bail!("--images {argument}: {}", named::not_among(name, "camera", &names));
        };
        for path in crate::files::expand(&[pattern.to_string()])? {
            collected.files.push(path.clone());
            if is_video(&path) {
                videos.push((camera, path));
            } else {
                pictures.push(Picture { camera, wild: views::wild_part(pattern, &path), path });
            }
        }
    }
    videos.sort();
    if let Some(pair) = videos.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        let (name, first, second) = (&names[pair[0].0], pair[0].1.display(), pair[1].1.display());
        bail!(
            "camera {name} has two videos, {first} and {second}; their frames would have the same numbers, give one"
        );
    }
    Ok((pictures, videos))
}

/// Frames of a video, a block at a time: memory stays bounded.
fn watch(
    args: &ObservationArgs,
    camera: usize,
    path: &Path,
    lenses: &mut [Option<Camera>],
    collected: &mut Collected,
) -> Result<()> {
    let mut frames = Video::open(path)?.enumerate();
    let size = 4 * rayon::current_num_threads();
    while let Some(block) = block(&mut frames, size) {
        let mut jobs = Vec::with_capacity(size);
        for (number, frame) in block {
            let name = number.to_string();
            match frame {
                Ok(image) => jobs.push(Job { camera, name, image: Source::Memory(image) }),
                Err(reason) => collected.left_out.push(LeftOut {
                    camera: collected.cameras[camera].name.clone(),
                    view: name,
                    what: "frame".into(),
                    reason: reason.to_string(),
                }),
            }
        }
        detect(args, &jobs, lenses, collected)?;
    }
    Ok(())
}

/// The next so many; none at the end. A block in which nothing could be decoded is not the end.
fn block<T>(frames: &mut impl Iterator<Item = T>, size: usize) -> Option<Vec<T>> {
    let block: Vec<T> = frames.take(size).collect();
    (!block.is_empty()).then_some(block)
}

/// Looks for every target in a list of frames, on all cores.
fn detect(
    args: &ObservationArgs,
    jobs: &[Job],
    lenses: &mut [Option<Camera>],
    collected: &mut Collected,
) -> Result<()> {
    let targets: Vec<Target> = collected.targets.iter().filter_map(|t| t.target.clone()).collect();
    let cameras: Vec<Camera> = collected.cameras.iter().map(|c| c.camera.clone()).collect();
    let detectors = || targets.iter().map(|target| args.corners.detector(target)).collect();
    let work = |detectors: &mut Vec<Detector>, job: &Job| Seen {
        camera: job.camera,
        name: job.name.clone(),
        found: sight(detectors, &targets, &cameras[job.camera], &job.image),
    };
    super::super::detect_in_order(jobs, detectors, work, |seen| {
        take(seen, lenses, collected);
        Ok(())
    })
}

fn sight(
    detectors: &mut [Detector],
    targets: &[Target],
    camera: &Camera,
    source: &Source,
) -> Result<Sight, String> {
    let read;
    let image = match source {
        Source::Memory(image) => image,
        Source::File(path) => {
            read = GrayImage::read(path).map_err(|e| e.to_string())?;
            &read
        }
    };
    let lens = check_image_size(camera, image.width_px, image.height_px)?;
    let mut sight = Sight { lens, targets: Vec::new(), skipped: Vec::new() };
    for (number, (detector, target)) in detectors.iter_mut().zip(targets).enumerate() {
        match detector.detect_with_camera(image, &sight.lens) {
            Ok(found) => sight.add(number, target, &found),
            Err(reason) => sight.skipped.push((target.kind().to_string(), reason.to_string())),
        }
    }
    Ok(sight)
}

impl Sight {
    fn add(&mut self, number: usize, target: &Target, found: &[Detection]) {
        let (seen, skipped) = correspond(found, target, &self.lens);
        let points: Vec<(String, Correspondence)> =
            seen.into_iter().map(|(feature, c)| (feature_name(target, feature), c)).collect();
        if !points.is_empty() {
            self.targets.push((number, points));
        }
        let told = |Skipped { feature, reason }: Skipped| {
            let reason = reason.map_or("not part of the target".to_string(), |reason| reason.to_string());
            (format!("point {}", feature_name(target, feature)), reason)
        };
        self.skipped.extend(skipped.into_iter().map(told));
    }
}

fn feature_name(target: &Target, feature: Feature) -> String {
    match target.has_tag_corners() {
        true => format!("{}.{}", feature.id, feature.corner),
        false => feature.id.to_string(),
    }
}

/// Files what a frame shows; all frames of a camera must have one size.
fn take(seen: Seen, lenses: &mut [Option<Camera>], collected: &mut Collected) {
    let Seen { camera, name, found } = seen;
    let mut leave_out = |what: &str, reason: String| {
        let (camera, view) = (collected.cameras[camera].name.clone(), name.clone());
        collected.left_out.push(LeftOut { camera, view, what: what.into(), reason });
    };
    let sight = match found {
        Ok(sight) => sight,
        Err(reason) => return leave_out("frame", reason),
    };
    let lens = lenses[camera].get_or_insert_with(|| sight.lens.clone());
    if lens.size != sight.lens.size {
        return leave_out("frame", "its size is not that of the camera's other frames".into());
    }
    sight.skipped.into_iter().for_each(|(what, reason)| leave_out(&what, reason));
    if sight.targets.is_empty() {
        return leave_out("frame", "no target in this image".into());
    }
    collected.frames.push(Frame { camera, name, t_s: None, targets: sight.targets });
}

fn times(path: &Path, collected: &mut Collected) -> Result<Times> {
    crate::files::must_exist(path)?;
    let table = Table::open(path, "camera,frame,t_s")?;
    let (camera, frame, t_s) =
        (table.need("camera", None)?, table.need("frame", None)?, table.need("t_s", None)?);
    let names: Vec<String> = collected.cameras.iter().map(|camera| camera.name.clone()).collect();
    let mut times = Times::new();
    table.each(|row| {
        let name = row.text(camera).unwrap_or_default();
        let number = names.iter().position(|known| known == name).with_context(|| {
            row.complaint(camera, &format!("is `{name}`: {}", named::not_among(name, "camera", &names)))
        })?;
        let Some(label) = row.text(frame) else { bail!(row.complaint(frame, "is empty; name the frame")) };
        let time = row.number(t_s)?;
        if !time.is_finite() {
            bail!(row.complaint(t_s, &format!("is {time}; remove the row or correct it")));
        }
        match times.insert((number, label.to_string()), time) {
            Some(_) => bail!(row.complaint(frame, &format!("is `{label}` a second time for camera {name}"))),
            None => Ok(()),
        }
    })?;
    collected.files.push(path.to_path_buf());
    Ok(times)
}

/// Gives each frame its time; those without one cannot be matched and are left out.
fn stamp(times: &Times, collected: &mut Collected) -> Result<()> {
    let frames = std::mem::take(&mut collected.frames);
    let n = frames.len();
    for mut frame in frames {
        frame.t_s = times.get(&(frame.camera, frame.name.clone())).copied();
        if frame.t_s.is_some() {
            collected.frames.push(frame);
            continue;
        }
        collected.left_out.push(LeftOut {
            camera: collected.cameras[frame.camera].name.clone(),
            view: frame.name,
            what: "frame".into(),
            reason: "no time stamp of this frame in the file of --timestamps".into(),
        });
    }
    if 0 < n && collected.frames.is_empty() {
        bail!(
            "--timestamps names none of the {n} frames: `frame` is an image's name without its ending, or the number of a video's frame counted from 0"
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eight damaged frames in a row are a whole block; what follows them belongs to the video all the same.
    #[test]
    fn a_block_of_damaged_frames_is_not_the_end() {
        let mut frames = (0..21).map(|i| if (4..14).contains(&i) { Err(i) } else { Ok(i) });
        let blocks: Vec<Vec<Result<i32, i32>>> = std::iter::from_fn(|| block(&mut frames, 4)).collect();
        assert!(blocks[1..3].iter().all(|block| block.iter().all(Result::is_err)));
        assert_eq!(blocks.iter().map(Vec::len).collect::<Vec<_>>(), [4, 4, 4, 4, 4, 1]);
        assert_eq!(blocks.concat().len(), 21);
    }
}
