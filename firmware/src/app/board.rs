//! The board of this image, as it appears in the register map and the self-description.

use board_support::boards::{self, AddressPins, PortKind, SlotPins};
use firmware::{HAS_SLOTS, device::Fixed};
use register_map::{Board, FixedPort, Module, board::Second, layout::Layout};

/// The board's row in the register map, found by name.
pub const BOARD: &Board = match Board::named(boards::BOARD.name) {
    Some(board) => board,
    None => panic!("the register map has no row for this board"),
};

/// Where the images are in flash.
pub const LAYOUT: &Layout = &BOARD.layout();

/// The fixed part of the self-description of every unit with this board.
pub const DESCRIPTION: &Fixed = &Fixed::of(BOARD);

/// The device with this board's number of slots.
pub type Device = firmware::device::Device<{ boards::SLOTS }>;

/// The settings of this board.
pub type Settings = firmware::config::Settings<{ boards::SLOTS }>;

// The register map and the pin descriptor mean the same board.
const _: () = {
    assert!(BOARD.slots as usize == boards::SLOTS);
    assert!(BOARD.switch == matches!(boards::BOARD.address, AddressPins::Switch(_)));
    assert!(BOARD.is_small() == cfg!(feature = "small"));
    assert!(match (BOARD.second, boards::BOARD.second) {
        (Some(Second::Radio), Some(pins)) => pins.radio.is_some(),
        (Some(Second::Rs232), Some(pins)) => pins.radio.is_none(),
        (None, None) => true,
        _ => false,
    });
    assert!(BOARD.has_radio() == HAS_SLOTS);
    assert!(BOARD.fixed.is_empty() == boards::BOARD.has_slots());
    let mut port = 0;
    while port < BOARD.fixed.len() {
        let SlotPins { lines, kind } = boards::BOARD.slots[port];
        let FixedPort {
            module, channels, ..
        } = BOARD.fixed[port];
        assert!(matches!(
            (kind, module),
            (PortKind::Inputs, Module::Di4)
                | (PortKind::Outputs, Module::Do4)
                | (PortKind::AnalogInputs(_) | PortKind::Analog(_), Module::Ai4)
                | (PortKind::AnalogOutputs(_), Module::Ao4)
        ));
        let mut line = 0;
        while line < lines.len() {
            assert!(lines[line].is_none() == (line >= channels as usize));
            line += 1;
        }
        port += 1;
    }
};
