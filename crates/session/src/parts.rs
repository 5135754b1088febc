//! The parts of a view.

use crate::cameras::{CommonCamera, of_model};
use crate::lens::{self, KnownLens};
use crate::measuring::Measured;
use crate::photograph::Photograph;
use crate::places::Places;
use crate::pose::Solved;
use crate::solving::StatedLens;
use crate::state::{Distance, ImagePoint, Measurement, PhotoState, State};
use crate::texts;
use crate::view::{DistanceView, LensView, MeasurementView, PhotoView, PointView};
use resight::core::Pixel;
use resight::measure::words::values_in_words;
use resight::overlay::ground::prediction_ellipse;

/// Two-sided 95 % point of the normal distribution.
const NORMAL_95: f64 = 1.96;
/// A residual of two parts exceeds this many variances once in a thousand times.
const SUSPECT_CHI2: f64 = 13.816;
/// Share of a point's variance that the pose must leave to its residual, below which nothing checks the point.
const LEAST_REST: f64 = 1e-3;

/// A photograph, and whether its lens can be that of others.
pub fn photo_view(p: &PhotoState, lends_lens: bool) -> PhotoView {
    let size = p.photograph.size();
    PhotoView {
        name: p.photograph.name.clone(),
        sha256: p.photograph.sha256.clone(),
        width_px: size.width_px,
        height_px: size.height_px,
        has_exif_lens: p.photograph.exif.is_some(),
        common_camera: common_camera(&p.photograph).map(|camera| camera.name),
        exif_advice: match p.photograph.exif {
            Some(_) => None,
            None => Some(texts::no_exif_lens(p.photograph.camera.as_ref())),
        },
        lends_lens,
    }
}

/// Returns the camera of the list that a photograph's EXIF names, where no lens follows from that.
fn common_camera(photograph: &Photograph) -> Option<&'static CommonCamera> {
    let camera = photograph.camera.as_ref().filter(|_| photograph.exif.is_none())?;
    of_model(camera.model.as_deref()?)
}

/// Returns the view of its lens; `solved` is the pose that is drawn, and `is_old` where that is of an earlier state.
pub fn lens_view(lens: &StatedLens, solved: Option<&Solved>, is_old: bool) -> LensView {
    let none = LensView {
        state: "given",
        words: String::new(),
        model: None,
        hfov_deg: None,
        remark: None,
        error: None,
    };
    match lens.known.as_deref() {
        Ok(KnownLens::Camera { camera, remark, name, .. }) => LensView {
            words: name.clone(),
            model: Some(camera.model_name().to_owned()),
            hfov_deg: lens::hfov_deg(camera),
            remark: remark.clone(),
            ..none
        },
        Ok(KnownLens::Unknown(_)) => {
            let focal = solved.and_then(|s| s.answer.estimated_focal.as_ref());
            LensView {
                state: if focal.is_some() && !is_old { "estimated" } else { "open" },
                words: focal.map_or_else(|| texts::OPEN_LENS.to_owned(), |focal| focal.words()),
                hfov_deg: focal.map(|f| f.horizontal_field_of_view_rad.to_degrees()),
                ..none
            }
        }
        Err(error) => LensView { state: "refused", error: Some(error.clone()), ..none },
    }
}

/// The distances typed.
pub fn distances_view(state: &State, places: &Places) -> Vec<DistanceView> {
    let one = |(i, d): (usize, &Distance)| {
        let ends = places.by_name.get(&d.a).zip(places.by_name.get(&d.b));
        let by_places = ends.map(|(a, b)| (a.x_m - b.x_m).norm());
        let computed_m = places.computed_m.get(i).copied().flatten().or(by_places);
        DistanceView {
            a: d.a.clone(),
            b: d.b.clone(),
            distance_m: d.distance_m,
            sigma_m: d.sigma_m,
            computed_m,
        }
    };
    state.distances.iter().enumerate().map(one).collect()
}
/// Points that other photographs show and this one does not, in the order in which they were placed.
pub fn names_elsewhere(state: &State, photo: usize) -> Vec<String> {
    let Some(shown) = state.photos.get(photo) else { return Vec::new() };
    let mut names: Vec<String> = Vec::new();
    for point in state.photos.iter().flat_map(|p| &p.points) {
        if !names.contains(&point.name) && shown.points.iter().all(|p| p.name != point.name) {
            names.push(point.name.clone());
        }
    }
    names
}

/// Returns the view of its points, with their residuals.
pub fn points_view(
    state: &State,
    photo: &PhotoState,
    places: &Places,
    solved: Option<&Solved>,
    measured: Option<&Measured>,
) -> Vec<PointView> {
    let mut all: Vec<PointView> =
        photo.points.iter().map(|p| point_view(state, p, places, solved, measured)).collect();
    let has_check = solved.is_some_and(|s| s.answer.estimate.is_some_and(|e| 0 < e.degrees_of_freedom));
    let residual = |p: &PointView| p.residual_px.unwrap_or(0.0);
    let worst = all.iter_mut().max_by(|a, b| residual(a).total_cmp(&residual(b)));
    if let Some(worst) = worst.filter(|p| has_check && 0.0 < residual(p)) {
        worst.is_worst = true;
    }
    for point in all.iter_mut().filter(|_| has_check) {
        // The pose takes a share of each point's own error up; the rest is what its residual scatters by.
        let variance = point.sigma_px.powi(2) * (1.0 - point.leverage.unwrap_or(0.0));
        point.is_suspect = LEAST_REST * point.sigma_px.powi(2) < variance
            && SUSPECT_CHI2 * variance < residual(point).powi(2);
    }
    all
}

fn point_view(
    state: &State,
    p: &ImagePoint,
    places: &Places,
    solved: Option<&Solved>,
    measured: Option<&Measured>,
) -> PointView {
    let used = solved.and_then(|s| Some((s, s.points.iter().find(|q| q.name == p.name)?)));
    let predicted = used.and_then(|(s, q)| s.camera.project(&(s.cam_from_world * q.seen.x_in_target)));
    let place = places.by_name.get(&p.name);
    let found = if place.is_none() { position(&p.name, measured) } else { None };
    PointView {
        name: p.name.clone(),
        u_px: p.u_px,
        v_px: p.v_px,
        sigma_px: p.sigma_px.unwrap_or(state.sigma_px),
        position_m: place.map(|place| place.x_m.into()).or(found.map(|f| f.0)),
        half_width_95_m: found.map(|f| f.1),
        residual_px: predicted.map(|pixel| (pixel - Pixel::new(p.u_px, p.v_px)).norm()),
        leverage: used.and_then(|(s, q)| leverage(s, q)),
        is_worst: false,
        is_suspect: false,
    }
}

/// Half the variance of the prediction, over that of the point itself.
fn leverage(solved: &Solved, point: &resight::locate::NamedPoint) -> Option<f64> {
    let covariance = &solved.covariance;
    let ellipse =
        prediction_ellipse(&solved.camera, &solved.cam_from_world, &point.seen.x_in_target, covariance)?;
    let middle = solved.camera.project(&(solved.cam_from_world * point.seen.x_in_target))?;
    // Ends of two semi-axes of the 95 % ellipse.
    let squared = |i: usize| (ellipse[i] - middle).norm_squared() / 5.991_464_547;
    let variance = 0.5 * (squared(0) + squared(10));
    Some((variance / point.seen.sigma_px.powi(2)).min(1.0))
}

/// Returns the position of a point that several photographs determine.
fn position(name: &str, measured: Option<&Measured>) -> Option<([f64; 3], [f64; 3])> {
    let answers = measured?.found.as_ref().ok()?;
    let answer = answers.answers.iter().find(|a| a.query.name == name)?;
    let values = answer.result.as_ref().ok().filter(|v| v.len() == 3)?;
    Some((std::array::from_fn(|i| values[i].value), std::array::from_fn(|i| NORMAL_95 * values[i].sigma)))
}

/// Something measured, or why it is not.
pub fn measurement_view(m: &Measurement, measured: Option<&Measured>) -> MeasurementView {
    let unit = if m.what == crate::MeasuredKind::Area { "m²" } else { "m" };
    let mut view = MeasurementView {
        name: m.name.clone(),
        what: m.what,
        photo: m.photo,
        points: m.points.clone(),
        status: None,
        value: None,
        half_width_95: None,
        low: None,
        high: None,
        values: Vec::new(),
        intervals_95: Vec::new(),
        unit,
        words: String::new(),
        error: Some(texts::NO_POSE_YET.to_owned()),
    };
    let answers = match measured {
        Some(Measured { found: Ok(answers), .. }) => answers,
        Some(Measured { found: Err(reason), .. }) => {
            view.error = Some(reason.clone());
            return view;
        }
        None => return view,
    };
    let Some(answer) = answers.answers.iter().find(|a| a.query.name == m.name) else { return view };
    view.status = Some(answer.status.name());
    match &answer.result {
        Ok(values) => {
            let first = values.first();
            view.values = values.iter().map(|v| v.value).collect();
            view.intervals_95 = values.iter().map(|v| [v.low, v.high]).collect();
            view.value = first.map(|v| v.value);
            (view.low, view.high) = (first.map(|v| v.low), first.map(|v| v.high));
            view.half_width_95 = first.map(|v| 0.5 * (v.high - v.low));
            view.words = values_in_words(answer.query.kind, values);
            view.error = None;
        }
        Err(reason) => view.error = Some(reason.clone()),
    }
    view
}
