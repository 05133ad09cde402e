//! Outputs from the reset to the first scan: off, then START, with no state in between, for every kind of reset.

use register_map::configuration::{AS_IT_WAS, START};
use sim::{Module, Time};

use crate::{
    analog_outputs::codes,
    rig::{Rig, SLOT, symbol},
};

/// Longest time from the reset until the outputs have their START values: the value for users.
const SOON: Time = Time::from_ms(100);
/// The same for analog outputs.
const SOON_ANALOG: Time = Time::from_ms(110);

fn stored(values: [u16; 4]) -> Vec<(u16, u16)> {
    (0..)
        .zip(values)
        .map(|(n, v)| (START + SLOT + n, v))
        .collect()
}

/// Function that causes a start.
type Begin = fn(&mut Rig);

const BEGINNINGS: [(&str, Begin); 4] = [
    ("power-on", |rig| rig.board.cycle()),
    ("the reset pin", |rig| rig.board.reset()),
    ("COMMAND 2", |rig| {
        rig.command(2);
    }),
    ("the watchdog", |rig| {
        // A branch to its own address at the entry of the scan's handler.
        let scan = symbol("EXTI1") & !1;
        let was = rig
            .board
            .patch_code(scan, &0xE7FEu16.to_le_bytes())
            .unwrap();
        let resets = rig.board.resets();
        while rig.board.resets() == resets {
            rig.board.run_for(Time::from_us(100));
        }
        rig.board.patch_code(scan, &was).unwrap();
    }),
];

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn digital_outputs_go_off_and_then_to_start_without_other_edges() {
    let mut rig = Rig::set_up(Module::Do4, &stored([1, 0, 1, 0]));
    rig.tolerant = true;
    for (what, begin) in BEGINNINGS {
        // Before the start, each output has the opposite of its START value.
        rig.write_bits(SLOT, &[false, true, false, true]).unwrap();
        (0..4).for_each(|pin| rig.board.watch_pin('A', pin));
        let from = rig.board.now();
        begin(&mut rig);
        rig.started();
        for pin in 0..4 {
            let edges: Vec<_> = rig
                .board
                .pin_edges('A', pin)
                .iter()
                .filter(|e| e.0 >= from)
                .collect();
            match (pin % 2, &edges[..]) {
                (0, [(_, true)]) | (1, [(_, false)]) => {}
                _ => panic!("{what}, pin {pin}: {edges:?}"),
            }
        }
        // The two outputs that went off did so at the reset. START followed soon after.
        let off = rig.board.pin_edges('A', 1).last().unwrap().0;
        let on = rig.board.pin_edges('A', 0).last().unwrap().0;
        let cut = if what == "power-on" {
            Time::from_ms(100)
        } else {
            Time::ZERO
        };
        let after = on - off - cut;
        assert!(after <= SOON, "{what}: START {after:?} after the reset");
        assert_eq!(
            rig.bits(1, SLOT, 4),
            Ok(vec![true, false, true, false]),
            "{what}"
        );
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn relays_do_not_click_at_power_on() {
    let mut rig = Rig::set_up(Module::Relay2, &[]);
    rig.tolerant = true;
    for (what, begin) in BEGINNINGS {
        (0..4).for_each(|pin| rig.board.watch_pin('A', pin));
        begin(&mut rig);
        rig.started();
        for pin in 2..4 {
            assert_eq!(rig.board.pin_edges('A', pin), [], "{what}");
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn analog_outputs_go_from_the_stored_dac_values_directly_to_start() {
    let start = [100, 4095, 0, 2048];
    let mut rig = Rig::set_up(Module::Ao4, &stored(start));
    rig.tolerant = true;
    for (what, begin) in BEGINNINGS {
        rig.write(SLOT, &[4000, 3000, 2000, 1000]).unwrap();
        rig.board.run_for(Time::from_ms(30));
        begin(&mut rig);
        let before = codes(&rig, [1, 2, 3, 4]);
        let from = rig.board.now();
        while codes(&rig, [1, 2, 3, 4]) != start {
            rig.board.run_for(Time::from_us(100));
            let now = codes(&rig, [1, 2, 3, 4]);
            let known = (0..4).all(|n| now[n] == before[n] || now[n] == start[n]);
            // COMMAND 2 restarts the unit some milliseconds after its response.
            assert!(known, "{what}: {now:?}");
            assert!(rig.board.now() - from < SOON_ANALOG, "{what}: {now:?}");
        }
        rig.started();
        assert_eq!(rig.registers(SLOT, 4), Ok(start.to_vec()), "{what}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_modio_02_has_no_room_for_outputs_that_start_as_they_were() {
    let mut rig = Rig::set_up(Module::Do4, &[]);
    rig.unlock();
    assert_eq!(rig.write(START + SLOT, &[AS_IT_WAS]), Err(3));
    rig.write(START + SLOT, &[1]).unwrap();
}
