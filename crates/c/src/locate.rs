//! `resight_detect` and `resight_locate`: images to points and poses.

use crate::answer::Answer;
use crate::call::call;
use crate::camera::Camera;
use crate::image::Image;
use crate::message::Message;
use crate::pointer::{Out, borrowed};
use crate::status::{Refusal, Status};
use crate::target::Target;
use resight::answer::DetectionAnswer;
use resight::detect::Detector;
use resight::detect::job;
use resight::locate::{ImageLocator, LocateOptions, Located, explain};

/// Finds the points of a target in an image.
///
/// Returns the status of the answer. Gives RESIGHT_STATUS_TARGET, and a null answer, for a target that is not detected in images.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_detect(
    target: *const Target,
    image: *const Image,
    answer: *mut *mut Answer,
    message: *mut Message,
) -> Status {
    let job = || {
        // SAFETY: what callers promise of their pointers.
        let (out, target, image) = unsafe {
            (Out::handle("answer", answer)?, borrowed("target", target)?, borrowed("image", image)?)
        };
        let answer = detected(target, image)?;
        let ended = (answer.status.into(), answer.message.clone().unwrap_or_default());
        out.give(Answer::of_detection(answer));
        Ok(ended)
    };
    // SAFETY: the same.
    unsafe { call(message, job) }
}

/// Solves for the pose of a camera from an image of a target: the answer of `resight locate`. Where the image has another size than the
/// camera's, but its aspect ratio, the intrinsics are scaled.
///
/// Returns the status of the answer. Gives RESIGHT_STATUS_TARGET, and a null answer, for a target that is not detected in images.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_locate(
    camera: *const Camera,
    target: *const Target,
    image: *const Image,
    answer: *mut *mut Answer,
    message: *mut Message,
) -> Status {
    let job = || {
        // SAFETY: what callers promise of their pointers.
        let (out, camera) = unsafe { (Out::handle("answer", answer)?, borrowed("camera", camera)?) };
        // SAFETY: the same.
        let (target, image) = unsafe { (borrowed("target", target)?, borrowed("image", image)?) };
        let Located { answer, detections, .. } = located(camera, target, image)?;
        let ended = (answer.status().into(), answer.verdict.message.clone());
        out.give(Answer::of_pose(answer, &detections, Vec::new()));
        Ok(ended)
    };
    // SAFETY: the same.
    unsafe { call(message, job) }
}

fn detected(target: &Target, image: &Image) -> Result<DetectionAnswer, Refusal> {
    let mut detector = Detector::new(&target.target).map_err(resight::Error::from)?;
    let mut answer = job::detect_target(&mut detector, &target.target, &image.view, &image.gray);
    answer.remarks.extend(image.remark.clone());
    target.with_explainer(|explainer| {
        job::explain(&mut answer, &target.target, explainer, || Some(image.gray.clone()));
    });
    Ok(answer)
}

fn located(camera: &Camera, target: &Target, image: &Image) -> Result<Located, Refusal> {
    let options = LocateOptions { intrinsics: camera.intrinsics(), ..LocateOptions::default() };
    let mut locator = ImageLocator::new(&camera.known.camera, &target.target, &options)?;
    let mut located = locator.locate(&image.gray, image.view.clone());
    located.answer.remarks.extend(image.remark.clone());
    target.with_explainer(|explainer| {
        explain(&mut located.answer, &target.target, explainer, || Some(image.gray.clone()));
    });
    let of_files = target.warnings.iter().chain(&camera.remarks);
    located.answer.remarks.splice(..0, of_files.cloned());
    Ok(located)
}
