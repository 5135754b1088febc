//! One contact of several that may be: the mean and the covariance of the mixture, docs/math/whisker_friction.md eqs. (18), (19).

use crate::estimate::Contact;
use nalgebra::{Matrix3, Vector3};

/// A mode less probable than this adds nothing that its neighbour's covariance would not hold.
pub(crate) const NEGLIGIBLE: f64 = 1e-6;

/// `contacts` with their probabilities, which sum to one; the first is the most probable and gives what is not averaged.
pub(crate) fn mixed(contacts: &[(f64, Contact)]) -> Option<Contact> {
    let (_, first) = contacts.first()?;
    let mean = |of: &dyn Fn(&Contact) -> f64| -> f64 { contacts.iter().map(|(p, c)| p * of(c)).sum() };
    let spread = |of: &dyn Fn(&Contact) -> f64, sigma: &dyn Fn(&Contact) -> f64| -> f64 {
        let centre = mean(of);
        mean(&|c| sigma(c).powi(2) + (of(c) - centre).powi(2)).sqrt()
    };
    let centre = contacts.iter().fold(Vector3::zeros(), |sum, (p, c)| sum + place(c, first) * *p);
    let covariance = contacts.iter().fold(Matrix3::zeros(), |sum, (p, c)| {
        let apart = place(c, first) - centre;
        sum + (c.covariance + apart * apart.transpose()) * *p
    });
    Some(Contact {
        x_in_world: first.x_in_world + centre.fixed_rows::<2>(0),
        theta_rad: first.theta_rad + centre.z,
        s_m: mean(&|c| c.s_m),
        s_sigma_m: spread(&|c| c.s_m, &|c| c.s_sigma_m),
        f_normal_n: mean(&|c| c.f_normal_n),
        f_tangent_n: mean(&|c| c.f_tangent_n),
        friction_angle_rad: mean(&|c| c.friction_angle_rad),
        friction_angle_sigma_rad: spread(&|c| c.friction_angle_rad, &|c| c.friction_angle_sigma_rad),
        modulus_squared: mean(&|c| c.modulus_squared),
        covariance,
    })
}

/// `[x, y, θ]` of a contact less those of another.
fn place(contact: &Contact, origin: &Contact) -> Vector3<f64> {
    let x = contact.x_in_world - origin.x_in_world;
    Vector3::new(x.x, x.y, contact.theta_rad - origin.theta_rad)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    /// A quarter and three quarters of two contacts 4 mm apart: mean and spread by hand.
    #[test]
    fn mixture_of_two() {
        let contact = |x_m: f64, s_m: f64, s_sigma_m: f64| Contact {
            x_in_world: Vector2::new(x_m, 0.0),
            theta_rad: 1.0,
            s_m,
            s_sigma_m,
            f_normal_n: 1.0,
            f_tangent_n: 0.0,
            friction_angle_rad: 0.0,
            friction_angle_sigma_rad: 0.0,
            modulus_squared: 0.5,
            covariance: Matrix3::identity() * 1e-6,
        };
        let both = [(0.75, contact(0.1, 0.25, 0.0)), (0.25, contact(0.104, 0.246, 1e-3))];
        let mixed = mixed(&both).expect("two contacts");
        assert!((mixed.x_in_world.x - 0.101).abs() < 1e-15 && (mixed.s_m - 0.249).abs() < 1e-15);
        // ¾ (1 mm)² + ¼ (3 mm)² = 3 mm², besides the contacts' own.
        assert!((mixed.covariance[(0, 0)] - 4e-6).abs() < 1e-18);
        assert!((mixed.covariance[(1, 1)] - 1e-6).abs() < 1e-18);
        assert!((mixed.s_sigma_m.powi(2) - 3.25e-6).abs() < 1e-18);
    }
}
