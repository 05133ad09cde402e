//! Analog points of all slots: sixteen inputs of the converter, and four DACs on one bus.

use register_map::configuration::FILTER;
use sim::slot::BusFault;
use sim::{Module, Time};

use crate::fitted::{change, codes, fitted};
use crate::rig::{Rig, corner};

/// Module state of port 1.
const STATE: u16 = 0x0218;

/// Asserts that every input point reads its voltage.
fn assert_reads(rig: &mut Rig, first: u16, millivolts: &[u16]) {
    for function in [3, 4] {
        let words = rig.words(function, first, millivolts.len() as u16);
        for ((point, word), millivolts) in (first..).zip(words.unwrap()).zip(millivolts) {
            let exact = f64::from(*millivolts) / 3300.0 * 4095.0;
            let error = (f64::from(word) - exact).abs();
            let slack = 2.0 + f64::from(corner().adc_noise());
            assert!(error <= slack, "point {point}: {word} for {exact}");
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn every_analog_input_reads_its_own_voltage() {
    // Switch the low-pass filters off.
    let filters: Vec<_> = (0..16).map(|point| (FILTER + point, 0)).collect();
    let mut rig = fitted([Module::Ai4; 4], &filters);
    for round in 0..4 {
        let millivolts: [u16; 16] = std::array::from_fn(|n| ((n + 5 * round) % 16) as u16 * 200);
        for (port, of_port) in (1..).zip(millivolts.chunks(4)) {
            for (channel, value) in (1..).zip(of_port) {
                change(&mut rig, port, |slot| slot.set_millivolts(channel, *value)).unwrap();
            }
        }
        rig.board.run_for(Time::from_ms(20));
        assert_reads(&mut rig, 0, &millivolts);
    }
    assert_eq!(rig.registers(STATE, 8), Ok(vec![0, 0, 0, 0, 1, 1, 1, 1]));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn four_dacs_on_one_bus_get_their_own_codes() {
    let mut rig = fitted([Module::Ao4; 4], &[]);
    for round in 0..3_u16 {
        let words: Vec<u16> = (0..16)
            .map(|n| 100 + (n * 241 + round * 977) % 3900)
            .collect();
        rig.write(0, &words).unwrap();
        assert_eq!(rig.registers(0, 16).as_ref(), Ok(&words));
        rig.board.run_for(Time::from_ms(40));
        for (port, of_port) in (1..).zip(words.chunks(4)) {
            assert_eq!(codes(&rig, port), of_port, "port {port}");
        }
    }
    rig.write_single(6, 0x0A, 4095).unwrap();
    rig.board.run_for(Time::from_ms(20));
    assert_eq!(codes(&rig, 3)[2], 4095);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn inputs_and_outputs_of_mixed_modules_do_not_affect_each_other() {
    let plugged = [Module::Ai2Ao2, Module::Ao4, Module::Ai2Ao2, Module::Ai4];
    let filters: Vec<_> = (0..16).map(|point| (FILTER + point, 0)).collect();
    let mut rig = fitted(plugged, &filters);
    for (port, channel, millivolts) in [(1, 1, 300), (1, 2, 600), (3, 1, 900), (3, 2, 1200)] {
        change(&mut rig, port, |slot| {
            slot.set_millivolts(channel, millivolts)
        })
        .unwrap();
    }
    change(&mut rig, 4, |slot| slot.set_millivolts(4, 3000)).unwrap();
    rig.write(2, &[11, 12, 21, 22, 23, 24]).unwrap();
    rig.write(0x0A, &[31, 32]).unwrap();
    rig.board.run_for(Time::from_ms(40));
    assert_reads(&mut rig, 0, &[300, 600]);
    assert_reads(&mut rig, 8, &[900, 1200]);
    assert_reads(&mut rig, 0x0C, &[0, 0, 0, 3000]);
    assert_eq!(codes(&rig, 2), [21, 22, 23, 24]);
    for (port, expected) in [(1, [11, 12]), (3, [31, 32])] {
        let channels = crate::fitted::channels(&rig, port);
        let code = |code| sim::Channel::Ao { code };
        assert_eq!(channels[2..], expected.map(code), "port {port}");
    }
    // Points 0 and 1 are inputs.
    assert_eq!(rig.write(1, &[1, 2]), Err(2));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_dac_that_does_not_answer_does_not_affect_the_other_slots() {
    let mut rig = fitted([Module::Ao4; 4], &[]);
    rig.write(0, &[500; 16]).unwrap();
    change(&mut rig, 3, |slot| slot.set_bus_fault(BusFault::Absent));
    rig.board.run_for(Time::from_ms(600));
    assert_eq!(rig.registers(STATE, 4), Ok(vec![0, 0, 2, 0]));
    assert_eq!(rig.write(8, &[1]), Err(4));
    for (first, port) in [(0, 1), (4, 2), (0x0C, 4)] {
        rig.write(first, &[700, 701, 702, 703]).unwrap();
        rig.board.run_for(Time::from_ms(40));
        assert_eq!(codes(&rig, port), [700, 701, 702, 703], "port {port}");
    }
    change(&mut rig, 3, |slot| slot.set_bus_fault(BusFault::None));
    rig.board.run_for(Time::from_ms(600));
    assert_eq!(rig.registers(STATE, 4), Ok(vec![0; 4]));
    assert_eq!(rig.registers(8, 4), Ok(vec![500; 4]));
    assert_eq!(codes(&rig, 3), [500; 4]);
}
