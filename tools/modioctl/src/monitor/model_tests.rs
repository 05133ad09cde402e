//! Tests of the model.

use std::time::Duration;

use chrono::{Local, TimeDelta};
use register_map::Module;
use register_map::board::MODIO_02;
use tokio::time::Instant;

use super::edges::Edge;
use super::fixture::{model, polled, show};
use super::link::State;
use super::messages::{Update, Write};
use super::model::{Model, Page};
use crate::failure::Failure;
use crate::names::book;

fn silent() -> Failure {
    Failure::NoAnswer("unit 1 does not answer".to_owned())
}

fn after(now: Instant, millis: u64) -> Instant {
    now + Duration::from_millis(millis)
}

/// A 4do whose second output is selected.
fn outputs(now: Instant) -> Model {
    let mut model = model(Module::Do4, now);
    show(&mut model, now, &[0, 1, 0, 0]);
    model.tree.select(2);
    model
}

fn is_fresh(model: &Model, name: &str, now: Instant) -> Option<bool> {
    model.value(name, now).map(|(_, fresh)| fresh)
}

#[test]
fn operate_orders_the_state_that_is_not_shown() {
    let now = Instant::now();
    let mut model = outputs(now);
    let write = model.operate(now).unwrap();
    assert_eq!(
        (write.item.name.as_str(), &write.words[..]),
        ("p5.2", &[0][..])
    );
    assert!(model.operate(now).is_none(), "the write is still pending");
    model.tree.select(1);
    assert_eq!(model.operate(now).unwrap().words, [1]);
}

#[test]
fn operate_on_an_old_value_orders_nothing() {
    let now = Instant::now();
    let mut model = outputs(now);
    assert!(model.operate(after(now, 5000)).is_none());
    model.update(Update::Lost(silent()), now);
    assert!(model.operate(now).is_none());
    assert!(model.notice(now).unwrap().contains("not known"));
    assert!(model.pending.is_empty());
}

#[test]
fn operate_on_an_input_orders_nothing() {
    let now = Instant::now();
    let mut model = model(Module::Di4, now);
    show(&mut model, now, &[0; 4]);
    assert!(model.operate(now).is_none());
    assert!(model.notice(now).unwrap().contains("input"));
}

#[test]
fn confirmed_write_is_pending_until_a_later_round() {
    let now = Instant::now();
    let mut model = outputs(now);
    let write = model.operate(now).unwrap();
    model.update(Update::Wrote(write, Ok(())), after(now, 50));
    let before = polled(after(now, 20), &[0, 1, 0, 0]);
    model.update(Update::Polled(before), after(now, 60));
    assert!(
        model.pending.contains_key("p5.2"),
        "the value was read before the write"
    );
    show(&mut model, after(now, 70), &[0, 0, 0, 0]);
    assert!(model.pending.is_empty());
}

#[test]
fn failed_write_is_offered_again_and_repeated_only_when_ordered() {
    let now = Instant::now();
    let mut model = outputs(now);
    let write = model.operate(now).unwrap();
    model.update(Update::Wrote(write, Err(silent())), now);
    assert!(model.pending.is_empty() && model.failed.len() == 1);
    assert!(model.failed[0].text.contains("may have executed it"));
    assert_eq!(is_fresh(&model, "p5.2", now), Some(false));
    let later = after(now, 60_000);
    let back = Box::new(book(&MODIO_02, Module::Do4, (1, 1)));
    model.update(Update::Learned(back), later);
    show(&mut model, later, &[0, 1, 0, 0]);
    let again = model.retry(later).unwrap();
    assert_eq!((&again.words[..], again.ordered), (&[0][..], later));
    assert!(model.failed.is_empty() && model.retry(later).is_none());
}

#[test]
fn newer_write_of_the_same_output_replaces_the_failed_one() {
    let now = Instant::now();
    let mut model = outputs(now);
    let write = model.operate(now).unwrap();
    let refused = Err(Failure::Refused("no".to_owned()));
    model.update(Update::Wrote(write.clone(), refused.clone()), now);
    model.update(Update::Wrote(write.clone(), refused), now);
    assert_eq!(model.failed.len(), 1);
    model.update(Update::Wrote(write, Ok(())), now);
    assert!(model.failed.is_empty());
}

#[test]
fn unit_with_other_modules_loses_values_writes_and_slider() {
    let now = Instant::now();
    let mut model = model(Module::Ao4, now);
    show(&mut model, now, &[4000; 4]);
    assert!(model.operate(now).is_none() && model.editor.is_some());
    let item = model.point().unwrap().clone();
    let write = Write {
        item,
        words: vec![5000],
        ordered: now,
    };
    model.update(Update::Wrote(write, Err(silent())), now);
    // The same module, but with voltages: 4000 would now be shown as 4000 mV.
    let volts = Box::new(book(&MODIO_02, Module::Ao4, (0, 1)));
    model.update(Update::Learned(volts), now);
    assert!(model.editor.is_none() && model.failed.is_empty());
    assert!(model.value("p5.1", now).is_none() && model.history("p5.1").is_none());
    assert!(model.notice(now).unwrap().contains("other modules"));
}

#[test]
fn same_unit_that_returns_keeps_its_values_as_old() {
    let now = Instant::now();
    let mut model = outputs(now);
    model.update(Update::Lost(silent()), after(now, 1000));
    let later = after(now, 12_000);
    assert_eq!(
        model.link.state(later),
        State::NoAnswer(Duration::from_secs(12))
    );
    let back = Box::new(book(&MODIO_02, Module::Do4, (1, 1)));
    model.update(Update::Learned(back), later);
    assert_eq!(is_fresh(&model, "p5.2", later), Some(false));
    show(&mut model, later, &[0; 4]);
    assert_eq!(is_fresh(&model, "p5.2", later), Some(true));
    assert_eq!(model.frames.counts.no_answer, 1);
}

#[test]
fn refused_port_has_old_values_and_the_reason() {
    let now = Instant::now();
    let mut model = outputs(now);
    let later = after(now, 2000);
    let mut round = polled(later, &[]);
    round.refused = vec![(5, "exception 04".to_owned())];
    model.update(Update::Polled(round), later);
    assert_eq!(is_fresh(&model, "p5.1", later), Some(false));
    assert_eq!(model.refusal(5), Some("exception 04"));
    assert!(model.operate(later).is_none());
}

#[test]
fn port_that_waits_for_a_restart_shows_no_analog_values() {
    let now = Instant::now();
    let mut model = model(Module::Ao4, now);
    show(&mut model, now, &[4000; 4]);
    let mut round = polled(now, &[]);
    round.waiting = [5].into();
    model.update(Update::Polled(round), now);
    assert!(model.waits(5) && model.value("p5.1", now).is_none());
    assert!(model.operate(now).is_none());
}

#[test]
fn slider_orders_its_value_and_stays_open_when_it_does_not_fit() {
    let now = Instant::now();
    let mut model = model(Module::Ao4, now);
    show(&mut model, now, &[4000; 4]);
    assert!(model.operate(now).is_none());
    model.editor.as_mut().unwrap().typed = "3".to_owned();
    assert!(model.send_edited(now).is_none() && model.editor.is_some());
    model.editor.as_mut().unwrap().typed = "12000".to_owned();
    let write = model.send_edited(now).unwrap();
    assert_eq!(
        (&write.words[..], model.editor.is_none()),
        (&[12_000][..], true)
    );
}

#[test]
fn edges_are_read_only_while_a_digital_input_is_selected_on_the_page_of_points() {
    let now = Instant::now();
    let mut inputs = model(Module::Di4, now);
    inputs.tree.select(1);
    assert!(inputs.shows_edges());
    inputs.page = Page::Line;
    assert!(!inputs.shows_edges());
    inputs.page = Page::Points;
    inputs.tree.select(0);
    assert!(!inputs.shows_edges(), "a port");
    for module in [Module::Do4, Module::Ai4] {
        let mut others = model(module, now);
        others.tree.select(1);
        assert!(!others.shows_edges(), "{module:?}");
    }
}

#[test]
fn edge_that_is_read_again_keeps_its_time_of_day() {
    let now = Instant::now();
    let mut model = model(Module::Di4, now);
    let first = Local::now();
    for late in [0, 20] {
        let mut round = polled(now, &[0; 4]);
        let read_at = first + TimeDelta::milliseconds(late);
        round.edges = Some(Edge::all(&[0x01, 0x10, 0, 0, 0, 1], 1, read_at));
        model.update(Update::Polled(round), now);
    }
    let times: Vec<_> = model.edges(0x10).map(|edge| edge.at).collect();
    assert_eq!(times, [first]);
}
