//! Detects targets in images and videos, and collects them into frames.

mod kept;
mod times;
mod views;

use super::names::natural;
use super::observed::{Collected, Frame, LeftOut, NO_TARGET};
use crate::core::correspondence::{Detection, Skipped, correspond};
use crate::core::target::Feature;
use crate::core::{Camera, Correspondence, Target};
use crate::detect::absent::not_found;
use crate::detect::{CornerWindow, Detector};
use crate::error::{Error, FileError};
use crate::formats::check_image_size;
use crate::image::{GrayImage, exif, orientation_remark};
use crate::input::{self, Kind, not_among};
use crate::parallel::{detect_in_order, report};
use crate::report::words::counted;
use crate::video::{Video, is_video};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use views::ImageFile;

pub use kept::KeptDetections;
pub use times::FrameTimes;

/// An image of a camera, or its video.
#[derive(Debug, Clone)]
pub struct CameraImage {
    camera: String,
    frame: ImageSource,
}

#[derive(Debug, Clone)]
enum ImageSource {
    File { path: PathBuf, pattern: Option<String> },
    Memory { view: String, image: GrayImage },
}

impl CameraImage {
    /// Returns the name of its camera.
    pub fn camera(&self) -> &str {
        &self.camera
    }

    /// Takes the image or the video of a file. Images of the same name, without the extension, are one view.
    pub fn file(camera: impl Into<String>, path: impl Into<PathBuf>) -> Self {
        CameraImage { camera: camera.into(), frame: ImageSource::File { path: path.into(), pattern: None } }
    }

    /// Takes a file that matches a pattern: where the cameras' file names differ, the text matched by the wildcards is the name of the view.
    pub fn matched(camera: impl Into<String>, path: impl Into<PathBuf>, pattern: impl Into<String>) -> Self {
        let frame = ImageSource::File { path: path.into(), pattern: Some(pattern.into()) };
        CameraImage { camera: camera.into(), frame }
    }

    /// Takes an image in memory; images of the same `view` are one view.
    pub fn in_memory(camera: impl Into<String>, view: impl Into<String>, image: GrayImage) -> Self {
        CameraImage { camera: camera.into(), frame: ImageSource::Memory { view: view.into(), image } }
    }
}

/// The images with their times, and the settings of the detectors.
#[derive(Debug, Clone, Default)]
pub struct ImageOptions {
    /// The time of each frame; `None` if only names decide which frames are one view.
    pub times: Option<FrameTimes>,
    /// The window in which corners of chessboards and ChArUco boards are refined.
    pub corner_window: CornerWindow,
    /// Where detections in image files are kept between runs; `None` to search every image again.
    pub kept: Option<KeptDetections>,
}

/// The reason for leaving out a frame of another size.
pub(crate) const OTHER_SIZE: &str = "its size is not that of the camera's other frames";

/// A camera and its video file.
type CameraVideo = (usize, PathBuf);

/// A frame to search.
struct Job<'a> {
    camera: usize,
    name: String,
    image: Pixels<'a>,
}

enum Pixels<'a> {
    File(PathBuf),
    Given(&'a GrayImage),
    Decoded(GrayImage),
}

impl Pixels<'_> {
    /// Returns the image and how EXIF asks viewers to show it, or why it cannot be read.
    fn read(&self) -> Result<(Cow<'_, GrayImage>, Option<&'static str>), String> {
        match self {
            Pixels::Given(image) => Ok((Cow::Borrowed(image), None)),
            Pixels::Decoded(image) => Ok((Cow::Borrowed(image), None)),
            Pixels::File(path) => GrayImage::read_with_orientation(path)
                .map(|(image, orientation)| (Cow::Owned(image), orientation))
                .map_err(|e| e.to_string()),
        }
    }

    /// Returns the pixels for later use: a file will be read again.
    fn kept(&self) -> Pixels<'static> {
        match self {
            Pixels::Given(image) => Pixels::Decoded((*image).clone()),
            Pixels::Decoded(image) => Pixels::Decoded(image.clone()),
            Pixels::File(path) => Pixels::File(path.clone()),
        }
    }
}

/// Images that EXIF asks viewers to show otherwise than they are stored: for each camera and way, their number.
#[derive(Debug, Clone, Default)]
pub(crate) struct Orientations(BTreeMap<(usize, &'static str), usize>);

impl Orientations {
    /// Counts an image; `None` for one that is shown as it is stored.
    pub(crate) fn add(&mut self, camera: usize, how: Option<&'static str>) {
        if let Some(how) = how {
            *self.0.entry((camera, how)).or_default() += 1;
        }
    }

    /// Returns a warning for each camera and way.
    pub(crate) fn remarks(&self, name: impl Fn(usize) -> String) -> Vec<String> {
        let remark = |((camera, how), n): (&(usize, &'static str), &usize)| {
            let which = format!("{} of camera {}", counted(*n, "image"), name(*camera));
            format!("warning: {}", orientation_remark(&which, how))
        };
        self.0.iter().map(remark).collect()
    }
}

/// The detections in one frame.
struct FrameResult {
    camera: usize,
    name: String,
    found: Result<FoundTargets, String>,
}

/// The targets in an image of a certain size.
pub(crate) struct FoundTargets {
    /// The camera, scaled to the size of the image.
    pub lens: Camera,
    /// How EXIF asks viewers to show the image.
    orientation: Option<&'static str>,
    /// The targets (indices into those given) and their points.
    pub targets: Vec<(usize, Vec<(String, Correspondence)>)>,
    skipped: Vec<(String, String)>,
    /// Why targets are not unique, such as several copies in view.
    pub failed: Vec<String>,
}

/// Searches every frame for every target.
pub(crate) fn collect(
    images: &[CameraImage],
    options: &ImageOptions,
    collected: &mut Collected,
) -> Result<(), Error> {
    if collected.targets.is_empty() {
        return Err(Error::request("--images needs --target FILE: what is to be found in them"));
    }
    let names: Vec<String> = collected.cameras.iter().map(|camera| camera.name.clone()).collect();
    options.times.as_ref().map_or(Ok(()), |times| times.check(&names))?;
    let (jobs, videos) = jobs(images, options, &names, collected)?;
    let n_cameras = collected.cameras.len();
    let (lenses, without) = (vec![None; n_cameras], (0..n_cameras).map(|_| None).collect());
    let mut search = Search { options, lenses, without, oriented: Orientations::default(), collected };
    search.frames(&jobs)?;
    for (camera, path) in videos {
        search.video(camera, &path)?;
    }
    search.explain();
    options.kept.iter().for_each(KeptDetections::tidy);
    let Search { lenses, oriented, .. } = search;
    collected.remarks.extend(oriented.remarks(|camera| names[camera].clone()));
    for (camera, lens) in collected.cameras.iter_mut().zip(lenses) {
        camera.camera = lens.unwrap_or_else(|| camera.camera.clone());
    }
    options.times.as_ref().map_or(Ok(()), |times| times.stamp(collected))
}

/// Sorts images by camera and view, and separates videos, of which a camera has one.
fn jobs<'a>(
    images: &'a [CameraImage],
    options: &ImageOptions,
    names: &[String],
    collected: &mut Collected,
) -> Result<(Vec<Job<'a>>, Vec<CameraVideo>), Error> {
    let (mut jobs, mut files, mut videos): (Vec<Job>, Vec<ImageFile>, Vec<CameraVideo>) = Default::default();
    for image in images {
        let Some(camera) = names.iter().position(|known| *known == image.camera) else {
            let what = not_among(&image.camera, "camera", names);
            return Err(Error::request(format!("--images {}: {what}", image.given_as())));
        };
        match &image.frame {
            ImageSource::Memory { view, image } => {
                jobs.push(Job { camera, name: view.clone(), image: Pixels::Given(image) });
            }
            ImageSource::File { path, .. } if is_video(path) => videos.push((camera, path.clone())),
            ImageSource::File { path, pattern } => {
                let wild = pattern.as_ref().and_then(|pattern| views::wild_part(pattern, path));
                files.push(ImageFile { camera, wild, path: path.clone() });
            }
        }
        if let ImageSource::File { path, .. } = &image.frame {
            collected.files.push(path.clone());
        }
    }
    one_video_each(&mut videos, names)?;
    let (views, remark) = views::names(&files, options.times.is_some())?;
    collected.remarks.extend(remark);
    jobs.extend(files.into_iter().zip(views).map(|(file, name)| Job {
        camera: file.camera,
        name,
        image: Pixels::File(file.path),
    }));
    jobs.sort_by(|a, b| a.camera.cmp(&b.camera).then_with(|| natural(&a.name, &b.name)));
    Ok((jobs, videos))
}

impl CameraImage {
    /// Returns the name used in the command line.
    fn given_as(&self) -> String {
        match &self.frame {
            ImageSource::File { path, pattern: None } => format!("{}={}", self.camera, path.display()),
            ImageSource::File { pattern: Some(pattern), .. } => format!("{}={pattern}", self.camera),
            ImageSource::Memory { view, .. } => format!("{}={view}", self.camera),
        }
    }
}

fn one_video_each(videos: &mut [CameraVideo], names: &[String]) -> Result<(), Error> {
    videos.sort();
    match videos.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        Some(pair) => {
            let (name, first, second) = (&names[pair[0].0], pair[0].1.display(), pair[1].1.display());
            Err(Error::request(format!(
                "camera {name} has two videos, {first} and {second}; their frames would have the same numbers, give one"
            )))
        }
        None => Ok(()),
    }
}

/// The search for targets, with its results.
struct Search<'a> {
    options: &'a ImageOptions,
    /// Each camera, scaled to the size of its images, once one was read.
    lenses: Vec<Option<Camera>>,
    /// For each camera: the first frame that shows no target, and its index in `left_out`.
    without: Vec<Option<(usize, Pixels<'static>)>>,
    oriented: Orientations,
    collected: &'a mut Collected,
}

impl Search<'_> {
    /// Searches the frames of a video block by block, so that memory stays bounded.
    fn video(&mut self, camera: usize, path: &Path) -> Result<(), Error> {
        let mut frames = Video::open(path)?.enumerate();
        let size = 4 * rayon::current_num_threads();
        while let Some(block) = block(&mut frames, size) {
            let mut jobs = Vec::with_capacity(size);
            for (number, frame) in block {
                let name = number.to_string();
                match frame {
                    Ok(image) => jobs.push(Job { camera, name, image: Pixels::Decoded(image) }),
                    Err(reason) => self.leave_out(camera, name, "frame", reason.to_string()),
                }
            }
            self.frames(&jobs)?;
        }
        Ok(())
    }

    /// Searches a list of frames for every target, on all cores.
    fn frames(&mut self, jobs: &[Job]) -> Result<(), Error> {
        let targets: Vec<Target> = self.collected.targets.iter().filter_map(|t| t.target.clone()).collect();
        let cameras: Vec<Camera> = self.collected.cameras.iter().map(|c| c.camera.clone()).collect();
        let ImageOptions { corner_window: window, kept, .. } = self.options;
        let (window, knows_lens) = (*window, self.collected.knows_lenses);
        let detectors =
            || targets.iter().map(|target| Detector::with_corner_window(target, window)).collect();
        let work = |detectors: &mut Vec<Detector>, job: &Job| {
            let lens = (&cameras[job.camera], knows_lens);
            let seen = match (&job.image, kept) {
                (Pixels::File(path), Some(kept)) => {
                    seen_before(detectors, &targets, lens, path, (kept, window))
                }
                _ => job.image.read().and_then(|(image, how)| Seen::new(detectors, lens, &image, how)),
            };
            let found = seen.and_then(|seen| FoundTargets::new(&targets, lens.0, seen));
            FrameResult { camera: job.camera, name: job.name.clone(), found }
        };
        let mut n_done = 0;
        detect_in_order(jobs, detectors, work, |result| {
            self.take(result, &jobs[n_done].image);
            n_done += 1;
            report(n_done, jobs.len())
        })
    }

    /// Stores the results of a frame; all frames of a camera must have one size.
    fn take(&mut self, result: FrameResult, image: &Pixels) {
        let FrameResult { camera, name, found } = result;
        let found = match found {
            Ok(found) => found,
            Err(reason) => return self.leave_out(camera, name, "frame", reason),
        };
        self.oriented.add(camera, found.orientation);
        let lens = self.lenses[camera].get_or_insert_with(|| found.lens.clone());
        if lens.size != found.lens.size {
            return self.leave_out(camera, name, "frame", OTHER_SIZE.into());
        }
        if found.targets.is_empty() && !found.failed.is_empty() {
            return self.leave_out(camera, name, "frame", found.failed.join("; "));
        }
        if found.targets.is_empty() {
            self.collected.add_found(camera, name.clone(), found);
            if self.without[camera].is_none() {
                self.without[camera] = Some((self.collected.left_out.len(), image.kept()));
            }
            return self.leave_out(camera, name, "frame", NO_TARGET.into());
        }
        self.collected.add_found(camera, name, found);
    }

    /// For each camera that observed no target, explains what its first frame shows instead, in the same words as other commands.
    fn explain(&mut self) {
        let targets: Vec<Target> = self.collected.targets.iter().filter_map(|t| t.target.clone()).collect();
        for (camera, without) in std::mem::take(&mut self.without).into_iter().enumerate() {
            let saw_something = self.collected.frames.iter().any(|frame| frame.camera == camera);
            let Some((place, pixels)) = without.filter(|_| !saw_something) else { continue };
            let Ok((image, _)) = pixels.read() else { continue };
            let said: Vec<String> = targets.iter().map(|target| not_found(target, &image)).collect();
            if let Some(left_out) = self.collected.left_out.get_mut(place) {
                left_out.reason = said.join("; ");
            }
        }
    }

    fn leave_out(&mut self, camera: usize, view: String, what: &str, reason: String) {
        let camera = self.collected.cameras[camera].name.clone();
        self.collected.left_out.push(LeftOut { camera, view, what: what.into(), reason });
    }
}

impl Collected {
    /// Stores the targets in a frame, where there are any, and the points that take no part.
    pub(crate) fn add_found(&mut self, camera: usize, view: String, found: FoundTargets) {
        for (what, reason) in found.skipped {
            let camera = self.cameras[camera].name.clone();
            self.left_out.push(LeftOut { camera, view: view.clone(), what, reason });
        }
        if !found.targets.is_empty() {
            self.frames.push(Frame { camera, name: view, t_s: None, targets: found.targets });
        }
    }
}

/// Searches an image of a camera with an unknown lens for targets, each with its detector.
pub(crate) fn search_image(
    detectors: &mut [Detector],
    targets: &[Target],
    camera: &Camera,
    image: &GrayImage,
) -> Result<FoundTargets, String> {
    let seen = Seen::new(detectors, (camera, false), image, None)?;
    FoundTargets::new(targets, camera, seen)
}

/// Returns the next block of frames; `None` at the end. A block in which nothing could be decoded is not the end.
fn block<T>(frames: &mut impl Iterator<Item = T>, size: usize) -> Option<Vec<T>> {
    let block: Vec<T> = frames.take(size).collect();
    (!block.is_empty()).then_some(block)
}

/// What detectors find in an image.
struct Seen {
    size_px: [u32; 2],
    /// How EXIF asks viewers to show the image.
    orientation: Option<&'static str>,
    /// For each target its detections, or why they are none.
    targets: Vec<Result<Vec<Detection>, String>>,
}

impl Seen {
    /// Searches an image of a camera, whose lens the detectors use where it is known.
    fn new(
        detectors: &mut [Detector],
        (camera, knows_lens): (&Camera, bool),
        image: &GrayImage,
        orientation: Option<&'static str>,
    ) -> Result<Self, String> {
        let size_px = [image.width_px, image.height_px];
        let lens = check_image_size(camera, image.width_px, image.height_px)?;
        let find = |detector: &mut Detector| match knows_lens {
            true => detector.detect_with_camera(image, &lens),
            false => detector.detect(image),
        };
        let targets = detectors.iter_mut().map(|d| find(d).map_err(|reason| reason.to_string())).collect();
        Ok(Seen { size_px, orientation, targets })
    }
}

/// Returns what is kept of an image file; otherwise searches it, and keeps what is found.
fn seen_before(
    detectors: &mut [Detector],
    targets: &[Target],
    lens: (&Camera, bool),
    path: &Path,
    (kept, window): (&KeptDetections, CornerWindow),
) -> Result<Seen, String> {
    let bytes = input::read(path, Kind::Image).map_err(|e| e.to_string())?;
    let place = kept.place(&bytes, targets, lens.1.then_some(lens.0), window);
    if let Some(seen) = kept::read(&place, &bytes, targets.len()) {
        return Ok(seen);
    }
    let image = GrayImage::decode(&bytes).map_err(|reason| FileError::new(path, reason).to_string())?;
    let seen = Seen::new(detectors, lens, &image, exif::orientation(&bytes))?;
    kept::write(&place, &seen);
    Ok(seen)
}

impl FoundTargets {
    /// Relates what was seen to the points of the targets.
    fn new(targets: &[Target], camera: &Camera, seen: Seen) -> Result<Self, String> {
        let Seen { size_px: [width_px, height_px], orientation, targets: found_of } = seen;
        let lens = check_image_size(camera, width_px, height_px)?;
        let mut found =
            FoundTargets { lens, orientation, targets: Vec::new(), skipped: Vec::new(), failed: Vec::new() };
        for (number, (target, detections)) in targets.iter().zip(found_of).enumerate() {
            match detections {
                Ok(detections) => found.add(number, target, &detections),
                Err(reason) => {
                    found.skipped.push((target.kind().to_string(), reason.clone()));
                    found.failed.push(reason);
                }
            }
        }
        Ok(found)
    }

    fn add(&mut self, number: usize, target: &Target, detections: &[Detection]) {
        let (seen, skipped) = correspond(detections, target, &self.lens);
        let points: Vec<(String, Correspondence)> =
            seen.into_iter().map(|(feature, c)| (feature_name(target, feature), c)).collect();
        if !points.is_empty() {
            self.targets.push((number, points));
        }
        let named = |Skipped { feature, reason }: Skipped| {
            let reason = reason.map_or("not part of the target".to_string(), |reason| reason.to_string());
            (format!("point {}", feature_name(target, feature)), reason)
        };
        self.skipped.extend(skipped.into_iter().map(named));
    }
}

fn feature_name(target: &Target, feature: Feature) -> String {
    match target.has_tag_corners() {
        true => format!("{}.{}", feature.id, feature.corner),
        false => feature.id.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eight damaged frames in succession are a whole block; the frames after them still belong to the video.
    #[test]
    fn a_block_of_damaged_frames_is_not_the_end() {
        let mut frames = (0..21).map(|i| if (4..14).contains(&i) { Err(i) } else { Ok(i) });
        let blocks: Vec<Vec<Result<i32, i32>>> = std::iter::from_fn(|| block(&mut frames, 4)).collect();
        assert!(blocks[1..3].iter().all(|block| block.iter().all(Result::is_err)));
        assert_eq!(blocks.iter().map(Vec::len).collect::<Vec<_>>(), [4, 4, 4, 4, 4, 1]);
        assert_eq!(blocks.concat().len(), 21);
    }
}
