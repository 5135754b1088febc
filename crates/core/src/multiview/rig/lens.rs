//! The offset of a camera's intrinsics, and its limits: docs/math/rig.md section 10.

/// The offset of a camera's intrinsics with all other unknowns free: one Gauss–Newton step, in focal lengths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LensOffset {
    /// Relative error of the focal length (the correction over the value given), with the principal point free.
    pub focal: f64,
    /// Its standard deviation, from the scatter of views where that is larger than from single points; the same holds for the other two.
    pub sigma_focal: f64,
    /// Error of the principal point over the focal length: right and down.
    pub centre: [f64; 2],
    /// Its standard deviations.
    pub sigma_centre: [f64; 2],
    /// Offset of the distortion at the camera's points (root mean square over the focal length), the others free.
    pub distortion: f64,
    /// Its standard deviation.
    pub sigma_distortion: f64,
    /// χ² that these four explain.
    pub explained_chi2: f64,
}

/// Number of standard deviations subtracted from an offset before it counts as too large; errors that a view's points share are in them.
const SIGMAS: f64 = 4.0;
/// Largest share of the focal length by which focal length or principal point may be off. On recordings with right files up to 0.0194 remains in
/// pairs and triples (webcams calibrated elsewhere, not synchronised; 0.0290 ± 0.0024), 0.006 in all four; with a focal length 10 % off 0.035 to
/// 0.09. Smaller offsets are in the covariance (`lens_doubt`).
const OFF: f64 = 0.02;
/// The same limit for distortion, as the displacement it causes. With right files 0 to 0.0005 remains in a rig of four and up to 0.002 in pairs
/// of the same webcams; with omitted distortion 0.003 to 0.014.
const DISTORTION_OFF: f64 = 0.0025;

impl LensOffset {
    /// Returns each offset beyond its uncertainty, over its limit: focal length, principal point, distortion.
    fn excess(&self) -> [f64; 3] {
        let beyond = |x: f64, sigma: f64| x.abs() - SIGMAS * sigma;
        let [right, down] = [0, 1].map(|i| beyond(self.centre[i], self.sigma_centre[i]));
        [
            beyond(self.focal, self.sigma_focal) / OFF,
            right.max(down) / OFF,
            beyond(self.distortion, self.sigma_distortion) / DISTORTION_OFF,
        ]
    }

    /// Returns whether focal length, principal point or distortion is off by more than those of fair calibrations are.
    pub fn is_off(&self) -> bool {
        self.excess().into_iter().any(|x| 1.0 < x)
    }

    /// Returns the name of the largest offset.
    pub fn worst(&self) -> &'static str {
        named(self.excess())
    }

    /// Returns the name of the offset that is largest beside its uncertainty.
    pub fn clearest(&self) -> &'static str {
        let [right, down] = [0, 1].map(|i| self.centre[i].abs() / self.sigma_centre[i]);
        named([
            self.focal.abs() / self.sigma_focal,
            right.max(down),
            self.distortion.abs() / self.sigma_distortion,
        ])
    }
}

/// Names the largest of the values for focal length, principal point and distortion.
fn named([focal, centre, distortion]: [f64; 3]) -> &'static str {
    match () {
        () if distortion <= focal && centre <= focal => "focal length",
        () if distortion <= centre => "principal point",
        () => "distortion",
    }
}
