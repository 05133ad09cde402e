//! Links on the image, as `firmware/tests/links/links.py` has them, a program that is their rules. The device's own tests
//! play all of its scenarios, and histories of its output; here are some of each.
//!
//! Source 0 is a digital input, source 1 a thermistor, whose wire is cut while it is not good. The watchdog expires 100 ms
//! after its event.

use std::collections::BTreeMap;

use register_map::configuration::{
    AS_IT_WAS, BAUD, COMM_TIMEOUT, FILTER, HOLD, RANGE, SAFE, SCALE, START,
};
use register_map::{links, state};
use serde_json::Value;
use sim::line::{Format, Settings};
use sim::{Module, Time};

use crate::bench::Bench;
use crate::fitted::{change, fitted, outputs};

const SCENARIOS: &str = include_str!("../../../../firmware/tests/links/scenarios.jsonl");
const HISTORIES: &str = include_str!("../../../../firmware/tests/links/histories.jsonl");

const MODULES: [Module; 4] = [Module::Di4, Module::Do4, Module::Ai4, Module::None];
const DIGITAL: u16 = 0;
const OUTPUT: u16 = 4;
const ANALOG: u16 = 8;

/// Longest time in ms from an event until the output has what it has then: an analog source is looked at once a second.
const SETTLED: u64 = 1_200;
/// Length of a history in ms.
const HISTORY: u64 = 12_000;

const PLAYED: [&str; 16] = [
    "cold at power-on: on after a second, START before",
    "warm at power-on: START 1 for a second, then off",
    "hysteresis",
    "cut: SAFE at once, and for a minute after it is back",
    "cut with SAFE hold: keeps what it wanted",
    "or of two level links",
    "a master's write is undone",
    "trip: no SAFE under an acting level link",
    "trip before it knows: START, never SAFE",
    "alone: acts with what it knows now",
    "alone: the master's first write does",
    "24 V come late: no edge",
    "toggle: rising edges",
    "pulse: ends though its link is gone",
    "restart between the thresholds: a heater does not drop",
    "a link that is written toggles nothing",
];

/// A unit whose time is that of the program.
struct Player {
    bench: Bench,
    /// Time of the board at which the program's time is 0.
    origin: Time,
    start: u16,
    filter: u16,
    celsius: f64,
    good: bool,
    tripped: bool,
}

/// Returns the registers of a link of the program: source, action, when, time in ms, HIGH, LOW.
fn registers(link: &Value) -> [u16; 4] {
    let number = |at| link.get(at).map_or(0, |value| value.as_i64().unwrap());
    let action = (number(1) | number(2) << 8) as u16;
    if number(0) == 0 {
        [DIGITAL, action, (number(3) / 100) as u16, 0]
    } else {
        // From 0.01 to 0.1 degC.
        [
            ANALOG,
            action,
            (number(4) / 10) as u16,
            (number(5) / 10) as u16,
        ]
    }
}

fn safe_of(value: &Value) -> u16 {
    value.as_bool().map_or(HOLD, u16::from)
}

/// Returns the voltage in mV at a thermistor of 10 kOhm and 3950 K under a pull-up of 10 kOhm to 3.3 V.
fn millivolts(celsius: f64) -> u16 {
    let ratio = (3950.0 * (1.0 / (celsius + 273.15) - 1.0 / 298.15)).exp();
    (3300.0 * ratio / (ratio + 1.0)).round() as u16
}

impl Player {
    fn new(setup: &Value) -> Self {
        let start = setup["start"].as_bool().unwrap_or_default().into();
        let mut settings = vec![
            (BAUD, 1152),
            (FILTER + DIGITAL, 0),
            (FILTER + ANALOG, 2),
            (RANGE + ANALOG, 2),
            (SCALE + ANALOG, 1),
            (SAFE + OUTPUT, setup.get("safe").map_or(0, safe_of)),
            (START + OUTPUT, start),
        ];
        let written = setup["links"].as_array().unwrap().iter().map(registers);
        for (second, words) in [false, true].into_iter().zip(written) {
            settings.extend((links::of_point(OUTPUT, second)..).zip(words));
        }
        let mut bench = fitted(MODULES, &settings);
        bench.tolerant = true;
        bench.settings(Settings {
            baud: 115_200,
            format: Format::N2,
        });
        let raw = &setup["raw"];
        let mut player = Self {
            bench,
            origin: Time::ZERO,
            start,
            filter: 2,
            celsius: raw[1].as_f64().unwrap_or(1_600.0) / 100.0,
            good: setup["good"].as_bool().unwrap_or(true),
            tripped: false,
        };
        // The inputs have their levels at the power-on.
        player.bench.board.power_off();
        player.set_digital(raw[0].as_bool().unwrap_or_default());
        player.set_analog();
        player.bench.board.run_for(Time::from_ms(50));
        player.bench.board.power_on();
        player.bench.board.run_for(Time::from_ms(120));
        player.bench.board.line().take_received();
        player.begin_at(0);
        player
    }

    /// Makes the time of the program `ms` at the start of the unit.
    fn begin_at(&mut self, ms: u64) {
        let uptime = self.bench.long(state::UPTIME_MS);
        self.origin = self.bench.board.now() - Time::from_ms(u64::from(uptime)) - Time::from_ms(ms);
    }

    fn run_until(&mut self, ms: u64) {
        let at = self.origin + Time::from_ms(ms);
        if at > self.bench.board.now() {
            self.bench.board.run_until(at);
        }
    }

    fn set_digital(&mut self, on: bool) {
        change(&mut self.bench, 1, |slot| slot.set_energised(1, on)).unwrap();
    }

    fn set_analog(&mut self) {
        let millivolts = if self.good {
            millivolts(self.celsius)
        } else {
            3_300
        };
        change(&mut self.bench, 3, |slot| {
            slot.set_millivolts(1, millivolts)
        })
        .unwrap();
    }

    fn output(&self) -> bool {
        outputs(&self.bench, 2)[0]
    }

    fn play(&mut self, ms: u64, event: &[Value]) {
        let name = event[0].as_str().unwrap();
        match name {
            "digital" => self.set_digital(event[1].as_bool().unwrap()),
            "analog" => {
                self.celsius = event[1].as_f64().unwrap() / 100.0;
                self.set_analog();
            }
            "good" => {
                self.good = event[1].as_bool().unwrap();
                self.set_analog();
            }
            "trip" if self.tripped => {}
            "trip" => {
                self.bench.configure(COMM_TIMEOUT, &[1]);
                self.tripped = true;
                self.bench.board.run_for(Time::from_ms(110));
            }
            "restart" | "power" => self.start(name, ms),
            _ => self.request(name, event),
        }
    }

    fn start(&mut self, name: &str, ms: u64) {
        self.end_trip();
        let start = if name == "restart" {
            AS_IT_WAS
        } else {
            self.start
        };
        self.bench.configure(START + OUTPUT, &[start]);
        self.bench.save();
        if name == "restart" {
            self.bench.restart();
        } else {
            self.bench.power_cycle();
        }
        self.begin_at(ms);
    }

    /// Switches the watchdog off, by a request that writes no output.
    fn end_trip(&mut self) {
        if self.tripped {
            self.bench.configure(COMM_TIMEOUT, &[0]);
            self.tripped = false;
        }
    }

    fn request(&mut self, name: &str, event: &[Value]) {
        match name {
            "master" => {
                let on = event[1].as_bool().unwrap();
                self.bench.write_bit(OUTPUT, on).unwrap();
            }
            "request" => {}
            "link" => {
                let second = event[1].as_u64() == Some(1);
                let first = links::of_point(OUTPUT, second);
                self.bench.configure(first, &registers(&event[2]));
            }
            "setting" => {
                self.filter ^= 1;
                self.bench.configure(FILTER + ANALOG, &[self.filter]);
            }
            "safe" => self.bench.configure(SAFE + OUTPUT, &[safe_of(&event[1])]),
            _ => panic!("{name}"),
        }
        self.end_trip();
    }
}

fn lines(text: &str) -> impl Iterator<Item = Value> {
    text.lines().map(|line| serde_json::from_str(line).unwrap())
}

/// Returns the entries of an object by time in ms.
fn by_time(object: &Value) -> BTreeMap<u64, Value> {
    let entries = object.as_object().unwrap().iter();
    entries
        .map(|(ms, value)| (ms.parse().unwrap(), value.clone()))
        .collect()
}

fn play(scenario: &Value) {
    let [events, states] = ["events", "states"].map(|name| by_time(&scenario[name]));
    let mut player = Player::new(scenario);
    let mut times: Vec<u64> = events.keys().chain(states.keys()).copied().collect();
    times.sort_unstable();
    times.dedup();
    for (n, ms) in times.iter().enumerate() {
        player.run_until(*ms);
        if let Some(event) = events.get(ms) {
            player.play(*ms, event.as_array().unwrap());
        }
        let Some(on) = states.get(ms).and_then(Value::as_bool) else {
            continue;
        };
        let latest = times
            .get(n + 1)
            .map_or(ms + SETTLED, |next| *next.min(&(ms + SETTLED)));
        let latest = player.origin + Time::from_ms(latest);
        while player.output() != on && player.bench.board.now() < latest {
            player.bench.board.run_for(Time::from_ms(1));
        }
        assert_eq!(player.output(), on, "{} at {ms} ms", scenario["name"]);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn image_plays_scenarios_of_the_rules_of_links() {
    let scenarios = lines(SCENARIOS).filter(|scenario| {
        let name = scenario["name"].as_str().unwrap();
        PLAYED.contains(&name)
    });
    let played = scenarios.map(|scenario| play(&scenario)).count();
    assert_eq!(played, PLAYED.len());
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn image_plays_a_dozen_histories_of_the_rules_of_links() {
    let mut histories: Vec<Vec<Value>> = Vec::new();
    for line in lines(HISTORIES) {
        if line.get("seed").is_some() {
            histories.push(Vec::new());
        }
        histories.last_mut().unwrap().push(line);
    }
    let mut looked = 0;
    for history in histories.iter().take(12) {
        let (setup, lines) = history.split_first().unwrap();
        let mut player = Player::new(setup);
        let (mut last, mut expected) = (0, setup["start"].as_bool().unwrap());
        for line in lines {
            let ms = line["ms"].as_u64().unwrap();
            if ms > HISTORY {
                break;
            }
            // Just before anything happens, if nothing has for long enough.
            if ms > last + SETTLED + 10 {
                player.run_until(ms - 10);
                assert_eq!(
                    player.output(),
                    expected,
                    "seed {} at {ms} ms",
                    setup["seed"]
                );
                looked += 1;
            }
            player.run_until(ms);
            match line.get("event") {
                Some(event) => player.play(ms, event.as_array().unwrap()),
                None => expected = line["on"].as_bool().unwrap(),
            }
            last = ms;
        }
    }
    assert!(looked > 20, "looked {looked} times");
}
