//! A board with a module in each of its four slots.

use register_map::configuration::modules;
use sim::slot::Slot;
use sim::{Channel, Config, Module};

use crate::LAYOUT;
use crate::rig::{Rig, flash_with_settings};

/// The lines of all slots, port 1 first, as in the board's schematic: port of the part and number of the pin.
pub const LINES: [[(char, u8); 4]; 4] = [
    [('A', 0), ('A', 1), ('A', 2), ('A', 3)],
    [('A', 4), ('A', 5), ('A', 6), ('A', 7)],
    [('C', 0), ('C', 1), ('C', 2), ('C', 3)],
    [('B', 0), ('B', 1), ('C', 4), ('C', 5)],
];

/// Returns a board with these modules in the slots of ports 1 to 4 and in its stored configuration, together with
/// these settings.
pub fn fitted(plugged: [Module; 4], settings: &[(u16, u16)]) -> Rig {
    fitted_with(plugged, settings, |_| {})
}

/// The same, with changes in its flash.
pub fn fitted_with(
    plugged: [Module; 4],
    settings: &[(u16, u16)],
    change: impl FnOnce(&mut [u8]),
) -> Rig {
    let slots: Vec<_> = (1..).zip(plugged).collect();
    let mut stored: Vec<_> = modules(slots.iter().copied()).collect();
    stored.extend(settings);
    let mut flash = flash_with_settings(&stored);
    change(&mut flash);
    Rig::with(Config {
        layout: LAYOUT,
        slots,
        chip: sim::chip::Config::holding(flash),
        ..Config::default()
    })
}

/// Changes the outside of the slot at a port.
pub fn change<T>(rig: &mut Rig, port: u8, action: impl FnOnce(&mut Slot) -> T) -> T {
    rig.board
        .change_slot(port, action)
        .expect("the port has a slot")
}

/// Returns the four channels of the slot at a port.
pub fn channels(rig: &Rig, port: u8) -> [Channel; 4] {
    let (_, slot) = rig
        .board
        .slots()
        .find(|(other, _)| *other == port)
        .expect("the port has a slot");
    [1, 2, 3, 4].map(|n| slot.channel(n))
}

/// Returns the states of the outputs of a 4DO.
pub fn outputs(rig: &Rig, port: u8) -> [bool; 4] {
    channels(rig, port).map(|channel| match channel {
        Channel::Do { on } => on,
        other => panic!("port {port} has {other:?}"),
    })
}

/// Returns the codes at the outputs of a 4AO.
pub fn codes(rig: &Rig, port: u8) -> [u16; 4] {
    channels(rig, port).map(|channel| match channel {
        Channel::Ao { code } => code,
        other => panic!("port {port} has {other:?}"),
    })
}
