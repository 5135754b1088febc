//! One line for each camera, or pair of camera and target.

use super::bars::bars;
use super::picture::Picture;
use crate::live::State;
use ratatui::Frame;
use ratatui::layout::{Alignment, Constraint, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Text};
use ratatui::widgets::{Cell, Row, Table, TableState};

/// A column: its head, its width, and the smallest width of the terminal that has room for it.
struct Column {
    head: &'static str,
    width: u16,
    from_width: u16,
    cell: fn(&Picture<'_>, usize) -> String,
}

const COLUMNS: [Column; 5] = [
    Column { head: "rotation", width: 9, from_width: 0, cell: turn },
    Column { head: "FPS", width: 6, from_width: 42, cell: rate },
    Column { head: "latency ms", width: 12, from_width: 56, cell: latency },
    Column { head: "dropped", width: 7, from_width: 64, cell: dropped },
    Column { head: "± turn", width: 8, from_width: 100, cell: scatter },
];
/// Width of the names; longer ones are cut.
const NAME: u16 = 20;
/// Width of the sign and word of the longest state.
const STATE: u16 = 14;
/// Smallest width of the terminal with a trail, which takes the remaining width.
const TRAIL_FROM: u16 = 72;

/// Draws the table, scrolled to the selected line.
pub fn draw(frame: &mut Frame<'_>, area: Rect, picture: &Picture<'_>) {
    let names = picture.board.names.pairs();
    let longest = names.iter().map(|name| Line::from(name.as_str()).width()).max().unwrap_or(4);
    let name_width = (longest as u16).clamp(6, NAME);
    let columns: Vec<&Column> = COLUMNS.iter().filter(|column| column.from_width <= area.width).collect();
    let mut widths = vec![Constraint::Length(name_width), Constraint::Length(STATE)];
    widths.extend(columns.iter().map(|column| Constraint::Length(column.width)));
    let used: u16 = 2 + name_width + STATE + columns.iter().map(|column| column.width + 1).sum::<u16>() + 1;
    let trail_width = area.width.saturating_sub(used + 1);
    if TRAIL_FROM <= area.width {
        widths.push(Constraint::Length(trail_width));
    }
    let rows = names.iter().enumerate().map(|(pair, name)| row(picture, pair, name, &columns, trail_width));
    let table = Table::new(rows, widths)
        .header(heads(picture, &columns))
        .column_spacing(1)
        .highlight_symbol("▶ ")
        .row_highlight_style(Style::new().add_modifier(Modifier::BOLD));
    let mut state = TableState::new().with_selected(picture.view.chosen);
    frame.render_stateful_widget(table, area, &mut state);
}

fn heads<'a>(picture: &Picture<'_>, columns: &[&Column]) -> Row<'a> {
    let mut cells = vec![Cell::from("camera"), Cell::from("state")];
    cells.extend(columns.iter().map(|column| Cell::from(right(column.head.to_string()))));
    cells.push(Cell::from("through time"));
    Row::new(cells).style(picture.color(Color::DarkGray))
}

fn row<'a>(picture: &Picture<'_>, pair: usize, name: &str, columns: &[&Column], trail_width: u16) -> Row<'a> {
    let (sign, word, color) = picture.sign(pair);
    let mut cells =
        vec![Cell::from(name.to_string()), Cell::from(format!("{sign} {word}")).style(picture.color(color))];
    cells.extend(columns.iter().map(|column| Cell::from(right((column.cell)(picture, pair)))));
    cells.push(Cell::from(small_trail(picture, pair, trail_width)).style(picture.color(color)));
    Row::new(cells)
}

fn right<'a>(text: String) -> Text<'a> {
    Text::from(text).alignment(Alignment::Right)
}

/// Shown for an unknown value.
const NONE: &str = "–";

/// Returns the present rotation; the drift's own rotation, once there is one.
fn turn(picture: &Picture<'_>, pair: usize) -> String {
    let pair = &picture.board.pairs[pair];
    let rotation_rad = match &pair.state {
        Some(State::Drifted(drift)) => match drift.pure_rotation() {
            Some((turn, _)) => Some(turn.norm()),
            None => Some(drift.old_from_new.fixed_rows::<3>(0).norm()),
        },
        _ => pair.trail().last_rad(),
    };
    rotation_rad.map_or(NONE.to_string(), |rotation_rad| format!("{:.3}°", rotation_rad.to_degrees()))
}

fn rate(picture: &Picture<'_>, pair: usize) -> String {
    match picture.board.pairs[pair].rate.per_s(picture.now.up_s) {
        None => NONE.to_string(),
        Some(rate) if 0.0 < rate && rate < 1.0 => format!("{rate:.2}"),
        Some(rate) if rate < 1000.0 => format!("{rate:.1}"),
        Some(rate) => format!("{rate:.0}"),
    }
}

/// Returns p50/p99.
fn latency(picture: &Picture<'_>, pair: usize) -> String {
    let latency_us = &picture.board.pairs[pair].latency_us;
    match (latency_us.quantile(0.5), latency_us.quantile(0.99)) {
        (Some(p50), Some(p99)) => format!("{}/{}", ms(p50), ms(p99)),
        _ => NONE.to_string(),
    }
}

/// Returns milliseconds from microseconds, with three digits.
pub fn ms(us: f64) -> String {
    match us / 1e3 {
        ms if ms < 10.0 => format!("{ms:.2}"),
        ms if ms < 100.0 => format!("{ms:.1}"),
        ms => format!("{ms:.0}"),
    }
}

fn dropped(picture: &Picture<'_>, pair: usize) -> String {
    picture.board.camera_of(pair).map_or(NONE.to_string(), |camera| camera.dropped.to_string())
}

/// Returns the standard deviation of the rotation of a frame, the three axes together.
fn scatter(picture: &Picture<'_>, pair: usize) -> String {
    let sigma = picture.board.pairs[pair].spread.sigma();
    sigma.map_or(NONE.to_string(), |sigma| format!("{:.3}°", sigma.fixed_rows::<3>(0).norm().to_degrees()))
}

fn small_trail(picture: &Picture<'_>, pair: usize, width: u16) -> String {
    let columns = picture.board.trail_columns(pair, usize::from(width), picture.now);
    let most_rad = super::panel::scale_rad(&picture.board.pairs[pair], &columns);
    bars(&columns, most_rad, 1).pop().unwrap_or_default()
}
