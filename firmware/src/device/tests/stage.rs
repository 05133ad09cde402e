//! The stage of the outputs as a master meets it: its registers, and what it does to points. `tests/outputs` has its rules.

use super::*;
use register_map::codes::LinkAction::{self, Follow, FollowAlone, Pulse, Set};

use register_map::links;
use register_map::stage::{DEAD_TIME, MAX_ON, MIN_OFF};

/// The outputs are those of port 2, points 4 to 7; the inputs those of port 1. Port 4 has relays, points 14 and 15.
const MODULES: [Module; 4] = [Module::Di4, Module::Do4, Module::None, Module::Relay2];
const OUTPUT: u16 = 4;
const SLOT: usize = 1;
const RELAYS: usize = 3;

fn device(settings: &[(u16, u16)]) -> Rig<Modio08> {
    let mut rig = Rig::on(MODULES, settings);
    rig.unlock();
    rig
}

impl Rig<Modio08> {
    /// Runs scans for this time. Returns the terminals of the port.
    fn run(&mut self, slot: usize, ms: u32) -> u8 {
        let mut terminals = 0;
        for _ in 0..ms {
            self.pass(1);
            terminals = self.device.drive(slot, 1);
        }
        terminals
    }

    /// Writes coils from the first output on.
    fn coils(&mut self, count: u8, bits: u8) {
        let reply = self.ask(&[0x0F, 0, OUTPUT as u8, 0, count, 1, bits]);
        assert_eq!(reply[0], 0x0F);
    }

    /// Reads the coils of the port.
    fn read_coils(&mut self) -> u8 {
        self.ask(&[1, 0, OUTPUT as u8, 0, 4])[2]
    }

    fn status(&mut self, point: u16) -> u16 {
        self.read(0x0240 + point, 1).unwrap()[0]
    }

    fn link(&mut self, output: u16, source: u16, action: LinkAction, time: u16) {
        let words = [source, action.code(), time, 0];
        self.write(links::of_point(output, false), &words).unwrap();
    }
}

#[test]
fn times_are_settings_with_the_values_of_their_rules() {
    let mut rig = Rig::<Modio08>::on(MODULES, &[]);
    assert_eq!(rig.write(DEAD_TIME + OUTPUT, &[50]), Err(6), "locked");
    rig.unlock();
    for (address, good, bad) in [
        (DEAD_TIME, &[0, 2, 1000][..], &[1, 1001, 0xFFFF][..]),
        (MAX_ON, &[0, 1, 0x7FFF, 0x8001, 0xFFFF], &[0x8000]),
        (MIN_OFF, &[0, 1, 0xFFFF], &[]),
    ] {
        // Of an output, of an input, of a port without points.
        for address in [address + OUTPUT, address, address + 31] {
            for value in good {
                assert_eq!(
                    rig.write(address, &[*value]),
                    Ok(()),
                    "{address:#x} {value}"
                );
                assert_eq!(rig.read(address, 1).unwrap(), [*value]);
            }
            let last = *good.last().unwrap();
            for value in bad {
                assert_eq!(
                    rig.write(address, &[*value]),
                    Err(3),
                    "{address:#x} {value}"
                );
                assert_eq!(rig.read(address, 1).unwrap(), [last]);
            }
        }
    }
    assert_eq!(rig.write(DEAD_TIME + 31, &[2, 0x8000]), Err(3), "whole");
    assert_eq!(rig.read(MIN_OFF + 31, 2), Err(2));
    assert_eq!(rig.write(MIN_OFF + 31, &[0, 0]), Err(2));
    assert_eq!(
        rig.read(DEAD_TIME - 1, 2),
        Err(2),
        "DEADBAND is another block"
    );
    assert_eq!(rig.read(DEAD_TIME, 96).unwrap().len(), 96);

    rig.device.config.begin_save();
    let saved: Vec<_> = rig.device.config.to_save().changed_from(0).collect();
    let (loaded, rejected) = Settings::<Modio08>::load(saved.into_iter());
    assert_eq!((&loaded, rejected), (rig.device.config.to_save(), 0));
    rig.device.config.end_save(false);
    rig.write(at::MODULE + 1, &[0]).unwrap();
    for first in [DEAD_TIME, MAX_ON, MIN_OFF] {
        assert_eq!(rig.read(first + OUTPUT, 1).unwrap(), [0], "another module");
        assert_ne!(rig.read(first, 1).unwrap(), [0]);
    }
    let damaged = [(MAX_ON + OUTPUT, 0x8000), (DEAD_TIME, 1)];
    assert_eq!(Settings::<Modio08>::load(damaged.into_iter()).1, 2);
}

#[test]
fn boards_without_the_stage_have_no_such_registers() {
    let mut rig = Rig::new(Module::Do4, &[]);
    rig.unlock();
    for address in [DEAD_TIME + 16, MAX_ON + 16, MIN_OFF + 16] {
        assert_eq!(rig.read(address, 1), Err(2));
        assert_eq!(rig.write(address, &[0]), Err(2));
    }
}

#[test]
fn of_a_pair_one_request_switches_neither_on_and_the_newer_one_wins() {
    let mut rig = device(&[(DEAD_TIME + OUTPUT, 5)]);
    rig.run(SLOT, 100);
    rig.coils(4, 0b1111);
    assert_eq!(rig.read_coils(), 0b1100, "the others are written");
    assert_eq!(rig.run(SLOT, 100), 0b1100);
    rig.coils(1, 1);
    assert_eq!(rig.run(SLOT, 1), 0b1101);
    assert_eq!(rig.ask(&[5, 0, 5, 0xFF, 0])[0], 5);
    assert_eq!(
        (rig.read_coils(), rig.status(5)),
        (0b1110, 0),
        "before the scan"
    );
    assert_eq!((rig.run(SLOT, 50), rig.status(5)), (0b1100, 5));
    assert_eq!((rig.run(SLOT, 1), rig.status(5)), (0b1110, 0));
}

#[test]
fn start_and_safe_of_a_pair_that_want_both_get_neither() {
    let both = |first| [(first + OUTPUT, 1), (first + OUTPUT + 1, 1)];
    let settings = [
        &[(at::COMM_TIMEOUT, 10)],
        &both(at::SAFE)[..],
        &both(at::START),
        &[(DEAD_TIME + OUTPUT, 5)],
    ];
    let mut rig = device(&settings.concat());
    rig.device.start_outputs(None, None);
    assert_eq!((rig.read_coils(), rig.run(SLOT, 100)), (0, 0));
    rig.coils(1, 1);
    rig.run(SLOT, 100);
    rig.device.request_seen(rig.device.state.millis(), true);
    rig.run(SLOT, 1_100);
    assert_eq!(rig.read_coils(), 0);
    assert_eq!(
        rig.device.outputs_at_safe() >> 4 & 3,
        3,
        "SAFE itself asked for both"
    );
}

#[test]
fn longest_time_on_counts_against_a_master_that_repeats_himself() {
    let mut rig = device(&[(MAX_ON + OUTPUT, 3)]);
    for _ in 0..10 {
        rig.coils(1, 1);
        rig.run(SLOT, 100);
    }
    assert_eq!((rig.read_coils(), rig.status(OUTPUT)), (0, 6));
    assert_eq!(rig.read(0x0219, 1).unwrap(), [0], "no fault of the module");
    rig.coils(1, 0);
    rig.coils(1, 1);
    assert_eq!(
        (rig.read_coils(), rig.run(SLOT, 1), rig.status(OUTPUT)),
        (1, 1, 0)
    );
}

#[test]
fn change_of_a_time_is_a_start_for_its_output_and_no_change_is_none() {
    let mut rig = device(&[]);
    rig.coils(4, 0b1111);
    rig.run(SLOT, 10);
    rig.write(MAX_ON + OUTPUT, &[0]).unwrap();
    rig.write(DEAD_TIME + OUTPUT + 1, &[50]).unwrap();
    assert_eq!(
        rig.read_coils(),
        0b1111,
        "the higher channel has no DEAD_TIME"
    );
    rig.write(MIN_OFF + OUTPUT, &[1]).unwrap();
    assert_eq!((rig.read_coils(), rig.run(SLOT, 1)), (0b1110, 0b1110));
    rig.write(DEAD_TIME + OUTPUT + 2, &[10]).unwrap();
    assert_eq!(rig.read_coils(), 0b0010, "of both");
    // COMMAND 4 drops the changes, which is one.
    rig.coils(4, 0b0111);
    rig.write(at::COMMAND, &[4]).unwrap();
    assert_eq!(rig.read_coils(), 0b0010);
    rig.coils(4, 0b1111);
    rig.write(at::COMMAND, &[4]).unwrap();
    assert_eq!(rig.read_coils(), 0b1111, "the same values again");
    // The last time of the port ends: off for a scan, then on as ordered, and no longer waiting.
    rig.link(OUTPUT, 0, Follow, 0);
    rig.write(MIN_OFF + OUTPUT, &[100]).unwrap();
    rig.scan_port(0, |channels| channels.set_bit(0, true));
    assert_eq!((rig.run(SLOT, 1_500) & 1, rig.status(OUTPUT)), (0, 5));
    rig.write(MIN_OFF + OUTPUT, &[0]).unwrap();
    assert_eq!(rig.run(SLOT, 1) & 1, 0);
    assert_eq!((rig.run(SLOT, 1) & 1, rig.status(OUTPUT)), (1, 0));
}

#[test]
fn links_of_a_pair_get_one_output_at_most() {
    let mut rig = device(&[(DEAD_TIME + OUTPUT, 5)]);
    rig.link(OUTPUT, 0, Set, 0);
    rig.link(OUTPUT + 1, 0, Set, 0);
    rig.link(OUTPUT + 2, 1, Follow, 0);
    rig.run(SLOT, 1_100);
    rig.scan_port(0, |channels| channels.set_bits(0b11, 0b11));
    assert_eq!(rig.run(SLOT, 1), 0b0100, "one edge wants both");
    assert_eq!(rig.read_coils(), 0b0100);
    rig.coils(1, 1);
    assert_eq!(rig.run(SLOT, 100), 0b0101);
}

#[test]
fn pulse_that_waits_for_its_whole_time_never_shows() {
    let mut rig = device(&[(MIN_OFF + OUTPUT, 20)]);
    rig.link(OUTPUT, 0, Pulse, 5);
    rig.run(SLOT, 1_100);
    rig.scan_port(0, |channels| channels.set_bit(0, true));
    for _ in 0..500 {
        assert_eq!(rig.run(SLOT, 1), 0);
    }
    assert_eq!((rig.read_coils(), rig.run(SLOT, 1_000)), (0, 0));
}

#[test]
fn relay_by_hand_stops_its_drive_and_that_of_its_partner() {
    let mut rig = device(&[(DEAD_TIME + 14, 5)]);
    let hand = |rig: &mut Rig<Modio08>, channels: u8| {
        rig.scan_port(RELAYS, |values| values.set_bits(0b11, channels));
    };
    rig.run(RELAYS, 100);
    assert_eq!(rig.ask(&[5, 0, 15, 0xFF, 0])[0], 5);
    assert_eq!(rig.run(RELAYS, 1) & 0b1100, 0b1000);
    hand(&mut rig, 0b01);
    assert_eq!(rig.run(RELAYS, 1) & 0b1100, 0);
    assert_eq!(rig.status(15), 5);
    hand(&mut rig, 0);
    assert_eq!(
        rig.run(RELAYS, 49) & 0b1100,
        0,
        "since the last scan by hand"
    );
    assert_eq!(rig.run(RELAYS, 1) & 0b1100, 0b1000);
}

#[test]
fn times_pass_while_the_uptime_wraps() {
    let mut rig = device(&[(DEAD_TIME + OUTPUT, 100), (MAX_ON + OUTPUT, 40)]);
    rig.link(OUTPUT + 2, 0, Pulse, 50);
    rig.run(SLOT, 1_100);
    let now = rig.device.state.millis();
    rig.device.tick(u32::MAX - 3_000 - now);
    rig.coils(1, 1);
    rig.scan_port(0, |channels| channels.set_bit(0, true));
    assert_eq!(rig.run(SLOT, 4_000), 0b0101);
    assert_eq!(rig.run(SLOT, 1), 0b0100, "after 4 s");
    assert_eq!(rig.run(SLOT, 998), 0b0100);
    assert_eq!(rig.run(SLOT, 1), 0, "5 s after the order");
    rig.coils(2, 0b10);
    assert_eq!(rig.run(SLOT, 1), 0b10);
}

#[test]
fn first_write_of_a_master_ends_the_hold_of_a_link_and_counts() {
    for settings in [&[][..], &[(MAX_ON + OUTPUT, 30_000)]] {
        let mut rig = device(&[&[(at::COMM_TIMEOUT, 10)], settings].concat());
        rig.link(OUTPUT, 0, FollowAlone, 0);
        rig.device.request_seen(rig.device.state.millis(), true);
        rig.scan_port(0, |channels| channels.set_bit(0, true));
        assert_eq!(rig.run(SLOT, 2_500), 1, "held without a master");
        rig.device.request_seen(rig.device.state.millis(), true);
        rig.coils(1, 0);
        // A write causes a scan.
        assert_eq!(rig.device.drive(SLOT, 0), 0);
        assert_eq!((rig.run(SLOT, 5), rig.read_coils()), (0, 0));
    }
}

#[test]
fn between_links_and_stage_an_ended_output_is_off_and_its_partner_stays_on() {
    let mut rig = device(&[(DEAD_TIME + OUTPUT, 5), (MAX_ON + OUTPUT, 3)]);
    rig.link(OUTPUT, 0, Follow, 0);
    rig.run(SLOT, 1_100);
    rig.scan_port(0, |channels| channels.set_bit(0, true));
    assert_eq!((rig.run(SLOT, 500), rig.status(OUTPUT)), (0, 6));
    rig.coils(2, 0b10);
    assert_eq!(rig.run(SLOT, 100), 0b10);
    rig.pass(1);
    assert_eq!(rig.read_coils(), 0b10);
    rig.coils(3, 0b110);
    assert_eq!(rig.device.drive(SLOT, 1), 0b110);
}

#[test]
fn repetitions_before_a_time_was_set_do_not_count() {
    let mut rig = device(&[(MAX_ON + OUTPUT, 3)]);
    for _ in 0..2 {
        rig.coils(1, 1);
        rig.run(SLOT, 10);
    }
    rig.write(MAX_ON + OUTPUT, &[0]).unwrap();
    rig.run(SLOT, 10);
    rig.write(MAX_ON + OUTPUT, &[3]).unwrap();
    for _ in 0..2 {
        rig.run(SLOT, 1_000);
        rig.coils(1, 1);
        assert_eq!(rig.run(SLOT, 1), 1, "a press");
    }
}

#[test]
fn what_a_link_held_before_a_reset_is_no_part_of_start() {
    let start = [(at::START + OUTPUT, 1), (at::START + OUTPUT + 1, 1)];
    let link = links::of_point(OUTPUT, false);
    let link = [(link, 0), (link + 1, Follow.code())];
    let settings = [&[(DEAD_TIME + OUTPUT, 5)], &start[..], &link].concat();
    for (held_on, wanted) in [(false, 0b10), (true, 0b01)] {
        let mut rig = device(&settings);
        rig.scan_port(0, |channels| channels.set_bit(0, held_on));
        rig.run(SLOT, 1_100);
        let mut next = Rig::<Modio08>::on(MODULES, &settings);
        next.device.start_outputs(Some(&keeping::kept(&rig)), None);
        assert_eq!(next.read_coils(), wanted);
    }
}
