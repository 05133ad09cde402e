//! An endpoint that logs every frame sent and received, for people who look for the cause of a failure.

use std::io::Write;
use std::time::Duration;

use delegate::delegate;
use modbus_line::LineFormat;

use super::{Abilities, Broken, Endpoint, Piece, Received};
use crate::bench::shown;
use crate::frame::hex;

/// Another endpoint, with a log of what is sent and received on it.
pub struct Trace<W> {
    endpoint: Box<dyn Endpoint>,
    log: W,
}

impl<W: Write> Trace<W> {
    /// Logs what is sent and received on `endpoint`.
    pub fn new(endpoint: Box<dyn Endpoint>, log: W) -> Self {
        Self { endpoint, log }
    }

    fn note(&mut self, at: Duration, what: &str) {
        // A log that cannot be written must not end the test.
        let _ = writeln!(self.log, "{:12.6} s {what}", at.as_secs_f64());
    }

    fn note_received(&mut self, received: &[Received], what: &str) {
        let Some(first) = received.first() else {
            return;
        };
        let bytes: Vec<u8> = received.iter().map(|received| received.byte).collect();
        let damaged = if received.iter().all(|received| received.good) {
            ""
        } else {
            " (damaged)"
        };
        self.note(first.start, &format!("{what} {}{damaged}", hex(&bytes)));
    }
}

impl<W: Write> Endpoint for Trace<W> {
    fn set_line(&mut self, line: LineFormat) -> Result<(), Broken> {
        self.note(self.endpoint.now(), &format!("line at {line}"));
        self.endpoint.set_line(line)
    }

    fn send(&mut self, pieces: &[Piece]) -> Result<Duration, Broken> {
        self.note(self.endpoint.now(), &format!("sent     {}", shown(pieces)));
        self.endpoint.send(pieces)
    }

    fn receive(
        &mut self,
        patience: Duration,
        quiet: Duration,
        enough: usize,
    ) -> Result<Vec<Received>, Broken> {
        let received = self.endpoint.receive(patience, quiet, enough)?;
        self.note_received(&received, "received");
        Ok(received)
    }

    fn flush(&mut self) -> Result<Vec<Received>, Broken> {
        let late = self.endpoint.flush()?;
        self.note_received(&late, "received too late, discarded:");
        Ok(late)
    }

    fn set_power(&mut self, on: bool) -> Result<(), Broken> {
        let state = if on { "power on" } else { "power off" };
        self.note(self.endpoint.now(), state);
        self.endpoint.set_power(on)
    }

    fn set_echo(&mut self, echo: bool) -> Result<(), Broken> {
        let state = if echo { "echo on" } else { "echo off" };
        self.note(self.endpoint.now(), state);
        self.endpoint.set_echo(echo)
    }

    delegate! {
        to self.endpoint {
            fn name(&self) -> String;
            fn abilities(&self) -> Abilities;
            fn line(&self) -> LineFormat;
            fn now(&self) -> Duration;
            fn rest(&mut self, time: Duration) -> Result<(), Broken>;
            fn take_driver_edges(&mut self) -> Result<Vec<(Duration, bool)>, Broken>;
            fn take_complaints(&mut self) -> Result<Vec<String>, Broken>;
        }
    }
}
