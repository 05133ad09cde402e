//! Tests of the platform and the scripts for Renode: against the types and arguments that Renode has, the part, the
//! board and the reference manual.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use board_support::design::SYSCLK_ON_HSE_HZ;
use register_map::Board;
use register_map::board::{MODIO_02, MODIO_08};

use super::DIRECTORY;
use crate::board::Hardware;
use crate::build;
use crate::toolchain::TARGET;
use crate::workspace::Workspace;

/// Types that the platform creates, which Renode has in every version from 1.16.1 on, and the arguments of their
/// constructors that the platform passes.
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

/// Names in the stock platform, and the arguments of them that the platform sets.
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

/// The Python models, at the addresses of their peripherals (RM0008 3.3), a kilobyte each.
const MODELS: [(&str, u32, &str); 5] = [
    ("rcc.py", 0x4002_1000, "rcc"),
    ("flash.py", 0x4002_2000, "flashController"),
    ("adc.py", 0x4001_2400, "adc1"),
    ("i2c1_mcp4728.py", 0x4000_5400, "dac"),
    ("iwdg.py", 0x4000_3000, "iwdg"),
];

/// An entry: its type, where it is registered, and the lines after it.
#[derive(Debug, Default)]
struct Entry {
    kind: Option<String>,
    place: String,
    lines: Vec<String>,
}

impl Entry {
    fn attribute(&self, name: &str) -> Option<&str> {
        let start = format!("{name}: ");
        self.lines.iter().find_map(|line| line.strip_prefix(&start))
    }
}

fn directory() -> PathBuf {
    Workspace::open().unwrap().root().join(DIRECTORY)
}

fn text(file: &str) -> String {
    fs_err::read_to_string(directory().join(file)).unwrap()
}

/// Returns the entries of a board's platform by name: its own entries, and those of the file for all boards. An entry
/// in both files has the lines of both.
fn entries(board: &Board) -> BTreeMap<String, Entry> {
    let mut entries = BTreeMap::new();
    for file in ["modio.repl", &format!("{board}.repl")] {
        let text = text(file);
        let lines = text
            .lines()
            .map(|line| line.split("//").next().unwrap_or_default());
        let lines = lines.filter(|line| !line.trim().is_empty() && !line.starts_with("using "));
        let mut current = String::new();
        let mut open = false;
        for line in lines {
            assert!(!line.contains('\t'), "Renode accepts no tabs: {line}");
            let indent = line.len() - line.trim_start().len();
            assert!(indent.is_multiple_of(4), "indented by fours: {line}");
            if indent == 0 {
                let (name, rest) = line.split_once(':').unwrap();
                let entry: &mut Entry = entries.entry(name.to_owned()).or_default();
                let (kind, place) = rest.split_once('@').unwrap_or((rest, ""));
                if !kind.trim().is_empty() {
                    assert!(
                        entry.kind.replace(kind.trim().to_owned()).is_none(),
                        "{name}"
                    );
                }
                entry.place += place.trim();
                open = place.contains('{');
                current = name.to_owned();
                continue;
            }
            let entry = entries.get_mut(&current).unwrap();
            if open {
                entry.place += line.trim();
                open = !line.contains('}');
            } else {
                entry.lines.push(line.trim().to_owned());
            }
        }
    }
    entries
}

fn number(text: &str) -> u32 {
    let text = text.trim_matches(|c: char| !c.is_ascii_alphanumeric());
    match text.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16),
        None => text.parse(),
    }
    .unwrap_or_else(|_| panic!("not a number: {text}"))
}

#[test]
fn every_entry_has_a_known_type_with_known_arguments() {
    for (name, entry) in Board::ALL.into_iter().flat_map(entries) {
        let known = match &entry.kind {
            Some(kind) => TYPES.iter().find(|(known, _)| known == kind),
            None => STOCK.iter().find(|(known, _)| *known == name),
        };
        let (_, arguments) =
            known.unwrap_or_else(|| panic!("{name}: {:?} is not known", entry.kind));
        let set = entry.lines.iter().take_while(|line| *line != "init:");
        for line in set.filter(|line| !line.contains(" -> ")) {
            let (argument, _) = line.split_once(": ").unwrap();
            assert!(arguments.contains(&argument), "{name}: {argument}");
        }
    }
}

#[test]
fn memories_and_clocks_are_those_of_the_part() {
    for board in Board::ALL {
        let entries = entries(board);
        let value = |name: &str, key: &str| number(entries[name].attribute(key).unwrap());
        let part = Hardware::of(board).part;
        assert_eq!(
            (value("flash", "size"), value("sram", "size")),
            (part.flash, part.ram)
        );
        let flash = &entries["flash"].place;
        assert!(flash.contains("sysbus 0x08000000;") && flash.contains("sysbus 0x0 "));
        // The flash size register (RM0008 45.1).
        let kib = format!("WriteDoubleWord 0x0 0x{:08X}", part.flash / 1024);
        assert_eq!(entries["signature"].place, "sysbus 0x1FFFF7E0");
        assert!(entries["signature"].lines.contains(&kib), "{kib}");
        assert_eq!(
            value("cpu", "PerformanceInMips"),
            SYSCLK_ON_HSE_HZ / 1_000_000
        );
        for name in ["usart1", "timer1", "timer2", "timer3", "timer4", "dwt"] {
            assert_eq!(value(name, "frequency"), SYSCLK_ON_HSE_HZ, "{name}");
        }
        // APB1 has half the clock.
        for name in ["usart2", "usart3"] {
            assert_eq!(value(name, "frequency"), SYSCLK_ON_HSE_HZ / 2, "{name}");
        }
    }
}

#[test]
fn download_of_the_stock_platform_is_replaced_and_its_i2c_removed() {
    let entries = entries(&MODIO_02);
    let sysbus = &entries["sysbus"].lines;
    assert_eq!(sysbus[0], "init:", "`init add:` would keep the download");
    assert!(!sysbus.iter().any(|line| line.contains("http")));
    let i2c = &entries["i2c1"];
    assert_eq!((i2c.place.as_str(), &i2c.kind), ("none", &None));
    assert!(text("modio.repl").contains("using \"platforms/cpus/stm32f103.repl\"\n"));
    for board in Board::ALL {
        // Without `./`, Renode searches its own directory.
        assert!(text(&format!("{board}.repl")).contains("using \"./modio.repl\"\n"));
    }
}

#[test]
fn models_and_entries_are_at_their_addresses_and_do_not_overlap() {
    let script = text("board.resc");
    assert_eq!(script.matches("PyDevFromFile").count(), MODELS.len());
    for (file, address, name) in MODELS {
        let line = format!("$ORIGIN/peripherals/{file} 0x{address:08X} 0x400 True \"{name}\"\n");
        assert!(script.contains(&line), "{line}");
    }
    for board in Board::ALL {
        let entries = entries(board);
        assert_eq!(
            number(&entries["bkp"].place["sysbus ".len()..]),
            0x4000_6C00
        );
        let mut ranges: Vec<(u32, u32, &str)> =
            MODELS.map(|(_, at, name)| (at, 0x400, name)).into();
        for (name, entry) in &entries {
            let Some(place) = entry.place.strip_prefix("sysbus ") else {
                continue;
            };
            let (address, size) = match place
                .strip_prefix('<')
                .and_then(|range| range.split_once(", +"))
            {
                Some((address, size)) => (number(address), number(size)),
                // A peripheral with a fixed size, which is at most a kilobyte.
                None => (number(place), entry.attribute("size").map_or(0x400, number)),
            };
            ranges.push((address, size, name));
        }
        ranges.sort_unstable();
        for pair in ranges.windows(2) {
            assert!(pair[0].0 + pair[0].1 <= pair[1].0, "{pair:x?}");
        }
    }
}

#[test]
fn pins_are_those_of_the_board() {
    let small = ["A 0", "A 1", "A 2", "A 3"];
    let large = [
        "A 0", "A 1", "A 2", "A 3", "A 4", "A 5", "A 6", "A 7", "C 0", "C 1", "C 2", "C 3", "B 0",
        "B 1", "C 4", "C 5",
    ];
    for (board, lines) in [(&MODIO_02, &small[..]), (&MODIO_08, &large[..])] {
        let entries = entries(board);
        let named = lines.iter().enumerate().map(|(n, pin)| {
            let port = if board.slots == 1 {
                String::new()
            } else {
                format!("port{}", n / 4 + 1)
            };
            (format!("{port}line{}", n % 4 + 1), *pin)
        });
        let others = [
            ("de", "A 8"),
            ("ledActivity", "B 8"),
            ("ledFault", "B 9"),
            ("ledRun", "C 13"),
        ];
        let others = others.map(|(name, pin)| (name.to_owned(), pin));
        let wiring: Vec<(String, &str)> = named.chain(others).collect();
        for (name, pin) in &wiring {
            let (port, pin) = pin.split_once(' ').unwrap();
            assert_eq!(
                entries[name].place,
                format!("gpioPort{port} {pin}"),
                "{name}"
            );
            let connection = format!("{pin} -> {name}@0");
            assert!(
                entries[&format!("gpioPort{port}")]
                    .lines
                    .contains(&connection),
                "{connection}"
            );
        }
        let ports = ["gpioPortA", "gpioPortB", "gpioPortC"].iter();
        let connections: usize = ports.map(|port| entries[*port].lines.len()).sum();
        assert_eq!(connections, wiring.len(), "no other connection");
        assert_eq!(entries["ledRun"].attribute("invert"), Some("true"));
    }
}

#[test]
fn scripts_name_files_and_peripherals_that_exist() {
    let entries = entries(&MODIO_02);
    let known =
        |name: &str| entries.contains_key(name) || MODELS.iter().any(|model| model.2 == name);
    let mut scripts = ["board", "line-socket", "line-exact", "line-pty"]
        .map(str::to_owned)
        .to_vec();
    for board in Board::ALL {
        scripts.extend(["-board", "", "-exact", "-pty"].map(|kind| format!("{board}{kind}")));
        let text = text(&format!("{board}-board.resc"));
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
    for script in scripts {
        let text = text(&format!("{script}.resc"));
        for word in text.split_whitespace() {
            if let Some((_, file)) = word.split_once("$ORIGIN/") {
                // The image is built later, so the file need not exist.
                let there = file.starts_with("../target/") || directory().join(file).is_file();
                assert!(there, "{script}: {file}");
            }
            if let Some(name) = word.strip_prefix("sysbus.") {
                assert!(known(name), "{script}: {name}");
            }
        }
    }
    // Peripherals that the suites read, and to which a model writes.
    let resource = text("tests/modio.resource");
    assert!(resource.contains("sysbus.usart1") && resource.contains("sysbus.sram"));
    assert!(
        text("peripherals/iwdg.py").contains("[\"sysbus.iwdgCounter\"]") && known("iwdgCounter")
    );
}

#[test]
fn flash_is_erased_once_and_every_reset_loads_and_drives() {
    let text = text("board.resc");
    let steps = [
        "LoadPlatformDescription",
        "ResetByte 0xFF",
        "ZeroAll",
        "macro reset",
    ];
    let at = steps.map(|step| text.find(step).unwrap_or_else(|| panic!("{step}")));
    assert!(at.is_sorted(), "a reset keeps what is stored");
    let (_, body) = text.split_once("macro reset\n\"\"\"\n").unwrap();
    let (body, after) = body.split_once("\n\"\"\"\n").unwrap();
    assert_eq!(body, "    sysbus LoadELF $elf\n    modio_inputs $dip");
    assert_eq!(after.trim(), "runMacro $reset");
}
