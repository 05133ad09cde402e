//! Draws the log of frames.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::{OLD, clip, is_focused, titled};
use crate::bus::Direction;
use crate::monitor::layout::Parts;
use crate::monitor::model::{Focus, Model};

/// Draws the log.
pub fn draw(frame: &mut Frame, model: &Model, area: Rect) {
    if area.is_empty() {
        return;
    }
    let frames = &model.frames;
    let state = match (frames.paused, frames.below()) {
        (true, below) => format!(", paused, {below} newer"),
        (false, 0) => String::new(),
        (false, below) => format!(", {below} newer"),
    };
    let title = format!("Frames{state}");
    let inside = Parts::inside(area);
    let lines = frames.window(inside.height.into()).map(|entry| {
        let arrow = match entry.direction {
            Direction::Request => "→",
            Direction::Response => "←",
        };
        let text = if frames.hex {
            &entry.bytes
        } else {
            &entry.text
        };
        let room = usize::from(inside.width).saturating_sub(15);
        Line::from(vec![
            Span::styled(entry.at.format("%H:%M:%S%.3f ").to_string(), OLD),
            Span::raw(format!("{arrow} {}", clip(text, room))),
        ])
    });
    let log = Paragraph::new(lines.collect::<Vec<_>>());
    let block = titled(title, is_focused(model, Focus::Frames));
    frame.render_widget(log.block(block), area);
}
