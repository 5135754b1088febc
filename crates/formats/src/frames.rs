//! Poses between frames that are joined through other frames.

use super::{CameraFile, Format, NamedCamera, Placement, WriteError};
use crate::core::Pose;

/// All poses a rig states, between cameras and other frames.
pub(super) struct Frames<'a> {
    placements: Vec<&'a Placement>,
}

impl<'a> Frames<'a> {
    /// All that a rig states.
    pub fn of_rig(rig: &'a CameraFile) -> Self {
        Frames::of(&rig.cameras, &rig.relations)
    }

    /// Those of the cameras and those between other frames.
    pub fn of(cameras: &'a [NamedCamera], relations: &'a [Placement]) -> Self {
        Frames { placements: cameras.iter().filter_map(|c| c.placement.as_ref()).chain(relations).collect() }
    }

    /// `b_from_a` through the shortest chain of poses; none when nothing joins the two.
    pub fn between(&self, b: &str, a: &str) -> Option<Pose> {
        self.reached_from(a).into_iter().find(|(frame, _)| frame == b).map(|(_, b_from_a)| b_from_a)
    }

    /// The frame that all cameras are placed in: the first of `preferred` that the rig has, else the natural one. Errors name the camera that nothing joins to it.
    pub fn common(
        &self,
        cameras: &[NamedCamera],
        preferred: &[&str],
        format: Format,
    ) -> Result<String, WriteError> {
        let wanted = preferred.iter().find(|name| self.has(name)).map(|name| (*name).to_owned());
        let reference = wanted.or_else(|| self.natural(cameras)).unwrap_or_else(|| cameras[0].name.clone());
        let reached = self.reached_from(&reference);
        match cameras.iter().find(|c| reached.iter().all(|(frame, _)| *frame != c.name)) {
            None => Ok(reference),
            Some(lost) => Err(WriteError(format!(
                "no pose joins camera `{}` to `{reference}`, and {} states where every camera is; give a file \
                    with its pose too, or pick cameras with FILE#NAME",
                lost.name,
                format.name()
            ))),
        }
    }

    /// The frame a person would place the cameras in: the one that all placements share, else the only one that is no
    /// camera, else the first camera.
    pub fn natural(&self, cameras: &[NamedCamera]) -> Option<String> {
        let others: Vec<&str> =
            self.names().into_iter().filter(|name| cameras.iter().all(|c| c.name != *name)).collect();
        let only = || (others.len() == 1).then(|| others[0].to_owned());
        shared_end(cameras).or_else(only).or_else(|| cameras.first().map(|c| c.name.clone()))
    }

    /// Every frame that poses join to `a`, with `a_from_frame`, in the order in which the rig names them; not `a` itself.
    pub fn seen_from(&self, a: &str) -> Vec<(String, Pose)> {
        let reached = self.reached_from(a);
        let pose = |name: &str| reached.iter().find(|(frame, _)| frame == name).map(|(_, p)| p.inverse());
        let names = self.names().into_iter().filter(|name| *name != a);
        names.filter_map(|name| pose(name).map(|p| (name.to_owned(), p))).collect()
    }

    /// All frames, in the order in which they are first named.
    pub fn names(&self) -> Vec<&'a str> {
        let mut names: Vec<&str> = Vec::new();
        for name in self.placements.iter().flat_map(|p| [p.b.as_str(), p.a.as_str()]) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        names
    }

    fn has(&self, frame: &str) -> bool {
        self.placements.iter().any(|p| p.a == frame || p.b == frame)
    }

    /// Every frame b that poses join to `a`, nearest first, with `b_from_a`; `a` itself is the first.
    pub fn reached_from(&self, a: &str) -> Vec<(String, Pose)> {
        let mut reached = vec![(a.to_owned(), Pose::identity())];
        let mut next = 0;
        while let Some((frame, frame_from_a)) = reached.get(next).cloned() {
            for p in &self.placements {
                if let Some((to, to_from_frame)) = step(p, &frame)
                    && reached.iter().all(|(seen, _)| seen != to)
                {
                    reached.push((to.to_owned(), to_from_frame * frame_from_a));
                }
            }
            next += 1;
        }
        reached
    }
}

/// The frame at the far end of every camera's placement, when it is one and the same.
fn shared_end(cameras: &[NamedCamera]) -> Option<String> {
    let ends: Vec<&String> = cameras
        .iter()
        .filter_map(|c| c.placement.as_ref().map(|p| if p.b == c.name { &p.a } else { &p.b }))
        .collect();
    let first = ends.first()?;
    ends.iter().all(|end| end == first).then(|| (*first).clone())
}

/// The frame at the other end of a pose, and the pose to there.
fn step<'p>(p: &'p Placement, frame: &str) -> Option<(&'p str, Pose)> {
    if p.a == frame {
        Some((&p.b, p.b_from_a))
    } else if p.b == frame {
        Some((&p.a, p.b_from_a.inverse()))
    } else {
        None
    }
}

/// `b_from_a` between two frames of a file (cameras, or what they are placed in), through any chain of its placements; none where
/// nothing joins them.
pub fn pose_between(cameras: &[NamedCamera], b: &str, a: &str) -> Option<Pose> {
    Frames::of(cameras, &[]).between(b, a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::{Camera, Vector6};

    #[test]
    fn chains_run_both_ways() {
        let cam = |name: &str, a: &str, x: f64| {
            NamedCamera::new(
                name,
                Camera::normalized(),
                Some(Placement {
                    b: name.into(),
                    a: a.into(),
                    b_from_a: Pose::exp(&Vector6::new(0.1, x, 0.2, x, 0.0, 1.0)),
                    covariance: None,
                }),
            )
        };
        let cameras = [cam("cam0", "imu", 0.1), cam("cam1", "cam0", 0.2), cam("cam2", "imu", 0.3)];
        let p = |i: usize| cameras[i].placement.as_ref().unwrap().b_from_a;
        let expected = p(1) * p(0) * p(2).inverse();
        let found = Frames::of(&cameras, &[]).between("cam1", "cam2").unwrap();
        assert!(
            (found.rotation - expected.rotation).norm() + (found.translation - expected.translation).norm()
                < 1e-12
        );
        assert!(Frames::of(&cameras, &[]).between("cam1", "world").is_none());
    }
}
