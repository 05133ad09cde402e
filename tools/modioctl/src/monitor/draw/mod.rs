//! Draws the display. It uses the terminal's own 16 colours, and no information is shown by colour only.

mod chart;
mod counters;
mod frames;
mod overlay;
#[cfg(test)]
mod tests;
mod tree;

use std::fmt::Display;

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Paragraph, Wrap};
use tokio::time::Instant;

use super::input::focus;
use super::layout::{AGAIN, DROP, LEAST, Parts, within};
use super::link::{State, ago};
use super::model::{Focus, Model};

/// Draws the whole display.
pub fn draw(frame: &mut Frame, model: &mut Model, now: Instant) {
    let screen = frame.area();
    let (width, height) = LEAST;
    if screen.width < width || screen.height < height {
        let text = format!(
            "The terminal has {} x {} characters; the monitor needs {width} x {height}. q quits.",
            screen.width, screen.height
        );
        frame.render_widget(Paragraph::new(text).wrap(Wrap { trim: true }), screen);
        return;
    }
    let parts = Parts::new(screen, model.page);
    head(frame, model, parts.head, now);
    tabs(frame, model, &parts);
    tree::draw(frame, model, parts.tree, now);
    chart::draw(frame, model, parts.chart, now);
    counters::draw(frame, model, parts.counters, now);
    frames::draw(frame, model, parts.frames);
    message(frame, model, &parts, now);
    keys(frame, model, parts.keys);
    overlay::slider(frame, model, now);
    overlay::help(frame, model);
}

const GOOD: Style = Style::new().fg(Color::Green);
const BAD: Style = Style::new().fg(Color::Red).add_modifier(Modifier::BOLD);
/// Style of values that are not fresh.
const OLD: Style = Style::new().add_modifier(Modifier::DIM);
const STRONG: Style = Style::new().add_modifier(Modifier::BOLD);
const SELECTED: Style = Style::new().add_modifier(Modifier::REVERSED);

/// Returns a part with a title. The title of the part that receives the keys is emphasised.
fn titled(title: impl Display, focused: bool) -> Block<'static> {
    let style = if focused { STRONG } else { Style::new() };
    let mark = if focused { "» " } else { "" };
    Block::new()
        .borders(Borders::TOP)
        .title(Span::styled(format!("{mark}{title} "), style))
}

fn is_focused(model: &Model, part: Focus) -> bool {
    focus(model) == part
}

fn head(frame: &mut Frame, model: &Model, area: Rect, now: Instant) {
    let (text, style) = state(model, now);
    let name = if model.title.is_empty() {
        "modio"
    } else {
        &model.title
    };
    let right = Line::from(Span::styled(text, style)).right_aligned();
    let left_width = usize::from(area.width).saturating_sub(right.width() + 1);
    let left = clip(
        &format!("{name}, unit {}, {}", model.unit, model.place),
        left_width,
    );
    frame.render_widget(Line::from(Span::styled(left, STRONG)), area);
    frame.render_widget(right, area);
}

fn state(model: &Model, now: Instant) -> (String, Style) {
    let since = |what: &str, duration| format!("× {what}no answer since {}", ago(duration));
    match model.link.state(now) {
        State::Answers if model.title.is_empty() => ("· connecting".to_owned(), OLD),
        State::Answers => ("● answers".to_owned(), GOOD),
        State::NoAnswer(duration) => (since("", duration), BAD),
        State::Garbled(duration) => (since("garbled, ", duration), BAD),
        State::PortLost(duration) => (since("port lost, ", duration), BAD),
        State::Refuses(duration) => (format!("× refused, no values since {}", ago(duration)), BAD),
    }
}

fn tabs(frame: &mut Frame, model: &Model, parts: &Parts) {
    for (page, name, area) in parts.pages() {
        let style = if page == model.page {
            SELECTED
        } else {
            Style::new()
        };
        frame.render_widget(Span::styled(name, style), area);
    }
    let right = match model.mouse {
        true => "? help",
        false => "mouse off   ? help",
    };
    frame.render_widget(Line::from(right).right_aligned(), parts.tabs);
}

fn message(frame: &mut Frame, model: &Model, parts: &Parts, now: Instant) {
    let area = parts.message;
    if let Some(failed) = model.failed.last() {
        let more = match model.failed.len() {
            1 => String::new(),
            count => format!("  ({} more failed)", count - 1),
        };
        let [first, second] = [0, 1].map(|y| within(area, 0, y, area.width, 1));
        let text = clip(&format!("× {}", failed.text), first.width.into());
        frame.render_widget(Span::styled(text, BAD), first);
        let buttons = format!("{AGAIN} {DROP}{more}");
        frame.render_widget(Span::styled(buttons, STRONG), second);
        return;
    }
    let trouble = model.link.trouble().map(ToString::to_string);
    let status = model.status(now);
    let status = || status.map(|text| format!("The unit reports: {text}"));
    let notice = model.notice(now).map(str::to_owned);
    let text = notice.or(trouble).or_else(status).unwrap_or_default();
    let paragraph = Paragraph::new(text).wrap(Wrap { trim: true });
    frame.render_widget(paragraph, area);
}

fn keys(frame: &mut Frame, model: &Model, area: Rect) {
    let text = match focus(model) {
        Focus::Tree => "↑↓ select  Space/Enter switch or set  ←→ close, open  Tab log  q quit",
        Focus::Frames => "↑↓ PgUp PgDn scroll  p pause  x bytes  Tab tree  1 2 pages  q quit",
    };
    let text = clip(text, area.width.into());
    frame.render_widget(Span::styled(text, OLD), area);
}

/// Returns text that fits a width, with `…` where it was cut.
fn clip(text: &str, width: usize) -> String {
    if Span::raw(text).width() <= width {
        return text.to_owned();
    }
    let mut clipped = String::new();
    for character in text.chars() {
        clipped.push(character);
        if Span::raw(&clipped).width() >= width {
            clipped.pop();
            break;
        }
    }
    clipped.push('…');
    clipped
}
