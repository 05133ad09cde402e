//! START = 0xFFFE: outputs start as a master or a link left them.

use register_map::codes::LinkAction;
use register_map::configuration::{AS_IT_WAS, BAUD, FILTER, RECORD_AFTER_S, START};
use register_map::links;
use sim::line::{Format, Settings};
use sim::{Module, Time};

use crate::fitted::{LINES, change, codes, fitted, outputs};
use crate::rig::{Rig, adu};
use crate::saving::SLOWEST;

const MODULES: [Module; 4] = [Module::Do4, Module::Di4, Module::Ao4, Module::None];
/// Point of an output with a link, its input, and the first analog output.
const LAMP: u16 = 3;
const BUTTON: u16 = 4;
const ANALOG: u16 = 8;

/// Half-words of a record of these outputs: head, a pair of the 4DO, two of the 4AO, CRC and seals.
const RECORD: u64 = 5 + 6 + 4;
/// Time after which a change is stored: the time between two comparisons, and some for the record.
const STORED: Time = Time::from_ms(RECORD_AFTER_S as u64 * 1000 + 50);
/// Longest time from power-on until outputs have their values.
const SOON: Time = Time::from_ms(100);
const SOON_ANALOG: Time = Time::from_ms(110);
/// Progress of a flash operation when the power fails.
const FRACTIONS: [f64; 4] = [0.0, 0.5, 0.75, 1.0];

/// Returns a board whose digital outputs and analog outputs 1 and 2 start as they were, with the first button's link.
fn keeping(settings: &[(u16, u16)]) -> Rig {
    let mut stored = settings.to_vec();
    stored.push((FILTER + BUTTON, 0));
    stored.extend([0, 1, 2, 3, 8, 9].map(|point| (START + point, AS_IT_WAS)));
    let link = links::of_point(LAMP, false);
    stored.extend([(link, BUTTON), (link + 1, LinkAction::Toggle.code())]);
    let mut rig = fitted(MODULES, &stored);
    rig.tolerant = true;
    rig
}

/// Presses and releases the button, which has a value a second after a power-on.
fn press(rig: &mut Rig) {
    rig.board.run_for(Time::from_ms(1_000));
    for pressed in [true, false] {
        change(rig, 2, |slot| slot.set_energised(1, pressed)).unwrap();
        rig.board.run_for(Time::from_ms(5));
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn outputs_start_as_a_master_and_a_link_left_them_ten_seconds_before_the_power_was_lost() {
    let mut rig = keeping(&[]);
    let operations = rig.board.flash_operations();
    rig.write_bits(0, &[true, false, true]).unwrap();
    press(&mut rig);
    rig.write(ANALOG, &[1234, 4095, 77]).unwrap();
    rig.board.run_for(STORED);
    assert_eq!(rig.board.flash_operations() - operations, RECORD);

    rig.board.power_off();
    rig.board.run_for(Time::from_ms(100));
    (0..4).for_each(|n| rig.board.watch_pin(LINES[0][n].0, LINES[0][n].1));
    rig.board.power_on();
    let from = rig.board.now();
    while codes(&rig, 3) != [1234, 4095, 0, 0] {
        rig.board.run_for(Time::from_ms(1));
        assert!(rig.board.now() - from < SOON_ANALOG);
    }
    rig.started();
    for (n, on) in [true, false, true, true].into_iter().enumerate() {
        let (line, pin) = LINES[0][n];
        let edges = rig.board.pin_edges(line, pin).iter();
        let edges: Vec<_> = edges.filter(|edge| edge.0 >= from).collect();
        match (on, &edges[..]) {
            (true, [(at, true)]) => assert!(*at - from <= SOON, "{:?}", *at - from),
            (false, []) => {}
            _ => panic!("output {n}: {edges:?}"),
        }
    }
    assert_eq!(rig.registers(ANALOG, 3), Ok(vec![1234, 4095, 0]));

    // The four records of this power-on, and changes after it, which are lost.
    for n in 0..4 {
        rig.write_bits(0, &[n == 1, n == 2, false, n == 3]).unwrap();
        rig.board.run_for(STORED);
    }
    let operations = rig.board.flash_operations();
    press(&mut rig);
    rig.write(ANALOG, &[4000]).unwrap();
    rig.board.run_for(STORED);
    assert_eq!(outputs(&rig, 1), [false; 4]);
    // A restart does not fill the budget, and does not need it.
    rig.restart();
    assert_eq!(outputs(&rig, 1), [false; 4]);
    assert_eq!(codes(&rig, 3), [4000, 4095, 0, 0]);
    rig.board.run_for(STORED);
    assert_eq!(rig.board.flash_operations(), operations);
    rig.power_cycle();
    assert_eq!(outputs(&rig, 1), [false, false, false, true]);
    assert_eq!(codes(&rig, 3), [1234, 4095, 0, 0]);
    // A start with what is stored, and time that passes, writes nothing.
    rig.board.run_for(STORED);
    assert_eq!(rig.board.flash_operations(), operations);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn without_outputs_that_start_as_they_were_nothing_is_written() {
    let mut rig = fitted(MODULES, &[]);
    let operations = rig.board.flash_operations();
    rig.write_bits(0, &[true; 4]).unwrap();
    // An unsaved setting is not in force and is not saved.
    rig.configure(START, &[AS_IT_WAS; 4]);
    rig.board.run_for(STORED);
    assert_eq!(rig.board.flash_operations(), operations);
    // A saved one counts from now on.
    rig.save();
    rig.board.run_for(STORED);
    rig.power_cycle();
    assert_eq!(outputs(&rig, 1), [true; 4]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn values_from_before_start_was_changed_do_not_return() {
    let mut rig = keeping(&[]);
    let starts = |rig: &mut Rig, start| {
        rig.configure(START, &[start; 4]);
        rig.configure(START + ANALOG, &[start; 2]);
        rig.save();
    };
    rig.write_bits(0, &[true; 4]).unwrap();
    rig.write(ANALOG, &[1234, 4095]).unwrap();
    rig.board.run_for(STORED);
    starts(&mut rig, 0);
    rig.board.run_for(STORED);
    rig.power_cycle();
    rig.board.run_for(STORED);
    starts(&mut rig, AS_IT_WAS);
    rig.power_cycle();
    assert_eq!(outputs(&rig, 1), [false; 4]);
    assert_eq!(rig.registers(ANALOG, 2), Ok(vec![0; 2]));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn power_cut_in_any_operation_of_a_record_keeps_settings_and_leaves_old_or_new_outputs() {
    let mut rig = keeping(&[(BAUD, 1152)]);
    rig.settings(Settings {
        baud: 115_200,
        format: Format::N2,
    });
    let (mut old, mut changed) = ([false; 4], 0);
    for operation in 1.. {
        let new = old.map(|on| !on);
        let fraction = FRACTIONS[operation as usize % FRACTIONS.len()];
        rig.board.cut_in_flash_operation(operation, fraction);
        rig.write_bits(0, &new).unwrap();
        rig.board.run_for(STORED);
        let done = rig.board.powered();
        rig.board.power_off();
        let mut found = None;
        for _ in 0..2 {
            rig.board.run_for(Time::from_ms(10));
            rig.board.power_on();
            rig.started();
            let now = outputs(&rig, 1);
            assert!([old, new].contains(&now), "{operation}: {now:?}");
            assert_eq!(*found.get_or_insert(now), now, "{operation}");
            assert!(!rig.status(2), "{operation}: the store is not damaged");
            let words = |rig: &mut Rig, address| rig.registers(address, 1).unwrap()[0];
            assert_eq!(words(&mut rig, BAUD), 1152);
            assert_eq!(words(&mut rig, START + 9), AS_IT_WAS);
            rig.board.power_off();
        }
        rig.board.power_on();
        rig.started();
        changed += usize::from(found == Some(new));
        if done {
            assert!(
                operation > 15 && changed > 1,
                "{operation}: {changed} changed"
            );
            return;
        }
        old = outputs(&rig, 1);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn requests_during_a_record_are_not_late() {
    let mut rig = keeping(&[(BAUD, 1152)]);
    rig.settings(Settings {
        baud: 115_200,
        format: Format::N2,
    });
    rig.board.set_flash_durations(SLOWEST);
    rig.write_bits(0, &[true; 4]).unwrap();
    let wait = STORED - Time::from_ms(300) - rig.board.now();
    rig.board.run_for(wait);
    let operations = rig.board.flash_operations();
    let end = rig.board.now() + Time::from_ms(1_000);
    while rig.board.flash_operations() < operations + RECORD {
        assert!(rig.board.now() < end, "no record was written");
        for pdu in [&[1, 1, 0, 0, 0, 4][..], &[1, 3, 1, 0x20, 0, 32]] {
            let (reply, late) = rig.hurry(Time::ZERO, &adu(pdu));
            assert_eq!(reply[1], pdu[1]);
            // Programming a half-word may delay the reply by the duration of the operation.
            assert!(late <= Time::from_us(320), "{late:?}");
        }
    }
}
