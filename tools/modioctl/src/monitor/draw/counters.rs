//! Draws the counters of the line: those of the unit and those of this program.

use std::time::Duration;

use ratatui::Frame;
use ratatui::layout::Constraint::{Fill, Length};
use ratatui::layout::{Layout, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;
use tokio::time::Instant;

use super::{OLD, clip, titled};
use crate::monitor::link::ago;
use crate::monitor::model::Model;
use crate::monitor::plan::Plan;
use crate::value::show;

const NAME: usize = 25;

/// Draws the counters.
pub fn draw(frame: &mut Frame, model: &Model, area: Rect, now: Instant) {
    if area.is_empty() {
        return;
    }
    let [left, _, right] = Layout::horizontal([Fill(1), Length(1), Fill(1)]).areas(area);
    let unit = Paragraph::new(of_unit(model, left.width, now));
    frame.render_widget(unit.block(titled("Counted by the unit", false)), left);
    let own = Paragraph::new(of_program(model, right.width));
    frame.render_widget(own.block(titled("Counted here", false)), right);
}

fn of_unit(model: &Model, width: u16, now: Instant) -> Vec<Line<'static>> {
    let plan = Plan::new(&model.book);
    let status = plan
        .state
        .iter()
        .filter(|item| item.name == "uptime" || item.name == "status");
    let items = plan.counters.iter().chain(status);
    let lines = items.map(|item| match model.counter(&item.name, now) {
        None => row(width, &item.name, "?", OLD),
        Some((value, true)) => {
            let shown = show(item, &value.words, false).to_string();
            row(width, &item.name, &shown, Style::new())
        }
        Some((value, false)) => {
            let shown = show(item, &value.words, false);
            let age = ago(now.saturating_duration_since(value.at));
            row(width, &item.name, &format!("{shown} (old: {age})"), OLD)
        }
    });
    lines.collect()
}

fn of_program(model: &Model, width: u16) -> Vec<Line<'static>> {
    let counts = &model.frames.counts;
    let time = |time: Option<Duration>| {
        time.map_or_else(|| "?".to_owned(), |time| format!("{} ms", time.as_millis()))
    };
    let rows = [
        ("requests", counts.requests.to_string()),
        ("no answer", counts.no_answer.to_string()),
        ("garbled answers", counts.garbled.to_string()),
        ("exceptions received", counts.exceptions.to_string()),
        ("connections lost", counts.lost.to_string()),
        ("round trip, last", time(counts.trip)),
        ("round trip, mean", time(counts.mean())),
        ("round trip, longest", time(Some(counts.longest))),
        ("time to read all points", time(Some(model.took))),
    ];
    let rows = rows.iter();
    rows.map(|(name, text)| row(width, name, text, Style::new()))
        .collect()
}

fn row(width: u16, name: &str, text: &str, style: Style) -> Line<'static> {
    let text = clip(&format!("{name:<NAME$}{text}"), width.into());
    Line::from(Span::styled(text, style))
}
