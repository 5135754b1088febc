//! Writes a page as SVG: its sides in millimetres, the unit of the view box a millimetre.

use super::shape::{Group, Page, Shape, number};
use std::fmt::Write as _;

pub(super) fn document(page: &Page) -> String {
    let [w, h] = page.size_mm.map(number);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}mm\" height=\"{h}mm\" viewBox=\"0 0 {w} {h}\">\n"
    );
    for (i, group) in page.groups.iter().enumerate() {
        draw(group, i, &mut out);
    }
    out + "</svg>\n"
}

fn draw(group: &Group, index: usize, out: &mut String) {
    match group.clip {
        Some([[x0, y0], [x1, y1]]) => {
            let [x, y, w, h] = [x0, y0, x1 - x0, y1 - y0].map(number);
            let _ = writeln!(
                out,
                "<clipPath id=\"c{index}\"><rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\"/></clipPath>\n<g clip-path=\"url(#c{index})\">"
            );
        }
        None => *out += "<g>\n",
    }
    group.shapes.iter().for_each(|shape| shape_into(shape, out));
    *out += "</g>\n";
}

fn shape_into(shape: &Shape, out: &mut String) {
    let _ = match shape {
        Shape::Area(outlines) => writeln!(out, "<path fill-rule=\"evenodd\" d=\"{}\"/>", path(outlines)),
        Shape::Disc { centre, radius } => {
            let [x, y, r] = [centre[0], centre[1], *radius].map(number);
            writeln!(out, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\"/>")
        }
        Shape::Line { from, to, width } => {
            let [x1, y1, x2, y2, w] = [from[0], from[1], to[0], to[1], *width].map(number);
            writeln!(
                out,
                "<line x1=\"{x1}\" y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\" stroke=\"#000\" stroke-width=\"{w}\"/>"
            )
        }
        Shape::Text { at, size, text } => {
            let [x, y, size] = [at[0], at[1], *size].map(number);
            let font = "font-family=\"Helvetica, Arial, sans-serif\"";
            writeln!(out, "<text x=\"{x}\" y=\"{y}\" {font} font-size=\"{size}\">{}</text>", escaped(text))
        }
    };
}

fn path(outlines: &[Vec<[f64; 2]>]) -> String {
    let mut path = String::new();
    for outline in outlines {
        for (i, p) in outline.iter().enumerate() {
            let _ = write!(path, "{}{} {}", if i == 0 { "M" } else { "L" }, number(p[0]), number(p[1]));
        }
        path.push('Z');
    }
    path
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
