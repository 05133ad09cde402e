//! Boards and waits for tests of the command. The core of a board runs an endless loop; the rest of the board works as
//! usual.

use std::thread;
use std::time::{Duration, Instant};

use register_map::Module;
use sim::{Board, Config, Image};

use super::scene::Scene;
use super::unit::Unit;

/// Part of the message about a missing directory.
pub const NO_DIRECTORY: &str = if cfg!(windows) {
    "(os error 3)"
} else {
    "(os error 2)"
};

/// Machine code: the vector table (stack, reset), and `b .` after it.
const LOOP: [u8; 10] = [0x00, 0x50, 0x00, 0x20, 0x09, 0x00, 0x00, 0x08, 0xFE, 0xE7];

/// Waits until `is()` returns true, at most 20 s.
pub fn eventually(what: &str, mut is: impl FnMut() -> bool) {
    let end = Instant::now() + Duration::from_secs(20);
    while !is() {
        assert!(Instant::now() < end, "{what}");
        thread::sleep(Duration::from_millis(1));
    }
}

/// Returns a board with this module, and its power on.
pub fn board(module: Module) -> Board {
    board_of(Config {
        module,
        ..Config::default()
    })
}

fn board_of(config: Config) -> Board {
    let image = Image::from_bytes(&LOOP).expect("the code is a valid image");
    Board::new(&image, config).expect("the image fits into the flash")
}

/// Returns a scene with one board that has this module, and its power on.
pub fn scene(module: Module) -> Scene {
    bench_of(Config {
        module,
        ..Config::default()
    })
}

/// Returns a scene with one board of this configuration.
pub fn bench_of(config: Config) -> Scene {
    bench_of_boards([("modio-02", config)])
}

/// Returns a scene with several boards and their names.
pub fn bench_of_boards(boards: impl IntoIterator<Item = (&'static str, Config)>) -> Scene {
    let boards = boards
        .into_iter()
        .map(|(name, config)| (board_of(config), Unit::new(name.to_owned(), None)));
    Scene::new(boards.collect())
}
