//! Arithmetic of pages and tiles, SVG against PDF, hostile sizes, and each kind rasterised from the shapes and found again.

use super::shape::{Group, Page, Shape};
use super::*;
use crate::GrayImage;
use crate::detect::Detector;
use crate::render::ink::bounds;
use resight_core::target::{AprilGrid, Charuco, Chessboard, CircleGrid, Feature, LinePlusOne, Tag};
use std::collections::BTreeMap;

fn request(target: Target, paper: Paper) -> PrintRequest {
    PrintRequest {
        target,
        paper,
        format: PrintFormat::Pdf,
        writes_target: true,
        measured: None,
        dot_diameter_m: None,
        name: "sheet".into(),
    }
}

fn tag(family: &str, size_m: f64) -> Target {
    Target::Tag(Tag { family: family.into(), id: 7, size_m })
}

fn chessboard(square_m: f64) -> Target {
    Target::Chessboard(Chessboard { rows: 6, columns: 9, square_m })
}

fn circles(rows: u32, columns: u32, asymmetric: bool) -> Target {
    Target::CircleGrid(CircleGrid { rows, columns, spacing_m: 0.018, diameter_m: None, asymmetric })
}

/// One of each kind that fits A4.
fn kinds() -> Vec<(&'static str, Target)> {
    let grid = AprilGrid {
        family: "tag36h11".into(),
        rows: 4,
        columns: 3,
        tag_size_m: 0.04,
        tag_spacing_ratio: 0.3,
        first_id: 0,
    };
    let charuco = Charuco {
        rows: 7,
        columns: 5,
        square_m: 0.03,
        marker_m: 0.022,
        dictionary: "DICT_5X5_100".into(),
        legacy_pattern: false,
    };
    vec![
        ("dots", Target::LinePlusOne(LinePlusOne { line_m: [0.0, 0.1, 0.15], off_m: [0.0, 0.15] })),
        ("tag36h11", tag("tag36h11", 0.1)),
        ("tagStandard41h12", tag("tagStandard41h12", 0.06)),
        ("DICT_4X4_50", tag("DICT_4X4_50", 0.1)),
        ("aprilgrid", Target::AprilGrid(grid)),
        ("chessboard", chessboard(0.02)),
        ("charuco", Target::Charuco(charuco)),
        ("asymmetric circles", circles(11, 4, true)),
        ("symmetric circles", circles(7, 6, false)),
        ("tags", sheet_of_tags("tag36h11", (0, 5), 0.05, None, None).expect("a sheet")),
    ]
}

fn laid(target: &Target, paper: Paper) -> Laid {
    let contents = content::contents(&request(target.clone(), paper)).expect("content");
    layout::lay(&contents[0], &paper).expect("pages")
}

/// The box around everything of a page that is no text.
fn box_of(page: &Page) -> ([f64; 2], [f64; 2]) {
    bounds(page.groups.iter().flat_map(|group| &group.shapes).flat_map(|shape| match shape {
        Shape::Area(outlines) => outlines.concat(),
        Shape::Disc { centre: [x, y], radius: r } => vec![[x - r, y - r], [x + r, y + r]],
        Shape::Line { from, to, .. } => vec![*from, *to],
        Shape::Text { at, size, text } => vec![*at, [at[0] + text::width_mm(text, *size), at[1] - size]],
    }))
}

/// The ink alone, on one page: areas and discs.
fn ink_box(page: &Page) -> ([f64; 2], [f64; 2]) {
    let is_ink = |shape: &&Shape| matches!(shape, Shape::Area(_) | Shape::Disc { .. });
    let shapes = page.groups.iter().flat_map(|g| &g.shapes).filter(is_ink).cloned().collect();
    box_of(&Page { size_mm: page.size_mm, groups: vec![Group { clip: None, shapes }] })
}

#[test]
fn each_kind_stands_on_one_page_within_its_margins_at_its_size() {
    for paper in [Paper::A4, Paper::A3, Paper::LETTER] {
        for (name, target) in kinds() {
            let Laid { pages, ruler_mm, tiles } = laid(&target, paper);
            assert!(pages.len() == 1 && tiles.is_none(), "{name} on {}: {} pages", paper.name(), pages.len());
            let (low, high) = box_of(&pages[0]);
            let size = pages[0].size_mm;
            for i in [0, 1] {
                // Cut marks may end in the margin; everything else is within it.
                assert!(
                    1.0 <= low[i] && high[i] <= size[i] - 1.0,
                    "{name} on {}: {low:?} to {high:?}",
                    paper.name()
                );
                assert!(100.0 <= ruler_mm[i], "{name}: {ruler_mm:?}");
            }
            let (low, high) = ink_box(&pages[0]);
            assert!(
                (0..2).all(|i| 5.0 - 1e-9 <= low[i] && high[i] <= size[i] - 5.0 + 1e-9),
                "{name}: ink in the margin"
            );
        }
    }
    // Inner corners are known; the outer squares add one on each side.
    let (low, high) = ink_box(&laid(&chessboard(0.02), Paper::A4).pages[0]);
    assert!(
        (high[0] - low[0] - 200.0).abs() < 1e-9 && (high[1] - low[1] - 140.0).abs() < 1e-9,
        "{low:?} {high:?}"
    );
    let (low, high) = ink_box(&laid(&tag("tag36h11", 0.16), Paper::A4).pages[0]);
    assert!(
        (0..2).all(|i| (high[i] - low[i] - 160.0).abs() < 1e-9),
        "the largest tag for A4: {low:?} {high:?}"
    );
}

#[test]
fn a_ruler_is_as_long_as_it_says_and_stands_off_the_white() {
    for (name, target) in kinds() {
        let Laid { pages, ruler_mm, .. } = laid(&target, Paper::A4);
        let shapes = &pages[0].groups[0].shapes;
        let (ink_low, ink_high) = ink_box(&pages[0]);
        for axis in [0, 1] {
            let length = |s: &Shape| match s {
                Shape::Line { from, to, .. } if from[1 - axis] == to[1 - axis] => {
                    (to[axis] - from[axis]).abs()
                }
                _ => 0.0,
            };
            let n = shapes.iter().filter(|s| (length(s) - ruler_mm[axis]).abs() < 1e-9).count();
            assert_eq!(n, 1, "{name}: one line of {} mm along axis {axis}", ruler_mm[axis]);
        }
        for shape in shapes {
            let Shape::Line { from, to, .. } = shape else { continue };
            let inside = |p: &[f64; 2]| (0..2).all(|i| ink_low[i] - 2.0 < p[i] && p[i] < ink_high[i] + 2.0);
            assert!(!inside(from) && !inside(to), "{name}: a line from {from:?} to {to:?} is in the target");
        }
    }
}

/// Every point of the board is on some page, at one place of the sheet put together, and neighbouring pages share the overlap.
#[test]
fn tiles_cover_a_board_once_and_overlap() {
    let target = chessboard(0.06);
    let Laid { pages, tiles, ruler_mm } = laid(&target, Paper::A4);
    let [rows, columns] = tiles.expect("several pages");
    assert!(rows * columns == pages.len() && 4 <= pages.len(), "{rows} × {columns}, {} pages", pages.len());
    assert_eq!(ruler_mm, [600.0, 400.0]);
    let [w, h] = pages[0].size_mm;
    let step = [w - 24.0 - 10.0, h - 24.0 - 10.0];
    let mut covered = Vec::new();
    for (i, page) in pages.iter().enumerate() {
        let clip = page.groups[0].clip.expect("a window");
        assert!(clip == [[12.0, 12.0], [w - 12.0, h - 12.0]], "{clip:?}");
        let to_sheet = [(i % columns) as f64 * step[0] - 12.0, (i / columns) as f64 * step[1] - 12.0];
        for shape in &page.groups[0].shapes {
            let Shape::Area(outlines) = shape else { continue };
            for p in outlines.concat() {
                let on_sheet = [p[0] + to_sheet[0], p[1] + to_sheet[1]];
                covered.push(on_sheet);
            }
        }
        // A joint has a mark above and below, or left and right.
        let joints = usize::from(0 < i % columns)
            + usize::from(i % columns + 1 < columns)
            + usize::from(0 < i / columns)
            + usize::from(i / columns + 1 < rows);
        let marks = page.groups[1].shapes.iter().filter(|s| matches!(s, Shape::Line { .. })).count();
        assert_eq!(marks, 2 * joints, "page {}", i + 1);
    }
    let covered = bounds(covered);
    assert!(
        (covered.1[0] - covered.0[0] - 600.0).abs() < 1e-9
            && (covered.1[1] - covered.0[1] - 420.0).abs() < 1e-9
    );
    // Corners inside the overlap are on both pages, at the same place of the sheet.
    let corners = |i: usize| -> Vec<[i64; 2]> {
        let [[x0, y0], [x1, y1]] = pages[i].groups[0].clip.expect("a window");
        let to_sheet = [(i % columns) as f64 * step[0] - 12.0, (i / columns) as f64 * step[1] - 12.0];
        let areas = pages[i].groups[0].shapes.iter().filter_map(|s| match s {
            Shape::Area(outlines) => Some(outlines.concat()),
            _ => None,
        });
        let seen = areas.flatten().filter(|p| x0 <= p[0] && p[0] <= x1 && y0 <= p[1] && p[1] <= y1);
        seen.map(|p| [0, 1].map(|k| ((p[k] + to_sheet[k]) * 1e4).round() as i64)).collect()
    };
    let (first, second) = (corners(0), corners(1));
    let [x0, x1] = [step[0], step[0] + 10.0].map(|x| (x * 1e4).round() as i64);
    let shared = |all: &[[i64; 2]]| {
        let mut kept: Vec<_> = all.iter().filter(|p| x0 <= p[0] && p[0] <= x1).copied().collect();
        kept.sort_unstable();
        kept.dedup();
        kept
    };
    assert_eq!(shared(&first), shared(&second));
}

/// Numbers of a PDF's areas and lines, and of an SVG's, in order.
fn numbers_of(text: &str) -> Vec<f64> {
    text.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-'))
        .filter_map(|x| x.parse().ok())
        .collect()
}

#[test]
fn svg_and_pdf_draw_the_same_shapes() {
    for (name, target) in kinds() {
        let page = &laid(&target, Paper::A4).pages[0];
        let (svg, pdf) = (svg::document(page), pdf::document(&[page]));
        let pdf = String::from_utf8_lossy(&pdf).into_owned();
        let areas: Vec<Vec<f64>> = svg
            .lines()
            .filter(|l| l.starts_with("<path"))
            .map(|l| numbers_of(l.split("d=").nth(1).unwrap()))
            .collect();
        let stream = pdf.split("stream\n").nth(1).unwrap();
        let mut drawn: Vec<Vec<f64>> = vec![Vec::new()];
        for line in stream.lines().filter(|l| l.ends_with(" h") || *l == "f*" || l.ends_with("l h")) {
            match line {
                "f*" => drawn.push(Vec::new()),
                outline => drawn.last_mut().unwrap().extend(numbers_of(outline)),
            }
        }
        drawn.pop();
        assert_eq!(areas, drawn, "{name}: areas");
        assert!(!areas.is_empty() || name.contains("dots") || name.contains("circles"));
        let lines: Vec<Vec<f64>> = svg
            .lines()
            .filter(|l| l.starts_with("<line"))
            .map(|l| {
                l.split('"')
                    .enumerate()
                    .filter(|(i, _)| i % 2 == 1)
                    .filter_map(|(_, x)| x.parse().ok())
                    .collect()
            })
            .collect();
        let strokes: Vec<Vec<f64>> = stream.lines().filter(|l| l.ends_with(" S")).map(numbers_of).collect();
        assert_eq!(lines.len(), strokes.len(), "{name}");
        for (a, b) in lines.iter().zip(&strokes) {
            assert_eq!([a[4], a[0], a[1], a[2], a[3]], b[..], "{name}: a line");
        }
        let circles = svg.lines().filter(|l| l.starts_with("<circle")).count();
        assert_eq!(circles, stream.lines().filter(|l| l.contains(" c ")).count(), "{name}: discs");
        assert_eq!(svg.matches("<text").count(), stream.matches(" Tj").count(), "{name}: words");
    }
}

/// The table of a PDF points at its objects, and its streams are as long as they say.
#[test]
fn a_pdf_is_whole() {
    let laid = laid(&chessboard(0.06), Paper::A4);
    let bytes = pdf::document(&laid.pages.iter().collect::<Vec<_>>());
    let text: String = bytes.iter().map(|b| if b.is_ascii() { char::from(*b) } else { '?' }).collect();
    let start: usize = text.lines().rev().nth(1).unwrap().parse().unwrap();
    let table: Vec<&str> = text[start..].lines().collect();
    assert_eq!(table[0], "xref");
    let n: usize = table[1].split(' ').nth(1).unwrap().parse().unwrap();
    assert_eq!(n, 4 + 2 * laid.pages.len());
    for (i, row) in table[3..2 + n].iter().enumerate() {
        let at: usize = row[..10].parse().unwrap();
        assert!(text[at..].starts_with(&format!("{} 0 obj\n", i + 1)), "object {}", i + 1);
    }
    for part in text.split("/Length ").skip(1) {
        let length: usize = part.split(' ').next().unwrap().parse().unwrap();
        let stream = part.split_once("stream\n").unwrap().1;
        assert!(stream[length..].starts_with("\nendstream"), "a stream of {length}");
    }
    assert!(text.contains("/PrintScaling /None"));
}

/// Grey values of a page at a resolution: each pixel the mean of 8 × 8 samples; an edge is placed to an eighth of a pixel.
fn rasterised(page: &Page, dpi: f64) -> GrayImage {
    const SAMPLES: usize = 8;
    let per_mm = dpi / 25.4 * SAMPLES as f64;
    let [w, h] = page.size_mm.map(|side| (side * dpi / 25.4).round() as usize * SAMPLES);
    let mut ink = vec![0u8; w * h];
    for group in &page.groups {
        for shape in &group.shapes {
            fill(shape, per_mm, w, h, &mut ink);
        }
    }
    let (columns, rows) = (w / SAMPLES, h / SAMPLES);
    let mut data = vec![0u8; columns * rows];
    for (i, grey) in data.iter_mut().enumerate() {
        let (x, y) = (i % columns * SAMPLES, i / columns * SAMPLES);
        let n: usize =
            (0..SAMPLES).map(|k| ink[(y + k) * w + x..][..SAMPLES].iter().filter(|b| **b == 1).count()).sum();
        *grey = (255.0 * (1.0 - n as f64 / (SAMPLES * SAMPLES) as f64)).round() as u8;
    }
    GrayImage { width_px: columns as u32, height_px: rows as u32, data }
}

/// Scan lines of samples, even–odd.
fn fill(shape: &Shape, per_mm: f64, w: usize, h: usize, ink: &mut [u8]) {
    let outlines: Vec<Vec<[f64; 2]>> = match shape {
        Shape::Area(outlines) => outlines.clone(),
        Shape::Disc { centre, radius } => {
            let at = |i: usize| {
                let (sin, cos) = (i as f64 * std::f64::consts::TAU / 720.0).sin_cos();
                [centre[0] + radius * cos, centre[1] + radius * sin]
            };
            vec![(0..720).map(at).collect()]
        }
        Shape::Line { from, to, width } => {
            let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
            let k = 0.5 * width / dx.hypot(dy);
            let corner = |p: &[f64; 2], s: f64| [p[0] - s * dy * k, p[1] + s * dx * k];
            vec![vec![corner(from, 1.0), corner(to, 1.0), corner(to, -1.0), corner(from, -1.0)]]
        }
        // Words need a font: the judges' rasterisers have one.
        Shape::Text { .. } => return,
    };
    let (low, high) = bounds(outlines.iter().flatten().copied());
    let rows =
        (low[1] * per_mm).floor().max(0.0) as usize..((high[1] * per_mm).ceil().max(0.0) as usize).min(h);
    for row in rows {
        let y = (row as f64 + 0.5) / per_mm;
        let mut cuts: Vec<f64> = Vec::new();
        for outline in &outlines {
            for (a, b) in outline.iter().zip(outline.iter().cycle().skip(1)) {
                if (y < a[1]) != (y < b[1]) {
                    cuts.push(a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
                }
            }
        }
        cuts.sort_by(f64::total_cmp);
        for pair in cuts.chunks_exact(2) {
            let sample = |x: f64| ((x * per_mm - 0.5).ceil().max(0.0) as usize).min(w);
            ink[row * w + sample(pair[0])..row * w + sample(pair[1])].fill(1);
        }
    }
}

/// Where a feature is printed: the target's own point, laid from the ink's box.
fn printed_px(target: &Target, feature: Feature, page: &Page, dpi: f64) -> [f64; 2] {
    let sheet = crate::render::ink::sheet(target, &Default::default()).unwrap();
    let (low, high) = sheet.ink_bounds();
    let (page_low, _) = ink_box(page);
    let p = target.point(feature).unwrap().position;
    let down = if sheet.is_y_up { high[1] - p.y } else { p.y - low[1] };
    [page_low[0] + 1e3 * (p.x - low[0]), page_low[1] + 1e3 * down].map(|mm| mm * dpi / 25.4 - 0.5)
}

/// Boards, dots, and sheets of twelve small tags.
fn read_back() -> Vec<(&'static str, Target)> {
    let sheet = |family: &'static str, size_m| {
        (family, sheet_of_tags(family, (0, 11), size_m, None, None).expect("a sheet"))
    };
    let boards =
        kinds().into_iter().filter(|(name, _)| !name.starts_with("tag") && !name.starts_with("DICT"));
    boards
        .chain([
            sheet("tag36h11", 0.02),
            sheet("tag16h5", 0.02),
            sheet("tagStandard41h12", 0.012),
            sheet("tagStandard52h13", 0.012),
            sheet("tagCustom48h12", 0.012),
            sheet("DICT_4X4_50", 0.02),
        ])
        .collect()
}

/// What prints is what is found: every feature of tags, boards and dots, on the whole page with its rulers and cut marks, at 150 dpi as a rasteriser draws it, without a lens; scale to 0.02 %, no bias above 0.05 px. `scripts/judges/printed_targets.py` says it of the PDF and SVG through other programs.
#[test]
fn every_kind_is_read_back_from_its_page_at_its_scale() {
    const DPI: f64 = 150.0;
    for (name, target) in read_back() {
        let page = &laid(&target, Paper::A4).pages[0];
        let image = rasterised(page, DPI);
        let found = Detector::new(&target).unwrap().detect(&image).unwrap();
        assert_eq!(found.len(), target.features().len(), "{name}: {} found", found.len());
        let pairs: Vec<([f64; 2], [f64; 2])> = found
            .iter()
            .map(|d| (printed_px(&target, d.feature, page, DPI), [d.pixel.x, d.pixel.y]))
            .collect();
        for i in [0, 1] {
            let n = pairs.len() as f64;
            let (mean, seen) = pairs.iter().fold((0.0, 0.0), |(a, b), (p, q)| (a + p[i] / n, b + q[i] / n));
            let spread: f64 = pairs.iter().map(|(p, _)| (p[i] - mean).powi(2)).sum();
            let scale = pairs.iter().map(|(p, q)| (p[i] - mean) * (q[i] - seen)).sum::<f64>() / spread;
            println!("{name}, axis {i}: scale {:+.1e}, bias {:+.3} px", scale - 1.0, seen - mean);
            assert!((scale - 1.0).abs() < 2e-4, "{name}: scale of axis {i} is off by {:.2e}", scale - 1.0);
            assert!((seen - mean).abs() < 0.05, "{name}: bias of axis {i} is {:.3} px", seen - mean);
        }
    }
}

#[test]
fn measured_rulers_reach_the_target_file() {
    let rulers = MeasuredRulers { x_mm: 99.6, y_mm: 150.3, sigma_mm: 0.1 };
    let sheet = request(tag("tag36h11", 0.1), Paper::A4);
    let plain = print_target(&sheet).unwrap();
    let [x, y] = plain.ruler_mm;
    let measured = MeasuredRulers { x_mm: 0.996 * x, y_mm: 1.002 * y, ..rulers };
    let answer = print_target(&PrintRequest { measured: Some(measured), ..sheet.clone() }).unwrap();
    let toml = answer.contents.last().unwrap().clone();
    let read = crate::formats::read_target_from_bytes("sheet.toml", toml).unwrap().target;
    let scale = read.printed_scale().expect("a scale");
    assert!((scale.ratio[0] - 0.996).abs() < 1e-12 && (scale.ratio[1] - 1.002).abs() < 1e-12);
    assert!((scale.sigma[0] - 0.1 / x).abs() < 1e-12 && (scale.sigma[1] - 0.1 / y).abs() < 1e-12);
    assert_eq!(read.design(), &sheet.target);
    let corner = read.point(Feature { id: 7, corner: 2 }).unwrap().position;
    assert!((corner.x - 0.0498).abs() < 1e-12 && (corner.y - 0.0501).abs() < 1e-12, "{corner:?}");
    // A new print of a measured target is drawn as designed, and says so.
    let again = print_target(&request(read, Paper::A4)).unwrap();
    assert_eq!(again.contents[0], plain.contents[0]);
    assert!(
        again.printed_scale.is_none() && again.warnings[0].contains("earlier print"),
        "{:?}",
        again.warnings
    );
}

fn refusal(request: &PrintRequest) -> String {
    print_target(request).map(|a| a.message).expect_err("it is refused").to_string()
}

/// Numbers that cannot be are refused by name, with what was seen and what is possible.
#[test]
fn what_cannot_be_printed_is_named() {
    let a4 = |target: Target| request(target, Paper::A4);
    let cases = [
        (a4(tag("tag36h11", f64::NAN)), "size_m"),
        (a4(tag("tag36h11", -0.1)), "size_m"),
        (a4(tag("tag36h11", f64::INFINITY)), "size_m"),
        (a4(tag("tag36h12", 0.1)), "tag36h12"),
        (a4(Target::Tag(Tag { family: "tag36h11".into(), id: 587, size_m: 0.1 })), "0 to 586, 587 asked for"),
        (a4(Target::Points(Vec::new())), "are not printed"),
        (
            a4(Target::Chessboard(Chessboard { rows: 70_000, columns: 70_000, square_m: 0.01 })),
            "at most 100000",
        ),
        (a4(Target::Chessboard(Chessboard { rows: 300, columns: 300, square_m: 1e6 })), "pages of A4"),
        (a4(chessboard(1e300)), "pages of A4"),
        (a4(tag("tag36h11", 1e-9)), "ruler"),
        (request(tag("tag36h11", 0.1), Paper { width_mm: f64::NAN, height_mm: 100.0 }), "NaN"),
        (request(tag("tag36h11", 0.1), Paper { width_mm: 210.0, height_mm: 10.0 }), "10 mm"),
        (PrintRequest { dot_diameter_m: Some(f64::NAN), ..a4(kinds()[0].1.clone()) }, "diameter"),
        (PrintRequest { dot_diameter_m: Some(0.06), ..a4(kinds()[0].1.clone()) }, "dots of 60 mm touch"),
    ];
    for (i, (request, needed)) in cases.iter().enumerate() {
        // A tiny tag fits every page, and is then printed as asked.
        let Err(reason) = print_target(request) else {
            assert_eq!(i, 9, "case {i} is printed");
            continue;
        };
        assert!(reason.to_string().contains(needed), "case {i}: {reason}");
    }
    let measured = |x_mm: f64, y_mm: f64, sigma_mm: f64| PrintRequest {
        measured: Some(MeasuredRulers { x_mm, y_mm, sigma_mm }),
        ..a4(tag("tag36h11", 0.1))
    };
    let [x, y] = print_target(&a4(tag("tag36h11", 0.1))).unwrap().ruler_mm;
    assert!(
        refusal(&measured(0.94 * x, y, 0.1)).contains("-6.0 % off"),
        "{}",
        refusal(&measured(0.94 * x, y, 0.1))
    );
    for (request, needed) in [
        (measured(f64::NAN, y, 0.1), "--measured-x-mm is NaN"),
        (measured(x, 1.06 * y, 0.1), "100 %"),
        (measured(x, y, f64::NAN), "--measured-sigma-mm is NaN"),
        (measured(x, y, 0.0), "is positive"),
        (measured(x, y, 0.06 * x), "longer ruler"),
        (PrintRequest { writes_target: false, ..measured(x, y, 0.1) }, "have it written"),
    ] {
        let reason = refusal(&request);
        assert!(reason.contains(needed), "{needed}: {reason}");
    }
}

#[test]
fn papers_are_named_or_measured() {
    assert_eq!(Paper::parse("a4").unwrap(), Paper::A4);
    assert_eq!(Paper::parse("letter").unwrap(), Paper::LETTER);
    assert_eq!(Paper::parse("600x400").unwrap(), Paper { width_mm: 600.0, height_mm: 400.0 });
    for (word, needed) in [
        ("A9", "no such paper"),
        ("10x400", "10 mm"),
        ("nanx400", "NaN"),
        ("6000x400", "5000"),
        ("x", "WIDTHxHEIGHT"),
    ] {
        let reason = Paper::parse(word).unwrap_err().to_string();
        assert!(reason.contains(needed), "{word}: {reason}");
    }
}

/// Ids and numbers of what a sheet says, for each kind.
#[test]
fn a_sheet_says_what_it_is() {
    let said: BTreeMap<&str, String> = kinds()
        .into_iter()
        .map(|(name, target)| {
            let page = laid(&target, Paper::A4).pages.remove(0);
            let words: Vec<String> = page.groups[0]
                .shapes
                .iter()
                .filter_map(|s| if let Shape::Text { text, .. } = s { Some(text.clone()) } else { None })
                .collect();
            (name, words.join(" "))
        })
        .collect();
    for (name, needed) in [
        ("tag36h11", "tag36h11 id 7, 100 mm"),
        ("aprilgrid", "ids 0 to 11, tags of 40 mm, gaps of 12 mm"),
        ("chessboard", "6 rows × 9 columns of inner corners, squares of 20 mm"),
        ("charuco", "7 rows × 5 columns of squares of 30 mm, markers of 22 mm from DICT_5X5_100"),
        ("tags", "tag36h11 id 5"),
        ("dots", "0, 100, 150 mm, the fourth at (0, 150) mm"),
    ] {
        assert!(said[name].contains(needed), "{name}: {}", said[name]);
    }
    assert!(said.values().all(|words| words.contains("Print at 100 %") && words.contains("mm, x")));
}
