//! Frame ids. TF is a tree: a frame has one parent, so what is observed by several cameras gets one name for each.

use super::super::super::names::{Names, split};
use crate::ros::write::Transform;
use anyhow::{Result, bail};
use resight::core::Pose;

/// Names of frames, by the indices of cameras and targets.
pub struct Frames {
    cameras: Vec<String>,
    targets: Vec<String>,
    target_is_parent: bool,
}

impl Frames {
    /// Builds the frame ids: the names of cameras and targets, except for those given as `NAME=FRAME_ID`.
    pub fn new(names: &Names, target_is_parent: bool, renamed: &[String]) -> Result<Self> {
        let mut frames =
            Frames { cameras: names.cameras.clone(), targets: names.targets.clone(), target_is_parent };
        for argument in renamed {
            let (Some(name), frame) = split(argument) else {
                bail!("--tf-frame {argument}: NAME=FRAME_ID is needed");
            };
            let places = [(&names.cameras, &mut frames.cameras), (&names.targets, &mut frames.targets)];
            let place = places
                .into_iter()
                .find_map(|(names, frames)| Some(&mut frames[names.iter().position(|n| n == name)?]));
            match place {
                Some(place) => *place = frame.trim_start_matches('/').to_string(),
                None => bail!(
                    "--tf-frame {argument}: there is no such camera or target; there are {}, {}",
                    names.cameras.join(", "),
                    names.targets.join(", ")
                ),
            }
        }
        let all: Vec<&String> = frames.cameras.iter().chain(&frames.targets).collect();
        match all.iter().enumerate().find(|(i, frame)| all[..*i].contains(frame)) {
            Some((_, frame)) => {
                bail!("two frames would be called {frame}; give one another name: --tf-frame NAME=FRAME_ID")
            }
            None => Ok(frames),
        }
    }

    /// Returns the camera's frame; one for each target where several are its parents.
    fn camera(&self, camera: usize, target: usize) -> String {
        match self.target_is_parent && 1 < self.targets.len() {
            true => format!("{}/{}", self.cameras[camera], self.targets[target]),
            false => self.cameras[camera].clone(),
        }
    }

    /// Returns the target's frame; one for each camera where several are its parents.
    pub fn target(&self, camera: usize, target: usize) -> String {
        match !self.target_is_parent && 1 < self.cameras.len() {
            true => format!("{}/{}", self.cameras[camera], self.targets[target]),
            false => self.targets[target].clone(),
        }
    }

    fn of_reference(&self, camera: usize, target: usize) -> String {
        match self.targets.as_slice() {
            [_, _, ..] => format!("{}/{}/reference", self.cameras[camera], self.targets[target]),
            _ => format!("{}/reference", self.cameras[camera]),
        }
    }

    /// Returns the transform that a frame of the camera measured.
    pub fn seen(&self, camera: usize, target: usize, cam_from_target: &Pose) -> Transform {
        let (cam, target) = (self.camera(camera, target), self.target(camera, target));
        match self.target_is_parent {
            true => Transform { parent: target, child: cam, parent_from_child: cam_from_target.inverse() },
            false => Transform { parent: cam, child: target, parent_from_child: *cam_from_target },
        }
    }

    /// Returns the reference pose of the camera, below the target.
    pub fn reference(&self, camera: usize, target: usize, cam_from_target: &Pose) -> Transform {
        let (parent, child) = (self.target(camera, target), self.of_reference(camera, target));
        Transform { parent, child, parent_from_child: cam_from_target.inverse() }
    }

    /// Returns its present pose according to the monitor, below the reference pose.
    pub fn correction(&self, camera: usize, target: usize, old_from_new: &Pose) -> Transform {
        let parent = self.of_reference(camera, target);
        let child = format!("{}/corrected", parent.trim_end_matches("/reference"));
        Transform { parent, child, parent_from_child: *old_from_new }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(cameras: &[&str], targets: &[&str]) -> Names {
        let owned = |all: &[&str]| all.iter().map(|name| format!("{name}=x")).collect::<Vec<_>>();
        Names::new(&owned(cameras), &owned(targets))
    }

    /// For any number of cameras and targets no frame has two parents, and none is its own ancestor.
    #[test]
    fn frames_form_a_forest() {
        for (cameras, targets) in [
            (&["a"][..], &["t"][..]),
            (&["a", "b"], &["t"]),
            (&["a"], &["t", "u"]),
            (&["a", "b"], &["t", "u"]),
        ] {
            for target_is_parent in [true, false] {
                let frames = Frames::new(&names(cameras, targets), target_is_parent, &[]).unwrap();
                let mut parents = std::collections::BTreeMap::new();
                for (c, t) in (0..cameras.len()).flat_map(|c| (0..targets.len()).map(move |t| (c, t))) {
                    let pose = Pose::identity();
                    for edge in [
                        frames.seen(c, t, &pose),
                        frames.reference(c, t, &pose),
                        frames.correction(c, t, &pose),
                    ] {
                        let before = parents.insert(edge.child.clone(), edge.parent.clone());
                        assert!(before.is_none_or(|before| before == edge.parent), "{edge:?}");
                    }
                }
                for start in parents.keys() {
                    let steps = std::iter::successors(Some(start), |frame| parents.get(*frame));
                    assert!(steps.take(10).count() < 10, "a circle at {start}");
                }
            }
        }
    }

    #[test]
    fn frames_are_renamed_and_never_shared() {
        let names = names(&["gate"], &["door"]);
        let frames = Frames::new(&names, true, &["gate=front_optical".into(), "door=/hall".into()]).unwrap();
        let seen = frames.seen(0, 0, &Pose::identity());
        assert_eq!((seen.parent.as_str(), seen.child.as_str()), ("hall", "front_optical"));
        for bad in ["gate=door", "window=x", "gate"] {
            assert!(Frames::new(&names, true, &[bad.to_string()]).is_err(), "{bad}");
        }
    }
}
