//! What the adviser reads besides cameras and targets: places and poses.

use anyhow::{Context, Result, bail};
use resight::core::target::KnownPoint;
use resight::core::{Point, Pose};
use std::path::Path;

/// A place of a CSV file.
pub struct Place {
    /// Column `id`, or its number.
    pub name: String,
    /// Where, and how well that is known.
    pub known: KnownPoint,
    /// Columns u_px, v_px, where both are there.
    pub pixel: Option<[f64; 2]>,
}

/// Rows beyond any survey.
const MOST: usize = 100_000;

/// Where the columns are.
struct Columns<'a> {
    shown: String,
    names: Vec<&'a str>,
    space: [usize; 3],
    id: Option<usize>,
    sigma: Option<usize>,
    image: Option<(usize, usize)>,
}

/// Columns x_m,y_m,z_m; optionally id, sigma_m, u_px and v_px.
pub fn places(path: &Path) -> Result<Vec<Place>> {
    crate::files::must_exist(path)?;
    let shown = path.display().to_string();
    let file = resight::input::open_table(path)?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(file);
    let header = reader.headers().with_context(|| shown.clone())?.clone();
    let columns = Columns::of(shown, &header)?;
    let shown = &columns.shown;
    let mut found = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| anyhow::anyhow!("{shown}: {e}"))?;
        if MOST <= found.len() {
            bail!("{shown}: more than {MOST} rows");
        }
        found.push(columns.place(&record, found.len() + 1)?);
    }
    if found.is_empty() {
        bail!("{shown}: no rows below the header");
    }
    Ok(found)
}

impl<'a> Columns<'a> {
    fn of(shown: String, header: &'a csv::StringRecord) -> Result<Self> {
        let names: Vec<&str> = header.iter().map(|name| name.trim_start_matches('\u{feff}')).collect();
        let find = |wanted: &str| names.iter().position(|name| *name == wanted);
        let need = |wanted: &str| {
            find(wanted).with_context(|| {
                format!("{shown}:1: no column `{wanted}`; the columns are {}", names.join(","))
            })
        };
        let space = [need("x_m")?, need("y_m")?, need("z_m")?];
        let (id, sigma, image) = (find("id"), find("sigma_m"), find("u_px").zip(find("v_px")));
        Ok(Columns { shown, names, space, id, sigma, image })
    }

    fn place(&self, record: &csv::StringRecord, n: usize) -> Result<Place> {
        let line = record.position().map_or(0, |p| p.line());
        let at = format!("{}:{line}", self.shown);
        let number = |i: usize| -> Result<f64> {
            let text = record.get(i).unwrap_or("");
            let value = text.parse::<f64>().ok().filter(|x| x.is_finite());
            value.with_context(|| format!("{at}: column `{}` is `{text}`; a number is needed", self.names[i]))
        };
        let filled = |i: usize| record.get(i).is_some_and(|text| !text.is_empty());
        let sigma_m = self.sigma.filter(|i| filled(*i)).map(number).transpose()?.unwrap_or(0.0);
        if sigma_m < 0.0 {
            bail!("{at}: sigma_m is {sigma_m}; it must be 0 or more");
        }
        let [x, y, z] = self.space;
        let position = Point::new(number(x)?, number(y)?, number(z)?);
        let pixel = match self.image.filter(|(u, v)| filled(*u) && filled(*v)) {
            Some((u, v)) => Some([number(u)?, number(v)?]),
            None => None,
        };
        let name = self.id.filter(|i| filled(*i)).and_then(|i| record.get(i));
        let name = name.map_or_else(|| n.to_string(), str::to_string);
        Ok(Place { name, known: KnownPoint { position, sigma_m }, pixel })
    }
}

/// The poses under `key` (or its other names) of a file of JSON objects, one a line; a single object may take several lines.
pub fn poses(path: &Path, keys: &[&str]) -> Result<Vec<Pose>> {
    crate::files::must_exist(path)?;
    let shown = path.display();
    let text = resight::input::read_text(path, resight::input::Kind::Results)?;
    let mut found = Vec::new();
    for (n, object) in serde_json::Deserializer::from_str(&text).into_iter::<serde_json::Value>().enumerate()
    {
        let object = object.with_context(|| format!("{shown}: object {}", n + 1))?;
        let pose = keys.iter().find_map(|key| object.get(key)).filter(|v| !v.is_null());
        let Some(pose) = pose else { continue };
        found.push(pose_of(pose).with_context(|| format!("{shown}: object {}: `{}`", n + 1, keys[0]))?);
    }
    if found.is_empty() {
        bail!("{shown}: no object with `{}`", keys[0]);
    }
    Ok(found)
}

fn pose_of(value: &serde_json::Value) -> Result<Pose> {
    fn list<const N: usize>(value: &serde_json::Value, key: &str) -> Result<[f64; N]> {
        let numbers: Option<Vec<f64>> =
            value.get(key).and_then(|v| v.as_array()).and_then(|v| v.iter().map(|x| x.as_f64()).collect());
        let all = numbers.and_then(|v| <[f64; N]>::try_from(v).ok());
        all.with_context(|| format!("{N} numbers `{key}` are needed"))
    }
    let (wxyz, translation) = (list::<4>(value, "rotation_wxyz")?, list::<3>(value, "translation_m")?);
    let length: f64 = wxyz.iter().map(|x| x * x).sum::<f64>().sqrt();
    if !((length - 1.0).abs() < 1e-3) {
        bail!("rotation_wxyz has length {length:.4}; a unit quaternion w,x,y,z is needed");
    }
    Ok(Pose::from_quaternion_wxyz(wxyz, translation.into()))
}
