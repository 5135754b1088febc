//! Estimates focal length, tilt, roll and height of a camera from lines that are marked in a photograph and listed in a CSV file: the job of
//! `resight solve` for a file with a column `direction`.

use crate::answer::Status;
use crate::answer::scene_view::SceneViewAnswer;
use crate::core::locate::unknown_focal::LensPrior;
use crate::core::locate::unknown_focal::marked_lines::{
    Axis, Length, LineCamera, MarkedLine, SceneView, scene_view,
};
use crate::core::{Camera, Pixel};
use crate::error::{Error, FileError};
use crate::input::table::{Table, TableRow};
use crate::locate::IntrinsicsCovariance;
use crate::report::verdict;
use std::path::Path;

/// Default standard deviation of an image point, px: that of a click on a screen,
const MARK_SIGMA_PX: f64 = 1.0;
/// and of a length, in parts of it.
const LENGTH_SIGMA: f64 = 0.01;
/// With a larger roll, the directions of the lines are probably exchanged.
const MOST_ROLL_RAD: f64 = std::f64::consts::FRAC_PI_4;

/// What is known of the camera's lens.
#[derive(Debug, Clone)]
pub enum SceneLens {
    /// Nothing is known: the focal length is estimated.
    Unknown(LensPrior),
    /// The camera is known, with the uncertainty of its intrinsics; `None` where they are exact.
    Known(Box<Camera>, Option<IntrinsicsCovariance>),
}

/// A row of the file.
#[derive(Debug, Clone)]
pub struct NamedMarkedLine {
    /// The column `id`, or the number of the line in the file.
    pub name: String,
    /// The line; its `sigma_px` is that of column `sigma_px`, or the default.
    pub line: MarkedLine,
}

/// The lines of one photograph.
#[derive(Debug, Clone)]
pub struct MarkedView {
    /// The column `view`, or the file's name.
    pub name: String,
    /// The lines, at least one.
    pub lines: Vec<NamedMarkedLine>,
}

/// Returns whether a file contains marked lines: its header has a column `direction`.
///
/// # Errors
/// A file that cannot be read.
pub fn is_marked_lines(path: impl AsRef<Path>) -> Result<bool, FileError> {
    let path = path.as_ref();
    Ok(Table::open(path, "x_m,y_m,z_m,u_px,v_px")?.find("direction").is_some())
}

const WANTED: &str = "direction,u_px,v_px,u2_px,v2_px";

/// Reads the views of a file: columns `direction` (`across`, `along`, `up` or `horizon`), `u_px, v_px, u2_px, v2_px` (two points of the line's
/// image), and optionally `length_m`, `length_sigma_m` (else 1 %), `sigma_px` of the image points (else the argument, else 1 px), `view`, `id`.
///
/// # Errors
/// What is wrong with the file, and in which line.
pub fn read_marked_lines(
    path: impl AsRef<Path>,
    sigma_px: Option<f64>,
) -> Result<Vec<MarkedView>, FileError> {
    let path = path.as_ref();
    let table = Table::open(path, WANTED)?;
    let need =
        |name: &str| table.need(name, Some("a marked line has the columns direction,u_px,v_px,u2_px,v2_px"));
    let direction = table.need("direction", None)?;
    let ends = [need("u_px")?, need("v_px")?, need("u2_px")?, need("v2_px")?];
    let [view, id, sigma, length, length_sigma] =
        ["view", "id", "sigma_px", "length_m", "length_sigma_m"].map(|name| table.find(name));
    let file_name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut views: Vec<MarkedView> = Vec::new();
    table.each(|cells: TableRow<'_>| {
        let view = view.and_then(|i| cells.text(i)).unwrap_or(&file_name);
        let axis = match cells.text(direction) {
            Some("across") => Axis::Across,
            Some("along") => Axis::Along,
            Some("up") => Axis::Up,
            Some("horizon") => Axis::Horizon,
            other => {
                let other = other.map_or_else(|| "empty".to_string(), |text| format!("`{text}`"));
                return Err(
                    cells.complaint(direction, &format!("is {other}; it is across, along, up or horizon"))
                );
            }
        };
        let [u, v, u2, v2] =
            [cells.number(ends[0])?, cells.number(ends[1])?, cells.number(ends[2])?, cells.number(ends[3])?];
        let length =
            cells.optional_number(length)?.map(|metres| (metres, cells.optional_number(length_sigma)));
        let length = length
            .map(|(metres, sigma_m)| {
                Ok::<_, FileError>(Length { metres, sigma_m: sigma_m?.unwrap_or(LENGTH_SIGMA * metres) })
            })
            .transpose()?;
        let sigma_px = cells.optional_number(sigma)?.or(sigma_px).unwrap_or(MARK_SIGMA_PX);
        let line = MarkedLine { ends_px: [Pixel::new(u, v), Pixel::new(u2, v2)], sigma_px, axis, length };
        let name =
            id.and_then(|i| cells.text(i)).map_or_else(|| format!("line {}", cells.line), str::to_string);
        let at = views.iter().position(|known| known.name == view).unwrap_or_else(|| {
            views.push(MarkedView { name: view.to_string(), lines: Vec::new() });
            views.len() - 1
        });
        views[at].lines.push(NamedMarkedLine { name, line });
        Ok(())
    })?;
    Ok(views)
}

/// Estimates the camera's pose relative to its scene, for all views of a file.
///
/// ```no_run
/// # fn main() -> Result<(), resight::Error> {
/// use resight::core::camera::ImageSize;
/// use resight::marked_lines::{SceneLens, scene_views};
/// use resight::nominal::lens_of_unknown_focal;
/// let lens = SceneLens::Unknown(lens_of_unknown_focal(ImageSize { width_px: 1280, height_px: 720 }));
/// for answer in scene_views("lines.csv", &lens, None)? {
///     println!("{}: {:?} px, tilt {:?}", answer.view, answer.focal_px, answer.tilt_rad);
/// }
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// What is wrong with the file, and in which line. Lines that determine nothing are reported in the answer.
pub fn scene_views(
    path: impl AsRef<Path>,
    lens: &SceneLens,
    sigma_px: Option<f64>,
) -> Result<Vec<SceneViewAnswer>, Error> {
    let path = path.as_ref();
    Ok(read_marked_lines(path, sigma_px)?.iter().map(|view| scene_view_of(view, lens)).collect())
}

/// Returns the answer of one view.
pub fn scene_view_of(view: &MarkedView, lens: &SceneLens) -> SceneViewAnswer {
    let lines: Vec<MarkedLine> = view.lines.iter().map(|named| named.line).collect();
    let n_lengths = lines.iter().filter(|line| line.length.is_some()).count();
    let unsolved = SceneViewAnswer::unsolved(view.name.clone(), lines.len(), n_lengths);
    let (covariance, width_px);
    let line_camera = match lens {
        SceneLens::Unknown(prior) => {
            width_px = Some(prior.size.width_px);
            LineCamera::Unknown(prior)
        }
        SceneLens::Known(camera, intrinsics) => {
            width_px = camera.size.map(|size| size.width_px);
            covariance = intrinsics.as_ref().map(|intrinsics| intrinsics.covariance(camera));
            LineCamera::Known(camera, covariance.as_deref())
        }
    };
    let name_of = |i: usize| view.lines.get(i).map_or_else(String::new, |named| named.name.clone());
    match scene_view(&lines, line_camera) {
        Ok(found) => {
            let (status, message) = judged(&found, &name_of);
            SceneViewAnswer { status, message, ..unsolved.with_view(&found, width_px, name_of) }
        }
        Err(reason) => {
            let verdict = verdict::of_error(&reason);
            let message = match reason {
                crate::core::Error::TooFewPoints { seen, needed } => {
                    format!(
                        "{seen} marked lines (a horizon counts as two); {needed} are needed, of two directions at least, so that a wrong one can be seen"
                    )
                }
                crate::core::Error::NotPositive { index, seen } => format!(
                    "{}: sigma_px, length_m and length_sigma_m must be positive and finite, not {seen}",
                    name_of(index)
                ),
                crate::core::Error::NotFinite { index, .. } => {
                    format!("{}: a pixel is not a finite number of this image", name_of(index))
                }
                crate::core::Error::Coincident { first, .. } => {
                    format!("{}: its two marks are one; mark two points far apart", name_of(first))
                }
                _ => verdict.message,
            };
            SceneViewAnswer { status: verdict.status, message, ..unsolved }
        }
    }
}

fn judged(found: &SceneView, name_of: &impl Fn(usize) -> String) -> (Status, String) {
    let per_degree = found.chi2 / found.degrees_of_freedom.max(1) as f64;
    let worst =
        format!("{} fits worst, {:.1} standard deviations off", name_of(found.worst.0), found.worst.1);
    if found.is_inconsistent {
        let message = format!(
            "the lines contradict each other (χ²/dof {per_degree:.1}, expected 1); {worst}: check its direction, its marks and the unit of its length"
        );
        return (Status::Inconsistent, message);
    }
    if MOST_ROLL_RAD < found.roll_rad.value.abs() {
        let message = format!(
            "the camera would be rotated by {:.0}° about its axis: up, across and along are swapped, or the photograph lies on its side",
            found.roll_rad.value.to_degrees()
        );
        return (Status::Inconsistent, message);
    }
    (Status::Ok, format!("The lines agree (χ²/dof {per_degree:.2}); {worst}."))
}
