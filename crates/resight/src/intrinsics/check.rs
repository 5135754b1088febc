//! Tests whether given intrinsics fit new images.

use super::IntrinsicsRequest;
use super::gather::{CameraViews, gather};
use crate::answer::intrinsics::{CameraCheck, IntrinsicsCheckAnswer, OffsetObject, worst};
use crate::answer::{SchemaNumber, Status};
use crate::core::multiview::intrinsics_check::{
    self as mathematics, Blame, Group, IntrinsicsCheck, ParameterOffset,
};
use crate::core::{Camera, Correspondence};
use crate::error::Error;
use crate::formats::check_image_size;

/// Tests whether the intrinsics of the request's `checked` cameras fit the observations of the cameras of the same names; a single camera is
/// checked whatever the names.
///
/// # Errors
/// The errors of [`super::intrinsics()`]; a camera without observations.
pub fn check_intrinsics(request: &IntrinsicsRequest) -> Result<IntrinsicsCheckAnswer, Error> {
    let gathered = gather(request)?;
    let mut cameras = Vec::new();
    for seen in &gathered.cameras {
        let given = match &request.checked[..] {
            [only] if gathered.cameras.len() == 1 => Some(only),
            several => several.iter().find(|camera| camera.name == seen.name),
        };
        let Some(given) = given else {
            let names: Vec<String> = request.checked.iter().map(|camera| camera.name.clone()).collect();
            return Err(Error::request(crate::input::not_among(&seen.name, "camera", &names)));
        };
        cameras.push(checked(seen, &given.camera)?);
    }
    let status = worst(cameras.iter().map(|camera| camera.status));
    Ok(IntrinsicsCheckAnswer {
        schema: SchemaNumber,
        kind: "intrinsics_check",
        status,
        cameras,
        remarks: gathered.remarks,
    })
}

fn checked(seen: &CameraViews, given: &Camera) -> Result<CameraCheck, Error> {
    let camera = match seen.size {
        Some(size) => check_image_size(given, size.width_px, size.height_px).map_err(Error::request)?,
        None => given.clone(),
    };
    let frames: Vec<&[Correspondence]> = seen.views.iter().map(|view| &view.points[..]).collect();
    if frames.is_empty() {
        return Ok(untold(seen, Status::NotFound, "no target was found in any image".to_string()));
    }
    Ok(match mathematics::check_intrinsics(&frames, &camera) {
        Ok(check) => answer(seen, &check),
        Err(reason) => untold(seen, Status::Degenerate, reason.to_string()),
    })
}

fn untold(seen: &CameraViews, status: Status, message: String) -> CameraCheck {
    CameraCheck {
        name: seen.name.clone(),
        status,
        message,
        p: None,
        offsets: Vec::new(),
        undetermined: Vec::new(),
        n_views: 0,
        noise_scale: None,
    }
}

fn answer(seen: &CameraViews, check: &IntrinsicsCheck) -> CameraCheck {
    let is_blamed = |name: &str| check.blamed.iter().flat_map(|b| &b.parameters).any(|p| p.name == name);
    let offset = |p: &ParameterOffset| OffsetObject {
        name: p.name,
        given: p.given,
        offset: p.offset,
        sigma: p.sigma,
        blamed: is_blamed(p.name),
    };
    // For the kinds that are blamed, the offsets are those with only these kinds free, which are more accurate.
    let blamed = check.blamed.iter().flat_map(|b| &b.parameters).map(offset);
    let others = check.tested.iter().filter(|p| !is_blamed(p.name)).map(offset);
    CameraCheck {
        name: seen.name.clone(),
        status: if check.fits() { Status::Ok } else { Status::Inconsistent },
        message: sentence(check),
        p: Some(check.p_value),
        offsets: blamed.chain(others).collect(),
        undetermined: check.undetermined.clone(),
        n_views: check.n_frames,
        noise_scale: Some(check.noise_scale),
    }
}

/// "the focal length is off by 1.9 % ± 0.2 %; principal point and distortion fit".
fn sentence(check: &IntrinsicsCheck) -> String {
    let mut parts: Vec<String> = check.blamed.iter().map(blame).collect();
    let groups = Group::ALL;
    let is_tested = |group: Group| check.tested.iter().any(|p| Group::of(p.name) == group);
    let fitting: Vec<&str> = groups
        .into_iter()
        .filter(|group| is_tested(*group) && check.blamed.iter().all(|b| b.group != *group))
        .map(Group::name)
        .collect();
    match &fitting[..] {
        [] => {}
        [one] => parts.push(format!("the {one} fits")),
        [some @ .., last] => parts.push(format!("{} and {last} fit", some.join(", "))),
    }
    if !check.undetermined.is_empty() {
        parts.push(format!("the views leave {} open", check.undetermined.join(", ")));
    }
    parts.join("; ")
}

fn blame(blame: &Blame) -> String {
    let name = blame.group.name();
    let strongest = blame
        .parameters
        .iter()
        .max_by(|a, b| (a.offset / a.sigma).abs().total_cmp(&(b.offset / b.sigma).abs()));
    match (blame.group, strongest) {
        (Group::FocalLength, Some(p)) => {
            // The given value is too large where the views require a smaller one.
            let per_cent = |x: f64| 100.0 * x / p.given;
            format!("the {name} is off by {:+.2} % ± {:.2} %", per_cent(-p.offset), per_cent(p.sigma))
        }
        (Group::PrincipalPoint, _) => {
            let listed: Vec<String> = blame
                .parameters
                .iter()
                .map(|p| format!("{} by {:+.2} ± {:.2} px", p.name, -p.offset, p.sigma))
                .collect();
            format!("the {name} is off: {}", listed.join(", "))
        }
        (_, Some(p)) => {
            format!("the {name} does not fit ({} is off by {:+.4} ± {:.4})", p.name, -p.offset, p.sigma)
        }
        (_, None) => format!("the {name} does not fit"),
    }
}
