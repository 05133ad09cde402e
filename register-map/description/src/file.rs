//! File 1 of a unit: the document, preceded by its length and its CRC.
//!
//! ```text
//!  record    0         1      2 ...
//!         +--------+-------+---------------+-----+
//!         | length | CRC   | CBOR document | (0) |
//!         +--------+-------+---------------+-----+
//! ```
//!
//! A record is a word, high byte first. A document with an odd length is followed by a byte 0.

use crc::{CRC_16_MODBUS, Crc};

use crate::{Description, Error};

/// File number.
pub const FILE: u16 = 1;

/// Number of records in front of the document: its length in bytes, and its CRC.
pub const HEAD: u16 = 2;

/// Returns the number of records of a file whose document has this length in bytes.
#[must_use]
pub const fn records(length: u16) -> u16 {
    HEAD + length.div_ceil(2)
}

/// Returns the CRC-16/MODBUS of a document: register 0x020F, and the second record of the file.
#[must_use]
pub fn checksum(document: &[u8]) -> u16 {
    const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);
    CRC.checksum(document)
}

impl Description {
    /// Returns the bytes of file 1.
    ///
    /// # Panics
    ///
    /// When the document has more than 65535 bytes.
    #[must_use]
    pub fn file(&self) -> Vec<u8> {
        let document = self.encode();
        let length = u16::try_from(document.len()).expect("a document has 65535 bytes at most");
        let head = [length, checksum(&document)].map(u16::to_be_bytes);
        let mut file = [head.as_flattened(), &document].concat();
        file.resize(usize::from(records(length)) * 2, 0);
        file
    }

    /// Decodes the bytes of file 1: its words, high byte first. Bytes after the document are ignored.
    ///
    /// # Errors
    ///
    /// [`Error::Short`] when the file is incomplete, [`Error::Crc`] when its CRC is wrong, and the errors of
    /// [`Description::decode`].
    pub fn open(file: &[u8]) -> Result<Self, Error> {
        let missing = Error::Short {
            length: 0,
            found: 0,
        };
        let (head, rest) = file.split_first_chunk::<4>().ok_or(missing)?;
        let [l1, l0, c1, c0] = *head;
        let length = u16::from_be_bytes([l1, l0]);
        let document = rest.get(..length.into()).ok_or(Error::Short {
            length,
            found: rest.len(),
        })?;
        let (stored, computed) = (u16::from_be_bytes([c1, c0]), checksum(document));
        if stored != computed {
            return Err(Error::Crc { stored, computed });
        }
        Self::decode(document)
    }
}
