//! Pictures of watched cameras: taken where frames are read, kept until the session has looked at them, encoded aside.

use resight::GrayImage;
use resight::core::{Camera, Target};
use resight::overlay::ground::target_lines;
use resight_watch::Request;
use resight_watch::live::Observation;
use resight_watch::source::{Content, Next, Source};
use serde_json::json;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::watch;

/// Longer side of a picture in the grid of cameras, px, and of the one shown at full size.
const SMALL_PX: u32 = 640;
const LARGE_PX: u32 = 1920;
/// Pictures of one camera, at most ten a second.
const APART: Duration = Duration::from_millis(95);
/// Frames that wait until the session has looked at them.
const WAITING: usize = 3;
/// Pictures that wait to be encoded; further ones are left out.
const ENCODING: usize = 4;
const QUALITY: u8 = 75;

/// A frame as pages get it: length of the header (u32, little end first), header, JPEG.
pub type Message = Arc<Vec<u8>>;

struct Waiting {
    number: u64,
    size_px: [u32; 2],
    small: GrayImage,
}

struct Job {
    camera: usize,
    header: serde_json::Value,
    image: GrayImage,
}

struct OneCamera {
    name: String,
    camera: Camera,
    targets: Vec<Arc<Target>>,
    waiting: Mutex<(Option<Instant>, VecDeque<Waiting>)>,
    /// Pages that show it at full size.
    large: AtomicUsize,
    newest: watch::Sender<Option<Message>>,
}

/// All cameras' pictures.
pub struct Pictures {
    cameras: Vec<OneCamera>,
    /// Pages that look on.
    lookers: AtomicUsize,
    jobs: Mutex<SyncSender<Job>>,
    began: Instant,
}

impl Pictures {
    /// Starts the thread that encodes; it ends with the pictures.
    pub fn new(request: &Request) -> Self {
        let cameras: Vec<OneCamera> = request.cameras.iter().map(one_camera).collect();
        let newest: Vec<watch::Sender<Option<Message>>> = cameras.iter().map(|c| c.newest.clone()).collect();
        let (sender, jobs) = sync_channel::<Job>(ENCODING);
        std::thread::spawn(move || {
            for job in jobs {
                if let (Some(message), Some(newest)) = (encoded(&job), newest.get(job.camera)) {
                    newest.send_replace(Some(Arc::new(message)));
                }
            }
        });
        Pictures { cameras, lookers: AtomicUsize::new(0), jobs: Mutex::new(sender), began: Instant::now() }
    }

    /// Seconds since the start.
    pub fn now_s(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    /// The newest picture of each camera.
    pub fn newest(&self) -> Vec<watch::Receiver<Option<Message>>> {
        self.cameras.iter().map(|c| c.newest.subscribe()).collect()
    }

    /// One more page looks on, or one less.
    pub fn look(&self, more: bool) {
        match more {
            true => self.lookers.fetch_add(1, Ordering::Relaxed),
            false => self.lookers.fetch_sub(1, Ordering::Relaxed),
        };
    }

    /// One more page shows this camera at full size, or one less.
    pub fn enlarge(&self, camera: usize, more: bool) {
        if let Some(one) = self.cameras.get(camera) {
            match more {
                true => one.large.fetch_add(1, Ordering::Relaxed),
                false => one.large.fetch_sub(1, Ordering::Relaxed),
            };
        }
    }

    /// A frame was read: kept small, if anybody looks on and the last was long enough ago.
    fn read(&self, camera: usize, number: u64, image: &GrayImage) {
        if self.lookers.load(Ordering::Relaxed) == 0 {
            return;
        }
        let Some(one) = self.cameras.get(camera) else { return };
        let now = Instant::now();
        {
            let mut waiting = one.waiting.lock().unwrap_or_else(PoisonError::into_inner);
            if waiting.0.is_some_and(|last| now.duration_since(last) < APART) {
                return;
            }
            waiting.0 = Some(now);
        }
        let limit = if 0 < one.large.load(Ordering::Relaxed) { LARGE_PX } else { SMALL_PX };
        let small = reduced(image, limit);
        let kept = Waiting { number, size_px: [image.width_px, image.height_px], small };
        let mut waiting = one.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        if WAITING <= waiting.1.len() {
            waiting.1.pop_front();
        }
        waiting.1.push_back(kept);
    }

    /// The session has looked at a frame: its picture goes out with what was found in it.
    pub fn observed(&self, camera: usize, target: usize, observation: &Observation) {
        let Some(one) = self.cameras.get(camera) else { return };
        if target + 1 < one.targets.len() && observation.estimate.is_none() {
            return; // A later target of the same frame may have been seen.
        }
        let mut waiting = one.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        while waiting.1.front().is_some_and(|w| w.number < observation.number) {
            waiting.1.pop_front();
        }
        if waiting.1.front().is_none_or(|w| w.number != observation.number) {
            return;
        }
        let Some(Waiting { size_px, small, .. }) = waiting.1.pop_front() else { return };
        drop(waiting);
        let overlay = one.overlay(target, observation, size_px);
        let header = json!({
            "camera": one.name, "frame": observation.number, "time_s": observation.capture_s,
            "width_px": size_px[0], "height_px": size_px[1], "overlay": overlay,
        });
        let sender = self.jobs.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let _ = sender.try_send(Job { camera, header, image: small }); // Left out where encoding does not keep up.
    }
}

impl OneCamera {
    /// Edges of the target, in pixels of the frame.
    fn overlay(&self, target: usize, observation: &Observation, [w, h]: [u32; 2]) -> serde_json::Value {
        let drawn = || {
            let (estimate, target) = (observation.estimate.as_ref()?, self.targets.get(target)?);
            let camera = resight::formats::check_image_size(&self.camera, w, h).ok()?;
            let lines = target_lines(&camera, &estimate.cam_from_target, target);
            let tenth = |x: f64| (10.0 * x).round() / 10.0;
            let curve = |line: &Vec<resight::core::Pixel>| -> Vec<[f64; 2]> {
                // A straight edge of 49 points is sent as seven.
                let step = (line.len() / 6).max(1);
                let last = line.len().saturating_sub(1);
                let kept = line.iter().enumerate().filter(|(i, _)| i % step == 0 || *i == last);
                kept.map(|(_, p)| [tenth(p.x), tenth(p.y)]).collect()
            };
            Some(lines.iter().map(curve).collect::<Vec<_>>())
        };
        json!({ "outline": drawn().unwrap_or_default(), "n_points": observation.n_points })
    }
}

fn one_camera(camera: &resight_watch::live::LiveCamera) -> OneCamera {
    OneCamera {
        name: camera.name.clone(),
        camera: camera.camera.clone(),
        targets: camera.targets.iter().map(|t| Arc::clone(&t.target)).collect(),
        waiting: Mutex::default(),
        large: AtomicUsize::new(0),
        newest: watch::Sender::new(None),
    }
}

/// Means of squares of pixels, so that the longer side is within the limit.
fn reduced(image: &GrayImage, limit_px: u32) -> GrayImage {
    let k = image.width_px.max(image.height_px).div_ceil(limit_px).max(1);
    if k == 1 {
        return image.clone();
    }
    let (width_px, height_px) = (image.width_px / k, image.height_px / k);
    let mut data = Vec::with_capacity((width_px * height_px) as usize);
    let mut sums = vec![0u32; width_px as usize];
    for v in 0..height_px {
        sums.fill(0);
        for row in 0..k {
            let from = ((v * k + row) * image.width_px) as usize;
            let pixels = &image.data[from..from + (width_px * k) as usize];
            for (sum, square) in sums.iter_mut().zip(pixels.chunks_exact(k as usize)) {
                *sum += square.iter().map(|p| u32::from(*p)).sum::<u32>();
            }
        }
        data.extend(sums.iter().map(|sum| (sum / (k * k)) as u8));
    }
    GrayImage { width_px, height_px, data }
}

fn encoded(job: &Job) -> Option<Vec<u8>> {
    let header = job.header.to_string();
    let mut message = u32::try_from(header.len()).ok()?.to_le_bytes().to_vec();
    message.extend(header.as_bytes());
    let GrayImage { width_px, height_px, data } = &job.image;
    let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut message, QUALITY);
    encoder.encode(data, *width_px, *height_px, image::ExtendedColorType::L8).ok()?;
    Some(message)
}

/// The JPEG of a message.
pub fn jpeg(message: &[u8]) -> Option<&[u8]> {
    let length = u32::from_le_bytes(message.get(..4)?.try_into().ok()?) as usize;
    message.get(4 + length..)
}

/// A source that pages see too.
pub struct Tap {
    source: Box<dyn Source>,
    camera: usize,
    pictures: Arc<Pictures>,
}

impl Tap {
    /// Of this camera.
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
