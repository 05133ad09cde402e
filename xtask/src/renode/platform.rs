//! The platform and the scripts, held against what is known of Renode, of the part, and of the simulator.

use std::path::Path;

use register_map::Board;
use register_map::board::MODIO_02;

use super::DIRECTORY;
use crate::board::Hardware;
use crate::build;
use crate::toolchain::TARGET;

mod parse;

use parse::{entries, models, number, read, root, simulator};

/// What the platform creates: types that Renode has in every version from 1.16.1 on, and the arguments
/// of their constructors that we give.
const TYPES: [(&str, &[&str]); 5] = [
    ("Memory.ArrayMemory", &["size"]),
    ("Miscellaneous.BitBanding", &["peripheralBase"]),
    ("Miscellaneous.DWT", &["frequency"]),
    ("Miscellaneous.LED", &["invert"]),
    (
        "Timers.STM32_IndependentWatchdog",
        &["frequency", "windowOption"],
    ),
];

/// What the stock platform has under these names, and what of it we set.
const STOCK: [(&str, &[&str]); 15] = [
    ("flash", &["size"]),
    ("sram", &["size"]),
    ("cpu", &["PerformanceInMips"]),
    ("usart1", &["frequency"]),
    ("usart2", &["frequency"]),
    ("usart3", &["frequency"]),
    ("timer1", &["frequency"]),
    ("timer2", &["frequency"]),
    ("timer3", &["frequency"]),
    ("timer4", &["frequency"]),
    ("i2c1", &[]),
    ("gpioPortA", &[]),
    ("gpioPortB", &[]),
    ("gpioPortC", &[]),
    ("sysbus", &[]),
];

#[test]
fn every_entry_is_of_a_known_type_with_known_arguments() {
    for (name, entry) in Board::ALL.into_iter().flat_map(entries) {
        let (allowed, of) = match &entry.kind {
            Some(kind) => (TYPES.iter().find(|(known, _)| known == kind), kind.as_str()),
            None => (
                STOCK.iter().find(|(known, _)| *known == name),
                "the stock platform",
            ),
        };
        let (_, arguments) = allowed.unwrap_or_else(|| panic!("{name}: {of} is not known"));
        let mut in_init = false;
        for line in &entry.lines {
            in_init |= line == "init:";
            if in_init || line.contains(" -> ") {
                continue;
            }
            let (argument, _) = line.split_once(": ").unwrap();
            assert!(arguments.contains(&argument), "{name}: {argument}");
        }
    }
}

#[test]
fn what_the_part_has_is_as_large_and_as_fast_as_on_the_board() {
    for board in Board::ALL {
        let entries = entries(board);
        let value =
            |name: &str, attribute: &str| number(entries[name].attribute(attribute).unwrap());
        let part = Hardware::of(board).part;
        assert_eq!(value("flash", "size"), part.flash);
        assert!(entries["flash"].place.contains("sysbus 0x08000000;"));
        assert!(entries["flash"].place.contains("sysbus 0x0 "));
        assert_eq!(value("sram", "size"), part.ram);
        let kib = format!("WriteDoubleWord 0x0 0x{:08X}", part.flash / 1024);
        assert!(entries["signature"].lines.contains(&kib), "{kib}");
        assert_eq!(value("cpu", "PerformanceInMips"), 72);
        for name in ["usart1", "timer1", "timer2", "timer3", "timer4", "dwt"] {
            assert_eq!(value(name, "frequency"), 72_000_000, "{name}");
        }
        for name in ["usart2", "usart3"] {
            assert_eq!(value(name, "frequency"), 36_000_000, "{name}");
        }
    }
    // What the firmware's own constants say.
    let design = read(&root().join("board-support/src/design.rs"));
    assert!(design.contains("SYSCLK_ON_HSE_HZ: u32 = 72_000_000"));
}

#[test]
fn the_stock_platforms_download_is_replaced_and_its_i2c_taken_away() {
    let entries = entries(&MODIO_02);
    assert_eq!(
        entries["sysbus"].lines[0], "init:",
        "`init add:` would keep the download"
    );
    assert!(
        !entries["sysbus"]
            .lines
            .iter()
            .any(|line| line.contains("http"))
    );
    assert_eq!(
        (entries["i2c1"].place.as_str(), &entries["i2c1"].kind),
        ("none", &None)
    );
    let text = |file: &str| read(&root().join(DIRECTORY).join(file));
    assert!(text("modio.repl").contains("using \"platforms/cpus/stm32f103.repl\"\n"));
    for board in Board::ALL {
        // With `./` it is looked for beside the file, otherwise in Renode's directory.
        assert!(text(&format!("{board}.repl")).contains("using \"./modio.repl\"\n"));
    }
    let filename = text("modio.repl").contains("    filename:");
    assert!(!filename, "it would be looked for in Renode's directory");
}

#[test]
fn addresses_agree_with_the_simulators() {
    let blocks = simulator();
    assert!(blocks.len() > 25, "{blocks:?}");
    let models = models();
    assert_eq!(models.len(), 5);
    for (file, address, size, name) in &models {
        let block = match name.as_str() {
            "flashController" => "flash",
            "dac" => "i2c1",
            name => name,
        };
        assert_eq!(
            blocks.get(address).map(String::as_str),
            Some(block),
            "{file}"
        );
        assert_eq!(*size, 0x400, "{file}");
        let path = root().join(DIRECTORY).join(file);
        assert!(path.is_file(), "{}", path.display());
    }
    let entries = entries(&MODIO_02);
    let bkp = &entries["bkp"].place;
    assert_eq!(blocks[&number(bkp.strip_prefix("sysbus ").unwrap())], "bkp");
    let signature = &entries["signature"].place;
    assert_eq!(signature, "sysbus 0x1FFFF7E0");
    // The firmware reads its number 8 bytes behind.
    let unique = read(&root().join("board-support/src/unique_id.rs"));
    assert!(unique.contains("0x1FFF_F7E8"));
}

#[test]
fn nothing_lies_over_anything_else() {
    for board in Board::ALL {
        let mut ranges: Vec<(u32, u32, String)> = models()
            .into_iter()
            .map(|(_, address, size, name)| (address, size, name))
            .collect();
        for (name, entry) in entries(board) {
            let Some(place) = entry.place.strip_prefix("sysbus ") else {
                continue;
            };
            let (address, size) = match place.strip_prefix('<') {
                Some(range) => {
                    let (address, size) = range.split_once(", +").unwrap();
                    (number(address), number(size))
                }
                // A peripheral that knows its size: at most a kilobyte here.
                None => (number(place), entry.attribute("size").map_or(0x400, number)),
            };
            ranges.push((address, size, name));
        }
        ranges.sort();
        for pair in ranges.windows(2) {
            let [(first, size, a), (second, _, b)] = pair else {
                unreachable!()
            };
            assert!(first + size <= *second, "{a} reaches into {b}");
        }
    }
}

/// The lines of the slots, the first slot's first.
fn lines(board: &Board) -> Vec<&'static str> {
    if *board == MODIO_02 {
        vec!["A 0", "A 1", "A 2", "A 3"]
    } else {
        vec![
            "A 0", "A 1", "A 2", "A 3", "A 4", "A 5", "A 6", "A 7", "C 0", "C 1", "C 2", "C 3",
            "B 0", "B 1", "C 4", "C 5",
        ]
    }
}

#[test]
fn pins_are_those_of_the_board() {
    for board in Board::ALL {
        let entries = entries(board);
        let mut wiring: Vec<(String, String)> = [
            ("de", "A 8"),
            ("ledActivity", "B 8"),
            ("ledFault", "B 9"),
            ("ledRun", "C 13"),
        ]
        .map(|(name, place)| (name.to_owned(), place.to_owned()))
        .into();
        for (n, place) in lines(board).into_iter().enumerate() {
            let line = n % 4 + 1;
            let name = if board.slots == 1 {
                format!("line{line}")
            } else {
                format!("port{}line{line}", n / 4 + 1)
            };
            wiring.push((name, place.to_owned()));
        }
        let mut connections = 0;
        for (name, place) in &wiring {
            let place = format!("gpioPort{place}");
            assert_eq!(entries[name].place, place, "{name}");
            let (port, pin) = place.split_once(' ').unwrap();
            let connection = format!("{pin} -> {name}@0");
            assert!(entries[port].lines.contains(&connection), "{connection}");
        }
        for port in ["gpioPortA", "gpioPortB", "gpioPortC"] {
            connections += entries[port].lines.len();
        }
        assert_eq!(connections, wiring.len(), "no other connection");
        assert_eq!(entries["ledRun"].attribute("invert"), Some("true"));
    }
}

#[test]
fn scripts_name_files_and_peripherals_that_exist() {
    let directory = root().join(DIRECTORY);
    let entries = entries(&MODIO_02);
    let known: Vec<String> = entries
        .keys()
        .cloned()
        .chain(models().into_iter().map(|(_, _, _, name)| name))
        .collect();
    let mut scripts = vec![
        "board.resc".to_owned(),
        "line-socket.resc".to_owned(),
        "line-exact.resc".to_owned(),
        "line-pty.resc".to_owned(),
    ];
    for board in Board::ALL {
        for kind in ["-board", "", "-exact", "-pty"] {
            scripts.push(format!("{board}{kind}.resc"));
        }
    }
    for script in scripts {
        let text = read(&directory.join(&script));
        for word in text.split_whitespace() {
            if let Some(file) = word.split_once("$ORIGIN/").map(|(_, file)| file) {
                // The image is built later.
                let there = file.starts_with("../target/") || directory.join(file).is_file();
                assert!(there, "{script}: {file}");
            }
            if let Some(name) = word.strip_prefix("sysbus.") {
                assert!(known.iter().any(|known| known == name), "{script}: {name}");
            }
        }
    }
    for board in Board::ALL {
        let text = read(&directory.join(format!("{board}-board.resc")));
        let elf = build::target(Path::new("../target"), board);
        let elf = elf.join(TARGET).join(build::PROFILE).join("modio");
        let set = format!("$elf?=$ORIGIN/{}\n", elf.display());
        assert!(text.contains(&set), "{text}");
        for set in [
            format!("$board=\"{board}\"\n"),
            format!("$platform=$ORIGIN/{board}.repl\n"),
        ] {
            assert!(text.find(&set) < text.find("include"), "{set}");
        }
    }
    // What the tests look at, and the models hand on to.
    let resource = read(&directory.join("tests/modio.resource"));
    assert!(resource.contains("sysbus.usart1") && resource.contains("sysbus.sram"));
    let watchdog = read(&directory.join("peripherals/iwdg.py"));
    assert!(watchdog.contains("[\"sysbus.iwdgCounter\"]") && known.contains(&"iwdgCounter".into()));
}

#[test]
fn the_flash_is_erased_once_and_every_reset_loads_and_drives() {
    let text = read(&root().join(DIRECTORY).join("board.resc"));
    let at = |what: &str| text.find(what).unwrap_or_else(|| panic!("{what}"));
    assert!(at("LoadPlatformDescription") < at("ResetByte 0xFF"));
    assert!(at("ResetByte 0xFF") < at("ZeroAll"));
    assert!(
        at("ZeroAll") < at("macro reset"),
        "a reset keeps what is stored"
    );
    let (_, body) = text.split_once("macro reset\n\"\"\"\n").unwrap();
    let (body, after) = body.split_once("\n\"\"\"\n").unwrap();
    assert_eq!(body, "    sysbus LoadELF $elf\n    modio_inputs $dip");
    assert_eq!(after.trim(), "runMacro $reset");
}
