//! Links, as a master sets them up and as inputs run them.

use super::*;
use register_map::codes::LinkAction::{
    self, Follow, FollowAlone, Invert, Pulse, Reset, Set, Toggle,
};
use register_map::links;

/// The outputs are those of port 2, points 4 to 7; the inputs those of port 1, points 0 to 3, and the analog ones of port
/// 3, points 8 to 11.
const MODULES: [Module; 4] = [Module::Di4, Module::Do4, Module::Ai4, Module::Relay2];
const OUTPUT: u16 = 4;
const ANALOG: u16 = 8;

/// The registers of a link.
fn link(source: u16, action: LinkAction, words: [u16; 2]) -> [u16; 4] {
    [source, action.code(), words[0], words[1]]
}

/// A device with links of point 4. Its inputs have been scanned once.
fn linked(first: [u16; 4], second: [u16; 4]) -> Bench<4> {
    let mut bench = Bench::on(&MODIO_08, MODULES, &[(at::COMM_TIMEOUT, 10)]);
    bench.unlock();
    for (second, words) in [(false, first), (true, second)] {
        assert_eq!(bench.write(links::of_point(OUTPUT, second), &words), Ok(()));
    }
    bench.input(0, false);
    bench
}

const NONE: [u16; 4] = [0xFFFF, 0, 0, 0];

impl Bench<4> {
    /// Scans a digital input with this level.
    fn input(&mut self, channel: usize, level: bool) {
        self.scan_port(0, |channels| channels.set_bit(channel, level));
    }

    /// Scans an analog input with this word.
    fn word(&mut self, word: u16) {
        self.scan_port(2, |channels| channels.set_word(0, word));
    }

    fn output(&mut self) -> bool {
        self.ask(&[1, 0, OUTPUT as u8, 0, 1])[2] == 1
    }

    fn write_output(&mut self, on: bool) {
        let high = if on { 0xFF } else { 0 };
        assert_eq!(self.ask(&[5, 0, OUTPUT as u8, high, 0])[0], 5);
    }

    /// Presses the button at an input. Returns the output after the rising and after the falling edge.
    fn press(&mut self, channel: usize) -> [bool; 2] {
        [true, false].map(|level| {
            self.input(channel, level);
            self.output()
        })
    }

    /// Runs scans for this time.
    fn pass(&mut self, ms: u32) {
        for _ in 0..ms {
            self.device.tick(1);
            (0..4).for_each(|port| self.scan_port(port, |_| {}));
        }
    }
}

#[test]
fn links_of_digital_outputs_alone_exist() {
    let mut bench = linked(NONE, NONE);
    assert_eq!(bench.read(0x0410, 16).unwrap(), [NONE; 4].as_flattened());
    assert_eq!(bench.read(0x0490, 16).unwrap(), [NONE; 4].as_flattened());
    assert_eq!(
        bench.read(0x0438, 8).unwrap(),
        [NONE; 2].as_flattened(),
        "relays"
    );
    for (address, count) in [
        (0x0400, 4),
        (0x040F, 2),
        (0x0410, 17),
        (0x0430, 4),
        (0x0440, 4),
    ] {
        assert_eq!(bench.read(address, count), Err(2), "{address:#06x}");
        assert_eq!(
            bench.write(address, &std::vec![0; count.into()]),
            Err(2),
            "{address:#06x}"
        );
    }
    let mut single = Bench::new(Module::Do4, &[]);
    assert_eq!(single.read(0x0440, 16), Err(2), "a board with one slot");
    assert_eq!(single.write(0x0440, &NONE), Err(2));
}

#[test]
fn links_are_locked_and_read_back_as_written() {
    let mut bench = Bench::on(&MODIO_08, MODULES, &[]);
    let words = link(3, Pulse, [25, 7]);
    assert_eq!(bench.write(0x0494, &words), Err(6), "locked");
    assert_eq!(
        bench.write(0x0494, &[4]),
        Err(3),
        "the value before the lock"
    );
    bench.unlock();
    assert_eq!(bench.write(0x0494, &words), Ok(()));
    assert_eq!(bench.read(0x0494, 4).unwrap(), words);
    assert_eq!(bench.read(0x020A, 1).unwrap()[0] & 8, 8, "not saved");
    assert_eq!(bench.write(0x0497, &[0]), Ok(()), "LOW alone");
    assert_eq!(bench.ask(&[0x16, 4, 0x96, 0xFF, 0, 0, 0x10])[0], 0x16);
    assert_eq!(bench.read(0x0494, 4).unwrap(), link(3, Pulse, [16, 0]));
    bench.write(at::COMMAND, &[4]).unwrap();
    assert_eq!(bench.read(0x0494, 4).unwrap(), NONE);
}

#[test]
fn a_link_is_checked_as_a_whole() {
    let mut bench = linked(NONE, NONE);
    for bad in [
        [16, 1, 0, 0],
        [4, 1, 0, 0],
        [ANALOG, 3, 0, 0],
        [ANALOG, 1, 1, 2],
        [0, 7, 0, 0],
        [0, 0x201, 0, 0],
        [0, 4, 0, 0],
    ] {
        assert_eq!(bench.write(0x0410, &bad), Err(3), "{bad:?}");
        let two = [bad, NONE].concat();
        assert_eq!(bench.write(0x0410, &two), Err(3), "{bad:?}");
        let two = [NONE, bad].concat();
        assert_eq!(bench.write(0x040C, &two), Err(2));
        assert_eq!(bench.write(0x0410, &two), Err(3), "{bad:?}");
    }
    assert_eq!(bench.read(0x0410, 8).unwrap(), [NONE; 2].as_flattened());
    // One register after another: each must suit the others.
    bench.write(0x0410, &[ANALOG]).unwrap();
    assert_eq!(bench.write(0x0413, &[1]), Err(3), "LOW above HIGH");
    for (address, value) in [(0x0412, 2), (0x0413, 1), (0x0411, 1)] {
        bench.write(address, &[value]).unwrap();
    }
    assert_eq!(bench.write(0x0411, &[3]), Err(3));
    // The last registers of one link and the first of the next.
    assert_eq!(bench.write(0x0412, &[1, 1, 3, 3]), Ok(()));
    assert_eq!(bench.write(0x0413, &[2, 3, 3]), Err(3));
}

#[test]
fn actions_happen_at_edges() {
    for (action, presses) in [
        (Follow, [[true, false], [true, false]]),
        (Invert, [[false, true], [false, true]]),
        (Toggle, [[true, true], [false, false]]),
        (Set, [[true, true], [true, true]]),
        (Reset, [[false, false], [false, false]]),
    ] {
        let mut bench = linked(link(2, action, [0; 2]), NONE);
        assert!(!bench.output(), "{action:?}: no edge yet");
        let pressed = [bench.press(2), bench.press(2)];
        assert_eq!(pressed, presses, "{action:?}");
    }
}

#[test]
fn a_write_stays_until_the_next_edge() {
    let mut bench = linked(link(2, Follow, [0; 2]), NONE);
    bench.input(2, true);
    bench.write_output(false);
    bench.pass(5);
    assert!(!bench.output());
    bench.input(2, false);
    bench.write_output(true);
    bench.pass(5);
    assert!(bench.output());
    assert_eq!(bench.press(2), [true, false]);
    let mut bench = linked(link(2, Toggle, [0; 2]), NONE);
    bench.write_output(true);
    assert_eq!(bench.press(2), [false, false], "from the written value");
}

#[test]
fn an_output_is_the_or_of_the_links_that_it_follows() {
    let mut bench = linked(link(0, Follow, [0; 2]), link(1, Invert, [0; 2]));
    // Input 2 is off, so the second link wants the output on.
    assert_eq!(bench.press(0), [true, true]);
    bench.input(1, true);
    assert!(!bench.output());
    assert_eq!(bench.press(0), [true, false]);
    // Both inputs change in one scan.
    bench.scan_port(0, |channels| {
        channels.set_bit(0, true);
        channels.set_bit(1, false);
    });
    assert!(bench.output());
    bench.scan_port(0, |channels| {
        channels.set_bit(0, false);
        channels.set_bit(1, true);
    });
    assert!(!bench.output());
    // A link with another action has its own edges.
    let mut bench = linked(link(0, Follow, [0; 2]), link(1, Set, [0; 2]));
    assert_eq!(bench.press(1), [true, true]);
    assert_eq!(bench.press(0), [true, false]);
}

#[test]
fn a_pulse_lasts_its_time_and_a_rising_edge_starts_it_again() {
    let mut bench = linked(link(0, Pulse, [2, 0]), NONE);
    bench.pass(10);
    assert_eq!(bench.press(0), [true, true]);
    bench.pass(199);
    assert!(bench.output());
    bench.pass(1);
    assert!(!bench.output());
    bench.press(0);
    bench.pass(150);
    bench.press(0);
    bench.pass(199);
    assert!(bench.output());
    bench.pass(1);
    assert!(!bench.output());
}

#[test]
fn what_acts_on_an_output_later_ends_its_pulse() {
    let mut bench = linked(link(0, Pulse, [2, 0]), link(1, Set, [0; 2]));
    bench.press(0);
    bench.write_output(true);
    bench.pass(300);
    assert!(bench.output(), "the write");
    bench.write_output(false);
    bench.press(0);
    bench.press(1);
    bench.pass(300);
    assert!(bench.output(), "the other link");
}

#[test]
fn links_for_a_missing_master_rest_while_there_is_one() {
    let mut bench = linked(link(0, FollowAlone, [0; 2]), link(1, Follow, [0; 2]));
    bench.device.request_seen(0, false);
    assert_eq!(bench.press(0), [false, false]);
    // Nor does it count when the other link acts.
    bench.input(0, true);
    assert_eq!(bench.press(1), [true, false]);
    bench.input(0, false);
    bench.write_output(true);
    bench.pass(999);
    assert_eq!(bench.press(0), [true, true]);
    bench.pass(1);
    assert!(!bench.output(), "SAFE");
    assert_eq!(bench.press(0), [true, false]);
    bench.input(0, true);
    assert_eq!(bench.press(1), [true, true], "both are awake");
    let now = bench.device.state.millis();
    bench.device.request_seen(now, false);
    bench.input(0, false);
    assert!(bench.output(), "it stays until an edge or a write");
    assert_eq!(bench.press(1), [true, false]);
}

#[test]
fn a_pulse_ends_while_its_link_rests_and_safe_replaces_it() {
    let pulse = link(0, LinkAction::PulseAlone, [1, 0]);
    let mut bench = linked(pulse, NONE);
    bench.pass(1000);
    assert_eq!(bench.press(0), [true, true]);
    let now = bench.device.state.millis();
    bench.device.request_seen(now, false);
    bench.pass(99);
    assert!(bench.output());
    bench.pass(1);
    assert!(!bench.output());
    // SAFE = 1 during a pulse.
    let mut bench = linked(link(0, Pulse, [1, 0]), NONE);
    bench.write(at::SAFE + OUTPUT, &[1]).unwrap();
    bench.device.request_seen(0, false);
    bench.pass(950);
    bench.press(0);
    bench.pass(200);
    assert!(bench.output());
    // SAFE = hold changes nothing, so the pulse ends.
    let mut bench = linked(link(0, Pulse, [1, 0]), NONE);
    bench.write(at::SAFE + OUTPUT, &[at::HOLD]).unwrap();
    bench.device.request_seen(0, false);
    bench.pass(950);
    bench.press(0);
    bench.pass(200);
    assert!(!bench.output());
}

#[test]
fn analog_inputs_switch_at_their_thresholds() {
    let mut bench = linked(link(ANALOG, Follow, [2000, 1000]), NONE);
    bench.word(3000);
    assert!(bench.output(), "from 0");
    for (word, on) in [
        (1500, true),
        (1000, true),
        (999, false),
        (2000, false),
        (2001, true),
    ] {
        bench.word(word);
        assert_eq!(bench.output(), on, "{word}");
    }
    // A level that a write of the link finds is no edge.
    bench.write_output(false);
    bench.write(0x0412, &[1800]).unwrap();
    bench.word(2001);
    assert!(!bench.output());
    bench.word(500);
    bench.word(1801);
    assert!(bench.output());
}

#[test]
fn levels_at_the_start_and_of_a_new_link_are_no_edges() {
    let stored = [
        (0x0410, 0),
        (0x0411, Follow.code()),
        (0x0494, ANALOG),
        (0x0495, Follow.code()),
        (0x0496, 10),
    ];
    let mut bench = Bench::on(&MODIO_08, MODULES, &stored);
    for (port, channels) in bench
        .device
        .points
        .ports()
        .iter()
        .map(|port| *port.channels())
        .enumerate()
        .collect::<Vec<_>>()
    {
        let mut channels = channels;
        channels.set_bit(0, true);
        channels.set_word(0, 4000);
        bench.device.scanned(port, &channels, true, 1);
    }
    (0..4).for_each(|slot| bench.device.run_links(slot));
    let bits = |bench: &mut Bench<4>| bench.ask(&[1, 0, OUTPUT as u8, 0, 4])[2];
    assert_eq!(bits(&mut bench), 0);
    bench.unlock();
    bench.write(0x0498, &link(0, Toggle, [0; 2])).unwrap();
    bench.pass(3);
    assert_eq!(bits(&mut bench), 0);
    assert_eq!(bench.press(0), [false, false], "no rising edge");
    bench.press(0);
    assert_eq!(bits(&mut bench), 0b0100);
}

#[test]
fn a_link_acts_only_where_a_write_would() {
    let mut bench = linked(link(0, Set, [0; 2]), NONE);
    bench.device.points.ports_mut()[1].set_failing(0b0001);
    bench.press(0);
    bench.device.points.ports_mut()[1].set_failing(0);
    assert!(!bench.output());
    bench.press(0);
    assert!(bench.output());
    // The coil of a relay in manual mode, as by a write.
    bench.write(0x0438, &link(0, Toggle, [0; 2])).unwrap();
    bench.scan_port(3, |channels| channels.set_bit(0, true));
    bench.press(0);
    assert_eq!(bench.ask(&[1, 0, 14, 0, 1]), [1, 1, 1]);
}

#[test]
fn links_of_a_port_rest_after_a_change_of_its_module() {
    let mut bench = linked(link(0, Toggle, [0; 2]), NONE);
    bench.write(0x0414, &link(12, Toggle, [0; 2])).unwrap();
    // Another module for the sources of the second output.
    bench
        .write(at::module_of(4), &[Module::Di4.code()])
        .unwrap();
    assert_eq!(bench.read(0x0410, 4).unwrap(), link(0, Toggle, [0; 2]));
    assert_eq!(bench.read(0x0414, 4).unwrap(), NONE);
    assert_eq!(bench.read(0x0438, 4), Err(2), "no longer an output");
    bench.write(0x0414, &link(12, Toggle, [0; 2])).unwrap();
    bench.scan_port(3, |channels| channels.set_bit(0, true));
    assert_eq!(
        bench.ask(&[1, 0, 5, 0, 1]),
        [1, 1, 0],
        "not before the restart"
    );
    assert_eq!(bench.press(0), [true, true], "another port");
    // Another module for the output.
    bench
        .write(at::module_of(2), &[Module::Relay2.code()])
        .unwrap();
    assert_eq!(bench.read(0x0410, 4), Err(2));
    assert_eq!(bench.read(0x0418, 8).unwrap(), [NONE; 2].as_flattened());
    bench.write(0x0418, &link(0, Toggle, [0; 2])).unwrap();
    bench.press(0);
    assert_eq!(bench.ask(&[1, 0, 4, 0, 4]), [1, 1, 0b0001]);
}

#[test]
fn edge_of_a_scan_reaches_a_link_although_a_setting_is_written_before_the_links_run() {
    let mut bench = linked(link(0, Follow, [0; 2]), NONE);
    // As `Scanning::run` does it: the inputs under one lock, then the links under others. A request is served in between.
    let mut channels = *bench.device.points.ports()[0].channels();
    channels.set_bit(0, true);
    bench.device.scanned(0, &channels, true, 1);
    bench.write(at::RESPONSE_DELAY, &[1]).unwrap();
    (0..4).for_each(|slot| bench.device.run_links(slot));
    assert!(bench.output(), "the edge was lost");
}

#[test]
fn change_of_the_scale_of_an_analog_source_is_no_edge() {
    // 2000 raw is 4884 mV.
    let mut bench = linked(link(ANALOG, Follow, [4000, 3000]), NONE);
    bench.word(2000);
    assert!(!bench.output());
    bench.write(at::SCALE + ANALOG, &[1]).unwrap();
    let mut channels = *bench.device.points.ports()[2].channels();
    channels.set_word(0, 4884);
    // The scan under way when the setting was written, then the first one with the new scale.
    for words in [false, true] {
        bench.device.scanned(2, &channels, words, 1);
        (0..4).for_each(|slot| bench.device.run_links(slot));
    }
    assert!(!bench.output(), "the input has not changed");
}
