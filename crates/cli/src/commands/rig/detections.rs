//! Points found already, from CSV files.

use super::{Collected, Frame, LeftOut, named};
use crate::table::{Table, TableRow};
use anyhow::{Context, Result, bail};
use resight::core::target::{Feature, KnownPoint};
use resight::core::{Correspondence, Pixel, Point, Target};
use resight::rig::NamedTarget;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Sigma of a pixel where neither file nor flag states one.
const ASSUMED_SIGMA_PX: f64 = 0.5;
/// Squares of larger numbers, and their products, leave the range of numbers.
const LARGEST: f64 = 1e60;
/// Name of the only target where the file names none.
const NAMELESS: &str = "target";

/// Where the columns are.
struct Columns {
    camera: usize,
    view: Option<usize>,
    id: Option<usize>,
    corner: Option<usize>,
    space: Option<[usize; 3]>,
    image: [usize; 2],
    target: Option<usize>,
    body: Option<usize>,
    sigma_px: Option<usize>,
    sigma_m: Option<usize>,
    t_s: Option<usize>,
}

/// Turns rows into frames.
struct Reader<'a> {
    collected: &'a mut Collected,
    cameras: HashMap<String, usize>,
    targets: HashMap<String, usize>,
    /// A target of each body that the column `body` names.
    bodies: HashMap<String, usize>,
    /// Frames by camera, view and, where there is no column `view`, the time as written.
    frames: HashMap<(usize, String), usize>,
    sigma_px: f64,
    assumes_sigma: bool,
}

/// Reads files into frames, and the targets they name into `collected.targets`.
pub fn read(paths: &[PathBuf], sigma_px: Option<f64>, collected: &mut Collected) -> Result<()> {
    let number = |names: Vec<String>| names.into_iter().zip(0..).collect();
    let cameras = number(collected.cameras.iter().map(|camera| camera.name.clone()).collect());
    let targets = number(collected.targets.iter().map(|target| target.name.clone()).collect());
    let (bodies, frames) = (HashMap::new(), HashMap::new());
    let assumed = sigma_px.unwrap_or(ASSUMED_SIGMA_PX);
    let mut reader =
        Reader { collected, cameras, targets, bodies, frames, sigma_px: assumed, assumes_sigma: false };
    for path in paths {
        crate::files::must_exist(path)?;
        let table = Table::open(path, "camera,view,id,x_m,y_m,z_m,u_px,v_px")?;
        let columns = reader.columns(path, &table)?;
        table.each(|row| reader.row(&columns, &row))?;
        reader.collected.files.push(path.clone());
    }
    if reader.assumes_sigma && sigma_px.is_none() {
        let text = format!("σ {ASSUMED_SIGMA_PX} px is assumed for every point; state yours with --sigma-px");
        collected.remarks.push(text);
    }
    Ok(())
}

impl Reader<'_> {
    fn columns(&self, path: &Path, table: &Table) -> Result<Columns> {
        let (t_s, view) = (table.find("t_s"), table.find("view"));
        if view.is_none() && t_s.is_none() {
            table.need("view", Some("or `t_s`: which frames belong together"))?;
        }
        let target = table.find("target");
        let given = &self.collected.targets;
        if target.is_none() && 1 < given.len() {
            bail!("{}:1: {} targets are given, so a column `target` is needed", path.display(), given.len());
        }
        let hint = "or --target FILE, which knows where its points are; then the column `id` is enough";
        let space = match given.is_empty() || table.find("x_m").is_some() {
            true => {
                Some([table.need("x_m", Some(hint))?, table.need("y_m", None)?, table.need("z_m", None)?])
            }
            false => None,
        };
        let id = table.find("id");
        if space.is_none() && id.is_none() {
            table.need("id", Some("which point of the target each row is"))?;
        }
        let (camera, image) =
            (table.need("camera", None)?, [table.need("u_px", None)?, table.need("v_px", None)?]);
        let (corner, body) = (table.find("corner"), table.find("body"));
        let (sigma_px, sigma_m) = (table.find("sigma_px"), table.find("sigma_m"));
        Ok(Columns { camera, view, id, corner, space, image, target, body, sigma_px, sigma_m, t_s })
    }

    fn row(&mut self, columns: &Columns, row: &TableRow<'_>) -> Result<()> {
        let camera = self.camera(columns, row)?;
        let target = self.target(columns, row)?;
        let frame = self.frame(columns, row, camera)?;
        let name = point_name(columns, row);
        let known = self.known(columns, row, target, &name)?;
        let [u, v] = columns.image;
        let pixel = Pixel::new(checked(row, u)?, checked(row, v)?);
        let sigma_px = self.sigma_px(columns, row)?;
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
                what: format!("point {name} (line {})", row.line),
                reason: reason.to_string(),
            }),
        }
        Ok(())
    }

    fn camera(&self, columns: &Columns, row: &TableRow<'_>) -> Result<usize> {
        let name = row.text(columns.camera).unwrap_or_default();
        self.cameras.get(name).copied().with_context(|| {
            let names: Vec<String> = self.collected.cameras.iter().map(|c| c.name.clone()).collect();
            let what = format!("is `{name}`: {}", named::not_among(name, "camera", &names));
            row.complaint(columns.camera, &what)
        })
    }

    fn target(&mut self, columns: &Columns, row: &TableRow<'_>) -> Result<usize> {
        let given = columns.target.and_then(|i| row.text(i));
        let name = match (given, &self.collected.targets[..]) {
            (Some(name), _) => name,
            (None, [only, ..]) => only.name.as_str(),
            (None, []) => NAMELESS,
        };
        let (name, n) = (name.to_string(), self.collected.targets.len());
        let found = match self.targets.get(&name) {
            Some(found) => *found,
            None => {
                self.targets.insert(name.clone(), n);
                self.collected.targets.push(NamedTarget { name, target: None, body: n });
                n
            }
        };
        if let Some(body) = columns.body.and_then(|i| row.text(i)) {
            let first = *self.bodies.entry(body.to_string()).or_insert(found);
            named::join(&mut self.collected.targets, first, found);
        }
        Ok(found)
    }

    /// The frame of a row, its time checked against that of its earlier rows.
    fn frame(&mut self, columns: &Columns, row: &TableRow<'_>, camera: usize) -> Result<usize> {
        let t_s = columns.t_s.map(|i| checked(row, i)).transpose()?;
        let column = columns.view.or(columns.t_s).unwrap_or_default();
        let Some(name) = row.text(column) else { bail!(row.complaint(column, "is empty; name the view")) };
        let frames = &mut self.collected.frames;
        let at = *self.frames.entry((camera, name.to_string())).or_insert(frames.len());
        if at == frames.len() {
            frames.push(Frame { camera, name: name.to_string(), t_s, targets: Vec::new() });
        }
        match (frames[at].t_s, t_s, columns.t_s) {
            (Some(earlier), Some(now), Some(column)) if earlier != now => {
                bail!(row.complaint(
                    column,
                    &format!("is {now}, earlier {earlier} for the same frame; a frame has one time")
                ))
            }
            _ => Ok(at),
        }
    }

    /// From the row's own columns where they are filled, else from the target.
    fn known(&self, columns: &Columns, row: &TableRow<'_>, target: usize, name: &str) -> Result<KnownPoint> {
        let sigma_m = row.optional_number(columns.sigma_m)?;
        if let (Some(sigma_m), Some(column)) = (sigma_m, columns.sigma_m)
            && !(0.0..=LARGEST).contains(&sigma_m)
        {
            bail!(row.complaint(column, &format!("is {sigma_m}; it must not be negative")));
        }
        let NamedTarget { name: target_name, target, .. } = &self.collected.targets[target];
        match (columns.space, target) {
            (Some([x, y, z]), None) => {
                let position = Point::new(checked(row, x)?, checked(row, y)?, checked(row, z)?);
                Ok(KnownPoint { position, sigma_m: sigma_m.unwrap_or(0.0) })
            }
            (Some([x, y, z]), Some(_)) if row.text(x).is_some() => {
                let position = Point::new(checked(row, x)?, checked(row, y)?, checked(row, z)?);
                Ok(KnownPoint { position, sigma_m: sigma_m.unwrap_or(0.0) })
            }
            (_, Some(target)) => {
                let known = feature(target, columns, row).and_then(|feature| target.point(feature));
                let Some(known) = known else {
                    let column = columns.id.unwrap_or(columns.camera);
                    bail!(
                        row.complaint(
                            column,
                            &format!("is `{name}`, which target {target_name} does not have")
                        )
                    )
                };
                Ok(KnownPoint { sigma_m: sigma_m.unwrap_or(known.sigma_m), ..known })
            }
            (None, None) => {
                let column = columns.target.unwrap_or(columns.camera);
                bail!(row.complaint(column, &format!("is `{target_name}`, of which no --target is given, and there are no columns x_m,y_m,z_m")))
            }
        }
    }

    fn sigma_px(&mut self, columns: &Columns, row: &TableRow<'_>) -> Result<f64> {
        let stated = row.optional_number(columns.sigma_px)?;
        self.assumes_sigma |= stated.is_none();
        match (stated, columns.sigma_px) {
            (Some(sigma), Some(column)) if !(0.0 < sigma && sigma <= LARGEST) => {
                bail!(row.complaint(column, &format!("is {sigma}; it must be positive")))
            }
            (sigma, _) => Ok(sigma.unwrap_or(self.sigma_px)),
        }
    }
}

/// A number that can be squared.
fn checked(row: &TableRow<'_>, column: usize) -> Result<f64> {
    let x = row.number(column)?;
    if !x.is_finite() {
        bail!(row.complaint(column, &format!("is {x}; remove the row or correct it")));
    }
    if LARGEST < x.abs() {
        bail!(row.complaint(
            column,
            &format!("is {x:e}; the largest number accepted is {LARGEST:e}, check the unit")
        ));
    }
    Ok(x)
}

/// `id`, with the corner of a tag; the line where there is no id.
fn point_name(columns: &Columns, row: &TableRow<'_>) -> String {
    let id = columns.id.and_then(|i| row.text(i));
    let corner = columns.corner.and_then(|i| row.text(i));
    match (id, corner) {
        (Some(id), Some(corner)) => format!("{id}.{corner}"),
        (Some(id), None) => id.to_string(),
        (None, _) => format!("line {}", row.line),
    }
}

/// The point of a target that `id` (and `corner`) name; named points go by their names.
fn feature(target: &Target, columns: &Columns, row: &TableRow<'_>) -> Option<Feature> {
    let id = row.text(columns.id?)?;
    let number = match target {
        Target::Points(points) => points.iter().position(|p| p.name == id).map(|i| i as u32),
        _ => None,
    };
    let corner = columns.corner.and_then(|i| row.text(i)).map_or(Some(0), |text| text.parse().ok())?;
    Some(Feature { id: number.or_else(|| id.parse().ok())?, corner })
}
