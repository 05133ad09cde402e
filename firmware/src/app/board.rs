//! The board of this image, as it appears in the register map and the self-description.

use board_support::boards;
use firmware::device::Fixed;
use register_map::{Board, layout::Layout};

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
const _: () = assert!(BOARD.slots as usize == boards::SLOTS);
