//! The shapes of a page, which both writers draw.

/// A black shape. Millimetres from the top left of the page, y down.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// Closed outlines of one area: points inside an odd number of them are black.
    Area(Vec<Vec<[f64; 2]>>),
    /// A disc.
    Disc {
        /// Its centre.
        centre: [f64; 2],
        /// Its radius.
        radius: f64,
    },
    /// A straight stroke with square ends at its end points.
    Line {
        /// One end.
        from: [f64; 2],
        /// The other end.
        to: [f64; 2],
        /// Its width.
        width: f64,
    },
    /// A line of Helvetica.
    Text {
        /// Left end of its baseline.
        at: [f64; 2],
        /// Height of the font.
        size: f64,
        /// Characters of Latin 1.
        text: String,
    },
}

/// Shapes, and the box to which they are clipped: least and greatest x and y.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Group {
    /// The box; `None` for the whole page.
    pub clip: Option<[[f64; 2]; 2]>,
    /// The shapes in drawing order.
    pub shapes: Vec<Shape>,
}

/// One page.
#[derive(Debug, Clone, PartialEq)]
pub struct Page {
    /// Width and height.
    pub size_mm: [f64; 2],
    /// The groups in drawing order.
    pub groups: Vec<Group>,
}

impl Shape {
    /// Returns the shape, shifted.
    pub fn moved(&self, by: [f64; 2]) -> Shape {
        let place = |p: &[f64; 2]| [p[0] + by[0], p[1] + by[1]];
        match self {
            Shape::Area(outlines) => {
                Shape::Area(outlines.iter().map(|o| o.iter().map(place).collect()).collect())
            }
            Shape::Disc { centre, radius } => Shape::Disc { centre: place(centre), radius: *radius },
            Shape::Line { from, to, width } => {
                Shape::Line { from: place(from), to: place(to), width: *width }
            }
            Shape::Text { at, size, text } => Shape::Text { at: place(at), size: *size, text: text.clone() },
        }
    }

    /// Returns the part that may be visible in a box: outlines completely outside are left out.
    pub(super) fn within(&self, window: &[[f64; 2]; 2]) -> Option<Shape> {
        let meets = |points: &[[f64; 2]], reach: f64| {
            let (low, high) = crate::render::ink::bounds(points.iter().copied());
            [0, 1].into_iter().all(|i| low[i] - reach <= window[1][i] && window[0][i] <= high[i] + reach)
        };
        match self {
            Shape::Area(outlines) => {
                let kept: Vec<_> = outlines.iter().filter(|o| meets(o, 0.0)).cloned().collect();
                (!kept.is_empty()).then_some(Shape::Area(kept))
            }
            Shape::Disc { centre, radius } => meets(&[*centre], *radius).then(|| self.clone()),
            Shape::Line { from, to, width } => meets(&[*from, *to], *width).then(|| self.clone()),
            Shape::Text { at, size, text } => {
                let end = [at[0] + super::text::width_mm(text, *size), at[1]];
                meets(&[*at, end], *size).then(|| self.clone())
            }
        }
    }
}

/// Writes a number of millimetres in the syntax of both formats, to 10 nm.
pub(super) fn number(x: f64) -> String {
    let text = format!("{x:.5}");
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" || short.is_empty() { "0".to_owned() } else { short.to_owned() }
}
