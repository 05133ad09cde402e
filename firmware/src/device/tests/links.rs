//! Links, as a master sets them up, and what the scenarios of `tests/links` do not show of the inputs that run them.

use super::*;
use modio_drivers::{Ai4, IoModule as _};
use register_map::codes::LinkAction::{self, Follow, Invert, Pulse, Set, Toggle};
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

/// A device with links of point 4, long enough after its start and after their write that they act.
fn linked(first: [u16; 4], second: [u16; 4]) -> Rig<Modio08> {
    let mut rig = Rig::<Modio08>::on(MODULES, &[(at::COMM_TIMEOUT, 10)]);
    rig.unlock();
    for (second, words) in [(false, first), (true, second)] {
        assert_eq!(rig.write(links::of_point(OUTPUT, second), &words), Ok(()));
    }
    rig.pass(1_010);
    rig
}

const NONE: [u16; 4] = [0xFFFF, 0, 0, 0];

impl Rig<Modio08> {
    /// Scans a digital input with this level.
    fn input(&mut self, channel: usize, level: bool) {
        self.scan_port(0, |channels| channels.set_bit(channel, level));
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
}

#[test]
fn links_of_digital_outputs_alone_exist() {
    let mut rig = linked(NONE, NONE);
    assert_eq!(rig.read(0x0410, 16).unwrap(), [NONE; 4].as_flattened());
    assert_eq!(rig.read(0x0490, 16).unwrap(), [NONE; 4].as_flattened());
    assert_eq!(
        rig.read(0x0438, 8).unwrap(),
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
        assert_eq!(rig.read(address, count), Err(2), "{address:#06x}");
        assert_eq!(
            rig.write(address, &std::vec![0; count.into()]),
            Err(2),
            "{address:#06x}"
        );
    }
    let mut single = Rig::new(Module::Do4, &[]);
    assert_eq!(single.read(0x0440, 16), Err(2), "a board with one slot");
    assert_eq!(single.write(0x0440, &NONE), Err(2));
}

#[test]
fn links_are_locked_and_read_back_as_written() {
    let mut rig = Rig::<Modio08>::on(MODULES, &[]);
    let words = link(3, Pulse, [25, 7]);
    assert_eq!(rig.write(0x0494, &words), Err(6), "locked");
    assert_eq!(rig.write(0x0494, &[4]), Err(3), "the value before the lock");
    rig.unlock();
    assert_eq!(rig.write(0x0494, &words), Ok(()));
    assert_eq!(rig.read(0x0494, 4).unwrap(), words);
    assert_eq!(rig.read(0x020A, 1).unwrap()[0] & 8, 8, "not saved");
    assert_eq!(rig.write(0x0497, &[0]), Ok(()), "LOW alone");
    assert_eq!(rig.ask(&[0x16, 4, 0x96, 0xFF, 0, 0, 0x10])[0], 0x16);
    assert_eq!(rig.read(0x0494, 4).unwrap(), link(3, Pulse, [16, 0]));
    rig.write(at::COMMAND, &[4]).unwrap();
    assert_eq!(rig.read(0x0494, 4).unwrap(), NONE);
}

#[test]
fn a_link_is_checked_as_a_whole() {
    let mut rig = linked(NONE, NONE);
    for bad in [
        [16, 1, 0, 0],
        [4, 1, 0, 0],
        [ANALOG, 3, 0, 0],
        [ANALOG, 1, 1, 2],
        [0, 8, 0, 0],
        [0, 0x201, 0, 0],
        [0, 4, 0, 0],
    ] {
        assert_eq!(rig.write(0x0410, &bad), Err(3), "{bad:?}");
        let two = [bad, NONE].concat();
        assert_eq!(rig.write(0x0410, &two), Err(3), "{bad:?}");
        let two = [NONE, bad].concat();
        assert_eq!(rig.write(0x040C, &two), Err(2));
        assert_eq!(rig.write(0x0410, &two), Err(3), "{bad:?}");
    }
    assert_eq!(rig.read(0x0410, 8).unwrap(), [NONE; 2].as_flattened());
    // One register after another: each must suit the others.
    rig.write(0x0410, &[ANALOG]).unwrap();
    assert_eq!(rig.write(0x0413, &[1]), Err(3), "LOW above HIGH");
    for (address, value) in [(0x0412, 2), (0x0413, 1), (0x0411, 1)] {
        rig.write(address, &[value]).unwrap();
    }
    assert_eq!(rig.write(0x0411, &[3]), Err(3));
    // The last registers of one link and the first of the next.
    assert_eq!(rig.write(0x0412, &[1, 1, 3, 3]), Ok(()));
    assert_eq!(rig.write(0x0413, &[2, 3, 3]), Err(3));
}

#[test]
fn a_link_acts_only_where_a_write_would() {
    let mut rig = linked(link(0, Set, [0; 2]), NONE);
    rig.device.points.ports_mut()[1].set_failing(0b0001);
    rig.press(0);
    rig.device.points.ports_mut()[1].set_failing(0);
    assert!(!rig.output());
    rig.press(0);
    assert!(rig.output());
    // The coil of a relay in manual mode, as by a write.
    rig.write(0x0438, &link(0, Toggle, [0; 2])).unwrap();
    rig.pass(1_000);
    rig.scan_port(3, |channels| channels.set_bit(0, true));
    rig.press(0);
    assert_eq!(rig.ask(&[1, 0, 14, 0, 1]), [1, 1, 1]);
}

#[test]
fn links_of_a_port_rest_after_a_change_of_its_module() {
    let mut rig = linked(link(0, Toggle, [0; 2]), NONE);
    rig.write(0x0414, &link(12, Toggle, [0; 2])).unwrap();
    // Another module for the sources of the second output.
    rig.write(at::module_of(4), &[Module::Di4.code()]).unwrap();
    assert_eq!(rig.read(0x0410, 4).unwrap(), link(0, Toggle, [0; 2]));
    assert_eq!(rig.read(0x0414, 4).unwrap(), NONE);
    assert_eq!(rig.read(0x0438, 4), Err(2), "no longer an output");
    rig.write(0x0414, &link(12, Toggle, [0; 2])).unwrap();
    rig.pass(1_000);
    rig.scan_port(3, |channels| channels.set_bit(0, true));
    assert_eq!(
        rig.ask(&[1, 0, 5, 0, 1]),
        [1, 1, 0],
        "not before the restart"
    );
    assert_eq!(rig.press(0), [true, true], "another port");
    // Another module for the output.
    rig.write(at::module_of(2), &[Module::Relay2.code()])
        .unwrap();
    assert_eq!(rig.read(0x0410, 4), Err(2));
    assert_eq!(rig.read(0x0418, 8).unwrap(), [NONE; 2].as_flattened());
    rig.write(0x0418, &link(0, Toggle, [0; 2])).unwrap();
    rig.pass(1_000);
    rig.press(0);
    assert_eq!(rig.ask(&[1, 0, 4, 0, 4]), [1, 1, 0b0001]);
}

#[test]
fn write_of_a_link_is_no_edge_whatever_its_inputs_had() {
    // Between the scan of the inputs and the links a request changes the source to an input with another level.
    let mut rig = linked(link(0, Toggle, [0; 2]), NONE);
    rig.scan_port(0, |channels| channels.set_bit(1, true));
    rig.pass(10);
    for source in [1, 0, 1] {
        rig.device.tick(1);
        rig.write(0x0410, &[source]).unwrap();
        rig.scan_port(0, |_| {});
        rig.pass(1_500);
        assert!(!rig.output(), "source {source}");
    }
    assert_eq!(rig.press(1), [false, false], "it was on");
    assert_eq!(rig.press(1), [true, true]);
}

#[test]
fn edge_of_a_scan_reaches_a_link_although_a_setting_is_written_before_the_links_run() {
    let mut rig = linked(link(0, Toggle, [0; 2]), NONE);
    // As `Scanning::run` does it: the inputs under one lock, then the links under others. A request is served in between.
    let mut channels = *rig.device.points.ports()[0].channels();
    channels.set_bit(0, true);
    rig.device.scanned(0, &channels, &[None; 4], true, 1);
    rig.write(at::RESPONSE_DELAY, &[1]).unwrap();
    (0..4).for_each(|slot| rig.device.run_links(slot));
    assert!(rig.output(), "the edge was lost");
}

#[test]
fn loaded_defaults_and_dropped_changes_count_as_writes_of_all_links() {
    let mut rig = linked(link(0, Follow, [0; 2]), NONE);
    rig.write(at::COMMAND, &[1]).unwrap();
    rig.device.config.end_save(false);
    rig.input(0, true);
    assert!(rig.output());
    for command in [3, 4] {
        rig.write(at::COMMAND, &[command]).unwrap();
        rig.write_output(false);
        rig.pass(990);
        assert!(!rig.output(), "it rests after COMMAND {command}");
    }
    rig.pass(10);
    assert!(rig.output());
}

#[test]
fn driven_output_never_has_what_a_master_writes_into_a_held_one() {
    let mut rig = linked(link(0, Follow, [0; 2]), NONE);
    rig.input(0, true);
    for _ in 0..3 {
        rig.write_output(false);
        // The scan that the write causes, which runs no links.
        assert!(rig.device.drive(1, 0) & 1 != 0);
        rig.pass(1);
        assert!(rig.device.drive(1, 0) & 1 != 0 && rig.output());
    }
    // SAFE is 0, and does not show.
    let now = rig.device.state.millis();
    rig.device.request_seen(now, true);
    for _ in 0..1_100 {
        rig.pass(1);
        assert!(rig.device.drive(1, 0) & 1 != 0);
    }
    assert!(rig.device.comm_watchdog.has_expired());
}

/// A heater or a fan at point 4, and the codes of its sensor at input 1 of port 3 through the driver of the module.
struct Sensor {
    rig: Rig<Modio08>,
    module: Ai4,
}

impl Sensor {
    fn new(range: u16, filter: u16, heater: [u16; 4]) -> Self {
        let mut rig = Rig::<Modio08>::on(
            MODULES,
            &[
                (at::FILTER + ANALOG, filter),
                (at::RANGE + ANALOG, range),
                (at::SCALE + ANALOG, 1),
            ],
        );
        rig.unlock();
        rig.write(0x0410, &heater).unwrap();
        Self {
            rig,
            module: Ai4::default(),
        }
    }

    /// Scans these codes, one in each ms. Returns how often the output was on.
    fn scan(&mut self, codes: impl Iterator<Item = u16>) -> usize {
        let mut on = 0;
        for code in codes {
            let device = &mut self.rig.device;
            let mut channels = *device.points.ports()[2].channels();
            self.module.configure(device.points.ports()[2].settings());
            let codes = [Some(code), None, None, None];
            // The lines without codes fail.
            let _ = self.module.read_inputs(&mut channels, &codes);
            device.scanned(2, &channels, &codes, true, 1);
            device.tick(1);
            (0..4).for_each(|slot| device.run_links(slot));
            on += usize::from(device.drive(1, 0) & 1);
        }
        on
    }
}

#[test]
fn loose_or_cut_wire_switches_neither_a_heater_nor_a_fan_on() {
    // Ranges, codes in between the thresholds and beyond, of a broken wire, and the links that switch on beyond them. An
    // NTC at 20 degC and at 40 degC, a loop at 12 mA and at 18 mA.
    let heaters = [
        (2, 2_269, 4_095, link(ANALOG, Invert, [180, 150])),
        (1, 2_457, 0, link(ANALOG, Invert, [9_000, 8_000])),
        (1, 2_457, 0, link(ANALOG, Invert, [9_000, 3_000])),
        // A fan, and a thermistor with a short circuit.
        (2, 2_269, 0, link(ANALOG, Follow, [300, 280])),
    ];
    for (range, good, broken, heater) in heaters {
        for filter in [0, 4, 8] {
            for on_off in [25, 8, 3] {
                let mut sensor = Sensor::new(range, filter, heater);
                assert_eq!(sensor.scan((0..3_000).map(|_| good)), 0);
                let loose = |ms: u32| {
                    if ((ms + 1) / on_off).is_multiple_of(2) {
                        broken
                    } else {
                        good
                    }
                };
                let on = sensor.scan((0..10_000).map(loose));
                assert_eq!(on, 0, "range {range}, filter {filter}, {on_off} ms");
            }
            let mut sensor = Sensor::new(range, filter, heater);
            sensor.scan((0..3_000).map(|_| good));
            assert_eq!(sensor.scan((0..5_000).map(|_| broken)), 0, "cut");
            assert_eq!(sensor.scan((0..70_000).map(|_| good)), 0, "mended");
        }
    }
}

#[test]
fn heater_works_again_a_minute_after_its_sensor_was_mended() {
    let mut sensor = Sensor::new(2, 4, link(ANALOG, Invert, [180, 150]));
    // 0 degC.
    assert!(sensor.scan((0..3_000).map(|_| 3_156)) > 1_900);
    assert_eq!(sensor.scan((0..20).map(|_| 4_095)), 9, "SAFE after ten");
    assert_eq!(sensor.scan((0..60_000).map(|_| 3_156)), 0);
    assert!(sensor.scan((0..2_000).map(|_| 3_156)) > 900);
}

#[test]
fn output_is_the_masters_again_after_the_last_link_of_its_slot_has_gone() {
    let mut rig = linked(link(0, Follow, [0; 2]), NONE);
    rig.input(0, true);
    assert!(rig.device.drive(1, 0) & 1 != 0);
    // ACTION 0.
    rig.write(links::of_point(OUTPUT, false) + 1, &[0]).unwrap();
    rig.pass(2_000);
    rig.write_output(false);
    rig.pass(1);
    assert!(rig.device.drive(1, 0) & 1 == 0, "the terminal");
    assert_eq!(rig.device.held_outputs(), 0);
}

#[test]
fn wire_that_is_open_for_a_few_scans_again_and_again_switches_no_heater_on() {
    // Once in 1,009 scans, so that the links look at each distance from it. And 50 times a second for a quarter of the time.
    for (filter, open, of, ms) in [(4, 9, 1_009, 400_000), (4, 5, 20, 9_000), (8, 5, 20, 9_000)] {
        let mut sensor = Sensor::new(2, filter, link(ANALOG, Invert, [180, 150]));
        sensor.scan((0..3_000).map(|_| 2_269));
        let codes = (0..ms).map(|ms| if ms % of < open { 4_095 } else { 2_269 });
        assert_eq!(sensor.scan(codes), 0, "filter {filter}, {open} of {of} ms");
    }
}
