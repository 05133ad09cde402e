//! A display with a unit, for tests.

use std::time::Duration;

use register_map::Module;
use register_map::board::MODIO_02;
use tokio::time::Instant;

use super::messages::{Polled, Update};
use super::model::Model;
use super::plan::Words;
use crate::names::book;

/// Interval of polling in tests.
pub const EVERY: Duration = Duration::from_millis(250);

/// Returns a display of a modio-02 with this module, in mA or V, before the first reading.
pub fn model(module: Module, now: Instant) -> Model {
    let mut model = Model::new("/dev/ttyUSB0, 9600 bit/s 8N2".to_owned(), 1, EVERY, now);
    let book = Box::new(book(&MODIO_02, module, (1, 1)));
    model.update(Update::Learned(book), now);
    model
}

/// Returns a round of polling with these values of p5.1 and so on, without any fault.
pub fn polled(at: Instant, values: &[u16]) -> Polled {
    let mut words = Words::new();
    for (channel, value) in (1..).zip(values) {
        words.insert(format!("p5.{channel}"), vec![*value]);
        words.insert(format!("p5.{channel}.channel_status"), vec![0]);
    }
    words.insert("p5.module_state".to_owned(), vec![0]);
    words.insert("bus messages".to_owned(), vec![1234]);
    words.insert("uptime".to_owned(), vec![0, 60]);
    Polled {
        at,
        took: Duration::from_millis(50),
        words,
        refused: Vec::new(),
        waiting: [].into(),
        edges: None,
    }
}

/// Shows a round of polling.
pub fn show(model: &mut Model, at: Instant, values: &[u16]) {
    model.update(Update::Polled(polled(at, values)), at);
}
