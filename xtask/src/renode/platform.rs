//! Tests of the platform and the scripts for Renode: against the part, the board's pins and the design's clocks.

use std::path::{Path, PathBuf};

use board_support::boards::{modio_02, modio_08};
use board_support::design::SYSCLK_ON_HSE_HZ;
use register_map::Board;

use crate::board::Hardware;
use crate::build;
use crate::toolchain::TARGET;

/// Pins with the same use on every board.
const COMMON: [(&str, char, u8); 4] = [
    ("de", 'A', 8),
    ("ledActivity", 'B', 8),
    ("ledFault", 'B', 9),
    ("ledRun", 'C', 13),
];

fn directory() -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../renode")).to_owned()
}

fn text(file: &str) -> String {
    fs_err::read_to_string(directory().join(file)).unwrap()
}

/// Asserts that a file has these lines in this order.
fn assert_has(file: &str, lines: &str) {
    assert!(text(file).contains(lines), "{file} has no\n{lines}");
}

#[test]
fn memories_and_clocks_are_those_of_the_part() {
    for board in Board::ALL {
        let file = format!("{board}.repl");
        let part = Hardware::of(board).part;
        assert_has(&file, &format!("\nflash:\n    size: {:#x}\n", part.flash));
        assert_has(&file, &format!("\nsram:\n    size: {:#x}\n", part.ram));
        // The flash size register (RM0008 45.1).
        let kib = part.flash / 1024;
        assert_has(&file, "signature: Memory.ArrayMemory @ sysbus 0x1FFFF7E0\n");
        assert_has(&file, &format!("WriteDoubleWord 0x0 0x{kib:08X}\n"));
    }
    // APB1 has half the clock.
    let (hz, apb1) = (SYSCLK_ON_HSE_HZ, SYSCLK_ON_HSE_HZ / 2);
    let timers = (1..=4).map(|timer| (format!("timer{timer}"), hz));
    let uarts = (1..=3).map(|uart| (format!("usart{uart}"), if uart == 1 { hz } else { apb1 }));
    let dwt = ("dwt: Miscellaneous.DWT @ sysbus 0xE0001000".to_owned(), hz);
    for (name, hz) in timers.chain(uarts).chain([dwt]) {
        let entry = text("modio.repl").replace(":\n", "\n");
        let lines = format!("\n{name}\n    frequency: {hz}\n");
        assert!(entry.contains(&lines), "{lines}");
    }
    let mips = hz / 1_000_000;
    assert_has(
        "modio.repl",
        &format!("\ncpu:\n    PerformanceInMips: {mips}\n"),
    );
    // `init add:` would keep the download of the stock platform.
    assert_has("modio.repl", "\nsysbus:\n    init:\n");
}

#[test]
fn pins_are_those_of_the_board() {
    for board in [&modio_02::BOARD, &modio_08::BOARD] {
        let file = format!("{}.repl", board.name);
        let text = text("modio.repl") + &text(&file);
        let mut pins = Vec::new();
        for (name, port, pin) in COMMON {
            pins.push((name.to_owned(), port, pin));
        }
        for (slot, n) in (1..).zip(board.slots) {
            for (line, pin) in (1..).zip(n.lines) {
                let (port, pin) = match pin.adc_input().unwrap() {
                    input @ 0..=7 => ('A', input),
                    input @ 8..=9 => ('B', input - 8),
                    input => ('C', input - 10),
                };
                let line = match board.slots {
                    [_] => format!("line{line}"),
                    _ => format!("port{slot}line{line}"),
                };
                pins.push((line, port, pin));
            }
        }
        for (name, port, pin) in &pins {
            let led = format!("\n{name}: Miscellaneous.LED @ gpioPort{port} {pin}\n");
            assert!(text.contains(&led), "{file}: {led}");
            let (_, connections) = text.split_once(&format!("\ngpioPort{port}:\n")).unwrap();
            let connection = format!("    {pin} -> {name}@0");
            let mut connections = connections.lines().take_while(|line| !line.is_empty());
            assert!(
                connections.any(|line| line == connection),
                "{file}: {connection}"
            );
        }
        assert_eq!(
            text.matches(" -> ").count(),
            pins.len(),
            "{file}: no other connection"
        );
    }
}

#[test]
fn scripts_name_files_that_exist_and_the_image_that_is_built() {
    for board in Board::ALL {
        let elf = build::target(Path::new("../target"), board);
        let elf = elf.join(TARGET).join(build::PROFILE).join("modio");
        assert_has(
            &format!("{board}-board.resc"),
            // Renode's scripts have slashes on every system.
            &format!("$elf?=$ORIGIN/{}\n", elf.display()).replace('\\', "/"),
        );
        for kind in ["", "-exact", "-pty"] {
            assert_has(
                &format!("{board}{kind}.resc"),
                &format!("$ORIGIN/{board}-board.resc\n"),
            );
        }
    }
    for file in fs_err::read_dir(directory()).unwrap() {
        let path = file.unwrap().path();
        if path
            .extension()
            .is_some_and(|extension| extension == "resc")
        {
            let script = fs_err::read_to_string(&path).unwrap();
            let files = script
                .split_whitespace()
                .filter_map(|word| word.split_once("$ORIGIN/"));
            for (_, file) in files.filter(|(_, file)| !file.starts_with("../target/")) {
                assert!(
                    directory().join(file).is_file(),
                    "{}: {file}",
                    path.display()
                );
            }
        }
    }
}
