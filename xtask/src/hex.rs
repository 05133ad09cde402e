//! Flash as an Intel HEX file.

use anyhow::{Context as _, Result};
use ihex::Record;

/// Bytes in a data record: a length that every programmer accepts.
const BYTES: usize = 16;

/// Returns the HEX file for these bytes at their addresses, and for the start address of the program.
pub fn file(regions: &[(u32, Vec<u8>)], entry: u32) -> Result<String> {
    let mut records = Vec::new();
    let mut upper = None;
    for (address, bytes) in regions {
        for (at, data) in (*address..).step_by(BYTES).zip(bytes.chunks(BYTES)) {
            // A data record has the lower half of its address only. Regions begin at a page, so no record crosses the
            // border of such a half.
            let half = (at >> 16) as u16;
            if upper.replace(half) != Some(half) {
                records.push(Record::ExtendedLinearAddress(half));
            }
            let (offset, value) = (at as u16, data.to_vec());
            records.push(Record::Data { offset, value });
        }
    }
    records.extend([Record::StartLinearAddress(entry), Record::EndOfFile]);
    ihex::create_object_file_representation(&records).context("no Intel HEX of the image")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_has_every_byte_at_its_address_and_the_entry() {
        let mut flash = vec![0xFF; 0x1_0011];
        (flash[0x0012], flash[0x1_0010]) = (0xAB, 0xCD);
        let regions = [(0x0800_0000, flash), (0x0803_F800, vec![0xEF])];
        let text = file(&regions, 0x0800_0131).unwrap();
        let lines: Vec<_> = text.lines().collect();
        let blank = format!(":10000000{}00", "FF".repeat(16));
        assert_eq!(lines[..2], [":020000040800F2", &blank]);
        assert!(lines[2].starts_with(":10001000FFFFAB"), "{}", lines[2]);
        let rest = [
            ":020000040801F1",
            &blank,
            ":01001000CD22",
            ":020000040803EF",
            ":01F80000EF18",
            ":0400000508000131BD",
            ":00000001FF",
        ];
        assert_eq!(lines[lines.len() - rest.len()..], rest);
    }
}
