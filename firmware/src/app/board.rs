//! The board that this image is for, as masters and tools know it.

use board_support::boards;
use firmware::device::Fixed;
use register_map::Board;

/// The board's row in the register map, found by its name.
pub const BOARD: &Board = match Board::named(boards::BOARD.name) {
    Some(board) => board,
    None => panic!("the register map has no row for this board"),
};

/// What is the same in the self-descriptions of all units with this board.
pub const DESCRIPTION: &Fixed = &Fixed::of(BOARD);

/// The device behind this board's line.
pub type Device = firmware::device::Device<{ boards::SLOTS }>;

// Register map and pins mean the same board.
const _: () = {
    let pins = boards::BOARD;
    assert!(BOARD.slots as usize == boards::SLOTS);
    let ([a, b], [first, second]) = (pins.store, BOARD.store.addresses());
    assert!(a == first && b == second && pins.page_bytes == BOARD.store.bytes);
};
