//! The report: a page for printing, with everything on which an answer depends.

use crate::export::escaped;
use crate::session::Session;
use crate::view::View;
use crate::{GivenLens, texts};
use std::fmt::Write;

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;overflow-wrap:anywhere}\
svg{display:block;width:100%;height:auto;max-height:16cm}table{border-collapse:collapse}\
th,td{padding:.2rem 1rem .2rem 0;vertical-align:top;text-align:left;border-bottom:1px solid #ccc;overflow-wrap:normal}\
td.long{overflow-wrap:anywhere}h1~h1{margin-top:3rem}\
@page{size:A4;margin:15mm}@media print{body{margin:0;max-width:none;padding:0}svg,tr{break-inside:avoid}h1,h2{break-after:avoid}h1~h1{break-before:page;margin-top:0}}";

/// A word with more letters may be broken, for it could be wider than the paper.
const LONG_WORD: usize = 24;

/// Writes a table with title, columns and rows; nothing without rows.
fn table(title: &str, columns: &[&str], rows: Vec<Vec<String>>) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let head: String = columns.iter().map(|c| format!("<th>{}</th>", escaped(c))).collect();
    // Each page repeats it.
    let has_head = columns.iter().any(|c| !c.is_empty());
    let head = if has_head { format!("<thead><tr>{head}</tr></thead>") } else { String::new() };
    let cell = |c: &String| {
        let is_long = c.split_whitespace().any(|word| LONG_WORD < word.chars().count());
        format!("<td{}>{}</td>", if is_long { " class=\"long\"" } else { "" }, escaped(c))
    };
    let row = |cells: Vec<String>| format!("<tr>{}</tr>", cells.iter().map(cell).collect::<String>());
    let rows: String = rows.into_iter().map(row).collect();
    format!("<h2>{}</h2><table>{head}<tbody>{rows}</tbody></table>", escaped(title))
}

fn metres(x: f64) -> String {
    format!("{} m", (1e4 * x).round() / 1e4)
}

impl Session {
    /// A page to print: the answer, and everything that it rests on: this photograph, then what belongs to the session, then its other photographs.
    pub(crate) fn report(&self, photo: usize, now_s: f64) -> String {
        let view = self.view(photo);
        let name = self.photograph(photo).map_or_else(String::new, |p| escaped(&p.name));
        let mut page = format!(
            "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>{name}</title><style>{STYLE}</style>{}",
            self.evidence(photo, &view)
        );
        page += &self.shared(&view, now_s);
        for other in (0..self.n_photographs()).filter(|other| *other != photo) {
            page += &self.evidence(other, &self.view(other));
        }
        let _ = writeln!(page, "<p>{}</p></html>", escaped(texts::REPORT));
        page
    }

    /// What one photograph shows: its pose, or why it has none, and what that rests on.
    fn evidence(&self, photo: usize, view: &View) -> String {
        let solved = self.solved(photo);
        let status = view.status().unwrap_or("no pose");
        let why = view.refusal.as_ref().or_else(|| view.missing.first());
        let message = match &solved {
            Some(solved) => solved.answer.verdict.message.as_str(),
            None => why.map_or("", |why| why.text.as_str()),
        };
        let mut part = format!(
            "<h1>{}</h1><p><strong>{status}</strong>: {}</p>{}",
            self.photograph(photo).map_or_else(String::new, |p| escaped(&p.name)),
            escaped(message),
            self.svg(photo, solved.as_deref())
        );
        part += &table("Photograph and lens", &["", ""], self.sources(photo, view));
        if let Some(solved) = &solved {
            let figure = |f: &crate::figures::Figure| vec![f.title.into(), f.words.clone(), f.help.into()];
            let rms = solved.answer.estimate.map(|estimate| {
                let words = format!("{:.3} px", estimate.rms_px);
                vec!["root mean square of the residuals".into(), words, String::new()]
            });
            part += &table(
                "Pose",
                &["", "value ± half of the 95 % interval", ""],
                view.figures.iter().map(figure).chain(rms).collect(),
            );
        }
        part += &table("Marks", &["name", "column, row", "± 1σ", "position", "residual"], marks(view));
        part
    }

    /// What belongs to all photographs.
    fn shared(&self, view: &View, now_s: f64) -> String {
        let distance = |d: &crate::view::DistanceView| {
            let computed = d.computed_m.map_or_else(String::new, metres);
            vec![format!("{}–{}", d.a, d.b), metres(d.distance_m), metres(d.sigma_m), computed]
        };
        let mut part = table(
            "Distances typed",
            &["between", "typed", "± 1σ", "by all marks together"],
            view.distances.iter().map(distance).collect(),
        );
        let has_several = 1 < view.photos.len();
        let measured = |m: &crate::view::MeasurementView| {
            let words = m.error.clone().unwrap_or_else(|| m.words.clone());
            let interval = m
                .low
                .zip(m.high)
                .map_or_else(String::new, |(low, high)| format!("{low:.4} to {high:.4} {}", m.unit));
            let photograph = view.photos.get(m.photo).filter(|_| has_several).map(|p| p.name.clone());
            let row =
                [m.name.clone(), m.what.name().into(), words, interval, m.status.unwrap_or_default().into()];
            row.into_iter().chain(photograph).collect()
        };
        let columns =
            ["name", "what", "value ± half of the 95 % interval", "95 % interval", "status", "photograph"];
        part += &table(
            "Measurements",
            &columns[..columns.len() - usize::from(!has_several)],
            view.measurements.iter().map(measured).collect(),
        );
        let rows = [
            ("standard deviation of a mark placed by hand", format!("{} px", view.sigma_px)),
            ("report made", date(now_s)),
            ("by", format!("Resight {}", env!("CARGO_PKG_VERSION"))),
        ];
        part += &table("Report", &["", ""], rows.map(|(title, value)| vec![title.to_owned(), value]).into());
        part
    }

    fn sources(&self, photo: usize, view: &View) -> Vec<Vec<String>> {
        let mut rows = Vec::new();
        let mut row = |title: &str, value: String| rows.push(vec![title.to_owned(), value]);
        if let Some(photograph) = self.photograph(photo) {
            let size = photograph.size();
            row("photograph", photograph.name.clone());
            row("SHA-256 of its file", photograph.sha256.clone());
            row(
                "size",
                format!("{} × {} px, {} bytes", size.width_px, size.height_px, photograph.bytes.len()),
            );
            if let Some(taken_s) = photograph.taken_s {
                row("taken, by the camera's clock", date(taken_s));
            }
            if let Some(camera) = &photograph.camera {
                row("camera, by its EXIF", camera.name.clone());
            }
        }
        if let Some(lens) = &view.lens {
            let stated = match self.state.photos.get(photo).and_then(|p| p.lens.as_ref()) {
                Some(GivenLens::File { name, .. }) => format!("camera file {name}: {}", lens.words),
                Some(GivenLens::Exif) => "by the photograph's EXIF".to_owned(),
                Some(GivenLens::FieldOfView { hfov_deg }) => {
                    format!("field of view stated: {hfov_deg}° across")
                }
                Some(GivenLens::Common { name }) => format!("of a common camera: {name}"),
                Some(GivenLens::Lines { lines }) => {
                    format!("{} lines that are parallel in the scene, {}", lines.len(), lens.words)
                }
                Some(GivenLens::Photograph { .. } | GivenLens::Unknown) | None => lens.words.clone(),
            };
            row("lens", stated);
            if let Some(hfov_deg) = lens.hfov_deg {
                row("field of view", format!("{hfov_deg:.2}° across"));
            }
            lens.model.iter().for_each(|model| row("model of the lens", model.clone()));
            lens.remark.iter().for_each(|remark| row("to be known of it", remark.clone()));
        }
        rows
    }
}

fn marks(view: &View) -> Vec<Vec<String>> {
    let mark = |p: &crate::view::PointView| {
        let place = p.position_m.map_or_else(String::new, |[x, y, z]| format!("({x:.4}, {y:.4}, {z:.4}) m"));
        let residual = p.residual_px.map_or_else(String::new, |px| format!("{px:.2} px"));
        vec![
            p.name.clone(),
            format!("{:.2}, {:.2}", p.u_px, p.v_px),
            format!("{:.2} px", p.sigma_px),
            place,
            residual,
        ]
    };
    view.points.iter().map(mark).collect()
}

/// `2026-03-14 15:09 UTC`, by the Gregorian calendar.
fn date(unix_s: f64) -> String {
    let minutes = (unix_s / 60.0).floor() as i64;
    let (days, minute) = (minutes.div_euclid(1440), minutes.rem_euclid(1440));
    // Years are counted from March, so that a leap day is the last of its year.
    let from_0000 = days + 719_468;
    let era = from_0000.div_euclid(146_097);
    let day_of_era = from_0000.rem_euclid(146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    let year = year_of_era + 400 * era + i64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02} {:02}:{:02} UTC", minute / 60, minute % 60)
}

#[cfg(test)]
mod tests {
    use super::date;

    /// As `date -u -d @… '+%F %R'` has them.
    #[test]
    fn dates_are_those_of_the_calendar() {
        for (unix_s, expected) in [
            (0.0, "1970-01-01 00:00 UTC"),
            (951_782_399.0, "2000-02-28 23:59 UTC"),
            (951_868_800.0, "2000-03-01 00:00 UTC"),
            (1_709_164_800.0, "2024-02-29 00:00 UTC"),
            (1_773_500_966.5, "2026-03-14 15:09 UTC"),
            (-1.0, "1969-12-31 23:59 UTC"),
        ] {
            assert_eq!(date(unix_s), expected);
        }
    }
}
