//! The board of this image, as it appears in the register map and the self-description.

use board_support::boards::{self, AddressPins, PortKind, SlotPins};
use firmware::line::Addresses;
use register_map::{
    FixedPort, Module,
    board::{Board, Row, Second},
    layout::Layout,
};

// `B`, the type of the board of this image: the one whose feature of board-support is on.
include!(concat!(env!("OUT_DIR"), "/board.rs"));

/// Its row in the register map.
pub const BOARD: &Row = B::ROW;

/// Where the images are in flash.
pub const LAYOUT: &Layout = &BOARD.layout();

/// The device.
pub type Device = firmware::device::Device<B>;

/// The unit addresses of a line.
pub type Units = <Events as Addresses>::Units;

/// Whether the board has events.
pub type Events = <B as Board>::Events;

// The register map and the pin descriptor mean the same board.
const _: () = {
    assert!(BOARD.slots as usize == boards::SLOTS);
    assert!(BOARD.switch == matches!(boards::BOARD.address, AddressPins::Switch(_)));
    assert!(match (BOARD.second, boards::BOARD.second) {
        (Some(Second::Radio), Some(pins)) => pins.radio.is_some(),
        (Some(Second::Rs232), Some(pins)) => pins.radio.is_none(),
        (None, None) => true,
        _ => false,
    });
    assert!(BOARD.is_modular() == boards::BOARD.has_slots());
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
