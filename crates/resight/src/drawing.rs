//! A flat drawing of lines and text, written as SVG and as PNG from the same list.

pub mod chart;

use crate::GrayImage;
use crate::overlay::canvas::{Canvas, Color, Path, Pen};
use crate::overlay::font;
use nalgebra::Vector2;

/// The part of a text that is at its position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// The text begins at the position.
    Start,
    /// The text is centred on the position.
    Middle,
    /// The text ends at the position.
    End,
}

/// An element of a drawing. Positions in px, y down.
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
        /// Opacity: 1 opaque, 0 invisible.
        opacity: f64,
    },
    /// One line of text; its position is on the baseline.
    Text {
        /// The characters.
        text: String,
        /// Its position.
        at: Vector2<f64>,
        /// Height of a capital, px.
        height: f64,
        /// Its colour.
        color: Color,
        /// The part of the text that is at the position.
        anchor: Anchor,
        /// Rotation, clockwise, about the position.
        rotation_rad: f64,
    },
}

/// A drawing on a white background.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// The items in drawing order: later ones cover earlier ones.
    pub items: Vec<Item>,
}

const WHITE: Color = [255, 255, 255];
/// Width of the strokes of letters relative to their height.
const BOLDNESS: f64 = 0.13;

impl Drawing {
    /// Creates an empty drawing.
    pub fn new(width_px: u32, height_px: u32) -> Self {
        Drawing { width_px, height_px, items: Vec::new() }
    }

    /// Adds a line.
    pub fn line(&mut self, path: Path, color: Color, width: f64) {
        self.faint_line(path, color, width, 1.0);
    }

    /// Adds a partly transparent line: opacity 1 is opaque, 0 invisible.
    pub fn faint_line(&mut self, path: Path, color: Color, width: f64, opacity: f64) {
        self.items.push(Item::Line { path, color, width, opacity });
    }

    /// Adds horizontal text.
    pub fn text(&mut self, text: &str, at: Vector2<f64>, height: f64, color: Color, anchor: Anchor) {
        self.rotated_text(text, at, height, color, anchor, 0.0);
    }

    /// Adds text rotated about its position, on a white shade that keeps it readable over lines.
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

    /// Encodes the drawing as PNG.
    ///
    /// # Errors
    /// The encoder's message.
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

    /// Writes the drawing as SVG; one unit is one pixel of the PNG.
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

/// Escapes text for XML.
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

/// Returns the letters as lines, anchored and rotated.
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
