//! The answer in other programs' formats, as a picture and as a report.

use crate::lines::{Curve, overlay};
use crate::refusal::{Refusal, Step};
use crate::session::Session;
use crate::{MeasuredKind, texts};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use nalgebra::DMatrix;
use resight::formats::{self, Format, NamedCamera, Placement};
use resight::measure::birdseye::{Labels, spots_beside};
use resight::measure::table::cell;
use std::fmt::Write;

/// A file to be saved by the person.
#[derive(Debug, Clone, PartialEq)]
pub struct Export {
    /// Its name.
    pub name: String,
    /// Its media type.
    pub media_type: &'static str,
    /// Its contents.
    pub text: String,
}

/// The exports in addition to the formats of `resight convert`.
const EXPORTS: [&str; 5] = ["json", "homography", "svg", "report", "csv"];

/// Mean width of a letter of a sans-serif font, in parts of the font's size; wide ones have 0.6.
const LETTER_WIDTH: f64 = 0.6;

/// Every word that [`Session::export`] takes.
pub fn exports() -> Vec<&'static str> {
    EXPORTS.into_iter().chain(Format::writable().filter_map(|(_, words)| words.first().copied())).collect()
}

impl Session {
    /// The answer of a photograph as `json`, `homography` (3×3, pixels from the plane z = 0), `csv` (measurements), `svg`, `report` (HTML), or
    /// a format of `resight convert`. `now_s` is the time of the report, seconds since 1970.
    ///
    /// # Errors
    /// No pose yet, a format that is not known, or that cannot hold the camera.
    pub fn export(&self, photo: usize, format: &str, now_s: f64) -> Result<Export, Refusal> {
        let refuse = |text: String| Refusal { step: Step::Measure, text };
        let Some(solved) = self.solved(photo) else { return Err(refuse(texts::NO_POSE_YET.to_owned())) };
        let file = |name: &str, media_type, text| Export { name: name.to_owned(), media_type, text };
        match format {
            "json" => Ok(file(
                "pose.json",
                "application/json",
                serde_json::to_string_pretty(&solved.answer.json()).unwrap_or_default(),
            )),
            "homography" => match homography(&solved) {
                Some(text) => Ok(file("homography.json", "application/json", text)),
                None => {
                    Err(refuse("This lens is bent; a homography holds for a straight one only.".to_owned()))
                }
            },
            "svg" => Ok(file("photograph.svg", "image/svg+xml", self.svg(photo, Some(&solved)))),
            "report" => Ok(file("report.html", "text/html", self.report(photo, now_s))),
            "csv" => Ok(file("measurements.csv", "text/csv", self.csv(photo))),
            word => {
                let format = Format::to_write(word).ok_or_else(|| refuse(unknown(word)))?;
                let files =
                    formats::write_cameras(&[named(&solved)], format).map_err(|e| refuse(e.to_string()))?;
                let only = files.len() == 1;
                let text = files
                    .iter()
                    .map(|f| if only { f.text.clone() } else { format!("# {}\n{}\n", f.name, f.text) })
                    .collect();
                let name = files.first().map_or("camera.txt".to_owned(), |f| f.name.replace('/', "-"));
                Ok(Export { name, media_type: "text/plain; charset=utf-8", text })
            }
        }
    }

    /// Writes one line per value; a position has three.
    fn csv(&self, photo: usize) -> String {
        let mut text = "name,what,value,low_95,high_95,unit,axis\n".to_owned();
        for m in self.view(photo).measurements {
            let (name, what) = (cell(&m.name), m.what.name());
            let axes: &[&str] = if m.what == MeasuredKind::Position { &["x", "y", "z"] } else { &[""] };
            if m.values.is_empty() {
                let _ = writeln!(text, "{name},{what},,,,{},", m.unit);
            }
            for ((value, [low, high]), axis) in m.values.iter().zip(&m.intervals_95).zip(axes) {
                let _ = writeln!(text, "{name},{what},{value},{low},{high},{},{axis}", m.unit);
            }
        }
        text
    }

    /// The photograph with everything drawn over it; grid and axes where it has a pose.
    pub(crate) fn svg(&self, photo: usize, solved: Option<&crate::pose::Solved>) -> String {
        let Some(photograph) = self.photograph(photo).cloned() else { return String::new() };
        let (w, h) = (photograph.image.width_px, photograph.image.height_px);
        let line = f64::from(w) / 800.0;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"-0.5 -0.5 {w} {h}\" fill=\"none\" stroke-width=\"{line:.2}\">\n<image x=\"-0.5\" y=\"-0.5\" width=\"{w}\" height=\"{h}\" href=\"data:{};base64,{}\"/>\n",
            photograph.media_type(),
            STANDARD.encode(&photograph.bytes)
        );
        let mut draw = |curve: &Curve, colour: &str| {
            let points: Vec<String> = curve.iter().map(|[u, v]| format!("{u},{v}")).collect();
            let _ = writeln!(svg, "<polyline stroke=\"{colour}\" points=\"{}\"/>", points.join(" "));
        };
        if let Some(solved) = solved {
            let drawn = overlay(&self.state, solved);
            drawn.grid.iter().for_each(|curve| draw(curve, "#78c8eb"));
            let axes = drawn.axes.iter().zip(["#ff4646", "#46dc5a", "#5a96ff"]);
            axes.for_each(|(axis, colour)| draw(&axis.points, colour));
        }
        let view = self.view(photo);
        for m in view.measurements.iter().filter(|m| m.photo == photo) {
            draw(&m.points, "#ffe15a");
        }
        let size = 10.0 * line;
        for p in &view.points {
            let (u, v) = (p.u_px, p.v_px);
            let _ = writeln!(svg, "<circle cx=\"{u}\" cy=\"{v}\" r=\"{size:.1}\" stroke=\"#ff5a50\"/>");
        }
        let marks = view.points.iter().map(|p| (p.name.as_str(), [p.u_px, p.v_px], "#ff5a50"));
        let measured = view.measurements.iter().filter(|m| m.photo == photo && m.error.is_none());
        let values = measured.map(|m| (m.words.as_str(), m.points[m.points.len() / 2], "#ffe15a"));
        // What has no room is in the table of the report.
        let mut labels = Labels::new([f64::from(w), f64::from(h)]);
        view.points.iter().for_each(|p| labels.keep_free_around([p.u_px, p.v_px], size));
        for (text, at, colour) in marks.chain(values) {
            let (width, capital) = (LETTER_WIDTH * 2.0 * size * text.chars().count() as f64, 1.4 * size);
            let spots = spots_beside(at, size, width, capital);
            if let Some([u, v]) = labels.first_free(spots, width, capital) {
                let _ = writeln!(
                    svg,
                    "<text x=\"{u:.1}\" y=\"{v:.1}\" font-size=\"{:.1}\" font-family=\"sans-serif\" fill=\"{colour}\">{}</text>",
                    2.0 * size,
                    escaped(text)
                );
            }
        }
        svg + "</svg>\n"
    }
}

fn unknown(word: &str) -> String {
    format!("There is no export `{word}`; there are {}.", exports().join(", "))
}

pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The camera in the frame of the points.
fn named(solved: &crate::pose::Solved) -> NamedCamera {
    let n = solved.camera.parameters().len();
    let rows = solved.intrinsics_covariance.as_ref().filter(|rows| rows.len() == n * n);
    NamedCamera {
        name: "camera".to_owned(),
        camera: solved.camera.clone(),
        placement: Some(Placement {
            b: "camera".to_owned(),
            a: "world".to_owned(),
            b_from_a: solved.cam_from_world,
            covariance: Some(solved.covariance),
        }),
        intrinsics_covariance: rows.map(|rows| DMatrix::from_row_slice(n, n, rows)),
    }
}

/// Returns the homography from the plane z = 0 to pixels, row by row; `None` for a lens with distortion.
fn homography(solved: &crate::pose::Solved) -> Option<String> {
    let is_bent = |(name, value): &(&str, f64)| !name.ends_with("_px") && *value != 0.0;
    if solved.camera.parameters().iter().any(is_bent) {
        return None;
    }
    let k = solved.camera.matrix()?;
    let (r, t) = (&solved.cam_from_world.rotation, &solved.cam_from_world.translation);
    let flat = [r.column(0).into_owned(), r.column(1).into_owned(), *t];
    let rows = [0, 1, 2].map(|i| {
        flat.map(|c| match i {
            0 => k.fx_px * c.x + k.cx_px * c.z,
            1 => k.fy_px * c.y + k.cy_px * c.z,
            _ => c.z,
        })
    });
    serde_json::to_string_pretty(&serde_json::json!({ "pixel_from_plane": rows })).ok()
}
