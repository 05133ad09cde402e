//! The stage of the outputs as `stage.py` has it, a program that is its rules: its scenarios, and random histories with
//! every change of a terminal. Both were printed by it:
//!
//! ```sh
//! cd firmware/tests/outputs
//! python3 stage.py --scenarios > scenarios.jsonl
//! for seed in $(seq 200); do python3 stage.py --history $seed; done | tr -d " " > histories.jsonl
//! ```

use std::collections::BTreeMap;
use std::mem;

use firmware::stage::{Held, Stage, Times};
use serde_json::Value;

const SCENARIOS: &str = include_str!("scenarios.jsonl");
const HISTORIES: &str = include_str!("histories.jsonl");

/// Where the two outputs of the program are: their channels.
const PLACES: [[usize; 2]; 4] = [[0, 1], [1, 0], [2, 3], [3, 2]];

/// A port whose outputs the program has.
struct Player {
    stage: Stage,
    times: [Times; 4],
    coils: u8,
    held: Held,
    manual: u8,
    /// There was no scan since the start.
    starting: bool,
    /// Time in ms until the pulse of an output ends.
    pulses: [u64; 2],
    start: Value,
    safe: Value,
    place: [usize; 2],
}

impl Player {
    fn new(setup: &Value, place: [usize; 2]) -> Self {
        let mut player = Self {
            stage: Stage::new(0),
            times: [Times::default(); 4],
            coils: 0,
            held: Held::default(),
            manual: 0,
            starting: true,
            pulses: [0; 2],
            start: setup["start"].clone(),
            safe: setup["safe"].clone(),
            place,
        };
        player.times[place[0].min(place[1])].dead = number(&setup["dead"]);
        for (output, channel) in place.into_iter().enumerate() {
            player.times[channel].max_on = number(&setup["max_on"][output]);
            player.times[channel].min_off = number(&setup["min_off"][output]);
        }
        player.held = player.held_as(&setup["held"]);
        player.begin();
        player
    }

    fn begin(&mut self) {
        let digital = 1 << self.place[0] | 1 << self.place[1];
        (self.stage, self.coils, self.pulses) = (Stage::new(digital), 0, [0; 2]);
        self.set();
        self.starting = true;
        self.stage.take_held(self.held);
        let start = self.start.clone();
        self.order(&start, 0);
    }

    /// Returns the outputs that have a value, and those whose value is 1.
    fn masks(&self, values: &Value) -> (u8, u8) {
        let mut masks = (0, 0);
        for (output, channel) in self.place.into_iter().enumerate() {
            let value = &values[output];
            masks.0 |= u8::from(!value.is_null()) << channel;
            masks.1 |= u8::from(value == 1 || value == true) << channel;
        }
        masks
    }

    fn held_as(&self, values: &Value) -> Held {
        let (outputs, on) = self.masks(values);
        Held { outputs, on }
    }

    fn order(&mut self, values: &Value, pulse: u64) {
        let (named, on) = self.masks(values);
        let named = named & !self.held.outputs;
        self.coils = self.stage.order(self.coils, named, on);
        self.end_pulses_of(named);
        for (output, channel) in self.place.into_iter().enumerate() {
            if (named & on) >> channel & 1 != 0 {
                self.pulses[output] = pulse;
            }
        }
    }

    fn end_pulses_of(&mut self, channels: u8) {
        for (pulse, channel) in self.pulses.iter_mut().zip(self.place) {
            if channels >> channel & 1 != 0 {
                *pulse = 0;
            }
        }
    }

    fn play(&mut self, event: &Value) {
        let values = &event[1];
        match event[0].as_str().expect("a name") {
            "request" => {
                let (named, on) = self.masks(values);
                let before = self.stage.ended();
                self.coils = self.stage.request(self.coils, named, on);
                let repeated = before & self.stage.ended() & on;
                self.end_pulses_of(named & !repeated & !self.held.outputs);
            }
            "link" => self.order(values, 0),
            "pulse" => self.order(values, event[2].as_u64().expect("a time")),
            "safe" => {
                let safe = self.safe.clone();
                self.order(&safe, 0);
            }
            "held" => {
                self.held = self.held_as(values);
                self.stage.take_held(self.held);
            }
            "manual" => self.manual = self.masks(values).1,
            "raw" => self.coils = self.masks(values).1,
            "reset" => self.begin(),
            name => {
                let channel = match event[1].as_u64() {
                    Some(output) => self.place[output as usize],
                    None => self.place[0].min(self.place[1]),
                };
                let times = &mut self.times[channel];
                let time = match name {
                    "dead" => &mut times.dead,
                    "max_on" => &mut times.max_on,
                    "min_off" => &mut times.min_off,
                    _ => panic!("{event}"),
                };
                *time = number(&event[2]);
                self.set();
            }
        }
    }

    /// Passes the times to the stage.
    fn set(&mut self) {
        for (channel, times) in self.times.into_iter().enumerate() {
            let before = self.coils;
            self.coils = self.stage.set(before, channel, times);
            self.end_pulses_of(before & !self.coils);
        }
    }

    /// Runs a scan. Returns the terminals, and the states of the outputs as the program numbers them.
    fn scan(&mut self) -> [u8; 4] {
        for (pulse, channel) in self.pulses.iter_mut().zip(self.place) {
            if *pulse > 0 {
                *pulse -= 1;
                if *pulse == 0 {
                    self.coils &= !(1 << channel);
                }
            }
        }
        self.end_pulses_of(self.held.outputs);
        self.coils = self.stage.scan(self.coils, self.manual, 1);
        // In the program a start takes a scan, also of outputs without times.
        let terminals = if mem::take(&mut self.starting) {
            0
        } else {
            self.stage.terminals()
        };
        let bit = |mask: u8, output: usize| mask >> self.place[output] & 1;
        let terminal = |output| bit(terminals, output);
        let status = |output| {
            if bit(self.stage.ended(), output) != 0 {
                6
            } else if bit(self.coils, output) > terminal(output) {
                5
            } else {
                0
            }
        };
        [terminal(0), terminal(1), status(0), status(1)]
    }
}

fn number(value: &Value) -> u32 {
    value.as_u64().unwrap_or(0).try_into().expect("a time")
}

/// Returns the entries of an object whose keys are times.
fn by_time(object: &Value) -> BTreeMap<u32, Vec<Value>> {
    let entries = object.as_object().expect("an object").iter();
    let all = entries.map(|(at, entry)| {
        let several = entry[0].is_array();
        let entries = entry.as_array().filter(|_| several).cloned();
        (
            at.parse().expect("a time"),
            entries.unwrap_or_else(|| vec![entry.clone()]),
        )
    });
    all.collect()
}

fn play(
    setup: &Value,
    events: &Value,
    until: u32,
    place: [usize; 2],
    mut look: impl FnMut(u32, [u8; 4]),
) {
    let events = by_time(events);
    let mut player = Player::new(setup, place);
    for at in 0..=until {
        for event in events.get(&at).into_iter().flatten() {
            player.play(event);
        }
        look(at, player.scan());
    }
}

#[test]
fn scenarios_have_the_terminals_and_states_of_the_program() {
    for line in SCENARIOS.lines() {
        let scenario: Value = serde_json::from_str(line).expect("valid JSON");
        let states = by_time(&scenario["states"]);
        let until = *states.keys().last().expect("a state");
        for place in PLACES {
            play(
                &scenario["setup"],
                &scenario["events"],
                until,
                place,
                |at, state| {
                    let Some(wanted) = states.get(&at) else {
                        return;
                    };
                    let wanted: Vec<u8> =
                        serde_json::from_value(wanted[0].clone()).expect("numbers");
                    assert_eq!(state[..wanted.len()], wanted, "{place:?} at {at} of {line}");
                },
            );
        }
    }
}

#[test]
fn histories_have_every_change_of_a_terminal_at_its_time() {
    for line in HISTORIES.lines() {
        let history: Value = serde_json::from_str(line).expect("valid JSON");
        for place in PLACES {
            let (mut changes, mut last) = (Vec::new(), [0, 0]);
            play(
                &history["setup"],
                &history["events"],
                6000,
                place,
                |at, state| {
                    let [one, two, ..] = state;
                    if last != [one, two] {
                        changes.push(serde_json::json!([at, one == 1, two == 1]));
                    }
                    last = [one, two];
                },
            );
            assert_eq!(
                Value::from(changes),
                history["changes"],
                "{place:?} of {line:.200}"
            );
        }
    }
}
