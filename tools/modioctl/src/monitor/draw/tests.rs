//! Tests of the drawn text.

use std::time::Duration;

use chrono::{Local, TimeDelta};
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use register_map::Module;
use register_map::board::MODIO_08;
use tokio::time::Instant;

use super::draw;
use crate::bus::adu::Framing;
use crate::bus::{Direction, Seen};
use crate::failure::Failure;
use crate::monitor::edges::Edge;
use crate::monitor::fixture::{model, polled, show};
use crate::monitor::messages::Update;
use crate::monitor::model::{Model, Page};
use crate::names::book;

fn screen(model: &mut Model, width: u16, height: u16, now: Instant) -> Vec<String> {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| draw(frame, model, now)).unwrap();
    let buffer = terminal.backend().buffer().clone();
    let rows = buffer.content().chunks(usize::from(width).max(1));
    rows.map(|row| {
        let text: String = row.iter().map(ratatui::buffer::Cell::symbol).collect();
        text.trim_end().to_owned()
    })
    .collect()
}

/// Returns a display of a modio-08 with relays, and these values.
fn relays(now: Instant, values: &[(&str, Vec<u16>)]) -> Model {
    let mut model = model(Module::Do4, now);
    let relays = Box::new(book(&MODIO_08, Module::Relay2, (0, 0)));
    model.update(Update::Learned(relays), now);
    let mut round = polled(now, &[]);
    let values = values.iter().cloned();
    round
        .words
        .extend(values.map(|(name, words)| (name.to_owned(), words)));
    model.update(Update::Polled(round), now);
    model
}

fn seconds(now: Instant, seconds: u64) -> Instant {
    now + Duration::from_secs(seconds)
}

#[test]
fn page_of_points_fits_80_by_24() {
    let now = Instant::now();
    let mut model = model(Module::Do4, now);
    show(&mut model, now, &[0, 1, 0, 0]);
    let rows = screen(&mut model, 80, 24, now);
    assert_eq!(
        rows[..12],
        [
            "modio-02 0.1.0, unit 1, /dev/ttyUSB0, 9600 bit/s 8N2                   ● answers",
            " 1 Points   2 Line                                                        ? help",
            "» Ports and points ─────────────────────────────── p5.1 ────────────────────────",
            "▾ p5   4do        good                             digital output",
            "  p5.1 digital output      [□ off] good            address 0x0010",
            "  p5.2 digital output       [■ on] good            off",
            "  p5.3 digital output      [□ off] good",
            "  p5.4 digital output      [□ off] good            Space switches it.",
            "",
            "",
            "",
            "",
        ]
    );
    assert!(rows[23].contains("q quit"));
}

#[test]
fn unit_without_answers_has_its_values_marked_as_old() {
    let now = Instant::now();
    let mut model = model(Module::Ai2Ao2, now);
    show(&mut model, now, &[12_000, 0, 4000, 20_000]);
    let silent = Failure::NoAnswer("unit 1 does not answer at /dev/ttyUSB0".to_owned());
    model.update(Update::Lost(silent), seconds(now, 1));
    let rows = screen(&mut model, 80, 24, seconds(now, 12));
    assert!(rows[0].ends_with("× no answer since 12 s"), "{}", rows[0]);
    assert!(rows[4].starts_with("  p5.1 analog input      12000 µA  old: 12 s"));
    assert!(rows[6].contains("[4000 µA] old: 12 s"));
    assert!(rows[3].contains("old: good"));
    assert!(rows[21].contains("does not answer at"));
    // Without new values the age alone marks a value as old.
    show(&mut model, seconds(now, 13), &[12_000, 0, 4000, 20_000]);
    assert!(screen(&mut model, 80, 24, seconds(now, 13))[0].ends_with("● answers"));
    let rows = screen(&mut model, 80, 24, seconds(now, 15));
    assert!(rows[0].ends_with("× no answer since 2 s") && rows[4].contains("old: 2 s"));
}

#[test]
fn channel_with_a_fault_and_unknown_values_are_marked() {
    let now = Instant::now();
    let mut model = model(Module::Ai4, now);
    let mut round = polled(now, &[0, 12_000]);
    round
        .words
        .insert("p5.1.channel_status".to_owned(), vec![3]);
    round.words.insert("p5.module_state".to_owned(), vec![3]);
    model.update(Update::Polled(round), now);
    let rows = screen(&mut model, 80, 24, now);
    assert!(rows[3].contains("× a channel out of range"));
    assert!(rows[4].contains("0 µA  × open circuit"));
    assert!(rows[5].contains("12000 µA  good"));
    assert!(rows[6].contains("?  not known"));
}

#[test]
fn pending_and_failed_writes_are_shown() {
    let now = Instant::now();
    let mut model = model(Module::Do4, now);
    show(&mut model, now, &[0; 4]);
    let write = model.operate(now).unwrap();
    assert!(screen(&mut model, 80, 24, now)[4].contains("[→ on]"));
    let refused = Failure::Refused("the unit refuses".to_owned());
    model.update(Update::Wrote(write, Err(refused)), now);
    let rows = screen(&mut model, 80, 24, now);
    assert_eq!(rows[21], "× p5.1 = on failed: the unit refuses");
    assert_eq!(rows[22], "[r: try again] [Esc: leave it]");
}

#[test]
fn analog_point_has_a_chart_with_its_unit() {
    let now = Instant::now();
    let mut model = model(Module::Ai4, now);
    for n in 0..200 {
        let at = now + Duration::from_millis(250 * n);
        show(&mut model, at, &[4000 + n as u16, 0, 0, 0]);
    }
    let text = screen(&mut model, 80, 24, seconds(now, 50)).join("\n");
    assert!(text.contains("p5.1 in µA, last 5 min"));
    assert!(text.contains("-5 min") && text.contains("now") && text.contains("4219"));
    assert!(text.chars().any(|c| ('\u{2801}'..='\u{28FF}').contains(&c)));
}

#[test]
fn slider_and_help_are_drawn_above_the_display() {
    let now = Instant::now();
    let mut model = model(Module::Ao4, now);
    show(&mut model, now, &[12_000; 4]);
    assert!(model.operate(now).is_none());
    let text = screen(&mut model, 80, 24, now).join("\n");
    assert!(text.contains("now 12000 µA, new 12000 µA") && text.contains("[Enter: send]"));
    assert!(text.contains("4000 µA") && text.contains("20000 µA"));
    model.editor = None;
    model.help = true;
    let text = screen(&mut model, 60, 16, now).join("\n");
    assert!(text.contains("Keys and marks") && text.contains("q, Ctrl-C"));
}

#[test]
fn page_of_the_line_has_counters_and_frames() {
    let now = Instant::now();
    let mut model = model(Module::Do4, now);
    show(&mut model, now, &[0; 4]);
    let frame = |direction, pdu: &[u8]| Seen {
        at: now,
        direction,
        framing: Framing::Rtu,
        bytes: Framing::Rtu.frame(0, 1, pdu),
    };
    let asked = frame(Direction::Request, &[1, 0, 0x10, 0, 4]);
    model.update(Update::Seen(asked), now);
    let answer = frame(Direction::Response, &[1, 1, 2]);
    model.update(Update::Seen(answer), now);
    model.page = Page::Line;
    let text = screen(&mut model, 80, 24, now).join("\n");
    assert!(text.contains("bus messages             1234"));
    assert!(text.contains("uptime                   60 s"));
    assert!(text.contains("requests                 1"));
    assert!(text.contains("→ unit 1: read coils 0x0010 x 4"));
    assert!(text.contains("← unit 1: read coils 0x0010 = 0100"));
    model.frames.hex = true;
    model.frames.pause();
    let text = screen(&mut model, 80, 24, now).join("\n");
    assert!(text.contains("paused") && text.contains("01 01 00 10 00 04"));
}

#[test]
fn large_board_scrolls_and_a_large_terminal_shows_counters_beside_the_tree() {
    let now = Instant::now();
    let mut model = model(Module::Do4, now);
    let eight = Box::new(book(&MODIO_08, Module::Do4, (0, 0)));
    model.update(Update::Learned(eight), now);
    model.tree.select(19);
    let rows = screen(&mut model, 80, 24, now);
    assert!(rows[2].contains("of 20") && rows.iter().any(|row| row.starts_with("  p4.4")));
    let text = screen(&mut model, 120, 40, now).join("\n");
    assert!(text.contains("Counted by the unit") && text.contains("Counted here"));
}

#[test]
fn links_are_shown_at_their_output_and_their_input() {
    let now = Instant::now();
    // The jumper p1.1 toggles the coil p1.3.
    let links = [
        ("p1.3.link1", vec![0, 3, 0, 0]),
        ("p1.3.link2", vec![0xFFFF, 0, 0, 0]),
    ];
    let mut model = relays(now, &links);
    for (row, count) in [(1, 1), (2, 0), (3, 1)] {
        model.tree.select(row);
        let text = screen(&mut model, 80, 24, now).join("\n");
        assert_eq!(text.matches("p1.1 toggles p1.3").count(), count, "{text}");
    }
}

#[test]
fn output_that_a_link_holds_is_marked_and_a_write_to_it_says_so() {
    let now = Instant::now();
    let values = [
        ("p1.3", vec![1]),
        ("p1.3.channel_status", vec![0]),
        // The jumper p1.1 holds the coil p1.3.
        ("p1.3.link1", vec![0, 1, 0, 0]),
        ("p1.4", vec![1]),
        ("p1.4.link1", vec![0, 3, 0, 0]),
    ];
    let mut model = relays(now, &values);
    model.tree.select(3);
    let rows = screen(&mut model, 120, 40, now);
    let row = |name: &str| {
        let row = rows.iter().find(|row| row.starts_with(name)).unwrap();
        row.chars().take(60).collect::<String>()
    };
    let (held, free) = (row("  p1.3"), row("  p1.4"));
    assert!(held.contains("■ on  held by a link"), "{held}");
    assert!(free.contains("[■ on]"), "{free}");
    let says = "held by link p1.1; a write to a held output has no effect";
    // Of this text the column shows the beginning in one row.
    assert!(rows.join("\n").contains("p1.3 is held by link p1.1;"));
    let write = model.operate(now).unwrap();
    model.update(Update::Wrote(write, Ok(())), now);
    assert_eq!(model.notice(now), Some(&*format!("p1.3: {says}")));
}

#[test]
fn last_edges_of_the_selected_input_are_shown_newest_first() {
    let now = Instant::now();
    let mut model = model(Module::Di4, now);
    let mut round = polled(now, &[0; 4]);
    // p5.2 off, p5.1 on, p5.2 on; the last one is late. They happened 100, 50 and 20 ms before the reading.
    let words = [0x11, 0, 900, 0x110, 0, 950, 0x8111, 0, 980];
    let read_at = Local::now() - TimeDelta::seconds(5);
    let edges = Edge::all(words.map(u16::to_be_bytes).as_flattened(), 1000, read_at);
    let time = |ms| read_at - TimeDelta::milliseconds(ms);
    round.edges = Some(edges);
    model.update(Update::Polled(round), now);
    model.tree.select(2);
    let rows = screen(&mut model, 120, 40, now);
    let first = rows.iter().position(|row| row.ends_with("Last edges:"));
    let rows = &rows[first.unwrap() + 1..];
    let line = |level, ms| format!("{level} {}  5 s ago", time(ms).format("%H:%M:%S%.3f"));
    assert!(
        rows[0].ends_with(&format!(
            "{}, or earlier, within an erase of flash",
            line("on ", 20)
        )),
        "{rows:?}"
    );
    assert!(rows[1].ends_with(&line("off", 100)), "{rows:?}");
    model.tree.select(3);
    assert!(
        !screen(&mut model, 80, 24, now)
            .join("\n")
            .contains("Last edges")
    );
}

#[test]
fn terminal_of_any_size_is_drawn() {
    let now = Instant::now();
    let mut model = model(Module::Ai2Ao2, now);
    show(&mut model, now, &[12_000; 4]);
    model.tree.select(3);
    assert!(model.operate(now).is_none());
    let rows = screen(&mut model, 40, 10, now);
    assert!(rows.join(" ").contains("60 x 16"), "{rows:?}");
    for (width, height) in [(1, 1), (60, 16), (61, 300), (300, 16), (20, 5)] {
        for page in [Page::Points, Page::Line] {
            model.page = page;
            model.help = page == Page::Line;
            screen(&mut model, width, height, now);
        }
    }
}
