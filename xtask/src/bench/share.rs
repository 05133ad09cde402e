//! What of a transaction is the server's, and what the line driver's.
//!
//! Figures of other servers are without a UART driver, which whoever uses one writes himself. To set this
//! server beside them its instructions are counted apart: framing, CRC, functions, and the points, settings
//! and state that requests reach. The rest are the application's interrupt handlers with RTIC's locks, the
//! drivers of UART and timer, and the marks by which the watchdog knows that every task runs.

use std::path::Path;

use serde_json::{Map, Value};

use crate::size::Source;
use crate::{Failure, Result, image};

/// Whose an instruction is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Server,
    Driver,
}

/// Sources and whose they are; the first that fits counts.
const SOURCES: [(&str, Part); 7] = [
    ("firmware/src/app/", Part::Driver),
    ("firmware/src/alive.rs", Part::Driver),
    ("firmware/src/line.rs", Part::Driver),
    ("firmware/src/", Part::Server),
    ("modbus-server/src/", Part::Server),
    ("register-map/src/", Part::Server),
    ("board-support/src/", Part::Driver),
];

/// Of the board's, but done for the server: it copies and fills memory.
const MEMORY: &str = "board-support/src/mem.rs";

/// Whose a source file is; `None` for a library, which is whose it is used by.
fn part_of(file: &str) -> Option<Part> {
    let file = file.replace('\\', "/");
    if file.ends_with(MEMORY) {
        return Some(Part::Server);
    }
    let sources = SOURCES
        .iter()
        .find(|(source, _)| file.contains(&format!("/{source}")));
    sources.map(|(_, part)| *part)
}

/// Puts the server's share, `server`, into each request of a report in the place of the counts by address.
///
/// # Errors
///
/// When the image has no debug information, or a broken one.
pub fn add(report: &mut Value, elf: &Path) -> Result<()> {
    let bytes = image::read(elf)?;
    let parsed = image::parse(&bytes).map_err(Failure::new)?;
    let source = Source::new(&parsed, &bytes).map_err(Failure::new)?;
    replace(report, |address| source.innermost(address, part_of))
}

fn replace(report: &mut Value, part: impl Fn(u32) -> Option<Part>) -> Result<()> {
    let rows = report["requests"].as_array_mut().into_iter().flatten();
    for row in rows.filter_map(Value::as_object_mut) {
        let server = server(row, &part)?;
        row.insert("server".to_owned(), server.into());
    }
    Ok(())
}

/// The instructions of a request that are the server's. Those of nobody known count too.
fn server(row: &mut Map<String, Value>, part: impl Fn(u32) -> Option<Part>) -> Result<u64> {
    let broken = || Failure::new("the bench's report is broken: no counts by address");
    let addresses = row.remove("addresses").ok_or_else(broken)?;
    let mut server = 0;
    for (address, count) in addresses.as_object().ok_or_else(broken)? {
        let address = address.parse().map_err(|_| broken())?;
        if part(address) != Some(Part::Driver) {
            server += count.as_u64().ok_or_else(broken)?;
        }
    }
    Ok(server)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_source_is_the_servers_or_the_drivers_or_a_library() {
        for (file, part) in [
            ("/m/modbus-server/src/line/receiver.rs", Some(Part::Server)),
            ("/m/firmware/src/device/points.rs", Some(Part::Server)),
            ("C:\\m\\firmware\\src\\app\\line.rs", Some(Part::Driver)),
            ("/m/firmware/src/alive.rs", Some(Part::Driver)),
            ("/m/firmware/src/line.rs", Some(Part::Driver)),
            ("/m/board-support/src/rs485.rs", Some(Part::Driver)),
            ("/m/board-support/src/mem.rs", Some(Part::Server)),
            ("/r/registry/src/index/vcell-0.1.3/src/lib.rs", None),
            ("/rustc/59807/library/core/src/ptr/mod.rs", None),
        ] {
            assert_eq!(part_of(file), part, "{file}");
        }
    }

    #[test]
    fn the_driver_is_left_out_and_what_nobody_knows_is_not() {
        let mut report = json!({ "requests": [{ "addresses": { "2": 10, "4": 200, "6": 3000 } }] });
        let part = |address| match address {
            2 => Some(Part::Server),
            4 => Some(Part::Driver),
            _ => None,
        };
        replace(&mut report, part).unwrap();
        assert_eq!(report, json!({ "requests": [{ "server": 3010 }] }));
        assert!(replace(&mut report, part).is_err());
    }
}
