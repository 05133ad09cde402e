//! A board for tests of the command: its core runs an endless loop, its world is real.

use register_map::Module;
use sim::{Board, Config, Image};

use super::bench::Bench;

/// The vector table (stack, reset) and `b .` after it.
const LOOP: [u8; 10] = [0x00, 0x50, 0x00, 0x20, 0x09, 0x00, 0x00, 0x08, 0xFE, 0xE7];

/// A bench whose board has this module plugged, and its power on.
pub fn bench(module: Module) -> Bench {
    bench_of(Config {
        module,
        ..Config::default()
    })
}

/// A bench with a board like this.
pub fn bench_of(config: Config) -> Bench {
    let image = Image::from_bytes(&LOOP).expect("a vector table and an instruction");
    Bench::new(Board::new(&image, config).expect("it fits"))
}
