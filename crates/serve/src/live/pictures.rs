//! Pictures of watched cameras: taken where frames are read, kept until the session has processed them, encoded on another thread. Each is
//! encoded once, and all pages share its bytes.

use super::small::{message, reduced};
use axum::body::Bytes;
use resight::GrayImage;
use resight::core::{Camera, Pixel, Target};
use resight::overlay::ground::target_lines;
use resight_watch::Request;
use resight_watch::live::Observation;
use resight_watch::source::{Content, Next, Source};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{oneshot, watch};

/// Longer side of a picture in the grid of cameras, px, and of a single large one.
const SMALL_PX: u32 = 640;
const LARGE_PX: u32 = 1920;
/// Pictures of one camera, at most ten a second.
const APART: Duration = Duration::from_millis(95);
/// Number of frames that wait until the session has processed them.
const WAITING: usize = 3;
/// Pictures that wait to be encoded; further ones are left out.
const ENCODING: usize = 4;
const QUALITY: u8 = 75;

/// A frame as pages get it: length of the header (u32, little end first), header, JPEG.
pub type Message = Bytes;

/// The size of a camera's picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Size {
    /// Small, in the grid of cameras.
    Small = 0,
    /// Large, for one camera alone.
    Large = 1,
}

/// A frame on its way through the session.
struct Waiting {
    number: u64,
    size_px: [u32; 2],
    /// Small and large pictures, as far as a page shows them.
    images: [Option<GrayImage>; 2],
    outlines: Vec<Vec<[f64; 2]>>,
    residuals: Vec<[f64; 5]>,
}

/// What a picture is of: it goes before the JPEG of the same frame.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct PictureHeader {
    /// The camera's name.
    camera: String,
    /// Number of the frame.
    frame: u64,
    /// When it was taken, seconds of capture.
    time_s: f64,
    /// Of the frame itself; the JPEG may be smaller.
    width_px: u32,
    height_px: u32,
    /// Edges of the targets, in pixels of the frame.
    outline: Vec<Vec<[f64; 2]>>,
    /// Points with their residuals: column, row, the two parts of the residual, and 1 where it agrees with the pose. Large pictures only.
    #[serde(skip_serializing_if = "Option::is_none")]
    points: Option<Vec<[f64; 5]>>,
}

struct Job {
    camera: usize,
    header: PictureHeader,
    residuals: Vec<[f64; 5]>,
    images: [Option<GrayImage>; 2],
}

#[derive(Default)]
struct Kept {
    last: Option<Instant>,
    waiting: VecDeque<Waiting>,
    /// Requests for the next frame as it is.
    wanted: Vec<oneshot::Sender<GrayImage>>,
}

struct OneCamera {
    name: String,
    camera: Camera,
    targets: Vec<Arc<Target>>,
    kept: Mutex<Kept>,
    /// Pages that look at its small and its large picture.
    lookers: [AtomicUsize; 2],
    newest: [watch::Sender<Option<Message>>; 2],
}

/// The pictures of all cameras.
pub struct Pictures {
    cameras: Vec<OneCamera>,
    jobs: Mutex<SyncSender<Job>>,
    /// Changes with every picture.
    news: watch::Sender<u64>,
}

impl Pictures {
    /// Starts the thread that encodes; it ends with the pictures.
    pub fn new(request: &Request) -> Self {
        let cameras: Vec<OneCamera> = request.cameras.iter().map(one_camera).collect();
        let newest: Vec<_> = cameras.iter().map(|c| c.newest.clone()).collect();
        let (sender, jobs) = sync_channel::<Job>(ENCODING);
        let news = watch::Sender::new(0);
        let told = news.clone();
        std::thread::spawn(move || {
            for job in jobs {
                let Some(newest) = newest.get(job.camera) else { continue };
                for (size, message) in encoded(job) {
                    newest[size as usize].send_replace(Some(message));
                }
                told.send_modify(|n| *n += 1);
            }
        });
        Pictures { cameras, jobs: Mutex::new(sender), news }
    }

    /// Returns the number of cameras.
    pub fn n_cameras(&self) -> usize {
        self.cameras.len()
    }

    /// Returns a receiver that is notified of every new picture, of any camera.
    pub fn news(&self) -> watch::Receiver<u64> {
        self.news.subscribe()
    }

    /// The pictures of a camera from now on; an earlier one is not shown as if it were live.
    pub fn newest(&self, camera: usize, size: Size) -> Option<watch::Receiver<Option<Message>>> {
        self.cameras.get(camera).map(|one| one.newest[size as usize].subscribe())
    }

    /// Records that one more or one fewer page shows this picture.
    pub fn look(&self, camera: usize, size: Size, more: bool) {
        let Some(one) = self.cameras.get(camera) else { return };
        match more {
            true => one.lookers[size as usize].fetch_add(1, Ordering::Relaxed),
            false => one.lookers[size as usize].fetch_sub(1, Ordering::Relaxed),
        };
    }

    /// The next frame of a camera as it is.
    pub fn frame(&self, camera: usize) -> Option<oneshot::Receiver<GrayImage>> {
        let one = self.cameras.get(camera)?;
        let (sender, receiver) = oneshot::channel();
        let mut kept = one.kept();
        kept.wanted.retain(|wanted| !wanted.is_closed());
        kept.wanted.push(sender);
        Some(receiver)
    }

    /// Takes a frame: keeps it, reduced, if a page shows it and the last one was long enough ago.
    fn read(&self, camera: usize, number: u64, image: &GrayImage) {
        let Some(one) = self.cameras.get(camera) else { return };
        let wants = [Size::Small, Size::Large].map(|s| 0 < one.lookers[s as usize].load(Ordering::Relaxed));
        let wanted = std::mem::take(&mut one.kept().wanted);
        for wanted in wanted {
            let _ = wanted.send(image.clone()); // Who asked may have left.
        }
        {
            let mut kept = one.kept();
            let now = Instant::now();
            let is_early = kept.last.is_some_and(|last| now.duration_since(last) < APART);
            if is_early || wants == [false, false] {
                return;
            }
            kept.last = Some(now);
        }
        let made = |is_wanted: bool, limit_px| is_wanted.then(|| reduced(image, limit_px));
        let waiting = Waiting {
            number,
            size_px: [image.width_px, image.height_px],
            images: [made(wants[0], SMALL_PX), made(wants[1], LARGE_PX)],
            outlines: Vec::new(),
            residuals: Vec::new(),
        };
        let mut kept = one.kept();
        if WAITING <= kept.waiting.len() {
            kept.waiting.pop_front();
        }
        kept.waiting.push_back(waiting);
    }

    /// Records that the session has processed a frame for one target: after the last target its picture is sent with everything found in it.
    pub fn observed(&self, camera: usize, target: usize, observation: &Observation) {
        let Some(one) = self.cameras.get(camera) else { return };
        let size_px = {
            let mut kept = one.kept();
            while kept.waiting.front().is_some_and(|w| w.number < observation.number) {
                kept.waiting.pop_front();
            }
            let waiting = kept.waiting.front().filter(|w| w.number == observation.number);
            let Some(waiting) = waiting else { return };
            waiting.size_px
        };
        let (outlines, residuals) = one.overlay(target, observation, size_px);
        let mut kept = one.kept();
        // Newer frames may have taken its place meanwhile.
        let Some(waiting) = kept.waiting.front_mut().filter(|w| w.number == observation.number) else {
            return;
        };
        waiting.outlines.extend(outlines);
        waiting.residuals.extend(residuals);
        if target + 1 < one.targets.len() {
            return;
        }
        let Some(Waiting { size_px, images, outlines, residuals, .. }) = kept.waiting.pop_front() else {
            return;
        };
        drop(kept);
        let header = PictureHeader {
            camera: one.name.clone(),
            frame: observation.number,
            time_s: observation.capture_s,
            width_px: size_px[0],
            height_px: size_px[1],
            outline: outlines,
            points: None,
        };
        let sender = self.jobs.lock().unwrap_or_else(PoisonError::into_inner).clone();
        // Left out where encoding does not keep up.
        let _ = sender.try_send(Job { camera, header, residuals, images });
    }
}

impl OneCamera {
    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Edges of the target, and its points with their residuals, in pixels of the frame.
    fn overlay(
        &self,
        target: usize,
        observation: &Observation,
        [w, h]: [u32; 2],
    ) -> (Vec<Vec<[f64; 2]>>, Vec<[f64; 5]>) {
        let outline = || {
            let (estimate, target) = (observation.estimate.as_ref()?, self.targets.get(target)?);
            let camera = resight::formats::check_image_size(&self.camera, w, h).ok()?;
            let lines = target_lines(&camera, &estimate.cam_from_target, target);
            Some(lines.iter().map(|line| thinned(line)).collect::<Vec<_>>())
        };
        let point = |r: &resight_watch::live::PointResidual| {
            let ([du, dv], agrees) = (r.residual_px, f64::from(u8::from(r.agrees)));
            [tenth(r.pixel.x), tenth(r.pixel.y), hundredth(du), hundredth(dv), agrees]
        };
        (outline().unwrap_or_default(), observation.residuals.iter().map(point).collect())
    }
}

/// A straight edge of 49 points is sent as seven.
fn thinned(line: &[Pixel]) -> Vec<[f64; 2]> {
    let step = (line.len() / 6).max(1);
    let last = line.len().saturating_sub(1);
    let kept = line.iter().enumerate().filter(|(i, _)| i % step == 0 || *i == last);
    kept.map(|(_, p)| [tenth(p.x), tenth(p.y)]).collect()
}

fn tenth(x: f64) -> f64 {
    (10.0 * x).round() / 10.0
}

fn hundredth(x: f64) -> f64 {
    (100.0 * x).round() / 100.0
}

fn one_camera(camera: &resight_watch::live::LiveCamera) -> OneCamera {
    OneCamera {
        name: camera.name.clone(),
        camera: camera.camera.clone(),
        targets: camera.targets.iter().map(|t| Arc::clone(&t.target)).collect(),
        kept: Mutex::default(),
        lookers: Default::default(),
        newest: [watch::Sender::new(None), watch::Sender::new(None)],
    }
}

/// Residuals go with the large picture only, where they can be seen.
fn encoded(job: Job) -> Vec<(Size, Message)> {
    let Job { mut header, residuals, images: [small, large], .. } = job;
    let small = small.and_then(|image| Some((Size::Small, message(&header, &image, QUALITY)?.into())));
    let large = large.and_then(|image| {
        header.points = Some(residuals);
        Some((Size::Large, message(&header, &image, QUALITY)?.into()))
    });
    small.into_iter().chain(large).collect()
}

/// A source that pages see too.
pub struct Tap {
    source: Box<dyn Source>,
    camera: usize,
    pictures: Arc<Pictures>,
}

impl Tap {
    /// Wraps the source of this camera.
    pub fn new(source: Box<dyn Source>, camera: usize, pictures: Arc<Pictures>) -> Self {
        Tap { source, camera, pictures }
    }
}

impl Source for Tap {
    fn next(&mut self, patience: Duration) -> Next {
        let next = self.source.next(patience);
        if let Next::Frame(frame) = &next
            && let Content::Image(image) = &frame.content
        {
            self.pictures.read(self.camera, frame.number, image);
        }
        next
    }

    fn is_live(&self) -> bool {
        self.source.is_live()
    }

    fn are_photographs(&self) -> bool {
        self.source.are_photographs()
    }

    fn orientation(&self) -> Option<&'static str> {
        self.source.orientation()
    }

    fn key_frames(&self) -> Option<u64> {
        self.source.key_frames()
    }

    fn reuse(&mut self, spent: GrayImage) {
        self.source.reuse(spent);
    }
}

/// Stands for a source that was taken out.
pub struct Ended;

impl Source for Ended {
    fn next(&mut self, _patience: Duration) -> Next {
        Next::End
    }

    fn is_live(&self) -> bool {
        false
    }
}
