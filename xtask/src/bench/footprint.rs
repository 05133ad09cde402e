//! What the server takes by itself: flash, by the source that code comes from; and RAM, its structures with the
//! two buffers that a line needs.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Value, json};

use crate::size::types;
use crate::{Failure, Result, image};

/// The server's crate.
const CRATE: &str = "modbus_server";

/// What a line needs of it, and how many.
const STRUCTURES: [(&str, u64); 4] = [
    ("Server", 1),
    ("Receiver<u8>", 1),
    ("Transmitter", 1),
    ("Adu", 2),
];

/// Puts it into a report, as `server`. The image's sizes are there already.
///
/// # Errors
///
/// When the image's debug information is broken or does not tell.
pub fn add(report: &mut Value, elf: &Path) -> Result<()> {
    let bytes = image::read(elf)?;
    let sizes = image::parse(&bytes).and_then(|parsed| types::of(&parsed, &bytes, CRATE));
    let ram = ram(&sizes.map_err(Failure::new)?)?;
    let crates = report["image"]["crates"].as_array().into_iter().flatten();
    let flash = crates
        .filter(|row| row["name"] == CRATE)
        .find_map(|row| row["flash"].as_u64());
    let flash = flash.ok_or_else(|| Failure::new(format!("nothing of the image is {CRATE}'s")))?;
    report["server"] = json!({ "flash": flash, "ram": ram });
    Ok(())
}

fn ram(sizes: &BTreeMap<String, u64>) -> Result<u64> {
    STRUCTURES
        .iter()
        .map(|(name, count)| {
            let size = sizes.get(*name).map(|size| size * count);
            size.ok_or_else(|| {
                Failure::new(format!("the debug information has no {CRATE}::{name}"))
            })
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_two_buffers() {
        let sizes = [
            ("Server", 100),
            ("Receiver<u8>", 40),
            ("Transmitter", 30),
            ("Adu", 260),
        ];
        let mut sizes = sizes.map(|(name, size)| (name.to_owned(), size)).into();
        assert_eq!(ram(&sizes).unwrap(), 690);
        sizes.remove("Adu");
        let missing = ram(&sizes).unwrap_err().to_string();
        assert!(missing.contains("modbus_server::Adu"), "{missing}");
    }
}
