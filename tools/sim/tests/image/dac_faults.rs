//! A DAC that is missing, or a bus that is held low: writes get exception 04, reads return the commanded values, the
//! status reports the fault, the line does not wait for the bus, and the unit recovers automatically.

use sim::{Module, Time, line::Direction, slot::BusFault};

use crate::{
    analog_outputs::codes,
    rig::{FIRST, PORT, Rig, SLOT, adu},
};

const MODULE_STATE: u16 = 0x0217 + PORT;
const MODULE_FAULT: u16 = 4;
/// Longest time after which the unit reports that a device is missing or has returned: the value for masters.
const NOTICED: Time = Time::from_ms(500);

const FAULTS: [BusFault; 3] = [
    BusFault::Absent,
    BusFault::HoldsScl,
    BusFault::HoldsSda { clocks: None },
];

/// Asserts that writes to the DAC's points get exception 04, that reads return the commanded values of the first and
/// the last one, also together with the analog inputs, and that the rest of the device still works.
fn assert_out(rig: &mut Rig, first: u16, commanded: [u16; 2]) {
    for function in [3, 4] {
        assert_eq!(rig.words(function, first, 1), Ok(vec![commanded[0]]));
        let all = rig.words(function, SLOT, 4);
        assert_eq!(all.map(|words| words[3]), Ok(commanded[1]));
    }
    assert_eq!(rig.write(SLOT + 2, &[1, 2]), Err(4));
    assert_eq!(rig.register(MODULE_STATE), 2);
    assert!(rig.status(MODULE_FAULT));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn outputs_stay_readable_refuse_writes_and_recover_automatically() {
    for (module, channels) in [(Module::Ao4, [1, 4]), (Module::Ai2Ao2, [3, 4])] {
        let first = SLOT + channels[0] as u16 - 1;
        let mut rig = Rig::set_up(module, &[]);
        for (n, fault) in (1..).zip(FAULTS) {
            let commanded = [n * 100, n * 200];
            rig.write_single(6, first, commanded[0]).unwrap();
            rig.write_single(6, SLOT + 3, commanded[1]).unwrap();
            rig.board.run_for(Time::from_ms(30));
            rig.board.set_bus_fault(fault);
            rig.board.run_for(NOTICED);
            assert_out(&mut rig, first, commanded);
            rig.board.run_for(Time::from_secs(2));
            assert_out(&mut rig, first, commanded);
            assert!(rig.board.leds().fault, "the fault LED is on");

            rig.board.set_bus_fault(BusFault::None);
            rig.board.run_for(NOTICED);
            assert_eq!(rig.register(MODULE_STATE), 0, "{fault:?}");
            assert!(!rig.status(MODULE_FAULT));
            assert_eq!(rig.register(first), commanded[0]);
            assert_eq!(
                codes(&rig, channels),
                commanded,
                "a refused write changed an output"
            );
            rig.write_single(6, SLOT + 3, 17).unwrap();
            rig.board.run_for(Time::from_ms(30));
            assert_eq!(codes(&rig, [4]), [17]);
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn device_that_holds_the_bus_is_released_by_clock_pulses() {
    let mut rig = Rig::set_up(Module::Ao4, &[]);
    rig.board
        .set_bus_fault(BusFault::HoldsSda { clocks: Some(7) });
    rig.write(SLOT, &[10, 20, 30, 40]).unwrap();
    rig.board.run_for(NOTICED);
    assert_eq!(
        rig.board.slot().bus_fault(),
        BusFault::None,
        "the device released the bus"
    );
    assert_eq!(rig.registers(SLOT, 4), Ok(vec![10, 20, 30, 40]));
    assert_eq!(codes(&rig, [1, 2, 3, 4]), [10, 20, 30, 40]);
    assert_eq!(rig.register(MODULE_STATE), 0);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_line_never_waits_for_the_bus() {
    let mut rig = Rig::set_up(Module::Ao4, &[]);
    for fault in FAULTS {
        rig.board.set_bus_fault(fault);
        let mut asked = 0;
        let from = rig.board.now();
        while rig.board.now() < from + Time::from_secs(2) {
            // Read registers that do not depend on the module, and points that do.
            let good = rig.registers(0x0200, 2).is_ok();
            assert!(good);
            asked += 1;
            assert_in_time(&mut rig);
            let _ = rig.write_single(6, SLOT, asked);
            assert_in_time(&mut rig);
            rig.board.run_for(Time::from_us(u64::from(asked % 7) * 130));
        }
        assert!(asked > 20);
        rig.board.set_bus_fault(BusFault::None);
        rig.board.run_for(NOTICED);
    }
}

fn assert_in_time(rig: &mut Rig) {
    // The baud generator adds up to a bit.
    let (due, bit) = (rig.sent + rig.t35(), rig.bit());
    let line = rig.board.line();
    let reply = line.frames().next_back().expect("a reply");
    assert_eq!(reply.direction, Direction::Response);
    let late = reply.start - due;
    assert!(late <= Time::from_us(60) + bit, "{late:?} after t3.5");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn unit_without_a_dac_starts_and_uses_the_dac_once_it_is_present() {
    let mut rig = Rig::set_up(
        Module::Ao4,
        &[(0x01E0 + SLOT, 1000), (0x01E0 + SLOT + 3, 4000)],
    );
    for fault in FAULTS {
        rig.board.power_off();
        rig.board.set_bus_fault(fault);
        rig.board.power_on();
        rig.started();
        assert_eq!(rig.write_single(6, SLOT, 1), Err(4), "{fault:?}");
        rig.board.set_bus_fault(BusFault::None);
        rig.board.run_for(NOTICED);
        assert_eq!(rig.registers(SLOT, 4), Ok(vec![1000, 0, 0, 4000]));
        assert_eq!(codes(&rig, [1, 2, 3, 4]), [1000, 0, 0, 4000], "START");
    }
}

/// The locked filters of the errata sheet make the bus look busy, and no reset of the block ends that.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn locked_filters_of_the_bus_are_released_at_a_start_and_while_running() {
    let mut rig = Rig::set_up(Module::Ao4, &[(0x01E0 + SLOT, 1000)]);
    rig.board.power_off();
    rig.board.lock_i2c_filters();
    rig.board.power_on();
    rig.started();
    assert_eq!(codes(&rig, [1]), [1000], "START");
    for n in 1..5 {
        rig.board.lock_i2c_filters();
        rig.write_single(6, SLOT, n).unwrap();
        rig.board.run_for(NOTICED);
        assert_eq!(rig.register(MODULE_STATE), 0);
        assert_eq!(codes(&rig, [1]), [n]);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn bus_errors_at_any_instant_of_a_transfer_lose_no_value() {
    let mut rig = Rig::set_up(Module::Ao4, &[]);
    let mut bus_errors = 0;
    for n in 1..40 {
        let values = [n, n + 100, n + 200, n + 300];
        let [a, b, c, d] = values.map(u16::to_be_bytes);
        let words = [a, b, c, d].concat();
        let now = rig.board.now();
        let end = rig.board.line().send(
            now,
            &adu(&[&[1, 16, 0, FIRST, 0, 4, 8], &words[..]].concat()),
        );
        // The transfer begins with the reply.
        rig.board.run_until(end + rig.t35());
        let until = rig.board.now() + Time::from_ms(4);
        while rig.board.now() < until {
            rig.board.run_for(Time::from_us(u64::from(n) * 7));
            bus_errors += u32::from(rig.board.disturb_i2c());
        }
        rig.board.run_for(NOTICED);
        rig.board.line().take_received();
        assert_eq!(rig.register(MODULE_STATE), 0, "{n}");
        assert_eq!(codes(&rig, [1, 2, 3, 4]), values, "{n}");
    }
    assert!(bus_errors > 30, "only {bus_errors} bus errors");
}
