//! Outputs that start as they were.

use register_map::codes::LinkAction;
use register_map::record::{encode_page, records};
use register_map::{configuration::AS_IT_WAS, links};

use super::*;
use crate::kept_outputs::{KeptOutputs, half_word_of};
use crate::outputs::Outputs;

/// Digital outputs at points 0 to 3, relays at points 6 and 7, analog outputs at points 8 to 11, inputs at 12 to 15.
const MODULES: [Module; 4] = [Module::Do4, Module::Relay2, Module::Ao4, Module::Di4];
/// The outputs that start as they were.
const POINTS: [u16; 6] = [0, 1, 3, 7, 8, 9];

/// Returns a device whose stored settings let these outputs start as they were, together with these settings.
fn keeping(settings: &[(u16, u16)]) -> Rig<Modio08> {
    let starts = POINTS.map(|point| (at::START + point, AS_IT_WAS));
    let mut stored = settings.to_vec();
    stored.extend(starts);
    stored.sort_unstable();
    Rig::<Modio08>::on(MODULES, &stored)
}

impl Rig<Modio08> {
    fn set(&mut self, point: u8, on: bool) {
        assert_eq!(self.ask(&[5, 0, point, if on { 0xFF } else { 0 }, 0])[0], 5);
    }

    /// Returns the values of the eight bit points and of the four analog outputs.
    fn values(&mut self) -> (u8, Vec<u16>) {
        (self.ask(&[1, 0, 0, 0, 8])[2], self.read(8, 4).unwrap())
    }

    /// Starts from these stored outputs.
    fn restored(self, outputs: &[(u16, u16)]) -> Self {
        let mut page = [0xFF; 200];
        encode_page(0, outputs, &mut page).unwrap();
        let (_, record) = records(&page, &MODIO_08).next().unwrap();
        self.device.start_outputs(None, Some(&record));
        self
    }
}

fn pairs(outputs: &Outputs) -> &[(u16, u16)] {
    outputs
}

#[test]
fn outputs_start_with_the_stored_values_and_all_others_with_start() {
    let stored = [(at::START + 2, 1), (at::START + 10, 1234)];
    let mut rig = keeping(&stored);
    let defaults = (0b0100, std::vec![0, 0, 1234, 0]);
    assert_eq!(rig.values(), defaults);
    rig.ask(&[0x0F, 0, 0, 0, 4, 1, 0b1001]);
    rig.ask(&[0x0F, 0, 6, 0, 2, 1, 0b11]);
    rig.write(8, &[100, 4095, 7, 8]).unwrap();
    let outputs = rig.device.outputs();
    let expected = [
        // Module, port and which outputs count; the value of point 2, which does not, is not stored.
        (0xE280, 0x0B09),
        (0xE384, 0x0808),
        (0xE508, 100),
        (0xE509, 4095),
    ];
    assert_eq!(pairs(&outputs), expected);
    let mut next = keeping(&stored).restored(&outputs);
    assert_eq!(next.values(), (0b1000_1101, std::vec![100, 4095, 1234, 0]));
    assert_eq!(next.device.outputs(), outputs);
    // A record without outputs.
    assert_eq!(keeping(&stored).restored(&[]).values(), defaults);
}

#[test]
fn stored_values_of_another_module_or_out_of_range_are_ignored() {
    let outputs = [
        // A 4DO and a 4AO where a 2RELAY and a 4DO are now, a point without a module, and a value above 4095.
        (0xE284, 0x0F0F),
        (0xE500, 1),
        (0xE5FF, 1),
        (0xE508, 4096),
        (0xE280, 0x0802),
    ];
    let mut rig = keeping(&[]).restored(&outputs);
    assert_eq!(
        rig.values(),
        (0, std::vec![0; 4]),
        "of point 1 no level is stored"
    );
}

#[test]
fn commanded_values_are_kept_while_outputs_are_at_safe() {
    let mut rig = keeping(&[
        (at::COMM_TIMEOUT, 5),
        (at::SAFE + 1, 1),
        (at::SAFE + 8, 50),
        (at::SAFE + 9, at::HOLD),
    ]);
    rig.set(0, true);
    rig.write(8, &[100, 200]).unwrap();
    let before = rig.device.outputs();
    for _ in 0..2 {
        let now = rig.device.state.millis();
        rig.device.request_seen(now, true);
        assert!(rig.device.tick(500));
    }
    assert_eq!(rig.values(), (0b0010, std::vec![50, 200, 0, 0]));
    assert_eq!(rig.device.outputs(), before);
    // What is commanded from now on replaces it.
    rig.set(1, true);
    rig.write(8, &[50]).unwrap();
    let after = rig.device.outputs();
    assert_eq!(after[0], (0xE280, 0x0B03));
    assert_eq!(after[2..], [(0xE508, 50), (0xE509, 200)]);
}

#[test]
fn an_edge_link_is_kept_a_pulse_and_an_output_that_a_link_always_holds_are_not() {
    let mut rig = keeping(&[(at::COMM_TIMEOUT, 50)]);
    rig.unlock();
    for (point, input, action) in [
        (0, 12, LinkAction::Toggle),
        (1, 13, LinkAction::Pulse),
        (3, 14, LinkAction::Follow),
        (7, 14, LinkAction::FollowAlone),
    ] {
        let link = [input, action.code(), 10, 0];
        rig.write(links::of_point(point, false), &link).unwrap();
    }
    rig.pass(1_010);
    rig.scan_port(3, |channels| channels.set_bits(0b0111, 0b0111));
    assert_eq!(rig.values().0, 0b0000_1011);
    assert_eq!(
        pairs(&rig.device.outputs())[..2],
        [(0xE280, 0x0301), (0xE384, 0x0800)]
    );
    // A link counts as well after SAFE.
    let now = rig.device.state.millis();
    rig.device.request_seen(now, false);
    rig.pass(5_000);
    assert_eq!(rig.values().0, 0b1000_1000, "both level links hold");
    assert_eq!(
        pairs(&rig.device.outputs())[..2],
        [(0xE280, 0x0301), (0xE384, 0x0808)]
    );
    for level in [0, 1, 0, 1] {
        rig.scan_port(3, |channels| channels.set_bits(1, level));
    }
    assert_eq!(rig.device.outputs()[0], (0xE280, 0x0300));
}

/// Returns what a reset now keeps.
pub(super) fn kept(rig: &Rig<Modio08>) -> KeptOutputs {
    let mut values = [0; 32];
    for (slot, port) in rig.device.points.ports().iter().enumerate() {
        for channel in 0..4 {
            values[slot * 4 + channel] = half_word_of(port.commanded(channel));
        }
    }
    KeptOutputs {
        values,
        modules: rig.device.modules_in_force(),
        held: rig.device.held_outputs(),
        at_safe: rig.device.outputs_at_safe(),
    }
}

#[test]
fn reset_keeps_outputs_as_they_were_and_held_ones_and_no_others() {
    // Output 3 of the 4DO is held by a link, with START 0; relay 1 by one that acts while there is no master.
    let stored = [
        (at::COMM_TIMEOUT, 5),
        (at::SAFE + 9, 300),
        (links::of_point(2, false), 12),
        (links::of_point(2, false) + 1, LinkAction::Invert.code()),
        (links::of_point(6, false), 12),
        (
            links::of_point(6, false) + 1,
            LinkAction::InvertAlone.code(),
        ),
    ];
    let mut rig = keeping(&stored);
    rig.ask(&[0x0F, 0, 0, 0, 4, 1, 0b0011]);
    rig.write(8, &[100, 200, 400]).unwrap();
    rig.pass(1_100);
    // SAFE of 0x0 and 0x8 is 0, of 0x9 it is 300. Both links hold.
    assert_eq!(rig.values(), (0b0100_0100, std::vec![0, 300, 0, 0]));
    rig.ask(&[0x0F, 0, 0, 0, 2, 1, 0b10]);
    rig.write(10, &[401]).unwrap();
    let before = kept(&rig);
    assert_eq!(before.held, 0b0100_0100);
    let mut next = keeping(&stored);
    next.device.start_outputs(Some(&before), None);
    // The third analog output has START.
    assert_eq!(next.values(), (0b0100_0110, std::vec![0, 300, 0, 0]));
    // Another reset, before the links know again.
    next.pass(3);
    let mut third = keeping(&stored);
    third.device.start_outputs(Some(&kept(&next)), None);
    assert_eq!(third.values().0, 0b0000_0110, "WHEN 1 held no more");

    let mut others = before;
    others.modules ^= 1;
    let mut next = keeping(&stored);
    next.device.start_outputs(Some(&others), None);
    assert_eq!(next.values(), (0, std::vec![0; 4]), "of other modules");
    let mut damaged = before;
    damaged.values[1] ^= 1;
    let mut page = [0xFF; 200];
    encode_page(0, &[(0xE280, 0x0203)], &mut page).unwrap();
    let (_, record) = records(&page, &MODIO_08).next().unwrap();
    let mut next = keeping(&stored);
    next.device.start_outputs(Some(&damaged), Some(&record));
    assert_eq!(next.values().0, 0b0100_0110, "from the record");
}

#[test]
fn values_are_stored_raw_and_start_in_the_unit_of_the_settings() {
    let mut rig = keeping(&[(at::SCALE + 8, 1)]);
    rig.write(8, &[5000, 2048]).unwrap();
    let outputs = rig.device.outputs();
    assert_eq!(outputs[2..], [(0xE508, 2048), (0xE509, 2048)]);
    let mut next = keeping(&[(at::SCALE + 8, 1), (at::RANGE + 8, 1)]).restored(&outputs);
    assert_eq!(next.values().1[..2], [10_002, 2048]);
    assert_eq!(next.device.outputs(), outputs);
}

#[test]
fn saved_settings_alone_decide_which_outputs_are_stored() {
    let mut rig = Rig::<Modio08>::on(MODULES, &[]);
    rig.unlock();
    rig.write(at::START, &[AS_IT_WAS, 0, AS_IT_WAS]).unwrap();
    assert!(rig.device.outputs().is_empty(), "not saved");
    rig.write(at::COMMAND, &[1]).unwrap();
    assert_eq!(pairs(&rig.device.outputs()), [(0xE280, 0x0500)]);
    rig.device.config.end_save(true);
    // The module in force is not the one of the next start.
    rig.write(at::MODULE, &[3]).unwrap();
    assert_eq!(rig.device.outputs().len(), 1);
    rig.write(at::COMMAND, &[1]).unwrap();
    assert!(rig.device.outputs().is_empty());
}

#[test]
fn output_that_a_link_always_holds_uses_no_record_while_its_link_begins_again() {
    let mut rig = keeping(&[]);
    rig.unlock();
    let link = [12, LinkAction::Follow.code(), 0, 0];
    rig.write(links::of_point(3, false), &link).unwrap();
    rig.pass(1_010);
    let before = rig.device.outputs();
    // A master that sets its link again.
    rig.write(links::of_point(3, false), &link).unwrap();
    rig.pass(10);
    assert_eq!(rig.device.outputs(), before, "while it rests");
    rig.write(at::FILTER + 12, &[6]).unwrap();
    rig.pass(1_010);
    assert_eq!(rig.device.outputs(), before);
}

#[test]
fn safe_is_not_stored_as_commanded_after_a_reset_that_kept_it() {
    let stored = [(at::COMM_TIMEOUT, 5), (at::SAFE + 8, 50)];
    let mut rig = keeping(&stored);
    rig.set(0, true);
    rig.write(8, &[100]).unwrap();
    let commanded = rig.device.outputs();
    let now = rig.device.state.millis();
    rig.device.request_seen(now, true);
    assert!(rig.device.tick(500));
    assert_eq!(rig.device.outputs(), commanded);
    let mut page = [0xFF; 200];
    encode_page(0, &commanded, &mut page).unwrap();
    let (_, record) = records(&page, &MODIO_08).next().unwrap();
    let mut next = keeping(&stored);
    next.device.start_outputs(Some(&kept(&rig)), Some(&record));
    assert_eq!(next.values(), (0, std::vec![50, 0, 0, 0]), "SAFE included");
    assert_eq!(next.device.outputs(), commanded, "SAFE was never commanded");
}
