//! Draws the slider and the help above the display.

use ratatui::Frame;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Clear, Paragraph, Wrap};
use tokio::time::Instant;

use super::{BAD, OLD, SELECTED, STRONG, clip};
use crate::monitor::layout::{LEAVE, SEND, Slider, centred, within};
use crate::monitor::model::Model;
use crate::value::show;

/// Draws the slider.
pub fn slider(frame: &mut Frame, model: &Model, now: Instant) {
    let Some(editor) = &model.editor else {
        return;
    };
    let places = Slider::new(frame.area());
    frame.render_widget(Clear, places.window);
    let title = format!(" {}, {} ", editor.item.name, editor.item.about);
    frame.render_widget(Block::bordered().title(title), places.window);
    let row = |y| within(places.window, 2, y, places.bar.width, 1);
    let present = match model.value(&editor.item.name, now) {
        Some((value, true)) => show(&editor.item, &value.words, false).to_string(),
        _ => "not known".to_owned(),
    };
    let new = if editor.typed.is_empty() {
        editor.shown().to_string()
    } else {
        format!("{}_ {}", editor.typed, editor.shown().unit)
    };
    let line = Line::from(vec![
        Span::raw(format!("now {present}, new ")),
        Span::styled(new, STRONG),
    ]);
    frame.render_widget(line, row(1));
    let width = usize::from(places.bar.width);
    let knob = (editor.part() * width.saturating_sub(1) as f64).round() as usize;
    let bar: String = (0..width)
        .map(|x| match x {
            x if x == knob => '█',
            x if x < knob => '━',
            _ => '─',
        })
        .collect();
    frame.render_widget(Span::raw(bar), places.bar);
    let [low, high] = editor.ends();
    frame.render_widget(Span::raw(low.to_string()), row(4));
    frame.render_widget(Line::from(high.to_string()).right_aligned(), row(4));
    if let Some(wrong) = &editor.wrong {
        frame.render_widget(Span::styled(clip(wrong, width), BAD), row(5));
    }
    frame.render_widget(Span::styled(SEND, STRONG), places.send);
    frame.render_widget(Span::styled(LEAVE, STRONG), places.leave);
    let keys = "←→ 1 %  Shift or PgUp/PgDn 10 %  ↑↓ 1 step  digits";
    frame.render_widget(Span::styled(clip(keys, width), OLD), row(7));
}

const HELP: [(&str, &str); 14] = [
    ("↑ ↓ PgUp PgDn", "select a row, or scroll the log"),
    ("← →", "close or open a port"),
    ("Space, Enter", "switch an output, or open its slider"),
    ("r, Esc", "try a failed write again, or leave it"),
    ("Tab", "to the log and back"),
    ("p, x", "pause the log; show bytes"),
    ("1, 2", "points; counters and log of the line"),
    ("m", "mouse to the monitor or the terminal"),
    ("q, Ctrl-C", "quit"),
    ("[■ on]", "output in brackets: can be set, also by a click"),
    ("[→ on]", "this value is being written"),
    ("old: 12 s", "value read 12 s ago: it may have changed"),
    ("?", "the value is not known"),
    ("×", "there is a fault"),
];

/// Draws the help.
pub fn help(frame: &mut Frame, model: &Model) {
    if !model.help {
        return;
    }
    let window = centred(frame.area(), 68, HELP.len() as u16 + 2);
    frame.render_widget(Clear, window);
    let lines = HELP.iter().map(|(key, does)| {
        Line::from(vec![
            Span::styled(format!(" {key:<15}"), STRONG),
            Span::raw(*does),
        ])
    });
    let title = Span::styled(" Keys and marks; any key closes ", SELECTED);
    let text = Paragraph::new(lines.collect::<Vec<_>>()).wrap(Wrap { trim: false });
    frame.render_widget(text.block(Block::bordered().title(title)), window);
}
