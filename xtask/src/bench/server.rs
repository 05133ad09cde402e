//! The server's share of the instructions of a request, of flash, and of RAM.
//!
//! Other servers are measured without a UART driver, which their users write themselves. For a comparison the
//! instructions of this server are counted without its line driver: the application's interrupt handlers with RTIC's
//! locks, the drivers of UART and timer, and the marks that show the watchdog that every task runs. The server's
//! parts are framing, CRC, functions, and the points, settings and state that requests access.

use std::collections::BTreeMap;

use anyhow::{Context as _, Result};
use serde_json::{Value, json};

use crate::image::Elf;
use crate::size::{Source, structures};

const CRATE: &str = "modbus_server";

/// The structures that a line needs, and their numbers. Their parameters do not matter.
const STRUCTURES: [(&str, u64); 4] = [
    ("Server", 1),
    ("Receiver", 1),
    ("Transmitter", 1),
    ("Adu", 2),
];

/// Sources, and whether they belong to the server; the first match decides. `mem.rs` copies and fills memory for the
/// server.
const SOURCES: [(&str, bool); 8] = [
    ("/board-support/src/mem.rs", true),
    ("/board-support/src/", false),
    ("/firmware/src/app/", false),
    ("/firmware/src/alive.rs", false),
    ("/firmware/src/line.rs", false),
    ("/firmware/src/", true),
    ("/modbus-server/src/", true),
    ("/register-map/src/", true),
];

/// Returns whether a source file belongs to the server, or `None` for a library.
fn is_server(file: &str) -> Option<bool> {
    let file = file.replace('\\', "/");
    let source = SOURCES.iter().find(|(source, _)| file.contains(source));
    source.map(|(_, server)| *server)
}

/// Adds the server's share to a report: `server` in each request, in place of the counts by address, and flash and RAM.
pub fn add(report: &mut Value, elf: &Elf<'_>) -> Result<()> {
    let source = Source::new(elf)?;
    replace(report, |address| source.innermost(address, is_server))
        .context("the report of tools/bench has no counts by address")?;
    let crates = report["image"]["crates"].as_array();
    let row = crates
        .into_iter()
        .flatten()
        .find(|row| row["name"] == CRATE);
    let flash = row.with_context(|| format!("the image has no code of {CRATE}"))?["flash"].clone();
    report["server"] = json!({ "flash": flash, "ram": ram(&structures(elf, CRATE)?)? });
    Ok(())
}

fn replace(report: &mut Value, is_server: impl Fn(u32) -> Option<bool>) -> Option<()> {
    for row in report["requests"].as_array_mut()? {
        let row = row.as_object_mut()?;
        let mut server = 0;
        for (address, count) in row.remove("addresses")?.as_object()? {
            // An instruction without a source is counted, too.
            if is_server(address.parse().ok()?) != Some(false) {
                server += count.as_u64()?;
            }
        }
        row.insert("server".to_owned(), server.into());
    }
    Some(())
}

/// Returns the server's RAM: its structures, with the two buffers of a line.
fn ram(sizes: &BTreeMap<String, u64>) -> Result<u64> {
    let size = |(name, count): &(&str, u64)| {
        let of = |full: &str| full.split('<').next() == Some(*name);
        let size = sizes
            .iter()
            .find(|(full, _)| of(full))
            .map(|(_, size)| size * count);
        size.with_context(|| format!("the debug information has no {CRATE}::{name}"))
    };
    STRUCTURES.iter().map(size).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn source_is_the_servers_or_the_drivers_or_a_library() {
        for (file, server) in [
            ("/m/modbus-server/src/line/receiver.rs", Some(true)),
            ("C:\\m\\firmware\\src\\app\\line.rs", Some(false)),
            ("/m/board-support/src/rs485.rs", Some(false)),
            ("/m/board-support/src/mem.rs", Some(true)),
            ("/r/registry/src/index/vcell-0.1.3/src/lib.rs", None),
        ] {
            assert_eq!(is_server(file), server, "{file}");
        }
    }

    #[test]
    fn instructions_of_the_driver_are_left_out() {
        let mut report = json!({ "requests": [{ "addresses": { "2": 10, "4": 200, "6": 3000 } }] });
        let is_server = |address| (address != 6).then_some(address == 2);
        replace(&mut report, is_server).unwrap();
        assert_eq!(report, json!({ "requests": [{ "server": 3010 }] }));
        assert!(replace(&mut report, is_server).is_none());
    }
}
