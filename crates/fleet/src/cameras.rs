//! The cameras of a fleet by name: lens, the points that each sees, where it stands on a map.

mod table;
mod text;

use crate::FleetError;
use resight::core::{Camera, Lens, Point, Target};
use resight::formats::{self, NamedCamera, plausible};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// A camera that is not in the table.
pub const UNKNOWN: u32 = u32::MAX;

/// Every camera of a fleet. A camera's number is its place in `cameras`.
#[derive(Debug, Clone, Default)]
pub struct Cameras {
    cameras: Vec<Camera>,
    names: Vec<String>,
    points: Vec<Option<Vec<Point>>>,
    /// Why the points of a camera are hardly in metres.
    sizes: Vec<Option<String>>,
    sites: Vec<Option<Site>>,
    number: HashMap<String, u32>,
    /// What is unusual but not wrong, in sentences.
    pub warnings: Vec<String>,
    /// The file and the reason of each row of the table that is no camera; views of theirs have no pose.
    pub rejected: Vec<(PathBuf, String)>,
}

/// Where a camera stands on the map of a report.
#[derive(Debug, Clone, PartialEq)]
pub struct Site {
    /// Its name; may be empty.
    pub name: String,
    /// East and north: degrees of longitude and latitude, or any plane coordinates.
    pub east_north: Option<[f64; 2]>,
}

/// One camera, as it is entered.
#[derive(Debug, Clone)]
pub struct FleetCamera {
    /// Its name in column `camera`.
    pub name: String,
    /// Lens and image size.
    pub camera: Camera,
    /// The points that it sees, metres, in the order of its pixels; none: the rows, or the target, state them.
    pub points: Option<Vec<Point>>,
    /// Where it stands.
    pub site: Option<Site>,
}

impl Cameras {
    /// Reads the cameras of a fleet: a CSV table with a row a camera, any camera file with names in it, or a folder of camera files, each
    /// named after its camera.
    ///
    /// # Errors
    /// What is wrong with a file, and in which line; a name that appears twice, but for tables, whose second row is rejected; no camera at all.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, FleetError> {
        let path = path.as_ref();
        let (cameras, rejected, remarks) = match path {
            folder if folder.is_dir() => of_folder(folder)?,
            table if is_table(table) => table::read(table)?,
            file => {
                let read = formats::read_cameras(file)?;
                (read.cameras.into_iter().map(of_file).collect(), Vec::new(), remarks(file, &read.warnings))
            }
        };
        let mut all = Cameras::of(cameras).map_err(|reason| match reason {
            FleetError::Setting(reason) => FleetError::at(path, reason),
            other => other,
        })?;
        all.rejected = rejected.into_iter().map(|reason| (reason.path.clone(), reason.to_string())).collect();
        all.warnings.extend(remarks);
        Ok(all)
    }

    /// Of these cameras, in this order.
    ///
    /// # Errors
    /// `Setting` for no camera, or a name that appears twice.
    pub fn of(cameras: Vec<FleetCamera>) -> Result<Self, FleetError> {
        if cameras.is_empty() {
            return Err(FleetError::Setting("no camera; at least one is needed".into()));
        }
        let mut all = Cameras::default();
        for FleetCamera { name, camera, points, site } in cameras {
            let number = all.cameras.len() as u32;
            if let Some(first) = all.number.insert(name.clone(), number) {
                let reason =
                    format!("camera `{name}` appears twice (camera {} and camera {})", first + 1, number + 1);
                return Err(FleetError::Setting(reason));
            }
            all.cameras.push(camera);
            all.names.push(name);
            all.sizes.push(points.as_deref().and_then(plausible::of_points));
            all.points.push(points);
            all.sites.push(site);
        }
        all.warn();
        Ok(all)
    }

    /// The points of a target for every camera that has none of its own.
    ///
    /// # Errors
    /// `Setting` for a target whose points have no fixed order.
    pub fn with_target(mut self, target: &Target) -> Result<Self, FleetError> {
        let points: Vec<Point> = target
            .features()
            .into_iter()
            .filter_map(|f| target.point(f))
            .map(|known| known.position)
            .collect();
        if points.len() < 3 {
            let (kind, n) = (target.kind(), points.len());
            let reason = format!("a target of kind {kind} has {n} points; 3 or more are needed");
            return Err(FleetError::Setting(reason));
        }
        let remarks = plausible::of_target(target);
        for (own, size) in self.points.iter_mut().zip(&mut self.sizes) {
            if own.is_none() {
                *own = Some(points.clone());
                *size = remarks.first().cloned();
            }
        }
        self.warnings.extend(remarks.into_iter().map(|remark| format!("target: {remark}")));
        Ok(self)
    }

    fn warn(&mut self) {
        let suspect =
            |(name, remark): (&String, &Option<String>)| Some(format!("camera {name}: {}", remark.as_ref()?));
        let mut suspects = self.names.iter().zip(&self.sizes).filter_map(suspect);
        let (first, others) = (suspects.next(), suspects.count());
        self.warnings.extend(first.map(|remark| match others {
            0 => remark,
            n => format!("{remark}; {n} other cameras likewise"),
        }));
        let slow = self.cameras.iter().filter(|camera| !matches!(camera.lens, Lens::Pinhole(_))).count();
        if 0 < slow {
            self.warnings.push(format!(
                "{slow} of {} cameras have lenses with distortion, whose views are solved one by one, some ten times slower than those of \
                 pinhole cameras; where speed matters undistort the pixels first",
                self.cameras.len()
            ));
        }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.cameras.len()
    }

    /// Whether there is none, which only `default` gives.
    pub fn is_empty(&self) -> bool {
        self.cameras.is_empty()
    }

    /// The number of a name.
    pub fn number(&self, name: &str) -> Option<u32> {
        self.number.get(name).copied()
    }

    /// Names, by number.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Lenses, by number.
    pub fn cameras(&self) -> &[Camera] {
        &self.cameras
    }

    /// Why the points of a camera are hardly in metres, in a sentence.
    pub fn size_remark(&self, number: u32) -> Option<&str> {
        self.sizes.get(number as usize)?.as_deref()
    }

    /// The points of a camera, metres.
    pub fn points(&self, number: u32) -> Option<&[Point]> {
        self.points.get(number as usize)?.as_deref()
    }

    /// Where a camera stands.
    pub fn site(&self, number: u32) -> Option<&Site> {
        self.sites.get(number as usize)?.as_ref()
    }
}

fn of_file(camera: NamedCamera) -> FleetCamera {
    FleetCamera { name: camera.name, camera: camera.camera, points: None, site: None }
}

fn is_table(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv"))
}

/// One camera a file; a file with several gives them all.
fn of_folder(folder: &Path) -> Result<table::Read, FleetError> {
    let entries = std::fs::read_dir(folder).map_err(|e| FleetError::at(folder, e.to_string()))?;
    let mut files: Vec<_> =
        entries.flatten().map(|entry| entry.path()).filter(|path| path.is_file()).collect();
    files.sort();
    let (mut cameras, mut unusual) = (Vec::new(), Vec::new());
    for file in files {
        let read = formats::read_cameras(&file)?;
        unusual.extend(remarks(&file, &read.warnings));
        let read = read.cameras;
        let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let is_alone = read.len() == 1;
        cameras.extend(read.into_iter().map(|camera| {
            let camera = of_file(camera);
            if is_alone { FleetCamera { name: stem.clone(), ..camera } } else { camera }
        }));
    }
    Ok((cameras, Vec::new(), unusual))
}

fn remarks(file: &Path, warnings: &[String]) -> Vec<String> {
    warnings.iter().map(|warning| format!("{}: {warning}", file.display())).collect()
}
