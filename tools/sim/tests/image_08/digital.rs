//! Digital points of all slots: each point is on a separate line.

use sim::{Channel, Module, Time};

use crate::fitted::{LINES, change, channels, fitted, outputs};

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn every_output_point_switches_its_own_line_and_no_other() {
    let mut rig = fitted([Module::Do4; 4], &[]);
    for point in 0..16 {
        let mut bits = [false; 16];
        bits[point] = true;
        rig.write_bits(0, &bits).unwrap();
        rig.board.run_for(Time::from_ms(5));
        for (n, &(port, pin)) in LINES.as_flattened().iter().enumerate() {
            assert!(rig.board.is_output(port, pin), "P{port}{pin}");
            assert_eq!(rig.board.pin(port, pin), n == point, "P{port}{pin}");
        }
        assert_eq!(rig.bits(1, 0, 16), Ok(bits.to_vec()));
    }
    for (point, port) in (0..16).step_by(4).zip(1..) {
        rig.write_bit(point + 2, true).unwrap();
        rig.board.run_for(Time::from_ms(5));
        assert!(outputs(&rig, port)[2], "port {port}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn every_input_point_follows_its_own_line_and_no_other() {
    let mut rig = fitted([Module::Di4; 4], &[]);
    for point in 0..16 {
        let (port, channel) = (point as u8 / 4 + 1, point % 4 + 1);
        change(&mut rig, port, |slot| slot.set_energised(channel, true)).unwrap();
        rig.board.run_for(Time::from_ms(10));
        let mut expected = vec![false; 16];
        expected[point] = true;
        for function in [1, 2] {
            assert_eq!(rig.bits(function, 0, 16).as_ref(), Ok(&expected));
        }
        change(&mut rig, port, |slot| slot.set_energised(channel, false)).unwrap();
        rig.board.run_for(Time::from_ms(10));
    }
    assert_eq!(rig.bits(2, 0, 16), Ok(vec![false; 16]));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn relays_and_their_jumpers_work_beside_empty_slots() {
    let plugged = [Module::None, Module::Relay2, Module::None, Module::None];
    let mut rig = fitted(plugged, &[]);
    change(&mut rig, 2, |slot| slot.set_manual(1, true)).unwrap();
    rig.write_bits(6, &[false, true]).unwrap();
    rig.board.run_for(Time::from_ms(50));
    assert_eq!(rig.bits(1, 4, 4), Ok(vec![true, false, false, true]));
    let relay = |energised, manual| Channel::Relay { energised, manual };
    let relays = [relay(false, true), relay(true, false)];
    assert_eq!(channels(&rig, 2)[..2], relays);
}
