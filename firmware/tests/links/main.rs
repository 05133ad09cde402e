//! Links as `links.py` has them, a program that is their rules: its scenarios, and random histories with every
//! change of the output. Both were printed by it:
//!
//! ```sh
//! cd firmware/tests/links
//! python3 links.py --scenarios > scenarios.jsonl
//! for seed in $(seq 100); do
//!     python3 links.py --history $seed | sed "1s/^{/{\"seed\": $seed, /"
//! done > histories.jsonl
//! ```
//!
//! Source 0 is a digital input without debounce, source 1 an analog input, whose words are the values of the program.

use std::collections::BTreeMap;

use firmware::config::{Config, LineName, Settings};
use firmware::device::{Device, Identity};
use firmware::kept_outputs::{KeptOutputs, half_word_of};
use modbus_server::line::{Faults, Framing, Port, Receiver};
use modbus_server::{Adu, Server, crc};
use modio_drivers::Channels;
use register_map::board::Modio08;
use register_map::{Module, configuration as at, links};
use serde_json::Value;

const SCENARIOS: &str = include_str!("scenarios.jsonl");
const HISTORIES: &str = include_str!("histories.jsonl");

/// The modules of ports 1 to 3.
const MODULES: [(u8, Module); 3] = [(1, Module::Di4), (2, Module::Do4), (3, Module::Ai4)];
const DIGITAL: u16 = 0;
const OUTPUT: u16 = 4;
const ANALOG: u16 = 8;
/// COMM_TIMEOUT: an hour. The player lets it pass when the program does.
const TIMEOUT: (u16, u32) = (36_000, 3_600_000);

/// Reset flags of a power-on, and of a restart.
const RESETS: [u8; 2] = [0b11_0000, 0b10_1000];

/// A device and its server.
struct Rig {
    device: &'static mut Device<Modio08>,
    server: Server,
}

impl Rig {
    /// Starts a device with these settings after a reset with these flags.
    fn new(reset_cause: u8, settings: &[(u16, u16)]) -> Self {
        let mut pairs: Vec<_> = at::modules(MODULES).collect();
        pairs.extend_from_slice(settings);
        let (settings, rejected) = Settings::load(pairs.into_iter());
        assert_eq!(rejected, 0);
        let identity = Identity {
            unit: 1,
            reset_cause,
            ..Identity::default()
        };
        Self {
            device: Device::new_in(
                Box::leak(Box::new_uninit()),
                Config::new(settings, false),
                identity,
            ),
            server: Server::new(Framing::Rtu),
        }
    }

    /// Sends a request that the unit must accept.
    fn ask(&mut self, pdu: &[u8]) {
        let mut adus = [Adu::new(), Adu::new()];
        let mut port = Port::new(Receiver::rtu(1, false), &mut adus);
        port.long_silence(0);
        let body = [&[1], pdu].concat();
        let crc = body.iter().fold(crc::START, |crc, b| crc::step(crc, *b));
        for byte in body.into_iter().chain(crc.to_le_bytes()) {
            port.received(byte, Faults::NONE);
        }
        assert!(port.long_silence(0));
        let request = port.take().expect("a request waits");
        let reply = self.server.serve(request, self.device);
        port.send(reply, 0);
        if let Some(order) = self.device.end_request() {
            self.device.carry_out(order, LineName::Rs485);
        }
        let reply: Vec<u8> = port.start().into_iter().chain(port.next_byte()).collect();
        assert_eq!(reply, [1, pdu[0]], "no exception");
        let now = self.device.state.millis();
        self.device.request_seen(now, true);
    }

    fn write(&mut self, address: u16, values: &[u16]) {
        self.ask(&[6, 1, 0, 0x5A, 0x17]);
        let [[a, b], [c, d]] = [address, values.len() as u16].map(u16::to_be_bytes);
        let mut pdu = vec![16, a, b, c, d, values.len() as u8 * 2];
        pdu.extend(values.iter().flat_map(|value| value.to_be_bytes()));
        self.ask(&pdu);
    }
}

/// A unit with one output and its links.
struct Unit {
    rig: Rig,
    links: [[u16; 4]; 2],
    start: u16,
    safe: u16,
    filter: u16,
    raw: (bool, i16),
    good: bool,
    tripped: bool,
    /// Time in ms since the start.
    now: u32,
}

/// Returns the registers of a link of the program: source, action, when, time in ms, HIGH, LOW.
fn registers(link: &Value) -> [u16; 4] {
    let number = |at| link.get(at).map_or(0, |value| value.as_i64().unwrap());
    let source = [DIGITAL, ANALOG][number(0) as usize];
    let action = number(1) as u16 | (number(2) as u16) << 8;
    let time = (number(3) / 100) as u16;
    if source == DIGITAL {
        return [source, action, time, 0];
    }
    [source, action, number(4) as u16, number(5) as u16]
}

/// Returns SAFE for a value of the program: a level or `"hold"`.
fn safe_of(value: &Value) -> u16 {
    value.as_bool().map_or(at::HOLD, u16::from)
}

impl Unit {
    fn new(setup: &Value) -> Self {
        let mut links = [[0xFFFF, 0, 0, 0]; 2];
        for (own, link) in links.iter_mut().zip(setup["links"].as_array().unwrap()) {
            *own = registers(link);
        }
        let raw = &setup["raw"];
        let mut unit = Self {
            rig: Rig::new(RESETS[0], &[]),
            links,
            start: setup["start"].as_bool().unwrap_or_default().into(),
            safe: setup.get("safe").map_or(0, safe_of),
            filter: 4,
            raw: (
                raw[0].as_bool().unwrap_or_default(),
                raw[1].as_i64().unwrap_or(1_600) as i16,
            ),
            good: setup["good"].as_bool().unwrap_or(true),
            tripped: false,
            now: 0,
        };
        unit.start_with(None);
        unit
    }

    /// Starts the unit: after a power-on, or with the outputs that a reset has kept.
    fn start_with(&mut self, kept: Option<&KeptOutputs>) {
        let start = if kept.is_some() {
            at::AS_IT_WAS
        } else {
            self.start
        };
        let mut settings = vec![
            (at::COMM_TIMEOUT, TIMEOUT.0),
            (at::FILTER + DIGITAL, 0),
            (at::FILTER + ANALOG, self.filter),
            (at::SAFE + OUTPUT, self.safe),
            (at::START + OUTPUT, start),
        ];
        for (second, words) in [false, true].into_iter().zip(self.links) {
            settings.extend((links::of_point(OUTPUT, second)..).zip(words));
        }
        let cause = RESETS[usize::from(kept.is_some())];
        self.rig = Rig::new(cause, &settings);
        self.rig.device.start_outputs(kept, None);
        (self.tripped, self.now) = (false, 0);
    }

    fn play(&mut self, event: &[Value]) {
        let name = event[0].as_str().unwrap();
        match name {
            "digital" => self.raw.0 = event[1].as_bool().unwrap(),
            "analog" => self.raw.1 = event[1].as_i64().unwrap() as i16,
            "good" => self.good = event[1].as_bool().unwrap(),
            "trip" if !self.tripped => {
                self.tripped = true;
                let now = self.rig.device.state.millis();
                let long_ago = now.wrapping_sub(TIMEOUT.1);
                self.rig.device.request_seen(long_ago, true);
            }
            "trip" => {}
            "restart" => {
                let kept = self.kept();
                self.start_with(Some(&kept));
            }
            "power" => self.start_with(None),
            _ => self.request(name, event),
        }
    }

    fn request(&mut self, name: &str, event: &[Value]) {
        let rig = &mut self.rig;
        match name {
            "master" => {
                let high = if event[1].as_bool().unwrap() { 0xFF } else { 0 };
                rig.ask(&[5, 0, OUTPUT as u8, high, 0]);
            }
            "request" => rig.ask(&[7]),
            "link" => {
                let index = event[1].as_u64().unwrap() as usize;
                self.links[index] = registers(&event[2]);
                rig.write(links::of_point(OUTPUT, index == 1), &self.links[index]);
            }
            "setting" => {
                self.filter ^= 1;
                rig.write(at::FILTER + ANALOG, &[self.filter]);
            }
            "safe" => {
                self.safe = safe_of(&event[1]);
                rig.write(at::SAFE + OUTPUT, &[self.safe]);
            }
            _ => panic!("{name}"),
        }
        self.tripped = false;
    }

    /// Returns what the region that a reset keeps has of the outputs.
    fn kept(&self) -> KeptOutputs {
        let mut values = [0; 32];
        for (slot, port) in self.rig.device.points.ports().iter().enumerate() {
            for channel in 0..4 {
                values[slot * 4 + channel] = half_word_of(port.commanded(channel));
            }
        }
        KeptOutputs {
            values,
            modules: self.rig.device.modules_in_force(),
            held: self.rig.device.held_outputs(),
            at_safe: self.rig.device.outputs_at_safe(),
        }
    }

    /// Scans the inputs, and returns the output as the next scan drives it.
    fn scan(&mut self) -> bool {
        let device = &mut self.rig.device;
        let mut channels = Channels::new();
        channels.set_bit(0, self.raw.0);
        channels.set_word(0, self.raw.1.cast_unsigned());
        // Unlike implausible codes, a line without codes is not good from the first scan on.
        device.points.ports_mut()[2].set_failing(u8::from(!self.good));
        device.scanned(0, &channels, &[None; 4], true, 1);
        device.scanned(2, &channels, &[None; 4], true, 1);
        device.tick(u32::from(self.now > 0));
        self.now += 1;
        (0..4).for_each(|slot| device.run_links(slot));
        device.drive(1, 0) & 1 != 0
    }
}

fn lines(text: &str) -> impl Iterator<Item = Value> {
    text.lines().map(|line| serde_json::from_str(line).unwrap())
}

/// Returns the entries of an object by time in ms.
fn by_time(object: &Value) -> BTreeMap<u32, Value> {
    let entries = object.as_object().unwrap().iter();
    entries
        .map(|(ms, value)| (ms.parse().unwrap(), value.clone()))
        .collect()
}

#[test]
fn links_play_every_scenario_of_their_rules() {
    let mut broken = Vec::new();
    let mut played = 0;
    for scenario in lines(SCENARIOS) {
        let mut unit = Unit::new(&scenario);
        let [events, states] = ["events", "states"].map(|name| by_time(&scenario[name]));
        let last = *events.keys().chain(states.keys()).max().unwrap();
        let (mut before, mut moves) = (None, 0);
        for ms in 0..=last + 10 {
            if let Some(event) = events.get(&ms) {
                unit.play(event.as_array().unwrap());
            }
            let on = unit.scan();
            moves += u32::from(before.is_some_and(|before| before != on));
            before = Some(on);
            if states
                .get(&ms)
                .is_some_and(|state| state.as_bool() != Some(on))
            {
                broken.push(format!("{}: {on} at {ms} ms", scenario["name"]));
                break;
            }
        }
        // An analog source is looked at once a second.
        if moves > 12 {
            broken.push(format!("{}: {moves} moves", scenario["name"]));
        }
        played += 1;
    }
    assert_eq!(broken, Vec::<String>::new());
    assert_eq!(played, 59);
}

#[test]
fn links_play_a_hundred_random_histories_of_their_rules() {
    let mut histories: Vec<Vec<Value>> = Vec::new();
    for line in lines(HISTORIES) {
        if line.get("seed").is_some() {
            histories.push(Vec::new());
        }
        histories.last_mut().unwrap().push(line);
    }
    assert_eq!(histories.len(), 100);
    for history in histories {
        let (setup, lines) = history.split_first().unwrap();
        let mut unit = Unit::new(setup);
        let mut expected = None;
        let mut next = lines.iter().peekable();
        for ms in 0..150_000 {
            while let Some(line) = next.next_if(|line| line["ms"] == ms) {
                match line.get("event") {
                    Some(event) => unit.play(event.as_array().unwrap()),
                    None => expected = line["on"].as_bool(),
                }
            }
            let on = Some(unit.scan());
            assert_eq!(on, expected, "seed {} at {ms} ms", setup["seed"]);
        }
    }
}
