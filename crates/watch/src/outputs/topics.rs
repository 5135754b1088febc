//! The names of topics, by camera and target.

use crate::names::Names;

/// Topics of a session.
pub struct Topics {
    prefix: String,
    cameras: Vec<String>,
    targets: Vec<String>,
}

impl Topics {
    pub fn new(prefix: &str, names: &Names) -> Self {
        let levels = |names: &[String]| names.iter().map(|name| level(name)).collect();
        Topics {
            prefix: prefix.to_string(),
            cameras: levels(&names.cameras),
            targets: levels(&names.targets),
        }
    }

    /// Returns the topic, retained, with `online` or `offline`.
    pub fn availability(&self) -> String {
        format!("{}/availability", self.prefix)
    }

    /// Returns the topic, retained, of the last state.
    pub fn state(&self, camera: usize, target: usize) -> String {
        self.of_pair(camera, target, "state")
    }

    /// Returns the topic of the values of a frame.
    pub fn frame(&self, camera: usize, target: usize) -> String {
        self.of_pair(camera, target, "frame")
    }

    /// Returns the topic, retained, that states whether the source is lost or back.
    pub fn source(&self, camera: usize) -> String {
        self.of_camera(camera, "source")
    }

    /// Returns the topic of what moved relative to the others.
    pub fn moved(&self) -> String {
        format!("{}/moved", self.prefix)
    }

    /// Returns a topic that two names share.
    pub fn shared(&self) -> Option<String> {
        let twice = |levels: &[String]| {
            levels.iter().enumerate().find(|(i, level)| levels[..*i].contains(level)).map(|(_, l)| l.clone())
        };
        twice(&self.cameras).or_else(|| twice(&self.targets)).map(|level| format!("{}/{level}", self.prefix))
    }

    /// Returns a topic of a camera.
    pub fn of_camera(&self, camera: usize, what: &str) -> String {
        format!("{}/{}/{what}", self.prefix, of(&self.cameras, camera))
    }

    /// Returns a topic of a camera against a target.
    pub fn of_pair(&self, camera: usize, target: usize, what: &str) -> String {
        format!("{}/{}/{}/{what}", self.prefix, of(&self.cameras, camera), of(&self.targets, target))
    }
}

fn of(levels: &[String], i: usize) -> &str {
    levels.get(i).map_or("_", String::as_str)
}

/// Returns one level of a topic: characters that would separate or match levels become underscores.
fn level(name: &str) -> String {
    name.chars().map(|c| if matches!(c, '/' | '+' | '#') || c.is_control() { '_' } else { c }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_within_their_level() {
        let names = |cameras: &[&str]| Names {
            cameras: cameras.iter().map(|name| name.to_string()).collect(),
            targets: vec!["do#or".to_string(), "Tür".to_string()],
        };
        let topics = Topics::new("site/a", &names(&["gate/1", "yard+"]));
        assert_eq!(topics.state(0, 0), "site/a/gate_1/do_or/state");
        assert_eq!(
            (topics.frame(1, 1), topics.source(1)),
            ("site/a/yard_/Tür/frame".to_string(), "site/a/yard_/source".to_string())
        );
        assert_eq!(topics.shared(), None);
        assert_eq!(Topics::new("p", &names(&["a+", "a#"])).shared(), Some("p/a_".to_string()));
    }
}
