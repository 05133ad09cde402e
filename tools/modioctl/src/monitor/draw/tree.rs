//! Draws the tree of ports and points.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use register_map::codes::ChannelStatus;
use tokio::time::Instant;

use super::{BAD, GOOD, OLD, SELECTED, clip, is_focused, titled};
use crate::monitor::layout::{Parts, VALUE, VALUE_AT, within};
use crate::monitor::link::ago;
use crate::monitor::model::{Focus, Model};
use crate::monitor::tree::Row;
use crate::names::{Item, PortItems};
use crate::value::{Shown, show};

/// Draws the tree.
pub fn draw(frame: &mut Frame, model: &mut Model, area: Rect, now: Instant) {
    if area.is_empty() {
        return;
    }
    let inside = Parts::inside(area);
    let height = usize::from(inside.height);
    let offset = model.tree.scrolled(height);
    let rows = model.tree.rows();
    let hidden = rows.len().saturating_sub(height);
    let title = match hidden {
        0 => "Ports and points".to_owned(),
        _ => format!(
            "Ports and points, rows {} to {} of {}",
            offset + 1,
            (offset + height).min(rows.len()),
            rows.len()
        ),
    };
    frame.render_widget(titled(title, is_focused(model, Focus::Tree)), area);
    let window = rows.iter().enumerate().skip(offset).take(height);
    for (y, (index, row)) in (0_u16..).zip(window) {
        let mut line = match row {
            Row::Port(item) => port(model, item, now),
            Row::Point(item) => point(model, item, now),
        };
        if index == model.tree.index() {
            line = line.style(SELECTED);
        }
        frame.render_widget(line, within(inside, 0, y, inside.width, 1));
    }
}

fn port(model: &Model, port: &PortItems, now: Instant) -> Line<'static> {
    let mark = match (port.points.is_empty(), model.tree.is_open(port.number)) {
        (true, _) => ' ',
        (false, true) => '▾',
        (false, false) => '▸',
    };
    let module = match port.module.as_str() {
        "none" => "no module",
        name => name,
    };
    let left = format!("{mark} p{:<3} {module:<10} ", port.number);
    let state_name = format!("p{}.module_state", port.number);
    let (state, style) = if model.refusal(port.number).is_some() {
        ("× its points are refused".to_owned(), BAD)
    } else if model.waits(port.number) {
        ("× waits for a restart".to_owned(), BAD)
    } else {
        judged(model, &state_name, now)
    };
    let room = 50_usize.saturating_sub(left.chars().count());
    Line::from(vec![
        Span::raw(left),
        Span::styled(clip(&state, room), style),
    ])
}

fn point(model: &Model, item: &Item, now: Instant) -> Line<'static> {
    let (value, fresh) = value(model, item, now);
    let status = format!("{}.channel_status", item.name);
    let (status, status_style) = match model.value(&item.name, now) {
        Some((value, false)) => {
            let age = now.saturating_duration_since(value.at);
            (format!("old: {}", ago(age)), OLD)
        }
        None => ("not known".to_owned(), OLD),
        Some((_, true)) => {
            let (text, style) = judged(model, &status, now);
            match model.held(item, now) {
                Some(_) if style != BAD => ("held by a link".to_owned(), style),
                _ => (text, style),
            }
        }
    };
    let style = if fresh { Style::new() } else { OLD };
    let left = format!("  {:<4} {:<15}", item.name, item.about);
    let left = clip(&left, VALUE_AT.into());
    let value = clip(&value, VALUE.into());
    let pad = usize::from(VALUE).saturating_sub(Span::raw(value.as_str()).width());
    Line::from(vec![
        Span::styled(left, style),
        Span::styled(format!("{}{value} ", " ".repeat(pad)), style),
        Span::styled(status, status_style),
    ])
}

/// Returns the value of a point for people, and whether it is fresh. Outputs that can be set are in brackets. An arrow marks a
/// value that is being written.
fn value(model: &Model, item: &Item, now: Instant) -> (String, bool) {
    let read = model.value(&item.name, now);
    let fresh = read.is_some_and(|(_, fresh)| fresh);
    let shown = match (model.pending.get(&item.name), read) {
        (Some(pending), _) => format!("→ {}", show(item, &pending.words, false)),
        (None, None) => "?".to_owned(),
        (None, Some((value, _))) => with_mark(&show(item, &value.words, false)),
    };
    if item.writable && model.held(item, now).is_none() {
        (format!("[{shown}]"), fresh)
    } else {
        (format!("{shown} "), fresh)
    }
}

/// Returns a digital value with a mark that is easy to see.
fn with_mark(shown: &Shown) -> String {
    match shown.text.as_str() {
        "on" => "■ on".to_owned(),
        "off" => "□ off".to_owned(),
        _ => shown.to_string(),
    }
}

/// Returns the text of a code, and its colour: 0 and 1 mean no fault.
fn judged(model: &Model, name: &str, now: Instant) -> (String, Style) {
    let Some((value, fresh)) = model.value(name, now) else {
        return (String::new(), OLD);
    };
    let item = model.book.item(name);
    let text = item.map_or_else(String::new, |item| {
        show(item, &value.words, false).to_string()
    });
    let code = value.words.first().copied().unwrap_or_default();
    let is_module = name.ends_with("module_state");
    let is_good = [ChannelStatus::Waits, ChannelStatus::Ended].map(ChannelStatus::code);
    match (fresh, code) {
        (false, _) => (format!("old: {text}"), OLD),
        (true, 0) => (text, GOOD),
        (true, 1) if is_module => (String::new(), OLD),
        (true, code) if !is_module && is_good.contains(&code) => (text, GOOD),
        (true, _) => (format!("× {text}"), BAD),
    }
}
