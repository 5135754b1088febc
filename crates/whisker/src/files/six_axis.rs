//! A six-axis reading as a row of contacts: reduced to its plane of bending where that is allowed, else refused with the reason.
//!
//! The hub moves in a plane, z = 0; the contact is reported in the world, its height above that plane included.

use super::contacts::{ContactRow, RowStatus, Spatial};
use crate::contact::Method;
use crate::estimate::{Status, estimate as planar_estimate};
use crate::spatial::{SpatialContact, SpatialEstimate, SpatialLoad, Verdict, estimate, load_covariance};
use crate::{Cell, Error, Rod, Sample};
use nalgebra::{Matrix3, Rotation3, Vector3};

/// χ² of the load, 6 degrees of freedom, up to which nothing is touched: a free whisker exceeds it once in 100,000 samples.
pub const FREE_CHI2: f64 = 33.107;

/// The row of one reading: `sample` with fx, fy, mz and `out_of_plane` with fz, mx, my (N, N·m, N·m, hub axes). Each reading for itself;
/// `ok` only where the six signals are those of one force in one plane.
///
/// # Errors
/// Signals that are no numbers; a cell without noise.
pub fn row(rod: &Rod, cell: &Cell, sample: &Sample, out_of_plane: [f64; 3]) -> Result<ContactRow, Error> {
    let [fz, mx, my] = out_of_plane;
    let load = SpatialLoad {
        force_n: Vector3::new(sample.load.fx_n, sample.load.fy_n, fz),
        moment_n_m: Vector3::new(mx, my, sample.load.mz_n_m),
    };
    let covariance = load_covariance(cell);
    let found = estimate(rod, &load, &covariance)?;
    let seen = load.to_vector();
    let chi2: f64 = (0..6).map(|i| seen[i] * seen[i] / covariance[(i, i)]).sum();
    if chi2 <= FREE_CHI2 {
        return Ok(blank(sample, Status::NoContact));
    }
    let Some(reduction) = found.reduction else {
        let note = "the load has no plane of bending".to_string();
        return Ok(ContactRow { note, ..blank(sample, Status::LowForce) });
    };
    // In its plane the load is one of a planar cell: what that allows to say is decided in one place.
    let in_plane = Sample { load: reduction.load, ..*sample };
    let planar = planar_estimate(rod, cell, &in_plane, Method::Auto);
    let (status, note) = verdict(&found, planar.status);
    let contact =
        found.contact.filter(|_| found.verdict != Verdict::CurvedWhisker && status != Status::NoContact);
    let mut row = ContactRow::new(rod, &in_plane, &planar);
    let in_world = contact.map(|contact| in_world(cell, sample, &contact));
    row.figures = row.figures.zip(in_world).map(|(mut figures, (x, covariance, theta_rad))| {
        figures.x_in_world = x.xy();
        figures.theta_rad = theta_rad;
        figures.covariance = Matrix3::from_element(f64::NAN);
        figures.covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&covariance.fixed_view::<2, 2>(0, 0));
        figures
    });
    row.spatial = Some(Spatial {
        z_m: in_world.map(|(x, ..)| x.z),
        covariance_z: in_world.map(|(_, c, _)| [c[(0, 2)], c[(1, 2)], c[(2, 2)]]),
        roll_rad: reduction.roll_rad,
        roll_sigma_rad: reduction.covariance[(3, 3)].sqrt(),
        plane_p: reduction.p_value,
    });
    // Left and right are sides of a plane; the roll says which way the whisker bends.
    Ok(ContactRow { status: RowStatus::Read(status), side: None, note, ..row })
}

fn blank(sample: &Sample, status: Status) -> ContactRow {
    ContactRow::blank(sample.sweep, sample.sample, sample.t_s, RowStatus::Read(status))
}

/// The status and its reason.
fn verdict(found: &SpatialEstimate, in_plane: Status) -> (Status, String) {
    match found.verdict {
        Verdict::CurvedWhisker => (
            Status::Inconsistent,
            "the whisker is curved of itself: six axes are reduced for straight whiskers alone".into(),
        ),
        Verdict::OutOfPlane => {
            let chi2 = found.reduction.map_or(f64::NAN, |reduction| reduction.chi2);
            let note = format!(
                "not one force in one plane (chi2 {chi2:.1} for 2 degrees of freedom): several contacts, torsion, or the cell out of line"
            );
            (Status::Inconsistent, note)
        }
        Verdict::TooWeak => (Status::LowForce, "too weak to say in which plane the whisker bends".into()),
        Verdict::Planar | Verdict::NoContact(_) => (in_plane, String::new()),
    }
}

/// The point, its covariance and the direction of the whisker's projection on the plane of the hub's motion, world.
fn in_world(cell: &Cell, sample: &Sample, contact: &SpatialContact) -> (Vector3<f64>, Matrix3<f64>, f64) {
    let hub = &sample.world_from_hub;
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), hub.angle_rad);
    let arm = turn * contact.x_in_hub;
    // Turning or shifting the hub moves the contact: by [x, y, angle] of the hub.
    let by_hub = Matrix3::new(1.0, 0.0, -arm.y, 0.0, 1.0, arm.x, 0.0, 0.0, 0.0);
    let covariance = turn.matrix() * contact.covariance * turn.matrix().transpose()
        + by_hub * cell.hub_covariance() * by_hub.transpose();
    let tangent = turn * contact.tangent_in_hub;
    (arm + Vector3::new(hub.x_m, hub.y_m, 0.0), covariance, tangent.y.atan2(tangent.x))
}
