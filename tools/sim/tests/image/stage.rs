//! The stage of the outputs on the image: scenarios of its rules, and random histories with every change of a terminal, as far
//! as a master, four inputs and resets can play them. Both are those of the firmware's own test. `stage.py` beside them
//! printed the histories, without what needs a jumper, a pulse or SAFE, and either with resets or with changes of settings,
//! which a reset would undo:
//!
//! ```python
//! for seed in 0, 1, 3, 6, 7, 10, 11, 12, 17, 18:
//!     setup, events = stage.history(seed)
//!     kinds = ("request", "link", "held", *(("reset",) if seed % 2 else ("dead", "max_on")))
//!     events = {t: e for t, e in events.items() if e[0] in kinds}
//!     print(json.dumps(dict(setup=setup, events=events, changes=stage.play(setup, events, 6000)[1])))
//! ```

use register_map::codes::LinkAction;
use register_map::configuration::{BAUD, FILTER, KEY, OPENING_KEY, START};
use register_map::links;
use register_map::stage::{DEAD_TIME, MAX_ON, MIN_OFF};
use serde_json::Value;
use sim::Time;
use sim::line::{Format, Settings};

use crate::rig::{Rig, adu};

const SCENARIOS: &str = include_str!("../../../../firmware/tests/outputs/scenarios.jsonl");
const HISTORIES: &str = include_str!("../../../../firmware/tests/outputs/histories-image.jsonl");
/// Length of a history.
const HISTORY_MS: usize = 6000;
/// Longer scenarios are played without the image alone.
const LONGEST_MS: usize = 3600;

/// How much earlier or later a terminal may change: a scan, and the line.
const TOLERANCE_MS: usize = 3;

/// From the end of a request until it is executed, in us: t3.5 and the work.
const EXECUTED_US: u64 = 1_800;
/// How long before an event its requests are on their way, in ms.
const AHEAD_MS: u64 = 15;
/// From the first drive of the outputs to the first scan, in which times begin.
const FIRST_SCAN: Time = Time::from_ms(4);
/// An input is on for so long, in ms, because of an edge link.
const PRESSED_MS: u64 = 10;

/// The rate, in units of 100 bit/s: a request is short in comparison to the least time.
pub const RATE: (u16, u16) = (BAUD, 4608);

/// Sets the master to [`RATE`].
pub fn at_rate(rig: &mut Rig) {
    rig.settings(Settings {
        baud: 460_800,
        format: Format::N2,
    });
}

/// Two outputs of a board, and four inputs without debounce. The next output has START = 1: it is on from the first drive on.
pub struct Pair {
    /// Addresses of the first output and of the first input.
    pub first: u16,
    pub inputs: u16,
    /// Returns a board with these stored settings.
    pub unit: fn(&[(u16, u16)]) -> Rig,
    /// Applies a voltage to an input, counted from 0.
    pub set: fn(&mut Rig, usize, bool),
    /// Returns the terminals of the two outputs and of the next one.
    pub terminals: fn(&Rig) -> [bool; 3],
}

/// Returns a PDU that writes a register.
fn setting(register: u16, value: u16) -> Vec<u8> {
    [&[6][..], &register.to_be_bytes(), &value.to_be_bytes()].concat()
}

fn number(value: &Value) -> u16 {
    value.as_u64().unwrap_or(0).try_into().expect("a time")
}

/// A board while it plays.
struct Player<'a> {
    rig: Rig,
    pair: &'a Pair,
    /// The outputs that a level link holds.
    held: [bool; 2],
    /// The board's time at 0 of the scenario. A reset moves it, because a start takes time.
    zero: Time,
}

impl<'a> Player<'a> {
    fn new(pair: &'a Pair, setup: &Value) -> Self {
        let first = pair.first;
        let held = [0, 1].map(|output| !setup["held"][output].is_null());
        let mut settings = vec![RATE, (DEAD_TIME + first, number(&setup["dead"]) / 10)];
        settings.push((START + first + 2, 1));
        settings.extend((0..4).map(|input| (FILTER + pair.inputs + input, 0)));
        for (output, point) in (0..).zip([first, first + 1]) {
            settings.push((MAX_ON + point, number(&setup["max_on"][output]) / 100));
            settings.push((MIN_OFF + point, number(&setup["min_off"][output]) / 100));
            settings.push((START + point, number(&setup["start"][output])));
            let input = pair.inputs + 2 * output as u16;
            let mut link = |second, input, action: LinkAction| {
                let register = links::of_point(point, second);
                settings.extend([(register, input), (register + 1, action.code())]);
            };
            if held[output] {
                link(false, input, LinkAction::Follow);
            } else {
                link(false, input, LinkAction::Set);
                link(true, input + 1, LinkAction::Reset);
            }
        }
        let mut rig = (pair.unit)(&settings);
        rig.tolerant = true;
        at_rate(&mut rig);
        // After a power-on inputs have no value for a second, but after a reset they have.
        rig.board.run_for(Time::from_ms(1_200));
        let mut player = Self {
            rig,
            pair,
            held,
            zero: Time::ZERO,
        };
        player.hold(&setup["held"]);
        player.reset(0);
        player
    }

    /// Sets the inputs of level links.
    fn hold(&mut self, wanted: &Value) {
        for output in 0..2 {
            if self.held[output] {
                (self.pair.set)(&mut self.rig, 2 * output, wanted[output] == true);
            }
        }
    }

    /// Resets the board, and runs until the first scan, which is at this time.
    fn reset(&mut self, at: u64) {
        self.rig.board.reset();
        self.rig.board.run_for(Time::from_ms(1));
        while !(self.pair.terminals)(&self.rig)[2] {
            self.rig.board.run_for(Time::from_us(100));
        }
        let scanned = self.rig.board.now() + FIRST_SCAN;
        self.zero = scanned - Time::from_ms(at);
        self.rig.board.line().take_received();
    }

    /// Sends a request that is executed at this time.
    fn request(&mut self, at: Time, pdu: &[u8]) {
        let bytes = adu(&[&[1], pdu].concat());
        let taken = self.rig.characters(bytes.len() as u64) + Time::from_us(EXECUTED_US);
        self.rig.board.line().send(at - taken, &bytes);
    }

    /// Sends the requests of an event, if it is one of a master.
    fn send(&mut self, at: u64, event: &Value) {
        let when = self.zero + Time::from_ms(at);
        let first = self.pair.first;
        let output = first + number(&event[1]);
        let (register, value) = match event[0].as_str().expect("a name") {
            "dead" => (DEAD_TIME + first, number(&event[2]) / 10),
            "max_on" => (MAX_ON + output, number(&event[2]) / 100),
            "min_off" => (MIN_OFF + output, number(&event[2]) / 100),
            "request" => return self.write(when, &event[1]),
            _ => return,
        };
        self.request(when - Time::from_ms(8), &setting(KEY, OPENING_KEY));
        self.request(when, &setting(register, value));
    }

    fn write(&mut self, when: Time, values: &Value) {
        let [high, low] = self.pair.first.to_be_bytes();
        let one = |low, on| vec![5, high, low, 0xFF * on as u8, 0];
        let pdu = match (values[0].as_u64(), values[1].as_u64()) {
            (Some(first), Some(second)) => {
                vec![0x0F, high, low, 0, 2, 1, (first | second << 1) as u8]
            }
            (Some(on), None) => one(low, on),
            (None, Some(on)) => one(low + 1, on),
            (None, None) => return,
        };
        self.request(when, &pdu);
    }

    /// Presses the inputs that give this order of edge links, or releases them.
    fn press(&mut self, order: &Value, on: bool) {
        for output in 0..2 {
            if let (false, Some(value)) = (self.held[output], order[output].as_u64()) {
                (self.pair.set)(&mut self.rig, 2 * output + usize::from(value == 0), on);
            }
        }
    }

    /// Returns the terminals of each millisecond.
    fn play(&mut self, events: &Value, until: usize) -> Vec<[bool; 2]> {
        let events = events.as_object().expect("events").iter();
        let mut events: Vec<(u64, &Value)> = events
            .map(|(at, event)| (at.parse().expect("a time"), event))
            .collect();
        events.sort_by_key(|(at, _)| *at);
        let mut ahead = events.iter().peekable();
        let mut seen = Vec::new();
        for at in 0..=until as u64 {
            let mut is_reset = false;
            for (when, event) in &events {
                match event[0].as_str() {
                    Some("link") if at + 1 == *when => self.press(&event[1], true),
                    Some("link") if at == *when + PRESSED_MS => self.press(&event[1], false),
                    Some("held") if at + 1 == *when => self.hold(&event[1]),
                    Some("reset") if at == *when => is_reset = true,
                    _ => {}
                }
            }
            if is_reset {
                self.rig.board.reset();
                seen.push(self.terminals());
                self.reset(at + 1);
            } else {
                self.rig.board.run_until(self.zero + Time::from_ms(at));
                seen.push(self.terminals());
            }
            let is_due = |(when, event): &&(u64, &Value)| match event[0].as_str() {
                // What follows a reset is sent after it.
                Some("reset") => *when <= at,
                _ => *when <= at + AHEAD_MS,
            };
            while let Some((when, event)) = ahead.next_if(is_due) {
                self.send(*when, event);
            }
        }
        seen
    }

    fn terminals(&self) -> [bool; 2] {
        let [one, two, _] = (self.pair.terminals)(&self.rig);
        [one, two]
    }
}

/// Returns the state of both outputs in an entry.
fn both(entry: &Value, first: usize) -> [bool; 2] {
    [0, 1].map(|output| entry[first + output] == 1 || entry[first + output] == true)
}

/// Plays every short scenario that a master, inputs and resets can play. Returns their number.
pub fn play_scenarios(pair: &Pair) -> usize {
    let mut played = 0;
    for line in SCENARIOS.lines() {
        let scenario: Value = serde_json::from_str(line).expect("valid JSON");
        let mut events = scenario["events"].as_object().expect("events").values();
        let kinds = [
            "request", "link", "held", "dead", "max_on", "min_off", "reset",
        ];
        let states = scenario["states"].as_object().expect("states").iter();
        let states: Vec<(usize, &Value)> = states
            .map(|(at, state)| (at.parse().expect("a time"), state))
            .collect();
        let last = states.iter().map(|(at, _)| *at).max().expect("a state");
        let setup = &scenario["setup"];
        let can_play = events.all(|event| match event[0].as_str() {
            // A link is written before.
            Some("held") => [0, 1]
                .iter()
                .all(|output| event[1][output].is_null() || !setup["held"][output].is_null()),
            kind => kind.is_some_and(|kind| kinds.contains(&kind)),
        });
        if !can_play || last > LONGEST_MS || !setup["safe"].is_null() {
            continue;
        }
        let mut player = Player::new(pair, setup);
        let seen = player.play(&scenario["events"], last + TOLERANCE_MS);
        let is_pair = number(&setup["dead"]) > 0;
        assert!(
            !is_pair || !seen.contains(&[true; 2]),
            "both on in {line:.300}"
        );
        for (at, wanted) in states {
            let near = &seen[at.saturating_sub(TOLERANCE_MS)..=at + TOLERANCE_MS];
            assert!(
                near.contains(&both(wanted, 0)),
                "{near:?} at {at} of {line:.300}"
            );
        }
        played += 1;
    }
    played
}

/// Plays the histories. Returns the number of changes.
pub fn play_histories(pair: &Pair) -> usize {
    let mut count = 0;
    for line in HISTORIES.lines() {
        let history: Value = serde_json::from_str(line).expect("valid JSON");
        let mut player = Player::new(pair, &history["setup"]);
        let seen = player.play(&history["events"], HISTORY_MS + TOLERANCE_MS);
        let mut last = [false; 2];
        let mut changes = Vec::new();
        for (at, terminals) in seen.into_iter().enumerate() {
            if terminals != last {
                changes.push((at, terminals));
            }
            last = terminals;
        }
        let wanted = history["changes"].as_array().expect("changes").iter();
        let wanted: Vec<_> = wanted
            .map(|change| (usize::from(number(&change[0])), both(change, 1)))
            .collect();
        let is_near = |(seen, wanted): (&(usize, _), &(usize, _))| {
            seen.1 == wanted.1 && seen.0.abs_diff(wanted.0) <= TOLERANCE_MS
        };
        assert!(
            changes.len() == wanted.len() && changes.iter().zip(&wanted).all(is_near),
            "{changes:?}\nfor {wanted:?}\nof {line}"
        );
        count += wanted.len();
    }
    count
}
