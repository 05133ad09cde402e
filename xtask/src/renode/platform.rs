//! Tests of the platform and the scripts for Renode: against the part, the board's pins and the design's clocks.

use std::collections::BTreeSet;
use std::path::Path;

use board_support::boards::{modio_02, modio_08};
use board_support::design::SYSCLK_ON_HSE_HZ;

use super::MODIO;
use crate::build;
use crate::toolchain::TARGET;

/// Pins with the same use on every board.
const COMMON: [(&str, char, u8); 4] = [
    ("de", 'A', 8),
    ("ledActivity", 'B', 8),
    ("ledFault", 'B', 9),
    ("ledRun", 'C', 13),
];

fn text(file: &str) -> String {
    let directory = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../renode"));
    fs_err::read_to_string(directory.join(file)).unwrap()
}

/// Asserts that a file has these lines in this order.
fn assert_has(file: &str, lines: &str) {
    assert!(text(file).contains(lines), "{file} has no\n{lines}");
}

#[test]
fn memories_and_clocks_are_those_of_the_part() {
    for board in MODIO {
        let file = format!("{board}.repl");
        let part = board.memory.part;
        assert_has(&file, &format!("\nflash:\n    size: {:#x}\n", part.flash));
        assert_has(&file, &format!("\nsram:\n    size: {:#x}\n", part.ram));
        // The flash size register (RM0008 45.1).
        let kib = part.flash / 1024;
        assert_has(&file, "signature: Memory.ArrayMemory @ sysbus 0x1FFFF7E0\n");
        assert_has(&file, &format!("WriteDoubleWord 0x0 0x{kib:08X}\n"));
    }
    // APB1 has half the clock.
    let (hz, apb1) = (SYSCLK_ON_HSE_HZ, SYSCLK_ON_HSE_HZ / 2);
    let timers = (1..=4).map(|timer| (format!("timer{timer}:"), hz));
    let uarts = [("usart1:", hz), ("usart2:", apb1), ("usart3:", apb1)];
    let uarts = uarts.map(|(name, hz)| (name.to_owned(), hz));
    let dwt = ("dwt: Miscellaneous.DWT @ sysbus 0xE0001000".to_owned(), hz);
    for (name, hz) in timers.chain(uarts).chain([dwt]) {
        assert_has("modio.repl", &format!("\n{name}\n    frequency: {hz}\n"));
    }
    let speed = format!("PerformanceInMips: {}", hz / 1_000_000);
    assert_has("modio.repl", &format!("\ncpu:\n    {speed}\n"));
    // `init add:` would keep the download of the stock platform.
    assert_has("modio.repl", "\nsysbus:\n    init:\n");
}

#[test]
fn pins_are_those_of_the_board() {
    for (board, row) in [&modio_02::BOARD, &modio_08::BOARD].into_iter().zip(MODIO) {
        let file = format!("{row}.repl");
        let text = text("modio.repl") + &text(&file);
        let mut pins = COMMON
            .map(|(name, port, pin)| (name.to_owned(), port, pin))
            .to_vec();
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
        let mut wanted = BTreeSet::new();
        for (name, port, pin) in pins {
            let led = format!("\n{name}: Miscellaneous.LED @ gpioPort{port} {pin}\n");
            assert!(text.contains(&led), "{file}: {led}");
            wanted.insert(format!("gpioPort{port}: {pin} -> {name}@0"));
        }
        let (mut connections, mut port) = (BTreeSet::new(), "");
        for line in text.lines() {
            match line.strip_prefix("    ") {
                None => port = line,
                Some(entry) if entry.contains(" -> ") => {
                    connections.insert(format!("{port} {entry}"));
                }
                Some(_) => {}
            }
        }
        assert_eq!(connections, wanted, "{file}");
    }
}

#[test]
fn commands_know_the_memory_of_the_board() {
    for board in MODIO {
        let (layout, ram) = (board.layout(), board.memory.part.ram);
        let (store, plain) = (layout.store.first, board.store().first);
        let bytes = 2 * layout.store.bytes;
        let memory = format!(
            "        \"ram\": 0x{ram:X},\n        \"store\": (0x{store:08X}, 0x{plain:08X}, {bytes}),\n"
        );
        assert_has("commands.py", &memory);
        let [a, _] = layout.slots;
        assert_has("commands.py", &format!("LoadBinary $image 0x{a:08X}\""));
    }
}

#[test]
fn scripts_name_the_images_that_are_built() {
    for board in MODIO {
        let built = build::target(Path::new("../target"), board);
        let built = built.join(TARGET).join(build::PROFILE);
        let [loader, image] = ["loader", "modio-a.image"].map(|name| {
            // Renode's scripts have slashes on every system.
            built.join(name).display().to_string().replace('\\', "/")
        });
        assert_has(
            &format!("{board}-board.resc"),
            &format!("$elf?=$ORIGIN/{loader}\n$image?=$ORIGIN/{image}\n"),
        );
        for kind in ["", "-exact", "-pty"] {
            let script = format!("{board}{kind}.resc");
            assert_has(&script, &format!("$ORIGIN/{board}-board.resc\n"));
        }
    }
}
