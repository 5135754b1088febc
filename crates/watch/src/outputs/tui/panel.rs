//! The panel of the selected camera: its state in words, times, scatter, and the rotation over time.

use super::bars::bars;
use super::picture::{Picture, duration};
use crate::board::pair::PairBoard;
use crate::board::statistics::Rolling;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Color;
use ratatui::text::{Line, Span, Text};
use ratatui::widgets::Paragraph;
use resight::core::Vector6;
use resight::core::temporal::monitor::{Reading, rotation_alone};

/// Smallest scale of a rotation, even where the noise is unknown.
const LEAST_SCALE_RAD: f64 = 1e-5;
/// Largest number of lines for the words of a state.
const WORDS: usize = 3;

/// Draws the panel, which has at least eight lines.
pub fn draw(frame: &mut Frame<'_>, area: Rect, picture: &Picture<'_>) {
    let Some(pair) = picture.board.pairs.get(picture.view.chosen) else { return };
    let words = words(picture, area.width);
    let [said, times, caption, drawn] = Layout::vertical([
        Constraint::Length(words.len() as u16),
        Constraint::Length(4),
        Constraint::Length(1),
        Constraint::Min(1),
    ])
    .areas(area);
    frame.render_widget(Paragraph::new(words), said);
    let [left, right] = Layout::horizontal([Constraint::Length(46), Constraint::Min(0)]).areas(times);
    frame.render_widget(stages(picture, pair), left);
    frame.render_widget(scatter(picture, pair), right);
    trail(frame, caption, drawn, picture, pair);
}

/// Returns the state in words and the reason why nothing is observed, in at most three lines.
pub fn words<'a>(picture: &Picture<'_>, width: u16) -> Vec<Line<'a>> {
    let Some(pair) = picture.board.pairs.get(picture.view.chosen) else { return Vec::new() };
    let (sign, _, color) = picture.sign(picture.view.chosen);
    let camera = picture.board.camera_of(picture.view.chosen);
    let mut text = format!("{sign} {}", pair.words(picture.now));
    if let Some(reason) = camera.and_then(|camera| camera.lost.as_ref()) {
        text += &format!("; source lost: {reason}");
    } else if camera.is_some_and(|camera| camera.has_ended) {
        text += "; its source has ended";
    }
    let lines = wrapped(&text, usize::from(width));
    lines.into_iter().take(WORDS).map(|line| Line::styled(line, picture.color(color))).collect()
}

/// Breaks a text at spaces; words longer than a line are not broken.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if Line::from(line.as_str()).width() + 1 + Line::from(word).width() <= width => {
                *line += &format!(" {word}");
            }
            _ => lines.push(word.to_string()),
        }
    }
    lines
}

/// Returns the microseconds of each stage.
fn stages<'a>(picture: &Picture<'_>, pair: &PairBoard) -> Text<'a> {
    let stages = [&pair.waited_us, &pair.detect_us, &pair.solve_us, &pair.decide_us];
    let line = |name: &str, number: &dyn Fn(&Rolling) -> Option<f64>| {
        let numbers = stages.map(|stage| format!("{:>9}", number(stage).map_or("–".to_string(), us)));
        Line::raw(format!("{name:<7}{}", numbers.concat()))
    };
    let heads = format!("{:<7}{:>9}{:>9}{:>9}{:>9}", "µs", "waited", "detect", "solve", "decide");
    Text::from(vec![
        Line::styled(heads, picture.color(Color::DarkGray)),
        line("last", &|stage| stage.last()),
        line("median", &|stage| stage.quantile(0.5)),
        line("p99", &|stage| stage.quantile(0.99)),
    ])
}

fn us(us: f64) -> String {
    if us < 10.0 { format!("{us:.1}") } else { format!("{us:.0}") }
}

/// Returns the standard deviations of the pose of a frame.
fn scatter<'a>(picture: &Picture<'_>, pair: &PairBoard) -> Text<'a> {
    let sigma = pair.spread.sigma();
    let line = |name: &str, first: usize, scale: f64, decimals: usize| {
        let number = |i: usize| sigma.map_or("–".to_string(), |s| format!("{:.decimals$}", s[i] * scale));
        Line::raw(format!("{name:<7}{:>8}{:>8}{:>8}", number(first), number(first + 1), number(first + 2)))
    };
    Text::from(vec![
        Line::styled(format!("{:<7}{:>8}{:>8}{:>8}", "±", "x", "y", "z"), picture.color(Color::DarkGray)),
        line("rot. °", 0, f64::to_degrees(1.0), 4),
        line("mm", 3, 1e3, 3),
        Line::styled(format!("std-dev of {} frames", pair.spread.len()), picture.color(Color::DarkGray)),
    ])
}

fn trail(frame: &mut Frame<'_>, caption: Rect, drawn: Rect, picture: &Picture<'_>, pair: &PairBoard) {
    let columns = picture.board.trail_columns(picture.view.chosen, usize::from(drawn.width), picture.now);
    let most_rad = scale_rad(pair, &columns);
    let says = match columns.iter().any(Option::is_some) {
        true => format!(
            "rotation against the reference{}, over {}; full height {:.3}°",
            if pair.has_shifted() { "" } else { " if pure" },
            duration(pair.trail().span_s()),
            most_rad.to_degrees()
        ),
        false => "rotation against the reference: nothing to compare yet".to_string(),
    };
    frame.render_widget(Span::styled(says, picture.color(Color::DarkGray)), caption);
    let (_, _, color) = picture.sign(picture.view.chosen);
    let lines = bars(&columns, most_rad, usize::from(drawn.height).clamp(1, 5));
    let lines = lines.into_iter().map(|line| Line::styled(line, picture.color(color)));
    frame.render_widget(Paragraph::new(lines.collect::<Vec<_>>()), drawn);
}

/// Returns the rotation of a full bar: the largest one, but not so small that a steady camera's noise fills the image.
pub fn scale_rad(pair: &PairBoard, columns: &[Option<f64>]) -> f64 {
    let noise_rad = |reading: &Reading| {
        let turn = match pair.has_shifted() {
            true => reading.covariance.fixed_view::<3, 3>(0, 0).trace(),
            false => {
                rotation_alone(&Vector6::zeros(), &reading.covariance).map_or(0.0, |(_, turn)| turn.trace())
            }
        };
        turn.max(0.0).sqrt()
    };
    let noise_rad = pair.last.as_ref().and_then(|last| last.reading.as_ref()).map_or(0.0, noise_rad);
    columns.iter().flatten().copied().fold((2.0 * noise_rad).max(LEAST_SCALE_RAD), f64::max)
}
