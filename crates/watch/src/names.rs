//! The names of cameras and targets, and `[NAME=]VALUE` arguments.

use anyhow::{Context, Result, bail};
use resight::formats::NamedCamera;

/// The names of a session, by the indices of its events.
#[derive(Debug, Clone)]
pub struct Names {
    /// Names of the cameras.
    pub cameras: Vec<String>,
    /// Names of the targets; every camera watches all of them.
    pub targets: Vec<String>,
}

impl Names {
    /// Builds the names from those given, otherwise `cam0`, `target0` and so on.
    pub fn new(cameras: &[String], targets: &[String]) -> Self {
        Names { cameras: given(cameras, "cam"), targets: of_targets(targets) }
    }

    /// Builds the names from a rig's file.
    pub fn of_rig(rig: &[NamedCamera], targets: &[String]) -> Self {
        let cameras = rig.iter().map(|camera| camera.name.clone()).collect();
        Names { cameras, targets: of_targets(targets) }
    }

    /// Returns the names if each stands for one camera, target or pair: what moved is reported by its name alone.
    ///
    /// # Errors
    /// A name that stands for two.
    pub fn distinct(self) -> Result<Self> {
        let pairs = if 1 < self.targets.len() { self.pairs() } else { Vec::new() };
        let all: Vec<&String> = self.cameras.iter().chain(&self.targets).chain(&pairs).collect();
        match all.iter().enumerate().find(|(i, name)| all[..*i].contains(name)) {
            None => Ok(self),
            Some((_, name)) => bail!(
                "two cameras or targets are called {name}; give each a name of its own: --camera NAME=FILE, --target NAME=FILE"
            ),
        }
    }

    /// Returns `camera gate` or `target door`.
    pub fn kind(&self, node: &str) -> String {
        match self.cameras.iter().any(|camera| camera == node) {
            true => format!("camera {node}"),
            false => format!("target {node}"),
        }
    }

    /// Returns the name of a camera.
    pub fn camera(&self, camera: usize) -> &str {
        self.cameras.get(camera).map_or("?", String::as_str)
    }

    /// Returns the name of a target.
    pub fn target(&self, target: usize) -> &str {
        self.targets.get(target).map_or("?", String::as_str)
    }

    /// Returns the name of a camera with one of its targets: `gate`, or `gate/door` where there are several targets.
    pub fn pair(&self, camera: usize, target: usize) -> String {
        match self.targets.as_slice() {
            [_, _, ..] => format!("{}/{}", self.camera(camera), self.target(target)),
            _ => self.camera(camera).to_string(),
        }
    }

    /// Returns the names of all pairs, camera by camera.
    pub fn pairs(&self) -> Vec<String> {
        let targets = self.targets.len();
        (0..self.cameras.len() * targets).map(|i| self.pair(i / targets, i % targets)).collect()
    }

    /// Returns camera and target of a pair, by its index among `pairs`.
    pub fn of_pair(&self, pair: usize) -> (usize, usize) {
        let targets = self.targets.len().max(1);
        (pair / targets, pair % targets)
    }

    /// Returns the index of a pair among `pairs`.
    pub fn pair_index(&self, camera: usize, target: usize) -> usize {
        camera * self.targets.len() + target
    }
}

/// Returns the names of the targets; without a target the one entry is for the landmarks.
fn of_targets(targets: &[String]) -> Vec<String> {
    match targets {
        [] => vec!["landmarks".to_string()],
        targets => given(targets, "target"),
    }
}

fn given(arguments: &[String], otherwise: &str) -> Vec<String> {
    let name = |(i, argument): (usize, &String)| match split(argument) {
        (Some(name), _) => name.to_string(),
        (None, _) => format!("{otherwise}{i}"),
    };
    arguments.iter().enumerate().map(name).collect()
}

/// Splits an argument into NAME and VALUE; without a name where the part before `=` is a path.
pub fn split(argument: &str) -> (Option<&str>, &str) {
    match argument.split_once('=') {
        Some((name, value)) if is_name(name) => (Some(name), value),
        _ => (None, argument),
    }
}

/// Returns whether a text is a name: `gate`, `cam.north` or `gate/door`, but neither `./a` nor `/a/b/c` nor `rtsp://host/a?b`.
fn is_name(text: &str) -> bool {
    let parts: Vec<&str> = text.split('/').collect();
    let is_part =
        |part: &&str| !part.is_empty() && !part.starts_with('.') && !part.contains(['\\', '*', ':', '?']);
    parts.len() <= 2 && parts.iter().all(is_part)
}

/// Returns the values of one flag, one entry for each name.
pub fn by_name(flag: &str, arguments: &[String], names: &[String]) -> Result<Vec<Option<String>>> {
    let mut values = vec![None; names.len()];
    for (i, argument) in arguments.iter().enumerate() {
        let (name, value) = split(argument);
        let place = match name {
            Some(name) => names.iter().position(|known| known == name),
            None if i < names.len() => Some(i),
            None => None,
        };
        // The part after `=` may contain a password.
        let place = place.with_context(|| {
            let shown = name.map_or("…".to_string(), |name| format!("{name}=…"));
            format!("{flag} {shown}: there is no such name; there are {}", names.join(", "))
        })?;
        if values[place].replace(value.to_string()).is_some() {
            bail!("{flag} is given twice for {}; once is needed", names[place]);
        }
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distinct(cameras: &[&str], targets: &[&str]) -> Result<Names> {
        let owned = |all: &[&str]| all.iter().map(|text| text.to_string()).collect::<Vec<_>>();
        Names::new(&owned(cameras), &owned(targets)).distinct()
    }

    #[test]
    fn split_takes_names_from_paths_and_addresses() {
        for (argument, name) in [
            ("gate=a.toml", Some("gate")),
            ("cam.north=a.toml", Some("cam.north")),
            ("cam.north/door.1=a.toml", Some("cam.north/door.1")),
            ("cam.north=./a=b.png", Some("cam.north")),
            ("./a=b.png", None),
            ("../a=b.png", None),
            (".a=b.png", None),
            ("a/../b=c.png", None),
            ("rtsp://host/a?b=c", None),
            ("C:\\a=b.png", None),
            ("*.v=2.png", None),
            ("a.toml", None),
        ] {
            assert_eq!(split(argument).0, name, "{argument}");
        }
    }

    #[test]
    fn a_name_stands_for_one() {
        assert!(distinct(&["gate=a", "yard=b"], &["door=c", "wall=d"]).is_ok());
        assert!(distinct(&["a.toml", "b.toml"], &[]).is_ok());
        for (cameras, targets) in [
            (&["gate=a", "gate=b"][..], &["door=c"][..]),
            (&["gate=a"], &["door=c", "door=d"]),
            (&["gate=a"], &["gate=c"]),
            (&["cam1=a", "b.toml"], &[]),
            (&["a=a", "a/b=b"], &["b/c=c", "c=d"]),
        ] {
            assert!(distinct(cameras, targets).is_err(), "{cameras:?} {targets:?}");
        }
    }
}
