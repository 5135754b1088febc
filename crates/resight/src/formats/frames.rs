//! Poses between frames that are joined through other frames.

use super::{NamedCamera, Placement};
use crate::core::Pose;

/// `b_from_a` through any chain of the cameras' placements; none when nothing joins the two.
pub(super) fn between(cameras: &[NamedCamera], b: &str, a: &str) -> Option<Pose> {
    let placements: Vec<&Placement> = cameras.iter().filter_map(|c| c.placement.as_ref()).collect();
    let mut reached = vec![(a.to_owned(), Pose::identity())];
    let mut next = 0;
    while let Some((frame, frame_from_a)) = reached.get(next).cloned() {
        if frame == b {
            return Some(frame_from_a);
        }
        for p in &placements {
            let step = if p.a == frame {
                Some((&p.b, p.b_from_a))
            } else if p.b == frame {
                Some((&p.a, p.b_from_a.inverse()))
            } else {
                None
            };
            if let Some((to, to_from_frame)) = step
                && reached.iter().all(|(seen, _)| seen != to)
            {
                reached.push((to.clone(), to_from_frame * frame_from_a));
            }
        }
        next += 1;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::{Camera, Vector6};

    #[test]
    fn chains_run_both_ways() {
        let cam = |name: &str, a: &str, x: f64| NamedCamera {
            name: name.into(),
            camera: Camera::normalized(),
            placement: Some(Placement {
                b: name.into(),
                a: a.into(),
                b_from_a: Pose::exp(&Vector6::new(0.1, x, 0.2, x, 0.0, 1.0)),
                covariance: None,
            }),
        };
        let cameras = [cam("cam0", "imu", 0.1), cam("cam1", "cam0", 0.2), cam("cam2", "imu", 0.3)];
        let p = |i: usize| cameras[i].placement.as_ref().unwrap().b_from_a;
        let expected = p(1) * p(0) * p(2).inverse();
        let found = between(&cameras, "cam1", "cam2").unwrap();
        assert!(
            (found.rotation - expected.rotation).norm() + (found.translation - expected.translation).norm()
                < 1e-12
        );
        assert!(between(&cameras, "cam1", "world").is_none());
    }
}
