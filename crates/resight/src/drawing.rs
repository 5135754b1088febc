//! A flat drawing of lines and words, written as SVG and as PNG from the same list.

pub mod chart;

use crate::GrayImage;
use crate::overlay::canvas::{Canvas, Color, Path, Pen};
use crate::overlay::font;
use nalgebra::Vector2;

/// Where a text stands relative to its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// Begins there.
    Start,
    /// Is centred there.
    Middle,
    /// Ends there.
    End,
}

/// Something drawn. Places in px, y down.
#[derive(Debug, Clone, PartialEq)]
pub enum Item {
    /// A line through points.
    Line {
        /// Its points.
        path: Path,
        /// Its colour.
        color: Color,
        /// Its width, px.
        width: f64,
        /// 1 opaque, 0 invisible.
        opacity: f64,
    },
    /// One line of text; the place is on its baseline.
    Text {
        /// What it says.
        text: String,
        /// Where.
        at: Vector2<f64>,
        /// Height of a capital, px.
        height: f64,
        /// Its colour.
        color: Color,
        /// Which part of it is there.
        anchor: Anchor,
        /// Turn, clockwise, about its place.
        rotation_rad: f64,
    },
}

/// A drawing on white.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// In order: later ones lie on top.
    pub items: Vec<Item>,
}

const WHITE: Color = [255, 255, 255];
/// Stroke of letters over their height.
const BOLDNESS: f64 = 0.13;

impl Drawing {
    /// An empty sheet.
    pub fn new(width_px: u32, height_px: u32) -> Self {
        Drawing { width_px, height_px, items: Vec::new() }
    }

    /// Adds a line.
    pub fn line(&mut self, path: Path, color: Color, width: f64) {
        self.faint_line(path, color, width, 1.0);
    }

    /// Adds a line that lets what lies below shine through: 1 opaque, 0 invisible.
    pub fn faint_line(&mut self, path: Path, color: Color, width: f64, opacity: f64) {
        self.items.push(Item::Line { path, color, width, opacity });
    }

    /// Adds level text.
    pub fn text(&mut self, text: &str, at: Vector2<f64>, height: f64, color: Color, anchor: Anchor) {
        self.rotated_text(text, at, height, color, anchor, 0.0);
    }

    /// Adds text rotated about its place, on a white shade that keeps it readable over lines.
    pub fn rotated_text(
        &mut self,
        text: &str,
        at: Vector2<f64>,
        height: f64,
        color: Color,
        anchor: Anchor,
        rotation_rad: f64,
    ) {
        self.items.push(Item::Text { text: text.to_string(), at, height, color, anchor, rotation_rad });
    }

    /// As PNG.
    ///
    /// # Errors
    /// What the encoder says.
    pub fn png(&self) -> Result<Vec<u8>, String> {
        let sheet = GrayImage::filled(self.width_px, self.height_px, 255);
        let mut canvas = Canvas::from_photograph(&sheet, 1, 0, WHITE);
        for item in &self.items {
            match item {
                Item::Line { path, color, width, opacity } => {
                    canvas.stroke(
                        std::slice::from_ref(path),
                        Pen { color: *color, width: *width, opacity: *opacity },
                    );
                }
                Item::Text { text, at, height, color, anchor, rotation_rad } => {
                    let strokes = strokes(text, *at, *height, *anchor, *rotation_rad);
                    let width = (BOLDNESS * height).max(1.0);
                    canvas.stroke(&strokes, Pen { color: WHITE, width: width + 3.0, opacity: 0.85 });
                    canvas.stroke(&strokes, Pen { color: *color, width, opacity: 1.0 });
                }
            }
        }
        canvas.png()
    }

    /// As SVG; one unit is one pixel of the PNG.
    pub fn svg(&self) -> String {
        let (w, h) = (self.width_px, self.height_px);
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\">\n\
             <rect width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>\n"
        );
        for item in &self.items {
            out += &match item {
                Item::Line { path, color, width, opacity } => {
                    let opacity = match *opacity {
                        1.0 => String::new(),
                        part => format!(" stroke-opacity=\"{part:.2}\""),
                    };
                    let points: Vec<String> = path.iter().map(|p| format!("{:.2},{:.2}", p.x, p.y)).collect();
                    format!(
                        "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width:.2}\"{opacity} stroke-linecap=\"round\" stroke-linejoin=\"round\"/>\n",
                        points.join(" "),
                        hex(*color)
                    )
                }
                Item::Text { text, at, height, color, anchor, rotation_rad } => {
                    svg_text(text, *at, *height, *color, *anchor, *rotation_rad)
                }
            };
        }
        out + "</svg>\n"
    }
}

/// A capital is about 0.72 of the font size in the common sans-serif fonts.
const CAPITAL_OVER_SIZE: f64 = 0.72;

fn svg_text(
    text: &str,
    at: Vector2<f64>,
    height: f64,
    color: Color,
    anchor: Anchor,
    rotation_rad: f64,
) -> String {
    let anchor = match anchor {
        Anchor::Start => "start",
        Anchor::Middle => "middle",
        Anchor::End => "end",
    };
    let turn = match rotation_rad {
        0.0 => String::new(),
        turn => format!(" transform=\"rotate({:.2} {:.2} {:.2})\"", turn.to_degrees(), at.x, at.y),
    };
    format!(
        "<text x=\"{:.2}\" y=\"{:.2}\" font-family=\"sans-serif\" font-size=\"{:.1}\" text-anchor=\"{anchor}\" fill=\"{}\" \
         stroke=\"#ffffff\" stroke-width=\"3\" stroke-opacity=\"0.85\" paint-order=\"stroke\"{turn}>{}</text>\n",
        at.x,
        at.y,
        height / CAPITAL_OVER_SIZE,
        hex(color),
        escaped(text)
    )
}

fn hex([r, g, b]: Color) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Text for XML.
pub fn escaped(text: &str) -> String {
    text.chars()
        .map(|letter| match letter {
            '&' => "&amp;".to_string(),
            '<' => "&lt;".to_string(),
            '>' => "&gt;".to_string(),
            '"' => "&quot;".to_string(),
            control if control.is_control() => " ".to_string(),
            other => other.to_string(),
        })
        .collect()
}

/// Letters as lines, anchored and turned.
pub fn strokes(text: &str, at: Vector2<f64>, height: f64, anchor: Anchor, rotation_rad: f64) -> Vec<Path> {
    let width = font::width(text, height);
    let back = match anchor {
        Anchor::Start => 0.0,
        Anchor::Middle => 0.5 * width,
        Anchor::End => width,
    };
    let (sin, cos) = rotation_rad.sin_cos();
    let turned = |p: Vector2<f64>| at + Vector2::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y);
    let lines = font::strokes(text, Vector2::new(-back, 0.0), height);
    lines.into_iter().map(|line| line.into_iter().map(turned).collect()).collect()
}
