//! A master that fetches events, and checks that each edge is reported once and in order.

use std::collections::VecDeque;

use modbus_server::crc;
use rand::RngExt;

use crate::bus::Bus;

/// Address of the first input of a unit.
const FIRST: u16 = 0;
/// Time that a unit takes to start, in us.
const START_US: f64 = 150_000.0;

/// What happens on the bus.
pub struct Traffic {
    pub edges_per_s: f64,
    pub restarts_per_s: f64,
    pub seconds: f64,
}

/// What the master knows of a unit.
#[derive(Default)]
struct Known {
    /// The last packet.
    packet: Vec<u8>,
    /// Edges that it has not reported yet: time, input, level.
    expected: VecDeque<(f64, usize, bool)>,
    /// The unit has restarted, and has not reported it yet.
    restarted: bool,
    /// Inputs whose states are reported next.
    states: u8,
    /// Its events are not checked.
    is_unchecked: bool,
}

pub struct Master {
    bus: Bus,
    known: Vec<Known>,
    /// Address and flag to be confirmed.
    confirms: (u8, u8),
    /// Ask from the last address that had events on until there are none, as wb-mqtt-serial does. Otherwise ask all.
    keeps_address: bool,
    least: u8,
}

impl Master {
    /// Returns a master whose units report edges with low priority.
    pub fn new(baud: u32, units: u8, errors: f64, seed: u64) -> Self {
        let mut master = Self {
            bus: Bus::new(baud, units, errors, seed),
            known: (0..units).map(|_| Known::default()).collect(),
            confirms: (0, 0),
            keeps_address: false,
            least: 0,
        };
        for n in 0..units.into() {
            master.switch_on(n);
        }
        // The states of the inputs.
        while master.fetch(&mut Vec::new()) {}
        master
    }

    /// Returns a master that keeps the last address that had events, and two units. Nothing is checked of the second one,
    /// which has the greater address.
    pub fn keeping_address(baud: u32) -> Self {
        let mut master = Self::new(baud, 2, 0.0, 3);
        master.keeps_address = true;
        master.known[1].is_unchecked = true;
        master
    }

    /// Starts the second unit again. Nobody sets it up.
    pub fn restart_second(&mut self) {
        let now = self.bus.now;
        self.bus.units[1].restart(now, START_US);
    }

    /// Lets the first input of the second unit switch on and off so often in a second, for these seconds.
    pub fn bounce_second(&mut self, hz: f64, seconds: f64) {
        let half_us = 5e5 / hz;
        for n in 0..(seconds * 2.0 * hz) as u32 {
            let at = self.bus.now + f64::from(n) * half_us;
            self.bus.units[1].change(at, 0, n % 2 == 0);
        }
    }

    /// Switches the events of a unit's inputs on, and the report of its start off.
    fn switch_on(&mut self, n: usize) {
        let address = self.bus.units[n].address;
        let request = [
            address, 0x46, 0x18, 13, 15, 0, 0, 1, 0, 2, 0, 0, 4, 1, 1, 1, 1,
        ];
        let expected = frame(&[address, 0x46, 0x18, 2, 0, 0b1111]);
        // The unit may be starting, and frames are damaged.
        let mut reply = Vec::new();
        for _ in 0..50 {
            reply = self.bus.ask(&frame(&request), false);
            if reply == expected {
                self.known[n].states = 0b1111;
                return;
            }
        }
        panic!("unit {address} answers {reply:02X?}");
    }

    /// Fetches events once. Adds their latencies in us. Returns whether there were any.
    fn fetch(&mut self, latencies: &mut Vec<f64>) -> bool {
        let (address, flag) = self.confirms;
        let request = frame(&[0xFD, 0x46, 0x10, self.least, 100, address, flag]);
        let reply = self.bus.ask(&request, true);
        let Some(body) = body(&reply) else {
            return true;
        };
        let [unit, 0x46, 0x11, flag, _, len, events @ ..] = body else {
            assert_eq!(body, [0xFD, 0x46, 0x12]);
            self.least = 0;
            return false;
        };
        if self.keeps_address {
            self.least = *unit;
        }
        assert_eq!(usize::from(*len), events.len());
        self.confirms = (*unit, *flag);
        let n = self
            .bus
            .units
            .iter()
            .position(|other| other.address == *unit);
        let n = n.expect("a unit of this bus");
        if self.known[n].packet == body {
            return true;
        }
        self.known[n].packet = body.to_vec();
        if self.known[n].is_unchecked {
            return true;
        }
        self.take(n, events, latencies);
        true
    }

    /// Takes the events of a packet of unit `n`.
    fn take(&mut self, n: usize, mut events: &[u8], latencies: &mut Vec<f64>) {
        let end = self.bus.now - 38.5 * self.bus.bit;
        while let [len, kind, high, low, rest @ ..] = events {
            let (value, rest) = rest.split_at((*len).into());
            events = rest;
            let id = u16::from_be_bytes([*high, *low]);
            let known = &mut self.known[n];
            if (*kind, id) == (15, 0) {
                if known.restarted {
                    known.restarted = false;
                    self.switch_on(n);
                }
                continue;
            }
            assert_eq!((*kind, value.len()), (2, 1), "unit {n} reports {kind} {id}");
            let (input, level) = (usize::from(id - FIRST), value[0] != 0);
            if known.states >> input & 1 != 0 {
                known.states &= !(1 << input);
                assert_eq!(
                    level,
                    self.bus.units[n].levels >> input & 1 != 0,
                    "unit {n}"
                );
                continue;
            }
            let (at, expected, of) = known.expected.pop_front().expect("an edge");
            assert_eq!((input, level), (expected, of), "unit {n}");
            latencies.push(end - at);
        }
    }

    /// Lets the traffic run. Returns the time from each edge until the master knows it, in us.
    pub fn run(&mut self, traffic: &Traffic) -> Vec<f64> {
        let mut latencies = Vec::new();
        let (start, mut next_edge, mut next_restart) = (self.bus.now, self.bus.now, self.bus.now);
        let end = start + traffic.seconds * 1e6;
        loop {
            // What happens during the next fetch is known before it; a unit sees it when its time has come.
            let horizon = self.bus.now + 100_000.0;
            while next_edge < horizon.min(end) {
                self.edge(next_edge);
                next_edge += -self.bus.rng.random::<f64>().ln() * 1e6 / traffic.edges_per_s;
            }
            if traffic.restarts_per_s > 0.0 && next_restart < self.bus.now {
                self.restart();
                let gap = -self.bus.rng.random::<f64>().ln() * 1e6 / traffic.restarts_per_s;
                next_restart = self.bus.now + gap;
            }
            let any = self.fetch(&mut latencies);
            if !any && self.bus.now > end + 1e6 {
                break;
            }
        }
        for (n, known) in self.known.iter().enumerate() {
            assert!(
                known.expected.is_empty(),
                "unit {n} has not reported {:?}",
                known.expected
            );
        }
        latencies
    }

    /// Changes an input of a unit at `at`.
    fn edge(&mut self, at: f64) {
        let n = self.bus.rng.random_range(0..self.bus.units.len());
        // Edges while a unit starts are lost, and those up to the report of its states are part of these.
        let known = &self.known[n];
        if known.restarted || known.states != 0 || known.is_unchecked {
            return;
        }
        let input = self.bus.rng.random_range(0..4);
        // Levels as they will be.
        let last = self.known[n]
            .expected
            .iter()
            .rev()
            .find(|edge| edge.1 == input);
        let level = match last {
            Some((_, _, level)) => !level,
            None => self.bus.units[n].levels >> input & 1 == 0,
        };
        self.bus.units[n].change(at, input, level);
        self.known[n].expected.push_back((at, input, level));
    }

    fn restart(&mut self) {
        let n = self.bus.rng.random_range(0..self.bus.units.len());
        let now = self.bus.now;
        self.bus.units[n].restart(now, START_US);
        self.known[n].restarted = true;
        self.known[n].expected.clear();
    }
}

/// Returns the time from edges at random times until a master that polls all units in turn knows them, in us.
pub fn polling(baud: u32, units: usize, count: usize) -> Vec<f64> {
    let bit = 1e6 / f64::from(baud);
    let silence = (38.5 * bit).max(1_750.0);
    // A request for four inputs and its reply.
    let (request, reply) = (8.0 * 11.0 * bit, 6.0 * 11.0 * bit);
    let cycle = units as f64 * (request + silence + reply + silence);
    // The unit's state counts when it serves the request.
    let after = reply;
    (0..count)
        .map(|n| cycle * (n as f64 + 0.5) / count as f64 + after)
        .collect()
}

/// Returns a frame: these bytes and their CRC.
fn frame(bytes: &[u8]) -> Vec<u8> {
    let sum = bytes
        .iter()
        .fold(crc::START, |sum, byte| crc::step(sum, *byte));
    [bytes, &sum.to_le_bytes()].concat()
}

/// Returns a frame without its CRC, if that is right.
fn body(frame: &[u8]) -> Option<&[u8]> {
    let (body, sum) = frame.split_at(frame.len().checked_sub(2)?);
    let good = body
        .iter()
        .fold(crc::START, |sum, byte| crc::step(sum, *byte))
        .to_le_bytes()
        == sum;
    good.then_some(body)
}
