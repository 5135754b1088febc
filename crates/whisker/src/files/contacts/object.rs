//! A row as a JSON object; its keys are the columns of the CSV file, in their order.

use super::{
    ContactRow, EVENTS, FEATURES, Figures, MODES, RowStatus, SIDES, STATUSES, Side, mode_name, word,
};
use schemars::JsonSchema;
use serde::Serialize;

/// Declares the object, and its keys as the columns of the CSV file.
macro_rules! object_of_columns {
    ($(#[$of_object:meta])* pub struct $object:ident { $($(#[$of_key:meta])* $key:ident: $kind:ty,)* }) => {
        $(#[$of_object])*
        pub struct $object { $($(#[$of_key])* $key: $kind,)* }
        /// In the order in which they are written.
        pub(super) const COLUMNS: &[&str] = &[$(stringify!($key)),*];
    };
}

object_of_columns! {
    /// The contact of one reading. SI units, world frame, the plane of the hub's motion is z = 0; null where nothing is known. The
    /// covariance is of `[x, y, theta]` and z.
    #[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
    pub struct ContactObject {
        /// Which sweep; null where the line of a stream could not be read.
        sweep: Option<u32>,
        /// Which sample of the sweep; null where the line of a stream could not be read.
        sample: Option<u32>,
        /// When, seconds.
        t: Option<f64>,
        /// 1 where something is touched, else 0.
        #[schemars(range(max = 1))]
        contact: u8,
        /// The point of the whisker's centre line that touches, metres.
        x: Option<f64>,
        /// As `x`, metres.
        y: Option<f64>,
        /// Arc length from the clamp to the contact, metres.
        s: Option<f64>,
        /// Direction of the whisker there, counter-clockwise from the world's x axis, radians.
        theta: Option<f64>,
        /// Force across the whisker, away from the object, newtons.
        f_normal: Option<f64>,
        /// Force along the whisker, towards the tip, newtons.
        f_tangent: Option<f64>,
        /// asin(f_tangent / force), radians.
        friction_angle: Option<f64>,
        /// k² of the elastica.
        k2: Option<f64>,
        /// Where on the whisker: `mid` is between clamp and tip; `free` where nothing is touched.
        #[schemars(extend("enum" = words(&MODES)))]
        mode: &'static str,
        /// Probability of that mode.
        mode_probability: f64,
        /// m².
        cov_xx: Option<f64>,
        /// m².
        cov_xy: Option<f64>,
        /// m².
        cov_yy: Option<f64>,
        /// m rad.
        cov_xtheta: Option<f64>,
        /// m rad.
        cov_ytheta: Option<f64>,
        /// rad².
        cov_thetatheta: Option<f64>,
        /// Which zero of the bending moment the contact is, counted from 0 at the clamp.
        branch: u32,
        /// The verdict; the numbers of any other than `ok` are not to be relied on.
        #[schemars(extend("enum" = words(&STATUSES)))]
        status: &'static str,
        /// On which side of the whisker, looking from clamp to tip, the object is.
        #[schemars(extend("enum" = words_or_null(&SIDES)))]
        side: Option<&'static str>,
        /// Standard deviation of `s`, metres.
        s_sigma: Option<f64>,
        /// Standard deviation of `friction_angle`, radians.
        friction_angle_sigma: Option<f64>,
        /// The whisker's radius there, metres: the outline is so far from the point.
        radius: Option<f64>,
        /// Arc lengths of the other zeros of the bending moment, metres.
        other_s: Vec<f64>,
        /// What is touched, where the contacts around it tell.
        #[schemars(extend("enum" = words_or_null(&FEATURES)))]
        feature: Option<&'static str>,
        /// What changed with this reading.
        #[schemars(extend("enum" = words_or_null(&EVENTS)))]
        event: Option<&'static str>,
        /// Readings until the whisker slips off, where that is asked for and predicted.
        steps_to_slip_off: Option<f64>,
        /// Standard deviation of `steps_to_slip_off`.
        steps_to_slip_off_sigma: Option<f64>,
        /// Of a six-axis cell: height of the contact above the plane of the hub's motion, metres.
        z: Option<f64>,
        /// Of a six-axis cell, m².
        cov_xz: Option<f64>,
        /// Of a six-axis cell, m².
        cov_yz: Option<f64>,
        /// Of a six-axis cell, m².
        cov_zz: Option<f64>,
        /// Of a six-axis cell: rotation about the clamped whisker from the plane of the hub's motion to the plane of bending, radians.
        roll: Option<f64>,
        /// Standard deviation of `roll`, radians.
        roll_sigma: Option<f64>,
        /// Of a six-axis cell: probability of readings as far from one force in one plane.
        plane_p: Option<f64>,
        /// Why there is no more to say; empty where nothing is amiss.
        note: String,
    }
}

/// The words that a key may hold.
fn words<T>(table: &[(T, &'static str)]) -> Vec<&'static str> {
    table.iter().map(|(_, word)| *word).collect()
}

fn words_or_null<T>(table: &[(T, &'static str)]) -> Vec<Option<&'static str>> {
    table.iter().map(|(_, word)| Some(*word)).chain([None]).collect()
}

impl From<&ContactRow> for ContactObject {
    fn from(row: &ContactRow) -> Self {
        let f = row.figures.as_ref();
        let of = |value: fn(&Figures) -> f64| f.map(value).filter(|x| x.is_finite());
        let spatial = row.spatial.as_ref();
        let [cov_xz, cov_yz, cov_zz] =
            spatial.and_then(|s| s.covariance_z).map_or([None; 3], |covariance| covariance.map(Some));
        let number = |n: u32| (row.status != RowStatus::Error).then_some(n);
        ContactObject {
            sweep: number(row.sweep),
            sample: number(row.sample),
            t: row.t_s,
            contact: row.status.is_touching().into(),
            x: of(|f| f.x_in_world.x),
            y: of(|f| f.x_in_world.y),
            s: of(|f| f.s_m),
            theta: of(|f| f.theta_rad),
            f_normal: of(|f| f.f_normal_n),
            f_tangent: of(|f| f.f_tangent_n),
            friction_angle: of(|f| f.friction_angle_rad),
            k2: of(|f| f.k2),
            mode: mode_name(row.mode),
            mode_probability: row.mode_probability,
            cov_xx: of(|f| f.covariance[(0, 0)]),
            cov_xy: of(|f| f.covariance[(0, 1)]),
            cov_yy: of(|f| f.covariance[(1, 1)]),
            cov_xtheta: of(|f| f.covariance[(0, 2)]),
            cov_ytheta: of(|f| f.covariance[(1, 2)]),
            cov_thetatheta: of(|f| f.covariance[(2, 2)]),
            branch: row.branch,
            status: row.status.name(),
            side: row.side.map(Side::name),
            s_sigma: f.and_then(|f| f.s_sigma_m),
            friction_angle_sigma: f.and_then(|f| f.friction_angle_sigma_rad),
            radius: of(|f| f.radius_m),
            other_s: row.other_s_m.clone(),
            feature: row.feature.and_then(|feature| word(&FEATURES, &feature)),
            event: word(&EVENTS, &row.event),
            steps_to_slip_off: row.steps_to_slip_off.map(|[steps, _]| steps),
            steps_to_slip_off_sigma: row.steps_to_slip_off.map(|[_, sigma]| sigma),
            z: spatial.and_then(|s| s.z_m),
            cov_xz,
            cov_yz,
            cov_zz,
            roll: spatial.map(|s| s.roll_rad),
            roll_sigma: spatial.map(|s| s.roll_sigma_rad),
            plane_p: spatial.map(|s| s.plane_p),
            note: row.note.clone(),
        }
    }
}
