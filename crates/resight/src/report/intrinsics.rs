//! The page about a camera's intrinsics: coverage, residuals, and projection uncertainty over the image.

use super::html::{Page, escaped};
use crate::answer::intrinsics::{CameraIntrinsics, IntrinsicsAnswer, IntrinsicsObject};
use crate::scene::geometry::magnification;
use std::fmt::Write;

/// Width of a drawing, in its own units.
const WIDTH: f64 = 480.0;
/// The part of the image's width that a large residual fills.
const ARROW: f64 = 0.04;
/// Largest number of arrows: more would be a black area.
const MOST_ARROWS: usize = 4000;

/// Returns a self-contained page (HTML).
pub fn intrinsics_page(answer: &IntrinsicsAnswer) -> String {
    let names: Vec<&str> = answer.cameras.iter().map(|camera| camera.name.as_str()).collect();
    let mut page = Page::new(&format!("Intrinsics of {}", names.join(", ")));
    if let Some(first) = answer.cameras.iter().find(|camera| camera.status == answer.status) {
        match first.is_weak() {
            true => page.weak_verdict(&first.message, &figures(first)),
            false => page.verdict(answer.status, &first.message, &figures(first)),
        };
    }
    for camera in &answer.cameras {
        page.heading(&format!("Camera {}", camera.name));
        // That of an only camera is the verdict above.
        if 1 < answer.cameras.len() {
            page.paragraph(&camera.message);
        }
        of_camera(&mut page, camera);
    }
    page.html()
}

fn figures(camera: &CameraIntrinsics) -> Vec<(&'static str, String)> {
    let Some(found) = &camera.intrinsics else { return Vec::new() };
    let mut figures = vec![
        ("lens model", found.model.to_string()),
        ("residuals", format!("{:.3} px", found.rms_px)),
        ("views", found.views.len().to_string()),
        ("coverage", format!("{:.0} %", 100.0 * found.coverage.share)),
    ];
    figures.extend(found.projection.rms_px.map(|px| ("projection uncertainty", format!("{px:.3} px"))));
    figures
}

fn of_camera(page: &mut Page, camera: &CameraIntrinsics) {
    for finding in camera.findings.iter().filter(|finding| finding.message != camera.message) {
        page.paragraph(&finding.message);
    }
    if let Some(found) = &camera.intrinsics {
        parameters(page, found);
        pictures(page, found);
        tables(page, found);
    }
    if !camera.left_out.is_empty() {
        let rows: Vec<Vec<String>> = camera
            .left_out
            .iter()
            .map(|one| vec![one.view.clone(), one.what.clone(), one.reason.clone()])
            .collect();
        page.heading("Left out").table(&["view", "what", "why"], &rows);
    }
}

fn parameters(page: &mut Page, found: &IntrinsicsObject) {
    let digits = |name: &str| if name.ends_with("_px") { 3 } else { 6 };
    let row = |p: &crate::answer::intrinsics::ParameterObject| {
        let n = digits(p.name);
        vec![p.name.to_string(), format!("{:.n$}", p.value), format!("{:.n$}", p.sigma)]
    };
    page.table(
        &["parameter", "value", "standard deviation"],
        &found.parameters.iter().map(row).collect::<Vec<_>>(),
    );
    if let Some(held) = &found.held_out {
        page.paragraph(&format!(
            "Views that took no part are predicted to {:.3} px by the camera of the other half ({:.3} px by that of all); two halves of one camera's views differ as much with probability {:.2}.",
            held.rms_px, held.with_all_px, held.p
        ));
    }
    if let Some(next) = &found.next_view {
        page.paragraph(&format!("Next view: {}.", next.message));
    }
}

fn pictures(page: &mut Page, found: &IntrinsicsObject) {
    let coverage: Vec<Option<f64>> =
        found.coverage.counts.iter().map(|n| (0 < *n).then_some(*n as f64)).collect();
    let most = found.coverage.counts.iter().copied().max().unwrap_or(0);
    let covered = cells(found, found.coverage.columns, found.coverage.rows, &coverage, 0.0);
    let sigma = &found.projection;
    let worst = sigma.sigma_px.iter().flatten().copied().fold(0.0, f64::max);
    let least = sigma.sigma_px.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    let known = cells(found, sigma.columns, sigma.rows, &sigma.sigma_px, 1.0);
    page.markup("<div class=\"row\">")
        .markup(&figure(found, &covered, &format!("Coverage: corners by part of the image, up to {most}; white parts have none.")))
        .markup(&figure(
            found,
            &known,
            &format!(
                "Projection uncertainty: standard deviation {least:.3} px (light) to {worst:.3} px (dark); white is outside the lens model's field."
            ),
        ))
        .markup(&residuals(found))
        .markup("</div>");
}

fn height(found: &IntrinsicsObject) -> f64 {
    WIDTH * f64::from(found.height_px) / f64::from(found.width_px.max(1))
}

fn figure(found: &IntrinsicsObject, content: &str, caption: &str) -> String {
    format!(
        "<figure><svg viewBox=\"0 0 {WIDTH} {:.1}\" role=\"img\" aria-label=\"{caption}\" style=\"width:100%;border:1px solid #889\"><rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>{content}</svg><figcaption>{caption}</figcaption></figure>",
        height(found),
        caption = escaped(caption)
    )
}

/// Draws the cells of a grid, darker for larger values; with `overlap` 1, values are at positions from corner to corner, each the centre of its
/// cell.
fn cells(
    found: &IntrinsicsObject,
    columns: usize,
    rows: usize,
    values: &[Option<f64>],
    overlap: f64,
) -> String {
    let most = values.iter().flatten().copied().fold(f64::MIN_POSITIVE, f64::max);
    let (w, h) =
        (WIDTH / (columns as f64 - overlap).max(1.0), height(found) / (rows as f64 - overlap).max(1.0));
    let mut text = String::new();
    for (i, value) in values.iter().enumerate() {
        let Some(value) = value else { continue };
        let (x, y) = (i % columns.max(1), i / columns.max(1));
        let shade = 0.08 + 0.85 * (value / most).sqrt();
        let _ = write!(
            text,
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{w:.2}\" height=\"{h:.2}\" fill=\"#1f4e8c\" fill-opacity=\"{shade:.3}\"><title>{value:.3}</title></rect>",
            (x as f64 - 0.5 * overlap) * w,
            (y as f64 - 0.5 * overlap) * h
        );
    }
    text
}

/// Draws the residuals as arrows, magnified so that large ones are well seen and do not cross the image.
fn residuals(found: &IntrinsicsObject) -> String {
    let all: Vec<&[f64; 4]> = found.views.iter().flat_map(|view| &view.residuals_px).collect();
    let mut lengths: Vec<f64> = all.iter().map(|[_, _, u, v]| u.hypot(*v)).collect();
    lengths.sort_by(f64::total_cmp);
    let large = lengths.get(lengths.len() * 99 / 100).copied().unwrap_or(0.0);
    let width_px = f64::from(found.width_px.max(1));
    let times = magnification(large, ARROW * width_px);
    let (scale, step) = (WIDTH / width_px, all.len().div_ceil(MOST_ARROWS).max(1));
    let mut arrows = String::new();
    for [u, v, du, dv] in all.into_iter().step_by(step) {
        let color = if large <= du.hypot(*dv) { "#b3261e" } else { "#1d232b" };
        let (x, y) = ((u + 0.5) * scale, (v + 0.5) * scale);
        let _ = write!(
            arrows,
            "<path d=\"M{x:.1} {y:.1}l{:.1} {:.1}\" stroke=\"{color}\" stroke-width=\"0.8\"/>",
            du * times * scale,
            dv * times * scale
        );
    }
    let caption =
        format!("Residuals (observed − predicted), {times} times enlarged; red: the largest per cent.");
    figure(found, &arrows, &caption)
}

fn tables(page: &mut Page, found: &IntrinsicsObject) {
    let number =
        |x: Option<f64>, digits: usize| x.map_or_else(|| "–".to_string(), |x| format!("{x:.digits$}"));
    let tried: Vec<Vec<String>> = found
        .tried
        .iter()
        .map(|one| {
            let open = one.undetermined.map_or(String::new(), |name| format!("leaves {name} open"));
            vec![one.model.clone(), number(one.rms_px, 4), number(one.aic, 1), open]
        })
        .collect();
    page.heading("Lens models tried").table(&["model", "residuals (px)", "AIC less the best", ""], &tried);
    let views: Vec<Vec<String>> = found
        .views
        .iter()
        .map(|view| vec![view.view.clone(), view.n_corners.to_string(), format!("{:.3}", view.rms_px)])
        .collect();
    page.heading("Views").table(&["view", "corners", "residuals (px)"], &views);
    if !found.bad_views.is_empty() {
        let rows: Vec<Vec<String>> =
            found.bad_views.iter().map(|bad| vec![bad.view.clone(), bad.reason.clone()]).collect();
        page.heading("Bad views").table(&["view", "why"], &rows);
    }
    if !found.bad_corners.is_empty() {
        let row = |bad: &crate::answer::intrinsics::BadCornerObject| {
            vec![bad.view.clone(), bad.point.clone(), number(bad.residual_px.map(|[u, v]| u.hypot(v)), 2)]
        };
        page.heading("Bad corners")
            .table(&["view", "point", "off (px)"], &found.bad_corners.iter().map(row).collect::<Vec<_>>());
    }
}
