//! Seeds for the decoder of descriptions: those of real units, in parts that are shorter than the longest input.

use modio_description::{Description, describe};
use register_map::{Board, Module};

use crate::Seed;

/// Registers of one seed.
const REGISTERS: usize = 12;

/// Returns descriptions that together have every register, kind of point and module of both boards.
pub fn seeds() -> Vec<Seed> {
    let mut seeds = Vec::new();
    for board in Board::ALL {
        let unit = describe(board, "1.2.3", |port| {
            Module::ALL[usize::from(port) % Module::ALL.len()]
        });
        for (part, registers) in unit.registers.chunks(REGISTERS).enumerate() {
            let unit = Description {
                registers: registers.to_vec(),
                ..unit.clone()
            };
            seeds.push((format!("{}-{part}", board.name), unit.encode()));
        }
        // The length and the CRC of a file in front.
        let file = Description {
            registers: Vec::new(),
            ..unit
        };
        seeds.push((format!("{}-file", board.name), file.file()));
    }
    seeds
}
