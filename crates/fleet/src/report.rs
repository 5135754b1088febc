//! One HTML file: which cameras moved, with evidence, since when, their histories and where they stand.

mod history;
mod map;

use crate::assess::{Assessment, CameraVerdict, Found, Motion};
use crate::cameras::Cameras;
use resight::report::html::{Page, escaped};
use resight::report::verdict::Status;

/// Cameras of one verdict that the page lists; of more it says how many there are.
const LISTED: usize = 500;
/// Histories drawn.
const DRAWN: usize = 60;
/// Verdicts in the order of the page, with their headings.
const SECTIONS: [(Found, &str, &str); 6] = [
    (
        Found::WrongMap,
        "Wrong maps",
        "Poses of these cameras contradict their points: the survey, the labels or the intrinsics are wrong, and no motion can be told.",
    ),
    (Found::Dead, "Dead cameras", "Not seen any more, or never."),
    (
        Found::Clock,
        "Clocks",
        "Times that cannot be; these cameras are not tested for motion until their clocks are set.",
    ),
    (
        Found::Wandering,
        "Moving to and fro",
        "Larger than the errors of a period, but no step and no ramp: mostly the warmth of the day. --diurnal-deg says how much of it is nobody's concern.",
    ),
    (Found::TooFew, "Too few poses", ""),
    (Found::Unknown, "Not in the table of cameras", ""),
];

/// On a phone the table of moved cameras is a list: each camera with its values below, named as the columns are.
const NARROW: &str = "@media(max-width:40rem){.moved-list table{font-size:1em}.moved-list table,.moved-list tbody,.moved-list tr,.moved-list td{display:block}.moved-list thead{display:none}\
    .moved-list tr{padding:.5rem 0;border-bottom:1px solid #8886}.moved-list td{border:0;padding:0;white-space:normal}.moved-list td:first-child{font-weight:600}\
    .moved-list td::before{opacity:.75}.moved-list td:nth-child(2)::before{content:'how '}.moved-list td:nth-child(3)::before{content:'since '}\
    .moved-list td:nth-child(4)::before{content:'± '}.moved-list td:nth-child(5)::before{content:'rotation '}\
    .moved-list td:nth-child(6)::before{content:'shift '}.moved-list td:nth-child(7)::before{content:'χ² (6) '}}";

/// The page of a fleet; `cameras` say where each stands.
pub fn page(fleet: &Assessment, cameras: Option<&Cameras>) -> String {
    let mut page = Page::new("Which cameras moved?");
    page.style(
        "svg{max-width:100%;height:auto}.axis{stroke:#99a;stroke-width:.6}.grid{stroke:#8886;stroke-width:.5}svg text{font:11px system-ui,sans-serif;fill:#778}\
         .rx{stroke:#c0392b}.ry{stroke:#1e8449}.rz{stroke:#2471a3}.moved{fill:#b3261e}.wrong_map{fill:#9a6b00}.dead{fill:#555}.clock{fill:#6c3483}\
         .wandering,.too_few,.unknown{fill:#2471a3}.steady{fill:#147a3466}.rx,.ry,.rz{fill:none;stroke-width:1.3}.since{stroke:#b3261e;stroke-dasharray:4 3}\
         td:nth-child(2):last-child{white-space:normal}.moved-list table{font-size:.88em}",
    );
    page.style(NARROW);
    summary(&mut page, fleet);
    moved(&mut page, fleet);
    if let Some(svg) = cameras.and_then(|cameras| map::svg(fleet, cameras)) {
        page.heading("Where they stand");
        page.markup(&svg);
    }
    for (found, heading, words) in SECTIONS {
        section(&mut page, fleet, found, heading, words);
    }
    page.html()
}

fn of(fleet: &Assessment, found: Found) -> Vec<&CameraVerdict> {
    fleet.cameras.iter().filter(|camera| camera.found == found).collect()
}

fn summary(page: &mut Page, fleet: &Assessment) {
    let n = |found: Found| of(fleet, found).len();
    let moved = n(Found::Moved);
    let sentence = match moved {
        0 => "No camera moved.".to_string(),
        1 => "One camera moved.".to_string(),
        n => format!("{n} cameras moved."),
    };
    let is_well = moved + n(Found::WrongMap) + n(Found::Dead) + n(Found::Clock) == 0;
    let status = if is_well { Status::Ok } else { Status::Inconsistent };
    let figures = [
        ("cameras", fleet.cameras.len().to_string()),
        ("moved", moved.to_string()),
        ("wrong map", n(Found::WrongMap).to_string()),
        ("dead", n(Found::Dead).to_string()),
        ("clock", n(Found::Clock).to_string()),
        ("to and fro", n(Found::Wandering).to_string()),
        ("steady", n(Found::Steady).to_string()),
    ];
    page.verdict(status, &sentence, &figures);
    if let Some((begin, end)) = fleet.span_s {
        page.paragraph(&format!(
            "From {} to {}, readings of {:.0} s each. At the stated rate of false alarms {:.4} of the cameras that stayed are expected to be called moved.",
            time(begin), time(end), fleet.period_s, fleet.expected_false_alarms
        ));
    }
}

fn moved(page: &mut Page, fleet: &Assessment) {
    let moved = of(fleet, Found::Moved);
    if moved.is_empty() {
        return;
    }
    page.heading("Moved cameras, by evidence");
    let row = |v: &&CameraVerdict| v.motion.as_ref().map(|motion| cells(&v.camera, motion));
    let rows: Vec<Vec<String>> = moved.iter().take(LISTED).filter_map(row).collect();
    page.markup("<div class=\"moved-list\">");
    page.table(&["camera", "how", "since", "±", "rotation x, y, z", "shift x, y, z", "χ² (6)"], &rows);
    page.markup("</div>");
    if LISTED < moved.len() {
        page.paragraph(&format!(
            "{} more moved; `resight fleet-report --json` has them all.",
            moved.len() - LISTED
        ));
    }
    page.paragraph(
        "Rotations and shifts are about and along the camera's own axes in its old frame: x right, y down, z forward. A rotation about the camera's own centre \
         is given alone where it explains the motion.",
    );
    page.heading("Histories");
    page.paragraph("Rotation about x (red), y (green) and z (blue), degrees, by period; the dashed line is when the motion began.");
    let drawn: String = moved.iter().take(DRAWN).map(|v| history::svg(v)).collect();
    page.markup(&format!("<div class=\"row\">{drawn}</div>"));
}

fn cells(camera: &str, motion: &Motion) -> Vec<String> {
    let rotation =
        motion.rotation_alone_deg.unwrap_or(motion.rotation_deg).map(|x| format!("{x:+.4}°")).join(" ");
    let shift = match motion.rotation_alone_deg {
        Some(_) => "none needed".to_string(),
        None => motion.translation_m.map(|x| format!("{:+.2}", 1e3 * x)).join(" ") + " mm",
    };
    let how = if motion.kind == "step" { "suddenly" } else { "slowly" };
    let (since, sigma) = (time(motion.since_s), format!("{:.0} s", motion.since_sigma_s));
    vec![camera.to_string(), how.to_string(), since, sigma, rotation, shift, format!("{:.0}", motion.chi2)]
}

fn section(page: &mut Page, fleet: &Assessment, found: Found, heading: &str, words: &str) {
    let cameras = of(fleet, found);
    if cameras.is_empty() {
        return;
    }
    page.heading(heading);
    if !words.is_empty() {
        page.paragraph(words);
    }
    let rows: Vec<Vec<String>> =
        cameras.iter().take(LISTED).map(|v| vec![v.camera.clone(), v.message.clone()]).collect();
    page.table(&["camera", "what was found"], &rows);
    if LISTED < cameras.len() {
        page.paragraph(&format!(
            "{} more; `resight fleet-report --json` has them all.",
            cameras.len() - LISTED
        ));
    }
}

/// UTC where it can be one of our days, else seconds.
fn time(t_s: f64) -> String {
    // 1990 to 2200.
    if !(6.3e8..7.3e9).contains(&t_s) {
        return format!("{t_s:.0} s");
    }
    let seconds = t_s as i64;
    let (year, month, day) = date(seconds.div_euclid(86_400));
    let of_day = seconds.rem_euclid(86_400);
    format!("{year}-{month:02}-{day:02} {:02}:{:02}:{:02} UTC", of_day / 3600, of_day / 60 % 60, of_day % 60)
}

/// Year, month and day of a number of days since 1970, by the civil calendar's 400-year cycle.
fn date(days: i64) -> (i64, i64, i64) {
    let shifted = days + 719_468;
    let (era, of_era) = (shifted.div_euclid(146_097), shifted.rem_euclid(146_097));
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let m = (5 * of_year + 2) / 153;
    let month = if m < 10 { m + 3 } else { m - 9 };
    (year + era * 400 + i64::from(month <= 2), month, of_year - (153 * m + 2) / 5 + 1)
}

/// A word as a class of the page's style.
fn class(found: Found) -> String {
    escaped(found.name())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_dates() {
        assert_eq!(time(1_780_000_000.0), "2026-05-28 20:26:40 UTC");
        assert_eq!(time(951_782_400.0), "2000-02-29 00:00:00 UTC");
        assert_eq!(time(12.3), "12 s");
    }
}
