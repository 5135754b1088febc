//! Collects detections, from rows in memory or CSV files, into frames.

pub(crate) mod table;

use super::NamedTarget;
use super::observed::{Collected, Frame, LeftOut};
use super::request::join;
use crate::core::correspondence::Observations;
use crate::core::target::{Feature, KnownPoint};
use crate::core::{Correspondence, Pixel, Point, Target};
use crate::error::Error;
use crate::input::not_among;
use crate::input::table::how_file_is_read;
use crate::report::words;
use std::collections::HashMap;
use std::path::PathBuf;

/// Default standard deviation of a pixel, where neither row nor request states one.
const ASSUMED_SIGMA_PX: f64 = 0.5;
/// Squares of larger numbers, and their products, overflow.
const LARGEST: f64 = 1e60;
/// Name of the only target, where no row states one.
const NAMELESS: &str = "target";

/// One point in one frame of one camera. `Default` fills in the optional fields.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct DetectionRow<'a> {
    /// Name of the camera.
    pub camera: &'a str,
    /// Name of the frame: frames of the same name are one view, unless times decide.
    pub view: &'a str,
    /// When the frame was taken, seconds, on a clock that all cameras share.
    pub t_s: Option<f64>,
    /// Name of the target; `None` if there is only one.
    pub target: Option<&'a str>,
    /// The body that the target is mounted on: targets of one body move together.
    pub body: Option<&'a str>,
    /// Identifier of the point in the target.
    pub id: Option<&'a str>,
    /// Index of the corner of the tag `id`, counted from 0.
    pub corner: Option<&'a str>,
    /// Position of the point in the target's frame, metres; `None` if the request's target states it.
    pub position_m: Option<[f64; 3]>,
    /// `[u, v]`, pixels.
    pub image_px: [f64; 2],
    /// Standard deviation of each image coordinate, pixels; by default that of [`Detections`].
    pub sigma_px: Option<f64>,
    /// Standard deviation of the position along each axis, metres; by default that of the target.
    pub sigma_m: Option<f64>,
    /// Line of the file that the row comes from; by default the number of the row, counted from 1.
    pub line: Option<u64>,
}

/// The source of detections.
#[derive(Debug, Clone, Copy)]
pub enum DetectionSource<'a> {
    /// CSV files with the columns camera, view, id, x_m, y_m, z_m, u_px, v_px and optionally target, body, corner, sigma_px, sigma_m, t_s.
    Files(&'a [PathBuf]),
    /// Rows in memory.
    Rows(&'a [DetectionRow<'a>]),
}

/// Detections of all cameras.
#[derive(Debug, Clone, Copy)]
pub struct Detections<'a> {
    /// The rows.
    pub source: DetectionSource<'a>,
    /// Standard deviation of each image coordinate, pixels, for rows without one; by default 0.5, with a remark.
    pub sigma_px: Option<f64>,
}

impl<'a> Detections<'a> {
    /// Reads detections from CSV files.
    pub fn files(paths: &'a [PathBuf]) -> Self {
        Detections { source: DetectionSource::Files(paths), sigma_px: None }
    }

    /// Takes detections from rows in memory.
    pub fn rows(rows: &'a [DetectionRow<'a>]) -> Self {
        Detections { source: DetectionSource::Rows(rows), sigma_px: None }
    }
}

/// The fault of a row: the column, and the end of a sentence about it.
pub(super) struct RowFault {
    column: &'static str,
    what: String,
}

impl RowFault {
    fn new(column: &'static str, what: impl Into<String>) -> Self {
        RowFault { column, what: what.into() }
    }
}

/// Converts rows to frames.
struct Reader<'a> {
    collected: &'a mut Collected,
    cameras: HashMap<String, usize>,
    targets: HashMap<String, usize>,
    /// One target of each body named in the rows.
    bodies: HashMap<String, usize>,
    /// Frames by camera and name.
    frames: HashMap<(usize, String), usize>,
    sigma_px: f64,
    assumes_sigma: bool,
    /// The observations of each target in each frame.
    observed: HashMap<(usize, usize), Observations>,
    n_rows: usize,
    n_repeated: usize,
}

/// Converts detections to frames, and adds the targets named in them to `collected.targets`.
pub(crate) fn collect(detections: &Detections, collected: &mut Collected) -> Result<(), Error> {
    if let Some(sigma) = detections.sigma_px
        && !(0.0 < sigma && sigma <= LARGEST)
    {
        return Err(Error::request(format!("sigma_px is {sigma}; it must be positive")));
    }
    let mut reader = Reader::new(collected, detections.sigma_px.unwrap_or(ASSUMED_SIGMA_PX));
    match detections.source {
        DetectionSource::Files(paths) => {
            paths.iter().try_for_each(|path| table::read(path, &mut reader))?;
            reader.collected.remarks.extend(paths.iter().filter_map(how_file_is_read));
        }
        DetectionSource::Rows(rows) => {
            for (row, number) in rows.iter().zip(1..) {
                let row = DetectionRow { line: row.line.or(Some(number)), ..*row };
                reader.row(&row).map_err(|RowFault { column, what }| {
                    Error::request(format!("detection {number}: {column} {what}"))
                })?;
            }
        }
    }
    if reader.assumes_sigma && detections.sigma_px.is_none() {
        let text = format!("σ {ASSUMED_SIGMA_PX} px is assumed for every point; state yours with --sigma-px");
        reader.collected.remarks.push(text);
    }
    reader.collected.remarks.extend(words::repeated(reader.n_repeated, reader.n_rows));
    Ok(())
}

impl<'a> Reader<'a> {
    fn new(collected: &'a mut Collected, sigma_px: f64) -> Self {
        let cameras = collected.cameras.iter().map(|camera| camera.name.clone()).zip(0..).collect();
        let targets = collected.targets.iter().map(|target| target.name.clone()).zip(0..).collect();
        let (bodies, frames) = (HashMap::new(), HashMap::new());
        let observed = HashMap::new();
        Reader {
            collected,
            cameras,
            targets,
            bodies,
            frames,
            sigma_px,
            assumes_sigma: false,
            observed,
            n_rows: 0,
            n_repeated: 0,
        }
    }

    fn row(&mut self, row: &DetectionRow) -> Result<(), RowFault> {
        let camera = self.camera(row)?;
        let target = self.target(row)?;
        let frame = self.frame(row, camera)?;
        let name = point_name(row);
        let known = self.known(row, target, &name)?;
        let pixel = Pixel::new(checked(row.image_px[0], "u_px")?, checked(row.image_px[1], "v_px")?);
        let sigma_px = self.sigma_px(row)?;
        let (number, of_frame) = (self.n_rows, self.observed.entry((frame, target)).or_default());
        self.n_rows += 1;
        if of_frame.first(0, &known.position, &pixel, number) != number {
            self.n_repeated += 1;
            return Ok(());
        }
        let lens = &self.collected.cameras[camera].camera;
        match Correspondence::new(lens, known.position, pixel, sigma_px) {
            Ok(seen) => {
                let seen = Correspondence { sigma_m: known.sigma_m, ..seen };
                let targets = &mut self.collected.frames[frame].targets;
                match targets.iter_mut().find(|(number, _)| *number == target) {
                    Some((_, points)) => points.push((name, seen)),
                    None => targets.push((target, vec![(name, seen)])),
                }
            }
            Err(reason) => self.collected.left_out.push(LeftOut {
                camera: self.collected.cameras[camera].name.clone(),
                view: self.collected.frames[frame].name.clone(),
                what: format!("point {name} (line {})", row.line.unwrap_or_default()),
                reason: reason.to_string(),
            }),
        }
        Ok(())
    }

    fn camera(&self, row: &DetectionRow) -> Result<usize, RowFault> {
        let name = row.camera;
        self.cameras.get(name).copied().ok_or_else(|| {
            let names: Vec<String> = self.collected.cameras.iter().map(|c| c.name.clone()).collect();
            RowFault::new("camera", format!("is `{name}`: {}", not_among(name, "camera", &names)))
        })
    }

    fn target(&mut self, row: &DetectionRow) -> Result<usize, RowFault> {
        let (n, named) = (self.collected.targets.len(), row.target);
        let name = match (named, &self.collected.targets[..]) {
            (Some(name), _) => name.to_string(),
            (None, [only, ..]) => only.name.clone(),
            (None, []) => NAMELESS.to_string(),
        };
        let found = match self.targets.get(&name) {
            Some(found) => *found,
            None => {
                self.targets.insert(name.clone(), n);
                self.collected.targets.push(NamedTarget { name, target: None, body: n });
                n
            }
        };
        if let Some(body) = row.body {
            let first = *self.bodies.entry(body.to_string()).or_insert(found);
            join(&mut self.collected.targets, first, found);
        }
        Ok(found)
    }

    /// Returns the frame of a row, and checks that its time agrees with that of its earlier rows.
    fn frame(&mut self, row: &DetectionRow, camera: usize) -> Result<usize, RowFault> {
        let t_s = row.t_s.map(|t_s| checked(t_s, "t_s")).transpose()?;
        if row.view.is_empty() {
            return Err(RowFault::new("view", "is empty; name the view"));
        }
        let frames = &mut self.collected.frames;
        let at = *self.frames.entry((camera, row.view.to_string())).or_insert(frames.len());
        if at == frames.len() {
            frames.push(Frame { camera, name: row.view.to_string(), t_s, targets: Vec::new() });
        }
        match (frames[at].t_s, t_s) {
            (Some(earlier), Some(now)) if earlier != now => Err(RowFault::new(
                "t_s",
                format!("is {now}, earlier {earlier} for the same frame; a frame has one time"),
            )),
            _ => Ok(at),
        }
    }

    /// Returns the point: the row's own position where it states one, else that in the target.
    fn known(&self, row: &DetectionRow, target: usize, name: &str) -> Result<KnownPoint, RowFault> {
        if let Some(sigma_m) = row.sigma_m
            && !(0.0..=LARGEST).contains(&sigma_m)
        {
            return Err(RowFault::new("sigma_m", format!("is {sigma_m}; it must not be negative")));
        }
        let NamedTarget { name: target_name, target, .. } = &self.collected.targets[target];
        match (row.position_m, target) {
            (Some([x, y, z]), _) => {
                let position = Point::new(checked(x, "x_m")?, checked(y, "y_m")?, checked(z, "z_m")?);
                Ok(KnownPoint { position, sigma_m: row.sigma_m.unwrap_or(0.0) })
            }
            (None, Some(target)) => {
                let known =
                    feature(target, row).and_then(|feature| target.point(feature)).ok_or_else(|| {
                        RowFault::new("id", format!("is `{name}`, which target {target_name} does not have"))
                    })?;
                Ok(KnownPoint { sigma_m: row.sigma_m.unwrap_or(known.sigma_m), ..known })
            }
            (None, None) => Err(RowFault::new(
                "target",
                format!(
                    "is `{target_name}`, of which no --target is given, and there are no columns x_m,y_m,z_m"
                ),
            )),
        }
    }

    fn sigma_px(&mut self, row: &DetectionRow) -> Result<f64, RowFault> {
        match row.sigma_px {
            Some(sigma) if !(0.0 < sigma && sigma <= LARGEST) => {
                Err(RowFault::new("sigma_px", format!("is {sigma}; it must be positive")))
            }
            Some(sigma) => Ok(sigma),
            None => {
                self.assumes_sigma = true;
                Ok(self.sigma_px)
            }
        }
    }
}

/// Checks that a number can be squared.
fn checked(x: f64, column: &'static str) -> Result<f64, RowFault> {
    if !x.is_finite() {
        return Err(RowFault::new(column, format!("is {x}; remove the row or correct it")));
    }
    if LARGEST < x.abs() {
        let what = format!("is {x:e}; the largest number accepted is {LARGEST:e}, check the unit");
        return Err(RowFault::new(column, what));
    }
    Ok(x)
}

/// Returns the name of a point: `id`, with the corner of a tag; the line number where there is no id.
fn point_name(row: &DetectionRow) -> String {
    match (row.id, row.corner) {
        (Some(id), Some(corner)) => format!("{id}.{corner}"),
        (Some(id), None) => id.to_string(),
        (None, _) => format!("line {}", row.line.unwrap_or_default()),
    }
}

/// Returns the point of a target with this `id` (and `corner`); named points are found by their names.
fn feature(target: &Target, row: &DetectionRow) -> Option<Feature> {
    let id = row.id?;
    let number = match target {
        Target::Points(points) => points.iter().position(|p| p.name == id).map(|i| i as u32),
        _ => None,
    };
    let corner = row.corner.map_or(Some(0), |text| text.parse().ok())?;
    Some(Feature { id: number.or_else(|| id.parse().ok())?, corner })
}
