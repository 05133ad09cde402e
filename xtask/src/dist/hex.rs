//! Flash as an Intel HEX file.

use anyhow::{Context as _, Result};
use ihex::Record;

use crate::image::FLASH_BASE;

/// Bytes in a data record: a length that every programmer accepts.
const BYTES: usize = 16;

/// Returns the HEX file for these bytes, from the first address of flash on, and for the start address of the program.
pub fn file(flash: &[u8], entry: u32) -> Result<String> {
    let mut records = Vec::new();
    let mut upper = None;
    for (address, value) in (FLASH_BASE..).step_by(BYTES).zip(flash.chunks(BYTES)) {
        let high = (address >> 16) as u16;
        if upper != Some(high) {
            records.push(Record::ExtendedLinearAddress(high));
            upper = Some(high);
        }
        records.push(Record::Data {
            offset: (address & 0xFFFF) as u16,
            value: value.to_vec(),
        });
    }
    records.push(Record::StartLinearAddress(entry));
    records.push(Record::EndOfFile);
    ihex::create_object_file_representation(&records).context("no Intel HEX of the image")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_bytes_are_read_back_at_their_addresses() {
        let flash: Vec<u8> = (0..0x1_0013_u32).map(|n| ((n * 7) >> 3) as u8).collect();
        let text = file(&flash, 0x0800_0131).unwrap();
        let mut back = Vec::new();
        let (mut upper, mut entry) = (0, 0);
        for record in ihex::Reader::new(&text) {
            match record.unwrap() {
                Record::ExtendedLinearAddress(high) => upper = u32::from(high) << 16,
                Record::Data { offset, value } => {
                    let address = upper + u32::from(offset);
                    assert_eq!(address - FLASH_BASE, back.len() as u32);
                    back.extend(value);
                }
                Record::StartLinearAddress(address) => entry = address,
                Record::EndOfFile => {}
                other => panic!("{other:?}"),
            }
        }
        assert_eq!(back, flash);
        assert_eq!(entry, 0x0800_0131);
        assert!(
            text.starts_with(":020000040800F2\n"),
            "the address of flash"
        );
        assert!(text.ends_with(":00000001FF\n"));
    }
}
