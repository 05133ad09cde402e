//! The manifest at the end of the file of an update: 128 bytes, little-endian.
//!
//! | offset | bytes | content |
//! |---|---|---|
//! | 0 | 8 | `MODM`, format 1, zeros |
//! | 8 | 8, 8 | offset and length of the image for slot A, for slot B |
//! | 24 | 64 | SHA-512 of everything before the manifest |
//! | 88 | 36 | zero |
//! | 124 | 4 | CRC-32 of the manifest, as that of an image |

use super::{BLOCK_BYTES, crc32};

const MAGIC: [u8; 8] = *b"MODM\x01\0\0\0";
const HASH: usize = 24;
const CRC: usize = BLOCK_BYTES - 4;

/// The manifest of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Manifest {
    /// Offset and length of the images for slots A and B, in bytes.
    pub images: [[u32; 2]; 2],
    /// SHA-512 of everything before the manifest.
    pub hash: [u8; 64],
}

impl Manifest {
    /// Returns the bytes of the manifest.
    #[must_use]
    pub fn encode(&self) -> [u8; BLOCK_BYTES] {
        let mut bytes = [0; BLOCK_BYTES];
        bytes[..MAGIC.len()].copy_from_slice(&MAGIC);
        let numbers = self.images.as_flattened().iter();
        for (place, number) in bytes[MAGIC.len()..HASH]
            .as_chunks_mut()
            .0
            .iter_mut()
            .zip(numbers)
        {
            *place = number.to_le_bytes();
        }
        bytes[HASH..HASH + 64].copy_from_slice(&self.hash);
        let crc = crc32([&bytes[..CRC], &[]]);
        bytes[CRC..].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    /// Returns whether these bytes begin as a manifest.
    #[must_use]
    pub fn is_one(bytes: &[u8; BLOCK_BYTES]) -> bool {
        bytes.starts_with(&MAGIC)
    }

    /// Returns the manifest with these bytes, or `None` if it is none, or damaged.
    #[must_use]
    pub fn decode(bytes: &[u8; BLOCK_BYTES]) -> Option<Self> {
        let number = |at: usize| u32::from_le_bytes(core::array::from_fn(|n| bytes[at + n]));
        let manifest = Self {
            images: [8, 16].map(|at| [number(at), number(at + 4)]),
            hash: core::array::from_fn(|n| bytes[HASH + n]),
        };
        let right = Self::is_one(bytes) && number(CRC) == crc32([&bytes[..CRC], &[]]);
        right.then_some(manifest)
    }

    /// Returns the bytes of the images, in the body of the file. `None` if it has no such part.
    #[must_use]
    pub fn images_in<'a>(&self, body: &'a [u8]) -> [Option<&'a [u8]>; 2] {
        self.images
            .map(|[first, length]| body.get(first as usize..)?.get(..length as usize))
    }
}
