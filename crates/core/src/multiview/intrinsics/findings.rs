//! Faults and weaknesses of views and answer, each with the number seen, the number needed and a remedy.

use super::groups::TwoGroups;
use crate::budget::{Accounted, ErrorSource, Warning};
use crate::locate::suspects::{Fault, correction};

/// The severity of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The answer holds; something could be better.
    Remark,
    /// The data contradict themselves or the model: the answer's errors may be far larger than stated.
    Inconsistent,
    /// The views do not determine the intrinsics.
    Degenerate,
}

/// A fault or weakness of the views or the answer.
#[derive(Debug, Clone, PartialEq)]
pub enum Finding {
    /// Too few views between which the target or the camera moved.
    FewViews {
        /// Views with a target.
        n_views: usize,
        /// Different ones.
        n_distinct: usize,
        /// Needed.
        needed: usize,
    },
    /// No view of the flat target is tilted.
    NotTilted {
        /// The largest tilt, rad.
        largest_rad: f64,
        /// Needed, rad.
        needed_rad: f64,
    },
    /// The flat target always had one orientation.
    OneOrientation {
        /// The largest angle between two, rad.
        spread_rad: f64,
        /// Needed, rad.
        needed_rad: f64,
    },
    /// A parameter is undetermined.
    Undetermined {
        /// Its name.
        parameter: &'static str,
        /// Relative standard deviation.
        relative: f64,
        /// The largest accepted.
        needed: f64,
    },
    /// No camera explains the corners of most views.
    NoCamera {
        /// Views given.
        n_views: usize,
        /// Views with a pose under the best camera.
        n_posed: usize,
    },
    /// A usual fault of points, pixels or labels, or two at once, without which the views agree.
    UsualFault {
        /// The faults.
        faults: Vec<Fault>,
    },
    /// The focal length is known only roughly.
    RoughFocal {
        /// Standard deviation over the focal length.
        relative: f64,
        /// The standard deviation of a good calibration.
        needed: f64,
    },
    /// Views that repeat others.
    Copies {
        /// How many.
        n: usize,
        /// Different ones.
        n_distinct: usize,
    },
    /// Corners fill too little of the image.
    SmallCoverage {
        /// Part of the image's cells with a corner.
        share: f64,
        /// Needed.
        needed: f64,
    },
    /// More bad views than a few damaged images explain.
    ManyBadViews {
        /// Bad.
        n: usize,
        /// Of.
        of: usize,
        /// Bad corners in the others.
        n_corners: usize,
        /// Of.
        of_corners: usize,
    },
    /// Views of two cameras, or of two zooms.
    TwoCameras {
        /// Which.
        groups: TwoGroups,
        /// Focal length of each group alone, px, with its standard deviation; none where it is not determined.
        focal_px: [Option<[f64; 2]>; 2],
    },
    /// The print is wider or higher than stated.
    Stretched {
        /// Height over width, less the stated ratio.
        stretch: f64,
        /// Standard deviation.
        sigma: f64,
        /// Whether the answer takes it into account.
        taken_in: bool,
    },
    /// The target is bent.
    Bent {
        /// Height of its middle above its edges, metres, along x and y.
        bend_m: [f64; 2],
        /// Standard deviations.
        sigma_m: [f64; 2],
        /// Whether the answer takes it into account.
        taken_in: bool,
    },
    /// The residuals are far larger than stated.
    Noisy {
        /// Standard deviation that the residuals show, px.
        seen_px: f64,
        /// As stated, px (root mean square).
        stated_px: f64,
    },
    /// A lens model that was not asked for explains the corners far better.
    OtherLens {
        /// Its name.
        model: &'static str,
        /// Root mean square of its residuals, px of one coordinate.
        rms_px: f64,
        /// That of the model that was asked for.
        own_rms_px: f64,
    },
    /// Views contradict each other by more than their noise.
    ViewsContradict {
        /// Factor on variances.
        times: f64,
    },
}

impl Warning for Finding {
    fn accounted(&self) -> Accounted {
        match self {
            Finding::FewViews { .. }
            | Finding::NotTilted { .. }
            | Finding::OneOrientation { .. }
            | Finding::NoCamera { .. }
            | Finding::Undetermined { .. }
            | Finding::UsualFault { .. }
            | Finding::ManyBadViews { .. }
            | Finding::TwoCameras { .. }
            | Finding::Stretched { taken_in: false, .. }
            | Finding::Bent { taken_in: false, .. }
            | Finding::OtherLens { .. }
            | Finding::Noisy { .. } => Accounted::Status,
            Finding::Stretched { taken_in: true, .. } | Finding::Bent { taken_in: true, .. } => {
                Accounted::Parts(&[ErrorSource::Target])
            }
            Finding::ViewsContradict { .. } => Accounted::Parts(&[ErrorSource::SharedInView]),
            // What few corners leave open is as uncertain as they and the prior of the lens leave it.
            Finding::RoughFocal { .. } | Finding::SmallCoverage { .. } => {
                Accounted::Parts(&[ErrorSource::Pixels])
            }
            Finding::Copies { .. } => Accounted::Nothing,
        }
    }
}

impl Finding {
    /// Returns the severity.
    pub fn severity(&self) -> Severity {
        match self {
            Finding::FewViews { .. }
            | Finding::NotTilted { .. }
            | Finding::OneOrientation { .. }
            | Finding::NoCamera { .. }
            | Finding::Undetermined { .. } => Severity::Degenerate,
            Finding::Stretched { taken_in: true, .. } | Finding::Bent { taken_in: true, .. } => {
                Severity::Remark
            }
            Finding::UsualFault { .. }
            | Finding::ManyBadViews { .. }
            | Finding::TwoCameras { .. }
            | Finding::Stretched { .. }
            | Finding::Bent { .. }
            | Finding::OtherLens { .. }
            | Finding::Noisy { .. } => Severity::Inconsistent,
            Finding::RoughFocal { .. }
            | Finding::Copies { .. }
            | Finding::SmallCoverage { .. }
            | Finding::ViewsContradict { .. } => Severity::Remark,
        }
    }

    /// Returns its word in JSON.
    pub fn name(&self) -> &'static str {
        match self {
            Finding::FewViews { .. } => "few_views",
            Finding::NotTilted { .. } => "not_tilted",
            Finding::OneOrientation { .. } => "one_orientation",
            Finding::Undetermined { .. } => "undetermined",
            Finding::NoCamera { .. } => "no_camera",
            Finding::UsualFault { .. } => "usual_fault",
            Finding::RoughFocal { .. } => "rough_focal_length",
            Finding::Copies { .. } => "copies",
            Finding::SmallCoverage { .. } => "small_coverage",
            Finding::ManyBadViews { .. } => "many_bad_views",
            Finding::TwoCameras { .. } => "two_cameras",
            Finding::Stretched { .. } => "stretched_target",
            Finding::Bent { .. } => "bent_target",
            Finding::Noisy { .. } => "noisy",
            Finding::OtherLens { .. } => "other_lens",
            Finding::ViewsContradict { .. } => "views_contradict",
        }
    }

    /// Describes it in a sentence; `name_of` returns the name of the view at an index.
    pub fn message(&self, name_of: impl Fn(usize) -> String) -> String {
        let degrees = f64::to_degrees;
        match self {
            Finding::FewViews { n_views, n_distinct, needed } if n_views == n_distinct => format!(
                "{n_views} {} given, {needed} are needed and 10 are good; move and tilt the target between images",
                if *n_views == 1 { "view is" } else { "views are" }
            ),
            Finding::FewViews { n_views, n_distinct, needed } => format!(
                "{n_distinct} of {n_views} views differ from each other, {needed} are needed and 10 are good; move and tilt the target between images"
            ),
            Finding::NotTilted { largest_rad, needed_rad } => format!(
                "no tilted views (largest tilt {:.0}°, {:.0}° needed): focal length and distance cannot be separated; tilt the target by 30° to 45°",
                degrees(*largest_rad),
                degrees(*needed_rad)
            ),
            Finding::OneOrientation { spread_rad, needed_rad } => format!(
                "the target always has about the same orientation (they differ by {:.0}° at most, {:.0}° needed): focal length and principal point cannot be separated; tilt the target to the left, right, up and down",
                degrees(*spread_rad),
                degrees(*needed_rad)
            ),
            Finding::Undetermined { parameter, relative, needed } => format!(
                "the views leave {parameter} open (relative standard deviation {relative:.2}, {needed} or less needed); add views tilted by 30° to 45° in several directions, near and far"
            ),
            Finding::NoCamera { n_views, n_posed } => format!(
                "no camera explains the corners ({n_posed} of {n_views} views have a pose); check the target's rows, columns and ids, and that all images are of one size"
            ),
            Finding::UsualFault { faults } => format!(
                "the views agree {}: correct it and run again",
                correction(faults, None, false, |point| format!("point {point}"))
            ),
            Finding::RoughFocal { relative, needed } => format!(
                "the focal length is known to {:.1} % only, a good calibration reaches {:.1} %; add views tilted by 30° to 45° in several directions, and near ones",
                100.0 * relative,
                100.0 * needed
            ),
            Finding::Copies { n, n_distinct } => format!(
                "{n} views are exact copies of others and count once: {n_distinct} different views; move the target between images"
            ),
            Finding::SmallCoverage { share, needed } => format!(
                "corners reach {:.0} % of the image, {:.0} % are good; distortion beyond them is extrapolated, put the target into the corners of the image",
                100.0 * share,
                100.0 * needed
            ),
            Finding::ManyBadViews { n, of, n_corners, of_corners } => format!(
                "{n} of {of} views, and {n_corners} of {of_corners} corners of the others, contradict the rest, more than a few spoilt images explain; check the target's rows, columns and ids, and that one camera took all images with one zoom and focus"
            ),
            Finding::TwoCameras { groups, focal_px } => two_cameras(groups, focal_px, name_of),
            Finding::Stretched { stretch, sigma, taken_in } => format!(
                "the target's height is {:.2} % ± {:.2} % {} than stated if its width is right{}; measure the print along both edges and correct the target file",
                100.0 * stretch.abs(),
                100.0 * sigma,
                if 0.0 < *stretch { "larger" } else { "smaller" },
                accounted(*taken_in)
            ),
            Finding::Bent { bend_m, sigma_m, taken_in } => format!(
                "the target is bent: its middle lies {:.2} ± {:.2} mm (along x) and {:.2} ± {:.2} mm (along y) off the plane of its edges{}; mount it on something flat",
                1e3 * bend_m[0],
                1e3 * sigma_m[0],
                1e3 * bend_m[1],
                1e3 * sigma_m[1],
                accounted(*taken_in)
            ),
            Finding::Noisy { seen_px, stated_px } => format!(
                "the residuals show a noise of {seen_px:.2} px, {stated_px:.2} px are stated; look for motion blur, a rolling shutter, a bent or stretched target, or choose another lens model"
            ),
            Finding::OtherLens { model, rms_px, own_rms_px } => format!(
                "the lens model does not follow the corners: it leaves {own_rms_px:.2} px, {model} leaves {rms_px:.2} px; choose that model"
            ),
            Finding::ViewsContradict { times } => format!(
                "views contradict each other: variances are {times:.1} times those of the corners' noise; a bent target or motion during the exposure are likely"
            ),
        }
    }
}

fn accounted(taken_in: bool) -> &'static str {
    if taken_in { " (the answer takes that into account)" } else { "" }
}

/// Names of a few views.
fn listed(views: &[usize], name_of: &impl Fn(usize) -> String) -> String {
    let some: Vec<String> = views.iter().take(3).map(|view| name_of(*view)).collect();
    let more = views.len() - some.len();
    if more == 0 { some.join(", ") } else { format!("{} and {more} more", some.join(", ")) }
}

fn two_cameras(
    groups: &TwoGroups,
    focal_px: &[Option<[f64; 2]>; 2],
    name_of: impl Fn(usize) -> String,
) -> String {
    let focal = |focal: &Option<[f64; 2]>| match focal {
        Some([value, sigma]) => format!("focal length {value:.1} ± {sigma:.1} px"),
        None => "focal length open".to_string(),
    };
    let likely = match groups.in_sequence {
        true => "the zoom or the focus changed between them",
        false => "two cameras' images are mixed",
    };
    format!(
        "two groups of views contradict each other (residual variance {:.1} times that of two cameras): {} views ({}) say {}, {} views ({}) say {}; likely {likely}: calibrate each group alone",
        groups.times,
        groups.first.len(),
        listed(&groups.first, &name_of),
        focal(&focal_px[0]),
        groups.second.len(),
        listed(&groups.second, &name_of),
        focal(&focal_px[1]),
    )
}
