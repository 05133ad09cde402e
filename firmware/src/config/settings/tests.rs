//! Tests of the settings and of their form in a record.

extern crate std;
use std::vec::Vec;

use super::*;

/// The settings of a modio-02.
type Settings = super::Settings<Modio02>;
use register_map::board::{Modio02, Modio08, Row};
use register_map::configuration::{
    BAUD, FILTER, HEARTBEAT, HOLD, LORA_ADDRESS, RANGE, SAFE, START, module_of,
};

use register_map::record::{FIRST_OFFSET, OVERHEAD};

const SLOT: u16 = points::first(5);
const MODULE_SLOT: u16 = module_of(5);

fn changed(settings: &Settings) -> Vec<(u16, u16)> {
    settings.changed_from(0).collect()
}

fn loaded(pairs: &[(u16, u16)]) -> (Settings, u16) {
    Settings::load(pairs.iter().copied())
}

#[test]
fn defaults_are_the_factory_settings_and_count_as_unchanged() {
    let settings = Settings::defaults();
    assert_eq!((settings.get(BAUD), settings.get(FILTER + SLOT)), (96, 5));
    assert_eq!((settings.get(0x0145), settings.get(0x017F)), (300, 3950));
    assert_eq!((settings.get(0x0201), settings.get(0x0001)), (0, 0));
    assert_eq!(changed(&settings), []);
    assert_eq!(RESTARTS, 7 + 8 + 6 + 32);
    assert_eq!(settings.restart_values().count(), RESTARTS);
}

#[test]
fn the_record_of_all_settings_fits_in_a_page() {
    for board in Row::ALL {
        // Settings of points that the board does not have keep their defaults.
        let of_points = board.slots * points::CHANNELS;
        let counts = RULES.iter().map(|rule| match rule.count {
            points::COUNT => of_points,
            count => count,
        });
        let settings: u16 = counts.sum();
        let slots = if links::exist(board.slots.into()) {
            board.slots
        } else {
            0
        };
        let pairs = settings + slots * points::CHANNELS * links::EACH * links::WORDS;
        let size = FIRST_OFFSET + OVERHEAD + 4 * usize::from(pairs);
        assert!(size <= board.store().bytes as usize, "{board}: {size}");
    }
}

#[test]
fn changed_settings_restore_the_same_settings() {
    let pairs = [
        (BAUD, 1152),
        (MODULE_SLOT, 4),
        (FILTER + SLOT, 8),
        (LORA_ADDRESS, 0xFFFF),
        (RANGE + SLOT + 3, 2),
        (START + 31, 4095),
    ];
    let (settings, rejected) = loaded(&pairs);
    assert_eq!(rejected, 0);
    assert_eq!(changed(&settings), pairs);
    let from: Vec<_> = settings.changed_from(FILTER + SLOT + 1).collect();
    assert_eq!(from, pairs[3..]);
    let backwards: Vec<_> = pairs.into_iter().rev().collect();
    assert_eq!(loaded(&backwards).0, settings, "the order does not matter");
}

#[test]
fn a_filter_has_the_default_of_its_module() {
    let (settings, _) = loaded(&[(MODULE_SLOT, 4)]);
    assert_eq!(
        (settings.get(FILTER + SLOT), settings.get(FILTER + SLOT - 1)),
        (4, 5)
    );
    assert_eq!(changed(&settings), [(MODULE_SLOT, 4)]);
    let (settings, _) = loaded(&[(MODULE_SLOT, 4), (FILTER + SLOT, 5)]);
    assert_eq!(changed(&settings), [(MODULE_SLOT, 4), (FILTER + SLOT, 5)]);
}

#[test]
fn a_value_not_allowed_is_counted_and_an_unknown_address_is_ignored() {
    let (settings, rejected) = loaded(&[
        (BAUD, 97),
        (MODULE, 1),
        (0x010A, 1),
        (KEY, 0x5A17),
        (COMMAND, 1),
        (HEARTBEAT, 1),
        (0x0200, 1),
        (0xFFFF, 0xFFFF),
        (MODULE_SLOT, 2),
        (SAFE + SLOT, 2),
        (SAFE + SLOT + 1, 1),
    ]);
    assert_eq!(rejected, 3, "BAUD, MODULE of port 1, SAFE of a bit");
    assert_eq!(changed(&settings), [(MODULE_SLOT, 2), (SAFE + SLOT + 1, 1)]);
}

#[test]
fn modules_are_accepted_only_on_ports_with_a_slot() {
    let pairs = (1..=8).map(|port| (module_of(port), 2));
    fn ports<B: Board>(pairs: impl Iterator<Item = (u16, u16)>) -> (Vec<u16>, u16) {
        let (settings, rejected) = super::Settings::<B>::load(pairs);
        let ports = (1..=8).filter(|port| settings.module(*port) == Module::Do4);
        (ports.collect(), rejected)
    }
    assert_eq!(ports::<Modio02>(pairs.clone()), (std::vec![5], 7));
    assert_eq!(ports::<Modio08>(pairs), (std::vec![1, 2, 3, 4], 4));
}

#[test]
fn stored_format_with_seven_data_bits_is_kept_in_ascii_mode_only() {
    for format in 4..=6 {
        let (settings, rejected) = loaded(&[(FORMAT, format), (MODE, 1)]);
        assert_eq!((settings.get(FORMAT), rejected), (format, 0));
        let (settings, rejected) = loaded(&[(FORMAT, format)]);
        assert_eq!((settings.get(FORMAT), rejected), (0, 1));
    }
    let (settings, rejected) = loaded(&[(FORMAT, 7), (MODE, 1)]);
    assert_eq!((settings.get(FORMAT), rejected), (0, 1));
}

#[test]
fn another_module_starts_from_its_own_defaults() {
    let (mut settings, _) = loaded(&[(MODULE_SLOT, 2), (SAFE + SLOT, HOLD), (START + SLOT, 1)]);
    settings.set(MODULE_SLOT, 3);
    assert_eq!(changed(&settings), [(MODULE_SLOT, 3)]);
    settings.set(MODULE_SLOT, 4);
    settings.set(RANGE + SLOT, 2);
    settings.set(MODULE_SLOT, 4);
    assert_eq!(
        settings.get(RANGE + SLOT),
        2,
        "the same module is no change"
    );
    settings.set(MODULE_SLOT, 0);
    assert_eq!(changed(&settings), []);
}

#[test]
fn settings_made_before_the_module_are_kept_if_it_allows_them() {
    let mut settings = Settings::defaults();
    settings.set(SAFE + SLOT, 2048);
    settings.set(SAFE + SLOT + 1, HOLD);
    settings.set(FILTER + SLOT, 3);
    settings.set(FILTER + SLOT + 1, 100);
    let mut outputs = settings;
    outputs.set(MODULE_SLOT, 2);
    assert_eq!(outputs.get(SAFE + SLOT), 0, "2048 is not allowed for a bit");
    assert_eq!(outputs.get(SAFE + SLOT + 1), HOLD);
    settings.set(MODULE_SLOT, 4);
    let filters: Vec<_> = (0..4).map(|i| settings.get(FILTER + SLOT + i)).collect();
    assert_eq!(filters, [3, 4, 4, 4]);
}

register_map::on_boards! {
    each_changed_setting_is_in_the_record: Modio02, Modio08, Fx3u14, Fx3u24, EthIo5r
}

fn each_changed_setting_is_in_the_record<B: Board>() {
    let modules = B::ROW
        .ports()
        .map(|port| (module_of(port), Module::Di4.code()));
    let modules = modules.filter(|_| B::ROW.is_modular());
    let registers = B::ROW.registers().flat_map(|(rule, _)| {
        // For every point another value than the default.
        let other = |value: &u16| *value != rule.default && rule.values.allow(*value);
        let value = (0..=u16::MAX).find(other);
        rule.addresses().zip(core::iter::repeat(value))
    });
    let settings = registers.filter_map(|(address, value)| Some((address, value?)));
    let settings = settings.filter(|(address, _)| {
        is_held::<B>(*address) && is_setting(*address) && port_of(*address).is_none()
    });
    let (settings, _) = super::Settings::<B>::load(modules.chain(settings));
    let changed: Vec<_> = settings.changed_from(0).collect();
    let behind = B::ROW.behind_links();
    let has = changed
        .iter()
        .filter(|(address, _)| behind.contains(address));
    assert_eq!(has.count(), behind.len());
    let (stored, rejected) = super::Settings::<B>::load(changed.into_iter());
    assert_eq!((stored, rejected), (settings, 0));
    assert_ne!(stored, super::Settings::<B>::defaults());
}
