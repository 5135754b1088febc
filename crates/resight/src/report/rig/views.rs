//! The table of views × cameras: the share of points used, and the observations that were left out as a whole.

use super::pieces::{fixed, row, tabular};
use crate::core::multiview::rig::RejectedObservation;
use crate::report::html::escaped;
use crate::rig::RigRun;
use std::collections::BTreeMap;

/// Largest number of cells; beyond it, only the views with the smallest share of points used are shown.
const MOST_CELLS: usize = 24_000;
/// Largest number of rejected observations listed.
const MOST_REJECTED: usize = 500;

/// The points of a camera in a view, over all targets.
#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    n_seen: usize,
    n_used: usize,
    sum_squares: f64,
    is_rejected: bool,
}

impl Cell {
    fn add(&mut self, other: &Cell) {
        self.n_seen += other.n_seen;
        self.n_used += other.n_used;
        self.sum_squares += other.sum_squares;
        self.is_rejected |= other.is_rejected;
    }

    fn share(&self) -> f64 {
        self.n_used as f64 / self.n_seen.max(1) as f64
    }

    fn rms(&self) -> f64 {
        (self.sum_squares / self.n_used as f64).sqrt()
    }

    /// Returns 0 (none used) to 10 (all), the class that colours the cell. Only a share of exactly 1 is 10, and only one of exactly 0 is 0.
    fn tenths(&self) -> usize {
        match self.n_used {
            0 => 0,
            n if n == self.n_seen => 10,
            _ => (10.0 * self.share()).floor().clamp(1.0, 9.0) as usize,
        }
    }
}

fn cells(run: &RigRun) -> BTreeMap<(usize, usize), Cell> {
    let mut cells: BTreeMap<(usize, usize), Cell> = BTreeMap::new();
    for (observation, result) in run.rig.observations.iter().zip(&run.solution.observations) {
        let used = || result.residuals_px.iter().flatten().filter(|r| r.1);
        cells.entry((observation.view, observation.camera)).or_default().add(&Cell {
            n_seen: observation.seen.len(),
            n_used: used().count(),
            sum_squares: used().map(|r| r.0.norm_squared()).sum(),
            is_rejected: result.rejected.is_some(),
        });
    }
    cells
}

/// Returns the table, one row per view, one column per camera.
pub(super) fn table(run: &RigRun) -> String {
    let cells = cells(run);
    let shown = shown_views(run, &cells);
    let name = |c: &crate::formats::NamedCamera| escaped(&c.name);
    let mut head = vec!["view".to_string()];
    head.extend(run.rig.cameras.iter().map(name));
    head.extend(["all".to_string(), "rms, px".to_string()]);
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let rows: String = shown.iter().map(|&view| view_row(run, view, &cells)).collect();
    let which = if shown.len() < run.rig.views.len() {
        format!(
            " ({} of {} views: those with the smallest share of points used)",
            shown.len(),
            super::grouped(run.rig.views.len())
        )
    } else {
        String::new()
    };
    let explained = format!(
        "Share of the points seen that were used, %; empty where a camera saw nothing, × where a whole observation was left out{which}"
    );
    let table = tabular("views", "Points used, %", &head, &rows);
    format!("<p class=\"note\">{explained}.</p>{}{table}", legend())
}

fn legend() -> String {
    let step = |i: usize| {
        let label = if i == 10 { "all".into() } else { format!("{}", 10 * i) };
        format!("<span class=\"s{i}\">{label}</span>")
    };
    format!("<p class=\"scale\" aria-hidden=\"true\">{} %</p>", (0..=10).map(step).collect::<String>())
}

fn shown_views(run: &RigRun, cells: &BTreeMap<(usize, usize), Cell>) -> Vec<usize> {
    let n_views = run.rig.views.len();
    let most = (MOST_CELLS / run.rig.cameras.len().max(1)).max(1);
    if n_views <= most {
        return (0..n_views).collect();
    }
    let mut order: Vec<usize> = (0..n_views).collect();
    let shares: Vec<f64> = order.iter().map(|&view| whole(view, cells).share()).collect();
    order.sort_by(|&a, &b| shares[a].total_cmp(&shares[b]).then(a.cmp(&b)));
    order.truncate(most);
    order.sort_unstable();
    order
}

fn whole(view: usize, cells: &BTreeMap<(usize, usize), Cell>) -> Cell {
    let mut all = Cell::default();
    cells.range((view, 0)..(view + 1, 0)).for_each(|(_, cell)| all.add(cell));
    all
}

fn view_row(run: &RigRun, view: usize, cells: &BTreeMap<(usize, usize), Cell>) -> String {
    let name = escaped(&run.rig.views[view]);
    let cell = |camera: usize| match cells.get(&(view, camera)) {
        None => "<td></td>".to_string(),
        Some(cell) => {
            let camera = escaped(&run.rig.cameras[camera].name);
            let text = if cell.is_rejected { "×".into() } else { percent(cell) };
            format!(
                "<td class=\"s{}\" title=\"{camera}, {name}: {}\">{text}</td>",
                cell.tenths(),
                counts(cell)
            )
        }
    };
    let all = whole(view, cells);
    let columns: String = (0..run.rig.cameras.len()).map(cell).collect();
    let rms = if all.n_used == 0 { "–".into() } else { fixed(all.rms(), 3) };
    format!(
        "<tr data-view=\"{view}\"><th scope=\"row\">{name}</th>{columns}<td>{}/{}</td><td>{rms}</td></tr>\n",
        all.n_used, all.n_seen
    )
}

/// Writes whole per cents; 100 only where all points were used.
fn percent(cell: &Cell) -> String {
    if cell.n_used == cell.n_seen { "100".into() } else { format!("{:.0}", (100.0 * cell.share()).min(99.0)) }
}

fn counts(cell: &Cell) -> String {
    let rms = if cell.n_used == 0 { String::new() } else { format!(", rms {} px", fixed(cell.rms(), 2)) };
    let rejected = if cell.is_rejected { "; an observation left out whole" } else { "" };
    format!("{} of {} points{rms}{rejected}", cell.n_used, cell.n_seen)
}

/// Lists the observations that took no part, each with its reason.
pub(super) fn rejected(run: &RigRun) -> String {
    let all = run.rig.observations.iter().zip(&run.solution.observations);
    let rejected: Vec<_> = all.filter_map(|(s, r)| Some((s, r.rejected.as_ref()?))).collect();
    let lost = run.solution.n_seen.saturating_sub(run.solution.n_used);
    let points = format!(
        "<p>{} of {} points were left out.</p>",
        super::grouped(lost),
        super::grouped(run.solution.n_seen)
    );
    if rejected.is_empty() {
        return format!("{points}<p>Every observation took part.</p>");
    }
    let rows: String = rejected
        .iter()
        .take(MOST_REJECTED)
        .map(|(s, reason)| {
            let name = |names: &str| escaped(names);
            row(&[
                name(&run.rig.views[s.view]),
                name(&run.rig.cameras[s.camera].name),
                name(&run.rig.targets[s.target].name),
                s.seen.len().to_string(),
                escaped(&why(reason)),
            ])
        })
        .collect();
    let shown = if MOST_REJECTED < rejected.len() {
        format!(": the first {MOST_REJECTED} of {}", rejected.len())
    } else {
        String::new()
    };
    let caption = format!("Observations that took no part{shown}");
    format!(
        "{points}{}",
        tabular("rejected", &caption, &["view", "camera", "target", "points", "reason"], &rows)
    )
}

fn why(reason: &RejectedObservation) -> String {
    match reason {
        RejectedObservation::Undetermined(error) => {
            format!("its points determine no pose and nothing else in the view does: {error}")
        }
        RejectedObservation::Contradicts { rms_px } => format!(
            "it contradicts the other observations by {} px rms: wrong labels, a target that moved, or another view",
            fixed(*rms_px, 1)
        ),
        _ => "it took no part".into(),
    }
}
