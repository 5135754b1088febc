//! Small elements of drawings and tables.

use crate::core::Point;
use std::fmt::Write;

/// Rounds to `decimals`, without trailing zeros; returns a dash for a number that is not finite.
pub(super) fn number(x: f64, decimals: usize) -> String {
    if !x.is_finite() {
        return "–".into();
    }
    let text = format!("{x:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".into() } else { text.into() }
}

/// Rounds to `decimals`, all of them shown; returns a dash for a number that is not finite.
pub(super) fn fixed(x: f64, decimals: usize) -> String {
    if x.is_finite() { format!("{x:.decimals$}") } else { "–".into() }
}

/// Writes `M x y L x y …` for points of a drawing, to a tenth of its unit; `Z` closes the path. Empty where a point is not finite.
pub(super) fn path(points: &[[f64; 2]], is_closed: bool) -> String {
    let mut text = String::new();
    for (i, [x, y]) in points.iter().enumerate() {
        if !(x.is_finite() && y.is_finite()) {
            return String::new();
        }
        let _ = write!(text, "{}{} {}", if i == 0 { 'M' } else { 'L' }, number(*x, 1), number(*y, 1));
    }
    if is_closed && !text.is_empty() {
        text.push('Z');
    }
    text
}

/// Returns the class that colours a camera's drawings.
pub(super) fn color_class(camera: usize) -> String {
    format!("c{}", camera % crate::scene::N_COLORS)
}

/// Returns a row of a table; texts must be escaped already.
pub(super) fn row(cells: &[String]) -> String {
    let cells: String = cells.iter().map(|c| format!("<td>{c}</td>")).collect();
    format!("<tr>{cells}</tr>\n")
}

/// Returns a table with a head and a caption; texts must be escaped already.
pub(super) fn tabular(class: &str, caption: &str, head: &[&str], rows: &str) -> String {
    let head: String = head.iter().map(|h| format!("<th scope=\"col\">{h}</th>")).collect();
    format!(
        "<div class=\"wide\"><table class=\"{class}\"><caption>{caption}</caption><thead><tr>{head}</tr></thead>\n<tbody>\n{rows}</tbody></table></div>"
    )
}

/// The viewpoint of a three-dimensional drawing; `view.js` computes the same.
#[derive(Debug, Clone, Copy)]
pub(super) struct Viewpoint {
    pub yaw_rad: f64,
    pub pitch_rad: f64,
    pub centre: Point,
    /// Distance from the centre, m.
    pub distance_m: f64,
    /// Drawing units from the centre at one radian, and the centre.
    pub focal: f64,
    pub middle: [f64; 2],
}

impl Viewpoint {
    /// Projects a point: rotated by yaw about the rig's y, then by pitch about the image's x; `None` behind the viewer.
    pub fn project(&self, x_in_rig: &Point) -> Option<[f64; 2]> {
        let d = x_in_rig - self.centre;
        let (sin, cos) = self.yaw_rad.sin_cos();
        let (x, z) = (cos * d.x + sin * d.z, cos * d.z - sin * d.x);
        let (sin, cos) = self.pitch_rad.sin_cos();
        let (y, z) = (cos * d.y - sin * z, cos * z + sin * d.y);
        let depth = z + self.distance_m;
        let is_seen = 0.02 * self.distance_m < depth;
        is_seen.then(|| [self.middle[0] + self.focal * x / depth, self.middle[1] + self.focal * y / depth])
    }

    /// Returns a complete line, or nothing where part of it is behind the viewer.
    pub fn path(&self, points: impl IntoIterator<Item = Point>, is_closed: bool) -> String {
        let seen: Option<Vec<[f64; 2]>> = points.into_iter().map(|x| self.project(&x)).collect();
        path(&seen.unwrap_or_default(), is_closed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let cases =
            [(1.5, 3, "1.5"), (-0.0004, 3, "0"), (120.0, 2, "120"), (f64::NAN, 1, "–"), (100.0, 0, "100")];
        for (x, decimals, text) in cases {
            assert_eq!(number(x, decimals), text);
        }
    }

    /// Seen from above, points ahead are higher in the image, right remains right, and points behind the viewer are not drawn.
    #[test]
    fn the_viewpoint_is_above_and_behind() {
        let at = Viewpoint {
            yaw_rad: 0.0,
            pitch_rad: 0.5,
            centre: Point::zeros(),
            distance_m: 5.0,
            focal: 100.0,
            middle: [50.0, 50.0],
        };
        let ahead = at.project(&Point::z()).unwrap();
        assert!(ahead[1] < 50.0 && (ahead[0] - 50.0).abs() < 1e-9);
        assert!(50.0 < at.project(&Point::x()).unwrap()[0]);
        assert!(at.project(&Point::new(0.0, 0.0, -9.0)).is_none());
    }
}
