//! The release image of the fx3u-24 behind its loader, on the virtual board: what differs from the boards with slots.
//! `MODIO_IMAGES_FX3U_24`, which `cargo xtask test` sets, names the directory of loader and images.
//!
//! The line, the store and the server are the same code as on the other boards, whose tests run at the corners.

use std::fs;

use register_map::codes::{Baud, LinkAction};
use register_map::configuration::{BAUD, FILTER, UNIT};
use register_map::links;
use register_map::name::UNIT_BY_SERIAL;
use register_map::part::FLASH_BASE;
use register_map::state;
use sim::board::terminals::Value;
use sim::board::{FX3U_24, Layout};
use sim::{Config, Time, chip};

/// The board that the image is for.
const LAYOUT: &Layout = &FX3U_24;

#[allow(dead_code, reason = "the tests of the modio-08 use the rest")]
#[path = "../image/fast_master.rs"]
mod fast_master;
#[allow(dead_code, reason = "tests of other boards use the rest")]
#[path = "../image/registers.rs"]
mod registers;
#[allow(dead_code, reason = "tests of other boards use the rest")]
#[path = "../image/rig.rs"]
mod rig;
mod rs232;
#[path = "../image/stage.rs"]
mod stage;
#[path = "../image/timing.rs"]
mod timing;

use fast_master::Master;
use rig::{Rig, corner, file, flash_with_settings};

/// Points of the first channel of ports 5, 7 and 8.
const Y0: u8 = 16;
const Y10: u8 = 24;
const AD0: u8 = 28;

/// A board with these stored settings.
fn board(settings: &[(u16, u16)]) -> Config {
    Config {
        chip: chip::Config::holding(flash_with_settings(settings)),
        ..Config::default()
    }
}

fn unit(settings: &[(u16, u16)]) -> Rig {
    Rig::with(board(settings))
}

fn set(rig: &mut Rig, name: &str, value: Value) {
    rig.board.set_terminal(name, value).unwrap();
}

fn relay(rig: &Rig, name: &str) -> bool {
    rig.board.terminals().get(name) == Some(Value::Relay(true))
}

/// Returns a reading of registers.
fn words(rig: &mut Rig, first: u16, count: u16) -> Vec<u16> {
    rig.words(3, first, count).expect("the registers exist")
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn every_input_is_at_its_point() {
    let mut rig = unit(&[]);
    let names = (0..8).chain(10..16).map(|n| format!("X{n}"));
    let inputs: Vec<_> = names.map(|name| (name, Value::Input(true))).collect();
    let rest = rig.ask(1, &[2, 0, 0, 0, 16]).unwrap();
    // A point is on while its pin is low: RUN is, and the 24 V are there.
    assert_eq!(rest, [2, 2, 0, 0b0100_0000]);
    for (point, (name, value)) in inputs.into_iter().enumerate() {
        set(&mut rig, &name, value);
        rig.board.run_for(Time::from_ms(10));
        let reply = rig.ask(1, &[2, 0, 0, 0, 16]).unwrap();
        let bits = u16::from_le_bytes([reply[2], reply[3]]);
        assert_eq!(bits, 1 << point | 1 << 14, "{name}");
        set(&mut rig, &name, Value::Input(false));
    }
    set(&mut rig, "RUN", Value::Switch(true));
    set(&mut rig, "24V", Value::Supply(false));
    rig.board.run_for(Time::from_ms(10));
    assert_eq!(rig.ask(1, &[2, 0, 14, 0, 2]).unwrap(), [2, 1, 0b10]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn every_relay_is_at_its_point_and_missing_ones_are_exception_02() {
    let mut rig = unit(&[]);
    let names = ["Y0", "Y1", "Y2", "Y3", "Y4", "Y5", "Y6", "Y7", "Y10", "Y11"];
    for (point, name) in (Y0..).zip(names) {
        rig.ask(1, &[5, 0, point, 0xFF, 0]).unwrap();
        rig.board.run_for(Time::from_ms(5));
        for other in names {
            assert_eq!(relay(&rig, other), other == name, "{name} {other}");
        }
        rig.ask(1, &[5, 0, point, 0, 0]).unwrap();
    }
    for point in [Y10 + 2, Y10 + 3] {
        assert_eq!(rig.ask(1, &[5, 0, point, 0xFF, 0]).unwrap(), [0x85, 2]);
        assert_eq!(rig.ask(1, &[1, 0, point, 0, 1]).unwrap(), [0x81, 2]);
    }
    assert_eq!(
        rig.ask(1, &[6, 1, 0x10, 0, 1]).unwrap(),
        [0x86, 2],
        "MODULE"
    );
}

const PAIR: stage::Pair = stage::Pair {
    first: Y0 as u16,
    inputs: 0,
    unit,
    set: |rig, input, on| set(rig, &format!("X{input}"), Value::Input(on)),
    terminals: |rig| ["Y0", "Y1", "Y2"].map(|name| relay(rig, name)),
};

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn scenarios_of_a_pair_of_relays_have_their_terminals() {
    let played = stage::play_scenarios(&PAIR);
    assert!(played >= 10, "{played}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn histories_of_a_pair_of_relays_have_every_change_of_a_terminal() {
    let changes = stage::play_histories(&PAIR);
    assert!(changes > 100, "{changes}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn analog_inputs_measure_volts_and_milliamperes() {
    let mut rig = unit(&[(FILTER + u16::from(AD0), 0)]);
    for (volts, milliamperes) in [(0, 0), (1_000, 4_000), (5_000, 10_000), (10_000, 20_000)] {
        set(&mut rig, "AD0", Value::Voltage(volts));
        set(&mut rig, "AD3", Value::Current(milliamperes));
        rig.board.run_for(Time::from_ms(1_500));
        let read = words(&mut rig, AD0.into(), 4);
        // 12 bits of 10 V or 20 mA. Five codes are the tolerance of the converter at its full scale.
        for (code, part) in [
            (read[0], f64::from(volts) / 10e3),
            (read[3], f64::from(milliamperes) / 20e3),
        ] {
            let expected = part * 4095.0;
            assert!(
                (f64::from(code) - expected).abs() <= 6.0,
                "{code} of {expected}"
            );
        }
        assert!(read[1].max(read[2]) <= 6, "AD1 and AD2: {read:?}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn analog_outputs_are_the_part_s_own_dac() {
    let mut rig = unit(&[(0x0117, 6)]);
    for code in [0, 410, 2048, 4095] {
        let [high, low] = u16::to_be_bytes(code);
        assert_eq!(rig.ask(1, &[6, 0, AD0 + 3, high, low]).unwrap()[0], 6);
        rig.board.run_for(Time::from_ms(20));
        let Some(Value::Output(millivolts)) = rig.board.terminals().get("DA1") else {
            panic!("no output");
        };
        let expected = f64::from(code) / 4095.0 * 10_000.0;
        assert!(
            (f64::from(millivolts) - expected).abs() < 60.0,
            "{millivolts} mV of {expected}"
        );
    }
}

/// Returns a board that was powered just now, with the loader in front of these bytes.
fn loaded(flash: Vec<u8>) -> Rig {
    let mut rig = Rig::cold(Config {
        chip: chip::Config::holding(flash),
        ..Config::default()
    });
    // The loader's reset after the check of an image.
    rig.tolerant = true;
    rig
}

/// Runs a board that was powered just now, and asserts that its line stays idle. While the part is in reset, for up to 4.5 ms
/// after power-on (DS5792 table 11), and until the first instructions of the loader, the board's resistor switches the driver
/// on, with an idle TX.
fn assert_idle(rig: &mut Rig, time: Time) {
    let begin = rig.board.now();
    rig.board.run_for(time);
    let mut since = None;
    for (at, on) in rig.board.line().driver_edges().collect::<Vec<_>>() {
        if let Some(since) = since.filter(|_| !on) {
            let reset = if since == begin {
                Time::from_us(4_500)
            } else {
                Time::ZERO
            };
            let time = at - since;
            assert!(
                time < reset + Time::from_us(50),
                "the driver was on for {time}"
            );
        }
        since = on.then_some(at);
    }
    assert_eq!(since, None, "the driver is on");
    assert_eq!(rig.board.line().take_received(), []);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn line_stays_idle_from_power_on_to_the_first_reply() {
    let mut flash = vec![0xFF; LAYOUT.part.flash_size];
    let [slot, _] = LAYOUT.board.layout().slots;
    let image = fs::read(file("modio-a.image")).expect("the image can be read");
    let at = (slot - FLASH_BASE) as usize;
    flash[at..at + image.len()].copy_from_slice(&image);
    let mut rig = loaded(flash);
    assert_idle(&mut rig, Time::from_ms(4_500));
    assert_eq!(rig.ask(1, &[2, 0, 0, 0, 1]).unwrap(), [2, 1, 0]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn line_stays_idle_without_a_valid_image() {
    let flash = vec![0xFF; LAYOUT.part.flash_size];
    let mut rig = loaded(flash);
    assert_idle(&mut rig, Time::from_secs(5));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn address_is_set_by_serial_number_and_kept() {
    let mut rig = unit(&[]);
    let serial = words(&mut rig, state::SERIAL_NUMBER, 2);
    let serial: Vec<u8> = serial.into_iter().flat_map(u16::to_be_bytes).collect();
    let [high, low] = UNIT_BY_SERIAL.to_be_bytes();
    let request = [&[0xFD, 0x46, 8][..], &serial, &[6, high, low, 0, 42]].concat();
    let reply = rig.exchange(&rig::adu(&request));
    let expected = [&[0xFD, 0x46, 9][..], &serial, &[6, high, low, 0, 42]].concat();
    assert_eq!(
        reply.get(reply.len().saturating_sub(15)..),
        Some(&rig::adu(&expected)[..])
    );
    rig.assert_answers(42);
    assert_eq!(rig.ask(1, &[2, 0, 0, 0, 1]), None);
    assert_eq!(
        rig.ask(42, &[6, high, low, 0, 43]).unwrap(),
        [0x86, 2],
        "to the unit address"
    );
    rig.board.run_for(Time::from_ms(500));
    rig.board.cycle();
    rig.board.run_for(Time::from_ms(200));
    rig.assert_answers(42);
    let [high, low] = UNIT.to_be_bytes();
    assert_eq!(rig.ask(42, &[3, high, low, 0, 1]).unwrap(), [3, 2, 0, 42]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn run_switch_moved_twice_after_power_on_starts_recovery() {
    let mut rig = Rig::with(board(&[(UNIT, 9), (0x0101, 192)]));
    rig.tolerant = true;
    for on in [true, false] {
        rig.board.run_for(Time::from_ms(500));
        set(&mut rig, "RUN", Value::Switch(on));
    }
    rig.board.run_for(Time::from_ms(500));
    rig.assert_answers(255);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn button_switches_a_lamp_without_a_master() {
    let link = links::of_point(Y0.into(), false);
    let mut rig = unit(&[(link, 0), (link + 1, LinkAction::Toggle.code())]);
    // After a power-on no button is seen for a second.
    rig.board.run_for(Time::from_ms(1_100));
    for lit in [true, false] {
        for pressed in [true, false] {
            set(&mut rig, "X0", Value::Input(pressed));
            rig.board.run_for(Time::from_ms(20));
            assert_eq!(relay(&rig, "Y0"), lit);
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn scan_finds_units_whose_start_bits_are_seen_by_an_interrupt() {
    for baud in [Baud::B9600, Baud::B115200, Baud::B921600] {
        let units = [200, -200, 0].into_iter().zip(0..).map(|(ppm, n)| {
            let mut config = board(&[(BAUD, baud.code())]);
            config.chip.corner = corner();
            config.chip.unique_id[11] = n;
            config.chip.crystal_hz = (8_000_000 + 8 * ppm) as u32;
            rig::board(config)
        });
        let mut master = Master::new(baud, 0, units.collect());
        for _ in 0..5 {
            let found = master.find_all();
            let units: Vec<u8> = found.iter().map(|(_, unit)| *unit).collect();
            assert_eq!(units, [1, 1, 1], "{baud:?}");
        }
        // Each unit also receives the replies of the others, at 921600 a character each 12 us.
        let lost: Vec<u16> = (master.find_all().into_iter())
            .map(|(serial, _)| overruns(&mut master, serial))
            .collect();
        // Three units lost 32 while each character took longer than that. Since then 1 and 4 were seen, in two layouts of
        // the code.
        assert!(lost.iter().sum::<u16>() <= 8, "{baud:?}: {lost:?}");
    }
}

/// Returns the messages that the unit with this serial number has lost by overruns.
fn overruns(master: &mut Master, serial: u32) -> u16 {
    let [a, b, c, d] = serial.to_be_bytes();
    let [high, low] = state::OVERRUNS.to_be_bytes();
    let request = [0xFD, 0x46, 8, a, b, c, d, 3, high, low, 0, 1];
    let (reply, _) = master.ask(&request, 0).expect("the unit replies");
    let [.., high, low] = reply[..] else {
        panic!("{reply:02X?}");
    };
    u16::from_be_bytes([high, low])
}
