//! The answer, in numbers and in sentences.

use super::VehicleAnswer;
use crate::answer::budget::{NumbersPartObject, parts_of_numbers};
use crate::answer::vehicle::{AlarmObject, RollObject, UndeterminedObject};
use crate::answer::{SchemaNumber, Status};
use crate::core::temporal::monitor::Drift;
use crate::core::temporal::vehicle::{
    Contradiction, RollSource, Undetermined, VehicleAlarm, VehicleEstimate,
};
use crate::core::{Camera, Pose};
use crate::landmarks::NoParallax;
use crate::report::verdict::figures;
use crate::report::words::{all_share_words, counted, decimals, degrees, shares};
use nalgebra::Vector3;
use std::fmt::Write;

/// Writes a time in seconds, to a tenth: `12`, `0.3`.
pub(super) fn seconds(s: f64) -> String {
    let text = format!("{s:.1}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_string)
}

/// What an answer is made of.
pub(super) struct Contents<'a> {
    pub name: &'a str,
    pub estimate: &'a VehicleEstimate,
    pub alarm: Option<&'a VehicleAlarm>,
    pub n_frames: usize,
    pub n_pairs: usize,
    pub n_still: usize,
    pub n_damaged: usize,
    pub n_repeated: usize,
    /// Time of the last frame, and between the frames of a pair.
    pub end_s: f64,
    pub every_s: f64,
    pub failed: &'a (usize, Option<NoParallax>),
    /// As its file states it.
    pub camera: &'a Camera,
    pub is_lens_stated: bool,
    /// Size of the images.
    pub size_px: [u32; 2],
}

pub(super) fn answer(contents: &Contents) -> VehicleAnswer {
    let estimate = contents.estimate;
    let alarm = contents.alarm.map(alarm_object);
    let (travel, roll, height) =
        (estimate.travel.as_ref().ok(), estimate.roll.as_ref().ok(), estimate.height.as_ref().ok());
    let undetermined = undetermined(contents);
    let contradictions: Vec<String> = estimate.contradictions.iter().map(contradiction).collect();
    let has_moved = alarm.as_ref().is_some_and(|alarm| alarm.state == "moved");
    let status = match travel {
        None => Status::Undecided,
        Some(_) if has_moved || !contradictions.is_empty() => Status::Inconsistent,
        Some(_) => Status::Ok,
    };
    let sigma = |i: usize| travel.map(|travel| travel.covariance[(i, i)].sqrt());
    let covariance = travel.map(|travel| &travel.covariance);
    let rotation = estimate.cam_from_vehicle_rotation();
    let mut answer = VehicleAnswer {
        schema: SchemaNumber,
        kind: "vehicle",
        view: contents.name.to_string(),
        status,
        yaw_rad: travel.map(|travel| travel.yaw_rad),
        yaw_sigma_rad: sigma(0),
        pitch_rad: travel.map(|travel| travel.pitch_rad),
        pitch_sigma_rad: sigma(1),
        yaw_pitch_covariance_rad2: covariance.map(|c| [[c[(0, 0)], c[(0, 1)]], [c[(1, 0)], c[(1, 1)]]]),
        budget: travel.map_or_else(Vec::new, |t| {
            parts_of_numbers(&t.budget, |part| t.budget.share_of(part, |c| c.trace()))
        }),
        travel_in_cam: travel.map(|travel| travel.in_cam.into()),
        roll_rad: roll.map(|roll| roll.roll_rad),
        roll_sigma_rad: roll.map(|roll| roll.sigma_rad),
        roll_budget: roll
            .map_or_else(Vec::new, |r| parts_of_numbers(&r.budget, |part| r.budget.share_of(part, |c| c.x))),
        roll_by_curves: roll.and_then(|roll| roll.by_curves).map(roll_object),
        roll_by_ground: roll.and_then(|roll| roll.by_ground).map(roll_object),
        cam_from_vehicle_wxyz: rotation.map(|r| Pose::new(r, Vector3::zeros()).quaternion_wxyz()),
        height_m: height.map(|height| height.height_m),
        height_sigma_m: height.map(|height| height.sigma_m),
        height_budget: height
            .map_or_else(Vec::new, |h| parts_of_numbers(&h.budget, |part| h.budget.share_of(part, |c| c.x))),
        undetermined,
        contradictions,
        remarks: remarks(contents),
        alarm,
        moving_s: estimate.moving_s,
        straight_s: estimate.straight_s,
        curve_s: estimate.curve_s,
        n_pairs: contents.n_pairs,
        n_still: contents.n_still,
        n_failed: contents.failed.0,
        message: String::new(),
    };
    answer.message = message(&answer, contents);
    answer
}

fn message(answer: &VehicleAnswer, contents: &Contents) -> String {
    let mut text = match (&answer.alarm, answer.contradictions.first(), answer.undetermined.first()) {
        (Some(alarm), _, _) if alarm.state == "moved" => alarm.message.clone(),
        (_, Some(contradiction), _) => contradiction.clone(),
        (_, _, Some(first)) if answer.status == Status::Undecided => first.reason.clone(),
        _ => {
            format!("yaw and pitch are determined from {} s of straight driving", seconds(answer.straight_s))
        }
    };
    if let (n, Some(reason)) = contents.failed
        && answer.n_pairs < 4 * n
        && !mostly_failed(contents)
    {
        let _ = write!(
            text,
            "; {} of {} give no motion, the last one because {reason}",
            counted(*n, "pair"),
            answer.n_pairs
        );
    }
    if 0 < contents.n_damaged {
        let _ = write!(text, "; {} of {} damaged", counted(contents.n_damaged, "frame"), contents.n_frames);
    }
    text
}

/// Whether most of the pairs give no motion for a reason that is not a camera at rest.
fn mostly_failed(contents: &Contents) -> bool {
    contents.n_pairs < 2 * contents.failed.0
}

/// Of what the camera's motion is too little for, in terms of what was seen.
fn too_little_motion(contents: &Contents, moving_s: f64, needed_s: f64) -> String {
    let (moving, needed, end) = (seconds(moving_s), seconds(needed_s), seconds(contents.end_s));
    let seen = format!("the frames show {moving} s of motion, {needed} s are needed");
    if contents.end_s < needed_s {
        let n = counted(contents.n_frames, "frame");
        return format!("{seen}: {n} in {end} s; give a longer video of driving straight ahead");
    }
    if contents.n_frames < 2 * contents.n_repeated {
        let (repeated, n) = (contents.n_repeated, contents.n_frames);
        return format!(
            "{seen}: {repeated} of {n} frames are equal to the one before; the vehicle stands still, or the video does"
        );
    }
    if contents.n_pairs == 0 {
        let every = seconds(contents.every_s);
        return format!(
            "{seen}: no two frames are {every} s apart; give the frames in order of time, without gaps"
        );
    }
    match contents.failed {
        (n, Some(reason)) if mostly_failed(contents) => {
            format!(
                "{seen}: {n} of {} give no motion, the last one because {reason}",
                counted(contents.n_pairs, "pair")
            )
        }
        _ => format!("{seen}: the vehicle stands still or hardly moves; drive on, straight ahead"),
    }
}

fn remarks(contents: &Contents) -> Vec<String> {
    let mut remarks = Vec::new();
    let [w, h] = contents.size_px;
    if let Some(size) = contents.camera.size.filter(|size| [size.width_px, size.height_px] != [w, h]) {
        let (width_px, height_px) = (size.width_px, size.height_px);
        remarks.push(format!(
            "the intrinsics are scaled from {width_px}×{height_px} px to the {w}×{h} px of these images: right where they are the whole image, resized; wrong for a crop"
        ));
    }
    if 0 < contents.n_repeated {
        let n = counted(contents.n_repeated, "frame");
        remarks.push(format!("{n} of {} left out, equal to the one before", contents.n_frames));
    }
    let looks_back = contents.estimate.travel.as_ref().is_ok_and(|travel| travel.in_cam.z < 0.0);
    if looks_back {
        remarks.push(
            "the camera looks back along the direction of travel; a video played backwards or a drive in reverse without signed speeds looks the same"
                .to_string(),
        );
    }
    if !contents.is_lens_stated {
        let by_pixel = contents.camera.matrix().map_or_else(String::new, |k| {
            format!(": 1 px of the principal point is {} of yaw or pitch", degrees(k.fx_px.recip()))
        });
        remarks.push(format!(
            "no uncertainty of the intrinsics is stated, so they are taken as exact, and no ± holds an error in them, which straight driving does not show{by_pixel}; state intrinsics_sigma in the camera file"
        ));
    }
    remarks
}

fn roll_object(source: RollSource) -> RollObject {
    let RollSource { roll_rad, sigma_rad, n, one_sided } = source;
    RollObject { roll_rad, sigma_rad, n, one_sided }
}

fn undetermined(contents: &Contents) -> Vec<UndeterminedObject> {
    let estimate = contents.estimate;
    let reasons = [
        ("yaw_pitch", estimate.travel.as_ref().err()),
        ("roll", estimate.roll.as_ref().err()),
        ("height", estimate.height.as_ref().err()),
    ];
    let object = |(what, reason): (&'static str, Option<&Undetermined>)| {
        Some(UndeterminedObject { what, reason: why(contents, reason?) })
    };
    reasons.into_iter().filter_map(object).collect()
}

fn why(contents: &Contents, reason: &Undetermined) -> String {
    match reason {
        Undetermined::Standing { moving_s, needed_s } => too_little_motion(contents, *moving_s, *needed_s),
        Undetermined::TooLittleStraight { straight_s, needed_s } => format!(
            "the vehicle drives straight ahead for {} s, {} s are needed: in curves the direction of travel depends on where the camera is mounted; drive a straight road",
            seconds(*straight_s),
            seconds(*needed_s)
        ),
        Undetermined::ForwardSign { share } => format!(
            "{} % of the pairs move against the others, so that forward and reverse cannot be distinguished; state speeds, negative in reverse",
            figures(100.0 * share)
        ),
        Undetermined::NoCurve { heading_rad, needed_rad } => format!(
            "the ground was not seen, or too seldom, and the largest change of heading in one curve is {}, {} is needed; drive curves to both sides",
            degrees(*heading_rad),
            degrees(*needed_rad)
        ),
        Undetermined::NoGround => {
            "no ground was seen below the camera, or too seldom; a camera that looks at the road is needed, and frames close enough for the road to be found again (--every)"
                .to_string()
        }
        Undetermined::NoSpeed => "no speed is stated, which the scale follows from; give --speed".to_string(),
        Undetermined::NoDirection => {
            "the direction of travel, which it refers to, is not determined".to_string()
        }
        Undetermined::Uncertain { sigma_rad, most_rad } => format!(
            "its standard deviation is {}, {} at most is of use; drive longer, for the roll in curves to both sides",
            degrees(*sigma_rad),
            degrees(*most_rad)
        ),
        Undetermined::LensUncertain { sigma_rad: Some((sigma_rad, most_rad)) } => format!(
            "its standard deviation is {} with the uncertainty of the intrinsics, {} at most is of use; calibrate the camera (resight intrinsics)",
            degrees(*sigma_rad),
            degrees(*most_rad)
        ),
        Undetermined::LensUncertain { sigma_rad: None } => {
            "the drive does not determine it through lenses within the stated uncertainty of the intrinsics; calibrate the camera (resight intrinsics)"
                .to_string()
        }
        Undetermined::NotUpright { roll_rad, most_rad } => format!(
            "curves give a roll of {}, and beyond {} they do not tell whether the camera is upside down",
            degrees(*roll_rad),
            degrees(*most_rad)
        ),
        _ => "the drive does not determine it".to_string(),
    }
}

fn contradiction(found: &Contradiction) -> String {
    match found {
        Contradiction::Halves(halves) => format!(
            "the second half of the drive differs from the first by {} ± {} in yaw and {} ± {} in pitch: the camera moved on the vehicle, or its load changed",
            degrees(halves.difference_rad.x),
            degrees(halves.sigma_rad.x),
            degrees(halves.difference_rad.y),
            degrees(halves.sigma_rad.y)
        ),
        Contradiction::Residuals { ratio, most } => format!(
            "residuals are {} times the noise of the landmarks, {} at most are expected: the intrinsics are those of another camera or focus, or the shutter rolls",
            figures(*ratio),
            figures(*most)
        ),
        Contradiction::Speeds { n, of } => format!(
            "the speeds are not those of the frames: in {n} of {of} pairs the vehicle drives by its speed and the frames show no motion, or the other way round; t_s counts seconds from the first frame"
        ),
        Contradiction::RollSources { difference_rad, sigma_rad } => format!(
            "the roll by curves differs from that by the ground by {} ± {}",
            degrees(*difference_rad),
            degrees(*sigma_rad)
        ),
        _ => "a contradiction".to_string(),
    }
}

fn alarm_object(alarm: &VehicleAlarm) -> AlarmObject {
    let state = |state: &'static str, message: String| AlarmObject {
        state,
        rotation_rad: None,
        began_s: None,
        alarm_s: None,
        message,
    };
    match alarm {
        VehicleAlarm::TooFew { seen, needed } => state(
            "too_short",
            format!(
                "{seen} readings of straight driving, {needed} are needed to compare a part of the drive with its beginning"
            ),
        ),
        VehicleAlarm::Steady { is_steady: true, compared } => state(
            "steady",
            format!("the camera stayed where it was, compared in {compared} readings of straight driving"),
        ),
        VehicleAlarm::Steady { .. } => state(
            "checking",
            "the end of the drive differs from its beginning, not yet by enough for an alarm".to_string(),
        ),
        VehicleAlarm::Unsettled(found) => moved(&found.drift, None),
        VehicleAlarm::Moved { drift, alarm_s } => moved(drift, Some(*alarm_s)),
    }
}

/// Of a motion in the axes right, down, forward of the direction of travel; the rotation about the last is not seen.
fn moved(drift: &Drift, alarm_s: Option<f64>) -> AlarmObject {
    let (right, down) = (drift.old_from_new[0], drift.old_from_new[1]);
    let message = format!(
        "the camera rotated on the vehicle by {} at {} s: {} to the left and {} down",
        degrees(right.hypot(down)),
        seconds(drift.began_s),
        degrees(-down),
        degrees(-right)
    );
    AlarmObject {
        state: "moved",
        rotation_rad: Some([right, down, 0.0]),
        began_s: Some(drift.began_s),
        alarm_s,
        message,
    }
}

/// Describes an answer for people, one line for each number.
pub fn describe(answer: &VehicleAnswer) -> String {
    let name = answer.status.name().to_uppercase().replace('_', " ");
    let mut out = format!("{}   {name}\n", answer.view);
    let mut line = |label: &str, text: &str| {
        let _ = writeln!(out, "  {label:<12}{text}");
    };
    let with_sigma = |x: f64, sigma: Option<f64>, directions: [&str; 2]| {
        let direction = if x < 0.0 { directions[1] } else { directions[0] };
        let (x, sigma) = (x.abs().to_degrees(), sigma.unwrap_or(0.0).to_degrees());
        let decimals = decimals(sigma);
        format!("{x:.decimals$}° ± {sigma:.decimals$}° {direction}")
    };
    if let (Some(yaw), Some(pitch)) = (answer.yaw_rad, answer.pitch_rad) {
        let yaw = with_sigma(yaw, answer.yaw_sigma_rad, ["to the left", "to the right"]);
        line("yaw", &format!("{yaw} of the direction of travel"));
        line("pitch", &with_sigma(pitch, answer.pitch_sigma_rad, ["down", "up"]));
    }
    if let Some(roll) = answer.roll_rad {
        let roll = with_sigma(roll, answer.roll_sigma_rad, ["to its right side", "to its left side"]);
        let by = match (&answer.roll_by_curves, &answer.roll_by_ground) {
            (Some(curves), None) if curves.one_sided => ", by curves to one side",
            (Some(_), None) => ", by curves",
            (None, _) => ", by the ground",
            (Some(_), Some(_)) => ", by curves and the ground",
        };
        line("roll", &format!("{roll}{by}"));
    }
    if let (Some(height_m), Some(sigma_m)) = (answer.height_m, answer.height_sigma_m) {
        line("height", &format!("{height_m:.2} m ± {sigma_m:.2} m above the ground"));
    }
    let budgets =
        [("yaw, pitch", &answer.budget), ("roll", &answer.roll_budget), ("height", &answer.height_budget)];
    for (what, budget) in budgets {
        if let Some(text) = all_share_words(shares(budget.iter().map(NumbersPartObject::share))) {
            line("budget", &format!("{what}: {text}"));
        }
    }
    for missing in &answer.undetermined {
        let what = if missing.what == "yaw_pitch" { "yaw, pitch" } else { missing.what };
        line(what, &format!("not determined: {}", missing.reason));
    }
    answer.contradictions.iter().for_each(|text| line("but", text));
    if let Some(alarm) = &answer.alarm {
        line("alarm", &alarm.message);
    }
    let (moving, straight, curves) =
        (seconds(answer.moving_s), seconds(answer.straight_s), seconds(answer.curve_s));
    line("drive", &format!("{moving} s of motion, {straight} s straight ahead, {curves} s in curves"));
    answer.remarks.iter().for_each(|remark| line("remark", remark));
    out
}
