//! The file of an update: the images for both slots of a board, and the manifest after them.

use std::fmt;
use std::path::Path;

use register_map::Row;
use register_map::layout::HEADER;
use register_map::state;
use register_map::update::{BLOCK_BYTES, Header, Manifest, Slot, crc32, intact};
use sha2::{Digest as _, Sha512};

use crate::failure::Failure;
use crate::input;
use crate::value::long;

/// The image for one slot.
#[derive(Clone, Debug)]
pub struct Image {
    /// The slot.
    pub slot: Slot,
    /// What file 2 reports of this image: version, patch level, epoch, commit (2), blocks, key (2).
    pub words: [u16; 8],
    /// Bytes of the header and the application.
    pub bytes: u32,
    /// Its CRC-32.
    pub crc: u32,
    /// Its blocks, the last one filled with FF.
    pub blocks: Vec<[u8; BLOCK_BYTES]>,
}

/// The images of a board for both slots.
#[derive(Clone, Debug)]
pub struct File {
    /// The board.
    pub board: &'static Row,
    /// The images for slots A and B.
    pub images: [Image; 2],
}

/// Version, epoch and commit of an image, for people.
#[derive(Clone, Copy, Debug)]
pub struct Version<'a> {
    /// The words that file 2 reports of it.
    words: &'a [u16; 8],
    /// Register BUILD, if the image runs.
    build: u16,
}

impl<'a> Version<'a> {
    /// Returns that of an image from the words that file 2 reports of it.
    #[must_use]
    pub const fn of(words: &'a [u16; 8]) -> Self {
        Self { words, build: 0 }
    }

    /// Returns that of the running image, whose register BUILD says whether it is a release.
    #[must_use]
    pub const fn of_running(words: &'a [u16; 8], build: u16) -> Self {
        Self { words, build }
    }
}

impl fmt::Display for Version<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [version, patch, epoch, high, low, ..] = *self.words;
        let version = state::version([version, patch], self.build);
        write!(f, "{version} ({high:04x}{low:04x})")?;
        if epoch > 0 {
            write!(f, " epoch {epoch}")?;
        }
        Ok(())
    }
}

impl Image {
    /// Returns the security epoch.
    #[must_use]
    pub const fn epoch(&self) -> u16 {
        self.words[2]
    }

    /// Returns the number of the key that signed it; 0 if it is not signed.
    #[must_use]
    pub fn key(&self) -> u32 {
        key_of(&self.words)
    }
}

/// Returns the number of the key that signed an image, from the words that file 2 reports of it.
#[must_use]
pub fn key_of(words: &[u16; 8]) -> u32 {
    long(&words[6..])
}

impl File {
    /// Reads and checks a file.
    ///
    /// # Errors
    ///
    /// In one line, what is wrong with the file.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let wrong = |what: &dyn fmt::Display| Failure::usage(format!("{}: {what}", path.display()));
        let bytes = input::read(path).map_err(|what| wrong(&what))?;
        Self::of(&bytes).map_err(|what| wrong(&what))
    }

    /// Checks the bytes of a file.
    ///
    /// # Errors
    ///
    /// What is wrong with them.
    pub fn of(bytes: &[u8]) -> Result<Self, String> {
        let (body, manifest) = bytes
            .split_last_chunk::<BLOCK_BYTES>()
            .filter(|(_, manifest)| Manifest::is_one(manifest))
            .ok_or("not the file of an update, or cut short: a .modio file is needed")?;
        let manifest = Manifest::decode(manifest)
            .filter(|manifest| Sha512::digest(body)[..] == manifest.hash)
            .ok_or("the file is damaged: copy it again")?;
        let parts = manifest.images_in(body);
        let [Some(first), Some(second)] = parts else {
            return Err("the manifest names no image in the file".to_owned());
        };
        let (board, a) = image(first, Slot::A)?;
        let (other, b) = image(second, Slot::B)?;
        let padding = [&a, &b].map(|image| image.blocks.as_flattened());
        if padding.concat() != body {
            return Err("the file has bytes that belong to no image".to_owned());
        }
        if board != other || a.words[..5] != b.words[..5] {
            return Err("the two images are not of one board and one version".to_owned());
        }
        if a.key() != b.key() {
            return Err("the two images are signed with different keys".to_owned());
        }
        let images = [a, b];
        Ok(Self { board, images })
    }

    /// Returns the number of the key that signed both images; 0 if they are not signed.
    #[must_use]
    pub fn key(&self) -> u32 {
        self.images[0].key()
    }

    /// Returns the image for a slot.
    #[must_use]
    pub const fn image(&self, slot: Slot) -> &Image {
        match slot {
            Slot::A => &self.images[0],
            Slot::B => &self.images[1],
        }
    }
}

/// Checks the image for a slot. Returns its board as well.
fn image(bytes: &[u8], slot: Slot) -> Result<(&'static Row, Image), String> {
    let wrong = |what: &str| format!("the image for slot {slot:?} {what}");
    let header = Header::of(bytes).map_err(|_| wrong("has no header"))?;
    let code = header.board();
    let board = Row::from_code(code.into()).ok_or_else(|| {
        wrong(&format!(
            "is for board {code}, which this program does not know"
        ))
    })?;
    let layout = board.layout();
    let address = layout.slots[slot as usize];
    header.suits(code, address).map_err(|_| {
        wrong(&format!(
            "is linked for {:#010x}, not for {address:#010x}",
            header.address()
        ))
    })?;
    header
        .blocks(layout.slot as usize)
        .map_err(|_| wrong(&format!("does not fit a slot of the {board}")))?;
    intact(bytes, crc32).map_err(|_| wrong("is cut short, or its CRC-32 is wrong"))?;
    let application = bytes.get(HEADER as usize..).unwrap_or_default();
    if application.len() != header.length() as usize {
        return Err(wrong("is longer than its header says"));
    }
    if Sha512::digest(application)[..] != header.hash() {
        return Err(wrong("does not have the SHA-512 in its header"));
    }
    let blocks = bytes.chunks(BLOCK_BYTES).map(|chunk| {
        let mut block = [0xFF; BLOCK_BYTES];
        block[..chunk.len()].copy_from_slice(chunk);
        block
    });
    let blocks: Vec<_> = blocks.collect();
    let [words @ .., _, _] = header.words();
    let (bytes, crc) = (HEADER + header.length(), header.crc());
    Ok((
        board,
        Image {
            slot,
            words,
            bytes,
            crc,
            blocks,
        },
    ))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::super::tests::sample::{file, image, sealed, signed};
    use super::*;

    /// Returns the file of a modio-02 whose images have this number of blocks.
    pub fn of_blocks(blocks: usize) -> File {
        signed_of_blocks(blocks, 0)
    }

    /// The same, signed with the key with this number.
    pub fn signed_of_blocks(blocks: usize, key: u32) -> File {
        let length = blocks * BLOCK_BYTES - 512;
        let images = Slot::ALL.map(|slot| signed(image(slot, length), key));
        File::of(&file(images)).unwrap()
    }

    #[test]
    fn a_right_file_has_both_images_in_blocks() {
        let [a, b] = [image(Slot::A, 1004), image(Slot::B, 2048)];
        let read = File::of(&file([a.clone(), b])).unwrap();
        assert_eq!(read.board.name, "modio-02");
        assert_eq!(read.image(Slot::B).blocks.len(), 20);
        let first = read.image(Slot::A);
        assert_eq!(first.blocks.len(), 12, "1516 bytes");
        assert_eq!(first.blocks.as_flattened()[..1516], a);
        assert_eq!(first.blocks.as_flattened()[1516..], [0xFF; 20]);
        assert_eq!(first.words, [3, 1, 0, 0x1A2B, 0x3C4D, 12, 0, 0]);
        assert_eq!(Version::of(&first.words).to_string(), "0.3.1 (1a2b3c4d)");
        let crc = u32::from_le_bytes(*a[20..].first_chunk().unwrap());
        assert_eq!((first.bytes, first.crc, first.key()), (1516, crc, 0));
        assert_eq!(signed_of_blocks(20, 0x0102_FFFE).key(), 0x0102_FFFE);
    }

    #[test]
    fn a_wrong_file_is_refused_with_the_reason() {
        let both = || [image(Slot::A, 1000), image(Slot::B, 1000)];
        let right = file(both());
        let refused = |bytes: &[u8]| File::of(bytes).unwrap_err();
        assert!(refused(&[]).contains("not the file of an update"));
        assert!(refused(&right[1..right.len() - 1]).contains("cut short"));
        for at in (0..right.len()).step_by(61) {
            let mut damaged = right.clone();
            damaged[at] ^= 0x10;
            refused(&damaged);
        }
        let [a, b] = both();
        assert!(refused(&file([b.clone(), b.clone()])).contains("is linked for 0x08011800"));
        let changed = |at: usize, byte: u8| {
            let mut image = b.clone();
            image[at] = byte;
            refused(&file([a.clone(), sealed(image)]))
        };
        assert!(changed(5, 9).contains("is for board 9, which"));
        assert!(changed(8, 1).contains("not of one board and one version"));
        assert!(changed(159, 1).contains("signed with different keys"));
        let mut unsealed = b.clone();
        unsealed[600] ^= 1;
        assert!(refused(&file([a.clone(), unsealed])).contains("CRC-32"));
        let long = image(Slot::B, 54 * 1024);
        assert!(refused(&file([a.clone(), long])).contains("does not fit a slot"));
        let mut other_hash = b.clone();
        other_hash[91] ^= 1;
        let text = refused(&file([a.clone(), other_hash]));
        assert_eq!(
            text,
            "the image for slot B does not have the SHA-512 in its header"
        );
    }

    #[test]
    fn bytes_after_the_length_in_the_header_are_refused() {
        let [a, b] = [image(Slot::A, 1000), image(Slot::B, 1000)];
        let refused = |images| File::of(&file(images)).unwrap_err();
        let longer = [b.clone(), vec![0xFF; 4]].concat();
        assert_eq!(
            refused([a.clone(), longer]),
            "the image for slot B is longer than its header says"
        );
        // The rest of the last block.
        let mut bytes = file([a, b]);
        bytes[1512] = 0;
        let (body, manifest) = bytes.split_last_chunk_mut::<BLOCK_BYTES>().unwrap();
        let mut decoded = Manifest::decode(manifest).unwrap();
        decoded.hash = Sha512::digest(&*body).into();
        *manifest = decoded.encode();
        assert_eq!(
            File::of(&bytes).unwrap_err(),
            "the file has bytes that belong to no image"
        );
    }

    #[test]
    fn a_missing_file_is_named() {
        let failure = File::read(Path::new("/nowhere/a.modio")).unwrap_err();
        assert_eq!(failure.status(), 2);
        assert!(failure.to_string().starts_with("/nowhere/a.modio: "));
    }
}
