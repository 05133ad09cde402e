//! Draws the details of the selected point: the chart of an analog point, the state of other points.

use chrono::Local;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Chart, Dataset, GraphType, Paragraph, Wrap};
use tokio::time::Instant;

use super::{OLD, STRONG, titled};
use crate::links::{self, sentence};
use crate::monitor::history::{SPAN, extent};
use crate::monitor::link::ago;
use crate::monitor::model::Model;
use crate::monitor::plan::is_digital_input;
use crate::monitor::tree::Row;
use crate::names::{Item, Meaning};
use crate::value::{show, unit_name};

/// Draws the chart.
pub fn draw(frame: &mut Frame, model: &Model, area: Rect, now: Instant) {
    if area.is_empty() || area.width < 16 {
        return;
    }
    match model.tree.selected() {
        None => frame.render_widget(titled("Selected", false), area),
        Some(Row::Port(port)) => {
            let text = if model.waits(port.number) {
                "MODULE of this port has been changed. RANGE and SCALE belong to the new module, so the monitor cannot say what the analog values mean. Restart the unit."
            } else if port.points.is_empty() {
                "The slot is empty. Plug in a module and set it with `modioctl module set`."
            } else {
                model.refusal(port.number).unwrap_or("Select a point.")
            };
            let paragraph = Paragraph::new(text).wrap(Wrap { trim: true });
            let block = titled(format!("p{}", port.number), false);
            frame.render_widget(paragraph.block(block), area);
        }
        Some(Row::Point(item)) => match &item.meaning {
            Meaning::Analog(_) => chart(frame, model, item, area, now),
            _ => facts(frame, model, item, area, now),
        },
    }
}

fn facts(frame: &mut Frame, model: &Model, item: &Item, area: Rect, now: Instant) {
    let value = model.value(&item.name, now);
    let mut lines = vec![
        Line::from(item.about.clone()),
        Line::from(format!("address {:#06X}", item.address)),
    ];
    let (text, style) = match value {
        None => ("value not known".to_owned(), OLD),
        Some((value, true)) => (show(item, &value.words, false).to_string(), STRONG),
        Some((value, false)) => {
            let age = ago(now.saturating_duration_since(value.at));
            let was = show(item, &value.words, false);
            (format!("was {was}, {age} ago"), OLD)
        }
    };
    lines.push(Line::from(Span::styled(text, style)));
    let mut links = links(model, item, now).peekable();
    if links.peek().is_some() {
        lines.push(Line::default());
        lines.extend(links);
    }
    let mut edges = edges(model, item).peekable();
    if edges.peek().is_some() {
        lines.push(Line::default());
        lines.push(Line::from("Last edges:"));
        lines.extend(edges);
    }
    if item.writable {
        let held = model.held(item, now);
        let text = held.map_or_else(
            || "Space switches it.".to_owned(),
            |held| format!("{} is {held}.", item.name),
        );
        lines.push(Line::default());
        lines.push(Line::from(text));
    }
    if item.meaning == Meaning::Unknown {
        lines.push(Line::from("RANGE and SCALE are not known."));
    }
    let facts = Paragraph::new(lines).wrap(Wrap { trim: true });
    frame.render_widget(facts.block(titled(&item.name, false)), area);
}

/// Iterates over the links to an output, or from an input, in words.
fn links(model: &Model, point: &Item, now: Instant) -> impl Iterator<Item = Line<'static>> {
    let links = links::all(&model.book).unwrap_or_default();
    let own: Vec<_> = links::of(&model.book, &point.name).collect();
    links.into_iter().filter_map(move |link| {
        let (value, fresh) = model.counter(&link.name, now)?;
        let is_from = value.words.first() == Some(&point.address);
        let is_shown = links::acts(&value.words) && (own.contains(&link) || is_from);
        let style = if fresh { Style::new() } else { OLD };
        let text = sentence(&model.book, &link, &value.words);
        is_shown.then(|| Line::from(Span::styled(text, style)))
    })
}

/// Iterates over the last edges of a digital input, newest first, in words.
fn edges(model: &Model, item: &Item) -> impl Iterator<Item = Line<'static>> {
    let now = Local::now();
    let edges = is_digital_input(item).then(|| model.edges(item.address));
    edges.into_iter().flatten().map(move |edge| {
        let level = if edge.on { "on" } else { "off" };
        let time = edge.at.format("%H:%M:%S%.3f");
        let age = ago((now - edge.at).to_std().unwrap_or_default());
        let late = if edge.late {
            ", or earlier, within an erase of flash"
        } else {
            ""
        };
        Line::from(format!("{level:<3} {time}  {age} ago{late}"))
    })
}

fn chart(frame: &mut Frame, model: &Model, item: &Item, area: Rect, now: Instant) {
    let Meaning::Analog(reading) = &item.meaning else {
        return;
    };
    let unit = unit_name(&reading.unit.code);
    let title = match unit {
        "" => format!("{}, last {} min", item.name, SPAN.as_secs() / 60),
        unit => format!("{} in {unit}, last {} min", item.name, SPAN.as_secs() / 60),
    };
    let block = titled(title, false);
    let lines = model
        .history(&item.name)
        .map(|history| history.lines(now, model.link.limit()))
        .unwrap_or_default();
    let Some((low, high)) = extent(&lines) else {
        let text = Paragraph::new("No values yet.").style(OLD).block(block);
        frame.render_widget(text, area);
        return;
    };
    let step = 10_f64.powi(reading.unit.exponent.into());
    let margin = ((high - low) * 0.1).max(step * 5.0);
    // The axis has the range of the point, extended when a value lies outside.
    let [least, most] = [reading.min, reading.max].map(|end| f64::from(end) * step);
    let bounds = [
        (low - margin).max(least.min(low)),
        (high + margin).min(most.max(high)),
    ];
    let datasets = lines.iter().map(|line| {
        // A single value gives no line.
        let graph = if line.len() > 1 {
            GraphType::Line
        } else {
            GraphType::Scatter
        };
        Dataset::default()
            .data(line)
            .graph_type(graph)
            .marker(Marker::Braille)
            .style(Style::new().fg(Color::Magenta))
    });
    let places = usize::from(reading.unit.exponent.min(0).unsigned_abs());
    let label = |value: f64| Span::raw(format!("{value:.places$}"));
    let span = SPAN.as_secs_f64();
    let chart = Chart::new(datasets.collect())
        .block(block)
        .legend_position(None)
        .x_axis(
            Axis::default()
                .bounds([-span, 0.0])
                .labels(["-5 min", "now"]),
        )
        .y_axis(Axis::default().bounds(bounds).labels([
            label(bounds[0]),
            label(f64::midpoint(bounds[0], bounds[1])),
            label(bounds[1]),
        ]));
    frame.render_widget(chart, area);
}
