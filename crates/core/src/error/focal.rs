//! The sentence that explains why a view does not determine its focal length, with the numbers seen and needed.

/// The change of the view that would separate focal length and distance, by its own geometry and noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FocalRemedy {
    /// Points in a plane that is seen too frontally, or too small.
    Tilt {
        /// Angle between the plane and the image plane, radians.
        tilt_rad: f64,
        /// Tilt at which the focal length would be determined; `None` where no tilt up to 60° is enough.
        needed_tilt_rad: Option<f64>,
        /// Distance from the camera to the centroid of the points.
        distance_m: f64,
        /// Distance at which it would be determined with the same tilt; `None` where no smaller distance is enough.
        needed_distance_m: Option<f64>,
    },
    /// Points in space, whose depths differ too little for the noise.
    Depth {
        /// Distance from the camera to the centroid of the points.
        distance_m: f64,
        /// Distance at which the focal length would be determined; `None` where no smaller distance is enough.
        needed_distance_m: Option<f64>,
    },
    /// Marked lines of known directions, which converge too little.
    Lines,
}

/// The sentence of `UndeterminedFocal`.
pub(super) struct FocalSentence<'a> {
    relative_sigma: f64,
    needed: f64,
    remedy: &'a FocalRemedy,
}

pub(super) fn undetermined_focal(
    relative_sigma: f64,
    needed: f64,
    remedy: &FocalRemedy,
) -> FocalSentence<'_> {
    FocalSentence { relative_sigma, needed, remedy }
}

impl core::fmt::Display for FocalSentence<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let needed = 100.0 * self.needed;
        match self.remedy {
            FocalRemedy::Lines => write!(f, "the lines leave the focal length open: ")?,
            _ => write!(f, "focal length and distance cannot be distinguished: ")?,
        }
        if self.relative_sigma.is_finite() {
            let seen = 100.0 * self.relative_sigma;
            write!(
                f,
                "the focal length has a standard deviation of {seen:.0} % of itself, {needed:.0} % or less is needed; "
            )?;
        } else {
            write!(
                f,
                "any focal length from a large one up fits, {needed:.0} % or less of it is needed as its standard deviation; "
            )?;
        }
        match *self.remedy {
            FocalRemedy::Lines => write!(
                f,
                "lines of two directions must converge in the image; mark lines that recede in a second direction and lie far apart, or give a camera file"
            ),
            FocalRemedy::Tilt { tilt_rad, needed_tilt_rad, distance_m, needed_distance_m } => {
                write!(
                    f,
                    "the points lie in a plane that is tilted by {:.0}° to the image, ",
                    tilt_rad.to_degrees()
                )?;
                match needed_tilt_rad {
                    Some(rad) => write!(f, "about {:.0}° is needed from here; tilt it", rad.to_degrees())?,
                    None => write!(f, "and no tilt is enough from {distance_m:.2} m")?,
                }
                if let Some(needed_m) = needed_distance_m {
                    write!(f, ", come nearer than {needed_m:.2} m (here {distance_m:.2} m)")?;
                }
                write!(f, ", or add points off the plane or give a camera file")
            }
            FocalRemedy::Depth { distance_m, needed_distance_m } => match needed_distance_m {
                Some(needed_m) => write!(
                    f,
                    "the points differ too little in depth for a distance of {distance_m:.2} m; come nearer than {needed_m:.2} m, add points that are nearer or farther, or give a camera file"
                ),
                None => write!(
                    f,
                    "the points differ too little in depth for a distance of {distance_m:.2} m; add points that are nearer or farther, or give a camera file"
                ),
            },
        }
    }
}
