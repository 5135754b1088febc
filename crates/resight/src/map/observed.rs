//! Finds every tag of a family in images and videos.

use super::{MapLeftOut, MapRequest, Observed, TagView};
use crate::core::Camera;
use crate::core::correspondence::Detection;
use crate::detect::every_tag::EveryTagFinder;
use crate::error::Error;
use crate::formats::check_image_size;
use crate::image::GrayImage;
use crate::parallel::{detect_in_order, report};
use crate::rig::OTHER_SIZE;
use crate::video::{Video, is_video};
use std::path::PathBuf;

/// An image of the camera, or its video.
#[derive(Debug, Clone)]
pub enum MapImage {
    /// A file.
    File(PathBuf),
    /// An image in memory, with the name of its view.
    Memory(String, GrayImage),
}

/// An image to search.
enum Job<'a> {
    File(&'a PathBuf),
    Given(&'a str, &'a GrayImage),
    Frame(String, GrayImage),
}

/// The corners of each tag, by id.
type TagsOfImage = Vec<(u32, Vec<Detection>)>;

/// What a search found.
struct Found {
    name: String,
    tags: Result<(Camera, TagsOfImage), String>,
}

struct Search<'a> {
    request: &'a MapRequest,
    observed: Observed,
    lens: Option<Camera>,
}

pub(super) fn of_images(images: &[MapImage], request: &MapRequest) -> Result<Observed, Error> {
    if images.is_empty() {
        return Err(Error::request("no image is given"));
    }
    let observed = Observed {
        camera: request.camera.clone(),
        n_images: 0,
        views: Vec::new(),
        left_out: Vec::new(),
        remarks: Vec::new(),
    };
    let mut search = Search { request, observed, lens: None };
    // Runs of images, and videos between them, in the order given.
    for run in images.chunk_by(|a, b| !is_film(a) && !is_film(b)) {
        match run {
            [MapImage::File(path)] if is_video(path) => search.video(path)?,
            _ => {
                let jobs = run.iter().map(|image| match image {
                    MapImage::File(path) => Job::File(path),
                    MapImage::Memory(name, image) => Job::Given(name, image),
                });
                search.images(&jobs.collect::<Vec<_>>())?;
            }
        }
    }
    search.take_lens();
    Ok(search.observed)
}

fn is_film(image: &MapImage) -> bool {
    matches!(image, MapImage::File(path) if is_video(path))
}

impl Search<'_> {
    /// Searches the frames block by block, so that memory stays bounded.
    fn video(&mut self, path: &PathBuf) -> Result<(), Error> {
        let mut frames = Video::open(path)?.enumerate();
        let size = 4 * rayon::current_num_threads();
        loop {
            let mut jobs = Vec::with_capacity(size);
            let mut n = 0;
            for (number, frame) in frames.by_ref().take(size) {
                n += 1;
                let name = format!("{}#{number}", path.display());
                match frame {
                    Ok(image) => jobs.push(Job::Frame(name, image)),
                    Err(reason) => self.leave_out(name, reason.to_string()),
                }
            }
            if n == 0 {
                return Ok(());
            }
            self.images(&jobs)?;
        }
    }

    fn images(&mut self, jobs: &[Job]) -> Result<(), Error> {
        let (camera, family) = (&self.request.camera.camera, &self.request.family);
        let mut n_done = 0;
        let mut all = Vec::with_capacity(jobs.len());
        detect_in_order(
            jobs,
            || EveryTagFinder::new(family),
            |finder, job: &Job| find(finder, camera, job),
            |found: Found| -> Result<(), Error> {
                all.push(found);
                n_done += 1;
                report(n_done, jobs.len())
            },
        )?;
        all.into_iter().for_each(|found| self.take(found));
        Ok(())
    }

    fn take(&mut self, found: Found) {
        self.observed.n_images += 1;
        let Found { name, tags } = found;
        match tags {
            Err(reason) => self.leave_out(name, reason),
            Ok((lens, tags)) => {
                if self.lens.get_or_insert_with(|| lens.clone()).size != lens.size {
                    return self.leave_out(name, OTHER_SIZE.into());
                }
                self.observed.views.push(TagView { name, tags });
            }
        }
    }

    /// Takes the camera as it is for the size of the images.
    fn take_lens(&mut self) {
        let Some(lens) = self.lens.take() else { return };
        let camera = &mut self.observed.camera;
        if camera.camera.size.is_some_and(|size| Some(size) != lens.size)
            && camera.intrinsics_covariance.is_some()
        {
            camera.intrinsics_covariance = None;
            self.observed.remarks.push(
                "warning: the images are an enlargement or reduction of those of the camera file; the uncertainty of its intrinsics is not in the ±"
                    .to_string(),
            );
        }
        camera.camera = lens;
    }

    fn leave_out(&mut self, view: String, reason: String) {
        self.observed.left_out.push(MapLeftOut { view, what: "image".to_string(), reason });
    }
}

fn find(finder: &mut EveryTagFinder, camera: &Camera, job: &Job) -> Found {
    let (name, read);
    let image = match job {
        Job::File(path) => {
            name = path.display().to_string();
            match GrayImage::read(path) {
                Ok(image) => {
                    read = image;
                    &read
                }
                Err(reason) => return Found { name, tags: Err(reason.to_string()) },
            }
        }
        Job::Given(given, image) => {
            name = (*given).to_string();
            *image
        }
        Job::Frame(given, image) => {
            name = given.clone();
            image
        }
    };
    let tags = check_image_size(camera, image.width_px, image.height_px).map(|lens| {
        let found = finder.find(image);
        let tags = found.iter().flat_map(|family| &family.tags);
        (lens, tags.map(|tag| (tag.id, tag.detections().collect())).collect())
    });
    Found { name, tags }
}
