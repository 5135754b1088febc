//! The image: header, table of cameras, the selected one, messages, keys. Small terminals show less of it.

use super::super::super::log::Line as EventText;
use super::picture::{Picture, duration};
use super::{details, panel, table};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, BorderType, Paragraph};

/// Smallest width with boxes; below it there are lines.
const BOXES_COLUMNS: u16 = 72;
const BOXES_ROWS: u16 = 18;
/// Rows of the panel of the selected camera, box included.
const PANEL_ROWS: u16 = 11;

/// Draws the image.
pub fn draw(frame: &mut Frame<'_>, picture: &Picture<'_>) {
    let [head, middle, foot] =
        Layout::vertical([Constraint::Length(1), Constraint::Min(1), Constraint::Length(1)])
            .areas(frame.area());
    header(frame, head, picture);
    keys(frame, foot, picture);
    if frame.area().width < BOXES_COLUMNS || frame.area().height < BOXES_ROWS {
        without_boxes(frame, middle, picture);
    } else {
        with_boxes(frame, middle, picture);
    }
}

fn with_boxes(frame: &mut Frame<'_>, area: Rect, picture: &Picture<'_>) {
    // Rows of the table with its heads and its box; a long one leaves room for the rest and scrolls.
    let cameras = (picture.board.pairs.len() as u16).saturating_add(3).min(area.height / 3).max(4);
    let [above, below] = Layout::vertical([Constraint::Length(cameras), Constraint::Min(0)]).areas(area);
    let inner = boxed(frame, above, "cameras", picture);
    table::draw(frame, inner, picture);
    if picture.view.has_details {
        let inner = boxed(frame, below, &picture.title(), picture);
        return details::draw(frame, inner, picture);
    }
    let chosen = PANEL_ROWS + below.height.saturating_sub(PANEL_ROWS + 6).min(5);
    let [middle, last] = Layout::vertical([Constraint::Length(chosen), Constraint::Min(0)]).areas(below);
    let inner = boxed(frame, middle, &picture.title(), picture);
    panel::draw(frame, inner, picture);
    if 2 < last.height {
        let inner = boxed(frame, last, "log", picture);
        log(frame, inner, picture);
    }
}

/// Draws a table of few columns, the selected camera in words, and the last message if there is room.
fn without_boxes(frame: &mut Frame<'_>, area: Rect, picture: &Picture<'_>) {
    let cameras = (picture.board.pairs.len() as u16).saturating_add(1).min((area.height / 2).max(2));
    let [above, below] = Layout::vertical([Constraint::Length(cameras), Constraint::Min(0)]).areas(area);
    table::draw(frame, above, picture);
    if picture.view.has_details {
        return details::draw(frame, below, picture);
    }
    let words = panel::words(picture, below.width);
    let [words_area, log_area] =
        Layout::vertical([Constraint::Length(words.len() as u16), Constraint::Min(0)]).areas(below);
    frame.render_widget(Paragraph::new(words), words_area);
    log(frame, log_area, picture);
}

fn boxed(frame: &mut Frame<'_>, area: Rect, title: &str, picture: &Picture<'_>) -> Rect {
    let title = Span::styled(format!(" {title} "), Style::new().add_modifier(Modifier::BOLD));
    let block = Block::bordered()
        .border_type(BorderType::Rounded)
        .border_style(picture.color(Color::DarkGray))
        .title(title);
    let inner = block.inner(area);
    frame.render_widget(block, area);
    inner
}

fn header(frame: &mut Frame<'_>, area: Rect, picture: &Picture<'_>) {
    let mut spans = vec![Span::styled(" resight watch ", Style::new().add_modifier(Modifier::BOLD))];
    for (count, word, color) in picture.counts() {
        spans.push(Span::styled(format!(" {count} {word} "), picture.color(color)));
    }
    if picture.view.is_paused {
        spans.push(Span::styled(" PAUSED ", Style::new().add_modifier(Modifier::REVERSED)));
    }
    if picture.board.is_over {
        spans.push(Span::raw(" all sources have ended "));
    }
    frame.render_widget(Line::from(spans), area);
    let up_s = picture.now.up_s as u64;
    let time = match area.width {
        BOXES_COLUMNS.. => format!("{} UTC  up {} ", clock(picture.now.unix_s), duration(up_s as f64)),
        _ => format!("{} ", clock(picture.now.unix_s)),
    };
    let used = Line::from(time.as_str()).width() as u16;
    let is_free = picture.view.is_paused || picture.board.is_over;
    if (picture.counts().len() as u16) * 13 + 15 + used + 24 * u16::from(is_free) <= area.width {
        frame.render_widget(Line::raw(time).right_aligned(), area);
    }
}

fn keys(frame: &mut Frame<'_>, area: Rect, picture: &Picture<'_>) {
    let all = [
        ("q", "quit"),
        ("r", "reset statistics"),
        ("↑↓", "camera"),
        ("Enter", if picture.view.has_details { "back" } else { "details" }),
        ("p", if picture.view.is_paused { "go on" } else { "pause" }),
    ];
    let is_narrow = area.width < 56;
    let mut spans = Vec::new();
    for (key, what) in all {
        let what = match (is_narrow, what) {
            (true, "camera") => "",
            (true, long) => long.split(' ').next().unwrap_or(long),
            (false, what) => what,
        };
        spans.push(Span::styled(format!(" {key}"), picture.color(Color::Cyan).add_modifier(Modifier::BOLD)));
        spans.push(Span::raw(if what.is_empty() { String::new() } else { format!(" {what}") }));
        spans.push(Span::raw(if is_narrow { "" } else { "   " }));
    }
    frame.render_widget(Line::from(spans), area);
}

/// Draws events and messages of the session in order of time; the newest at the bottom.
fn log(frame: &mut Frame<'_>, area: Rect, picture: &Picture<'_>) {
    let mut all: Vec<&EventText> =
        picture.board.reported.iter().map(|reported| &reported.line).chain(picture.lines).collect();
    all.sort_by(|a, b| a.unix_s.total_cmp(&b.unix_s));
    let first = all.len().saturating_sub(usize::from(area.height));
    let line = |said: &&EventText| {
        let time = Span::styled(format!("{} ", clock(said.unix_s)), picture.color(Color::DarkGray));
        Line::from(vec![time, Span::raw(shortened(&said.text, usize::from(area.width).saturating_sub(9)))])
    };
    frame.render_widget(Paragraph::new(all[first..].iter().map(line).collect::<Vec<_>>()), area);
}

/// Shortens a text that does not fit and adds a sign for the rest.
fn shortened(text: &str, width: usize) -> String {
    if Line::from(text).width() <= width {
        return text.to_string();
    }
    text.chars().take(width.saturating_sub(1)).chain(['…']).collect()
}

/// Returns the time of day, UTC.
fn clock(unix_s: f64) -> String {
    duration(unix_s.max(0.0) % 86_400.0)
}

#[cfg(test)]
mod tests;
