//! Errors when bytes are not a self-description.

use std::fmt;

/// Error when bytes cannot be decoded as a self-description.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Error {
    /// The document has this version of the format, which is newer than [`crate::VERSION`].
    Version(u64),
    /// The bytes are not CBOR, or not CBOR of this form. Contains the reason.
    Form(String),
    /// The file has fewer bytes than the document should have.
    Short {
        /// The length of the document, from the first word of the file. 0 if the file has fewer than two words.
        length: u16,
        /// Bytes of the file after its first two words.
        found: usize,
    },
    /// The CRC of the document is not the one in the second word of the file.
    Crc {
        /// The CRC in the file.
        stored: u16,
        /// The CRC of the document.
        computed: u16,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Version(version) => write!(
                f,
                "the self-description has format version {version}, and this program reads versions up to {}: use a newer program",
                crate::VERSION
            ),
            Self::Form(what) => write!(f, "not a self-description: {what}"),
            Self::Short { length, found } => write!(
                f,
                "the file has {found} bytes after its first two words, but the self-description has {length}: read the whole file"
            ),
            Self::Crc { stored, computed } => write!(
                f,
                "the CRC of the self-description is {computed:#06X}, but the file contains {stored:#06X}: read the file again"
            ),
        }
    }
}

impl std::error::Error for Error {}

impl From<minicbor::decode::Error> for Error {
    fn from(error: minicbor::decode::Error) -> Self {
        Self::Form(match error.position() {
            Some(at) => format!("{error} (byte {at})"),
            None => error.to_string(),
        })
    }
}
