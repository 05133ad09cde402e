//! Boards with programs written by hand, where the images show less: an early driver, dividers, radios on one air.

#[path = "../../../f103/tests/machine/asm.rs"]
#[allow(dead_code, reason = "the tests of the core use all of the assembler")]
mod asm;
mod echo;
mod fx3u;
mod radio_bus;
#[path = "../../../f103/tests/machine/regs.rs"]
#[allow(dead_code, reason = "the tests of the core use all of the registers")]
mod regs;
mod witness;

use sim::{Board, Config, Image, Time};

/// Time from power-on to the first instruction: the reset delay of the part.
const START: Time = Time::from_us(2_500);

/// Returns a board that runs a program.
fn board_with(image: &Image, config: Config) -> Board {
    Board::new(image, config).expect("the program fits")
}

/// Returns the `n`th word that a program has stored at [`regs::OUT`].
fn out(board: &Board, n: u32) -> u32 {
    board.word(regs::OUT + 4 * n).expect("in SRAM")
}

/// Returns the findings as text.
fn findings(board: &Board) -> Vec<String> {
    board
        .findings()
        .iter()
        .map(|f| f.what.to_string())
        .collect()
}
