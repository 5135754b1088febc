//! One HTML file: which cameras moved, with evidence and times, their histories and positions; it can be searched and sorted.

mod history;
mod map;
mod sites;
mod verdicts;

use crate::assess::{Assessment, CameraVerdict, Found, Motion};
use crate::cameras::Cameras;
use crate::words::{duration, expected, utc, with_sigma};
use resight::report::html::{Page, escaped};
use resight::report::verdict::Status;

/// Largest number of cameras in the table of all; the file of verdicts contains all of them.
const LISTED: usize = 20_000;
/// Verdicts in the order of the page, with their headings.
const SECTIONS: [(Found, &str, &str); 6] = [
    (
        Found::WrongMap,
        "Wrong maps",
        "Poses of these cameras contradict their points: the map, the labels or the intrinsics are wrong, so that no motion can be determined.",
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
        "Larger than the errors of a period, but no step and no ramp beyond doubt: mostly diurnal variation. State with --diurnal-deg how much of it is expected.",
    ),
    (
        Found::TooFew,
        "Too few poses",
        "Too few for a verdict, or a single period that says that the camera moved.",
    ),
    (Found::Unknown, "Not in the table of cameras", ""),
];

/// On a phone the table of moved cameras is a list: each motion with its values below, labelled like the columns.
const NARROW: &str = "@media(max-width:40rem){.moved-list table{font-size:1em}.moved-list table,.moved-list tbody,.moved-list tr,.moved-list td{display:block}.moved-list thead{display:none}\
    .moved-list tr{padding:.5rem 0;border-bottom:1px solid #8886}.moved-list td{border:0;padding:0;white-space:normal}.moved-list td:first-child{font-weight:600}\
    .moved-list td:empty{display:none}.moved-list td::before{opacity:.75}.moved-list td:nth-child(2)::before{content:'site '}.moved-list td:nth-child(3)::before{content:'how '}\
    .moved-list td:nth-child(4)::before{content:'since '}.moved-list td:nth-child(5)::before{content:'± '}.moved-list td:nth-child(6)::before{content:'rotation '}\
    .moved-list td:nth-child(7)::before{content:'x, y, z '}.moved-list td:nth-child(8)::before{content:'shift '}.moved-list td:nth-child(9)::before{content:'χ² (6) '}}";

const STYLE: &str = "body{max-width:76rem}svg{max-width:100%;height:auto}.axis{stroke:#99a;stroke-width:.6}.grid{stroke:#8886;stroke-width:.5}svg text{font:11px system-ui,sans-serif;fill:#778}\
     .rx{stroke:#c0392b}.ry{stroke:#1e8449}.rz{stroke:#2471a3}.moved{fill:#b3261e}.wrong_map{fill:#9a6b00}.dead{fill:#555}.clock{fill:#6c3483}\
     .wandering,.too_few,.unknown{fill:#2471a3}.steady{fill:#147a3466}.rx,.ry,.rz{fill:none;stroke-width:1.3}.since{stroke:#b3261e;stroke-dasharray:4 3}\
     .found td:last-child{white-space:normal;min-width:14rem}.moved-list table{font-size:.88em}[hidden]{display:none!important}\
     th{cursor:pointer}th[aria-sort=ascending]::after{content:' ↑'}th[aria-sort=descending]::after{content:' ↓'}summary{cursor:pointer}\
     .tools{display:flex;flex-wrap:wrap;gap:.6rem 1.2rem;align-items:center}.tools input{font:inherit;padding:.3rem .6rem;flex:1 1 14rem;max-width:24rem;\
     border:1px solid #8888;border-radius:6px;background:transparent;color:inherit}.tools a{color:inherit}";

/// The script for searching and sorting.
const SCRIPT: &str = include_str!("report/interaction.js");

/// Returns the page of a fleet; `cameras` state the position of each camera.
pub fn page(fleet: &Assessment, cameras: Option<&Cameras>) -> String {
    let mut page = Page::new("Which cameras moved?");
    page.style(STYLE).style(NARROW);
    summary(&mut page, fleet);
    tools(&mut page, fleet, cameras);
    changes(&mut page, fleet);
    masts(&mut page, fleet);
    moved(&mut page, fleet, cameras);
    histories(&mut page, fleet);
    if let Some(cameras) = cameras {
        if let Some(svg) = map::svg(fleet, cameras) {
            page.heading("Positions");
            page.markup(&svg);
        }
        sites::table(&mut page, fleet, cameras);
    }
    for (found, heading, words) in SECTIONS {
        section(&mut page, fleet, found, heading, words, cameras);
    }
    all(&mut page, fleet, cameras);
    page.markup(&format!("<script>{SCRIPT}</script>"));
    page.html()
}

/// Writes a search field and the verdicts as a file.
fn tools(page: &mut Page, fleet: &Assessment, cameras: Option<&Cameras>) {
    let csv = verdicts::address(&verdicts::csv(fleet, cameras));
    page.markup(&format!(
        "<div class=\"tools\"><label>Search for cameras, sites or words <input id=\"search\" type=\"search\"></label><span id=\"shown\"></span>\
         <a download=\"verdicts.csv\" href=\"{csv}\">verdicts.csv</a></div>"
    ));
}

/// Writes the differences from the end of the state before these poses.
fn changes(page: &mut Page, fleet: &Assessment) {
    let Some(changes) = &fleet.changes else { return };
    page.heading(&format!("Since {}", utc(changes.since_s)));
    if changes.cameras.is_empty() {
        page.paragraph("Nothing changed.");
        return;
    }
    let word = |found: Found| found.name().replace('_', " ");
    let row = |(camera, before, now): &(String, Option<Found>, Found)| {
        vec![camera.clone(), before.map_or("not there".into(), word), word(*now)]
    };
    page.table(&["camera", "before", "now"], &changes.cameras.iter().map(row).collect::<Vec<_>>());
}

fn masts(page: &mut Page, fleet: &Assessment) {
    if fleet.together.is_empty() {
        return;
    }
    page.heading("Masts that moved");
    page.paragraph("Several cameras of one site moved at one time: the mast, not the camera.");
    let row = |t: &crate::assess::Together| {
        let when = utc(0.5 * (t.span_s.0 + t.span_s.1));
        vec![t.site.clone(), format!("{} of {}", t.cameras.len(), t.of), when, t.cameras.join(", ")]
    };
    page.markup("<div class=\"found\">");
    page.table(&["site", "moved", "when", "cameras"], &fleet.together.iter().map(row).collect::<Vec<_>>());
    page.markup("</div>");
}

/// Returns the site of a camera; empty where unknown.
fn site_of(cameras: Option<&Cameras>, verdict: &CameraVerdict) -> String {
    let site = cameras.and_then(|cameras| cameras.site(cameras.number(&verdict.camera)?));
    site.map_or(String::new(), |site| site.name.clone())
}

fn of(fleet: &Assessment, found: Found) -> Vec<&CameraVerdict> {
    fleet.cameras.iter().filter(|camera| camera.found == found).collect()
}

fn summary(page: &mut Page, fleet: &Assessment) {
    let n = |found: Found| of(fleet, found).len();
    let moved = n(Found::Moved);
    let unconfirmed = of(fleet, Found::TooFew).iter().filter(|v| !v.events.is_empty()).count();
    let mut sentence = match moved {
        0 => "No camera moved.".to_string(),
        1 => "One camera moved.".to_string(),
        n => format!("{n} cameras moved."),
    };
    if 0 < unconfirmed {
        sentence += &format!(" A single period says so of {unconfirmed} more.");
    }
    let is_well = moved + n(Found::WrongMap) + n(Found::Dead) + n(Found::Clock) == 0;
    let status = match (is_well, unconfirmed) {
        (true, 0) => Status::Ok,
        (true, _) => Status::Undecided,
        (false, _) => Status::Inconsistent,
    };
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
            "From {} to {}, readings of {:.0} s each. At the stated rate of false alarms {} of the cameras that stayed are expected to be called moved.",
            utc(begin), utc(end), fleet.period_s, expected(fleet.expected_false_alarms)
        ));
    }
    for unread in &fleet.unread {
        page.paragraph(&format!("Not read: {unread}"));
    }
}

fn moved(page: &mut Page, fleet: &Assessment, cameras: Option<&Cameras>) {
    let moved = of(fleet, Found::Moved);
    if moved.is_empty() {
        return;
    }
    page.heading("Moved cameras, by evidence");
    let rows = |v: &&CameraVerdict| {
        let site = site_of(cameras, v);
        v.events.iter().map(|event| cells(&v.camera, &site, event)).collect::<Vec<_>>()
    };
    let rows: Vec<Vec<String>> = moved.iter().flat_map(rows).collect();
    let head = ["camera", "site", "how", "since", "±", "rotation", "about x, y, z", "shift", "χ² (6)"];
    page.markup("<div class=\"moved-list\">");
    page.table(&head, &rows);
    page.markup("</div>");
    page.paragraph(
        "A row for each motion. Rotations and shifts are about and along the camera's own axes in its old frame: x right, y down, z forward. A rotation about \
         the camera's own centre is given alone where it explains the motion. Every ± is one standard deviation.",
    );
}

/// Writes the histories of all cameras that moved, wander or seem to have moved.
fn histories(page: &mut Page, fleet: &Assessment) {
    let drawn: String = [Found::Moved, Found::Wandering, Found::TooFew]
        .into_iter()
        .flat_map(|found| of(fleet, found))
        .filter(|v| v.found != Found::TooFew || !v.events.is_empty())
        .map(history::svg)
        .collect();
    if drawn.is_empty() {
        return;
    }
    page.heading("Histories");
    page.paragraph("Rotation about x (red), y (green) and z (blue), degrees, by period; a dashed line is when a motion began.");
    page.markup(&format!("<div class=\"row\">{drawn}</div>"));
}

fn cells(camera: &str, site: &str, motion: &Motion) -> Vec<String> {
    let rotation =
        motion.rotation_alone_deg.unwrap_or(motion.rotation_deg).map(|x| format!("{x:+.4}°")).join(" ");
    let how = match (motion.kind, motion.until_s) {
        ("step", _) => "suddenly".to_string(),
        ("ramp", None) => "slowly".to_string(),
        ("ramp", Some([until_s, _])) => format!("slowly until {}", utc(until_s)),
        ("pending", _) => "in its last period".to_string(),
        _ => "for one period".to_string(),
    };
    let least = if motion.is_at_least { " at least" } else { "" };
    let shift = match motion.rotation_alone_deg {
        Some(_) => "none needed".to_string(),
        None => format!("{} mm{least}", with_sigma(motion.shift_m.map(|x| 1e3 * x))),
    };
    vec![
        camera.to_string(),
        site.to_string(),
        how,
        utc(motion.since_s),
        duration(motion.since_sigma_s),
        format!("{}°{least}", with_sigma(motion.angle_deg)),
        rotation,
        shift,
        format!("{:.0}", motion.chi2),
    ]
}

fn section(
    page: &mut Page,
    fleet: &Assessment,
    found: Found,
    heading: &str,
    words: &str,
    cameras: Option<&Cameras>,
) {
    let verdicts = of(fleet, found);
    if verdicts.is_empty() {
        return;
    }
    page.heading(heading);
    if !words.is_empty() {
        page.paragraph(words);
    }
    let row = |v: &&CameraVerdict| vec![v.camera.clone(), site_of(cameras, v), v.message.clone()];
    let rows: Vec<Vec<String>> = verdicts.iter().map(row).collect();
    page.markup("<div class=\"found\">");
    page.table(&["camera", "site", "what was found"], &rows);
    page.markup("</div>");
}

/// Writes every camera, whatever its verdict.
fn all(page: &mut Page, fleet: &Assessment, cameras: Option<&Cameras>) {
    let row = |v: &CameraVerdict| {
        let found = v.found.name().replace('_', " ");
        vec![v.camera.clone(), site_of(cameras, v), found, v.message.clone()]
    };
    let rows: Vec<Vec<String>> = fleet.cameras.iter().take(LISTED).map(row).collect();
    page.markup(&format!("<details class=\"found\"><summary>All {} cameras</summary>", fleet.cameras.len()));
    page.table(&["camera", "site", "found", "what was found"], &rows);
    if LISTED < fleet.cameras.len() {
        page.paragraph(&format!("{} more are in verdicts.csv.", fleet.cameras.len() - LISTED));
    }
    page.markup("</details>");
}

/// Returns a word as a class of the page's style.
fn class(found: Found) -> String {
    escaped(found.name())
}
