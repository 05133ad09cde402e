//! A board for tests of the command: its core runs an endless loop, its world is real.

use register_map::Module;
use sim::{Board, Config, Image};

use super::bench::Bench;

/// The vector table (stack, reset) and `b .` after it.
const LOOP: [u8; 10] = [0x00, 0x50, 0x00, 0x20, 0x09, 0x00, 0x00, 0x08, 0xFE, 0xE7];

/// A bench whose board has this module plugged, and its power on.
pub fn bench(module: Module) -> Bench {
    let image = Image::from_bytes(&LOOP).expect("a vector table and an instruction");
    let config = Config {
        module,
        ..Config::default()
    };
    Bench::new(Board::new(&image, config).expect("it fits"))
}
