//! Writes pages as PDF 1.4: few objects, no compression, Helvetica without embedding, and a request to the viewer not to scale.
//!
//! A transform at the head of each page makes the unit a millimetre with y down, so that the numbers are those of the SVG.

use super::shape::{Group, Page, Shape, number};
use std::fmt::Write as _;

/// 72 points an inch of 25.4 mm.
const POINTS_PER_MM: f64 = 72.0 / 25.4;
/// Number of arcs of a circle: the cubic for an eighth deviates from it by 4e-6 of the radius.
const ARCS: usize = 8;

/// Writes all pages to one file.
pub(super) fn document(pages: &[&Page]) -> Vec<u8> {
    let mut objects: Vec<Vec<u8>> = Vec::new();
    objects.push(b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>".to_vec());
    let kids: Vec<String> = (0..pages.len()).map(|i| format!("{} 0 R", 4 + 2 * i)).collect();
    objects
        .push(format!("<< /Type /Pages /Kids [{}] /Count {} >>", kids.join(" "), pages.len()).into_bytes());
    objects
        .push(b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica /Encoding /WinAnsiEncoding >>".to_vec());
    for (i, page) in pages.iter().enumerate() {
        let [w, h] = page.size_mm.map(|side| number(side * POINTS_PER_MM));
        objects.push(
            format!(
                "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {w} {h}] /Resources << /Font << /F1 3 0 R >> >> /Contents {} 0 R >>",
                5 + 2 * i
            )
            .into_bytes(),
        );
        let content = content(page);
        let mut stream = format!("<< /Length {} >>\nstream\n", content.len()).into_bytes();
        stream.extend(content);
        stream.extend(b"\nendstream");
        objects.push(stream);
    }
    file(&objects)
}

/// Writes the objects, numbered from 1, with the table of their offsets.
fn file(objects: &[Vec<u8>]) -> Vec<u8> {
    let mut out = b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n".to_vec();
    let mut table = format!("xref\n0 {}\n0000000000 65535 f \n", objects.len() + 1);
    for (i, object) in objects.iter().enumerate() {
        let _ = writeln!(table, "{:010} 00000 n ", out.len());
        out.extend(format!("{} 0 obj\n", i + 1).into_bytes());
        out.extend(object);
        out.extend(b"\nendobj\n");
    }
    let start = out.len();
    out.extend(table.into_bytes());
    let trailer =
        format!("trailer\n<< /Size {} /Root 1 0 R >>\nstartxref\n{start}\n%%EOF\n", objects.len() + 1);
    out.extend(trailer.into_bytes());
    out
}

fn content(page: &Page) -> Vec<u8> {
    let height = number(page.size_mm[1] * POINTS_PER_MM);
    let mut out = format!("{POINTS_PER_MM:.12} 0 0 -{POINTS_PER_MM:.12} 0 {height} cm\n").into_bytes();
    for group in &page.groups {
        draw(group, &mut out);
    }
    out
}

fn draw(group: &Group, out: &mut Vec<u8>) {
    if let Some([[x0, y0], [x1, y1]]) = group.clip {
        let numbers = [x0, y0, x1 - x0, y1 - y0].map(number).join(" ");
        out.extend(format!("q {numbers} re W n\n").into_bytes());
    }
    group.shapes.iter().for_each(|shape| shape_into(shape, out));
    if group.clip.is_some() {
        out.extend(b"Q\n");
    }
}

fn shape_into(shape: &Shape, out: &mut Vec<u8>) {
    match shape {
        Shape::Area(outlines) => {
            let mut path = String::new();
            for outline in outlines {
                for (i, p) in outline.iter().enumerate() {
                    let _ =
                        write!(path, "{} {} {} ", number(p[0]), number(p[1]), if i == 0 { "m" } else { "l" });
                }
                path += "h\n";
            }
            out.extend((path + "f*\n").into_bytes());
        }
        Shape::Disc { centre, radius } => out.extend(disc(*centre, *radius).into_bytes()),
        Shape::Line { from, to, width } => {
            let [a, b] = [from, to].map(|p| format!("{} {}", number(p[0]), number(p[1])));
            out.extend(format!("{} w {a} m {b} l S\n", number(*width)).into_bytes());
        }
        Shape::Text { at, size, text } => {
            let [x, y] = at.map(number);
            // In the font, y points up.
            out.extend(format!("BT /F1 {} Tf 1 0 0 -1 {x} {y} Tm (", number(*size)).into_bytes());
            for c in text.chars() {
                match u8::try_from(u32::from(c)).unwrap_or(b'?') {
                    escaped @ (b'(' | b')' | b'\\') => out.extend([b'\\', escaped]),
                    byte => out.push(byte),
                }
            }
            out.extend(b") Tj ET\n");
        }
    }
}

fn disc([x, y]: [f64; 2], radius: f64) -> String {
    let angle = std::f64::consts::TAU / ARCS as f64;
    let handle = 4.0 / 3.0 * (0.25 * angle).tan();
    let at = |i: usize, along: f64| {
        let (sin, cos) = (i as f64 * angle).sin_cos();
        let p = [x + radius * (cos - along * sin), y + radius * (sin + along * cos)];
        format!("{} {}", number(p[0]), number(p[1]))
    };
    let mut path = format!("{} m ", at(0, 0.0));
    for i in 0..ARCS {
        let _ = write!(path, "{} {} {} c ", at(i, handle), at(i + 1, -handle), at(i + 1, 0.0));
    }
    path + "h f\n"
}
