//! What a programmer writes into the flash of a board: an image that runs alone, or the loader and an image in a slot.
//!
//! The loader's first start checks the signature of the image, which takes seconds, and writes the boot state. Here the
//! boot state is written together with the image, as if the board had been started once.

use std::ops::Range;
use std::path::Path;

use f103::Image;
use f103::memory::FLASH_BASE;
use register_map::layout::{HEADER, LOADER, LOADER_KEYS};
use register_map::update::{Header, Slot, State, crc32, intact, keys};

use super::{Board, Layout};

/// Version of the layout of the record.
const RECORD_LAYOUT: u16 = 0x4201;

/// Register with the address of the table of vectors in force (PM0056 4.4.4).
const VTOR: u32 = 0xE000_ED08;

/// What is written into a flash.
#[derive(Clone, Debug)]
pub enum Firmware {
    /// An image that runs without a loader.
    Alone(Image),
    /// The loader, and an image for one slot.
    Loaded(Image, InSlot),
}

/// An intact image, and the slot that it is linked for.
#[derive(Clone, Debug)]
pub struct InSlot {
    slot: Slot,
    /// The header, and the application.
    bytes: Vec<u8>,
}

impl InSlot {
    /// Reads a file, and returns the image that [`from_file`](Self::from_file) finds in it.
    ///
    /// # Errors
    ///
    /// In one line: the file cannot be read, or has no image for the board.
    pub fn read(layout: &Layout, path: &Path) -> Result<Self, String> {
        let file = std::fs::read(path).map_err(|error| error.to_string());
        let image = file.and_then(|file| Self::from_file(layout, &file));
        image.map_err(|what| format!("{}: {what}", path.display()))
    }

    /// Returns the image in the file of an update (the one for slot A), or in a file for one slot.
    ///
    /// # Errors
    ///
    /// In one line: the file has no image, or one that is damaged or for another board.
    pub fn from_file(layout: &Layout, file: &[u8]) -> Result<Self, String> {
        let header =
            Header::of(file).map_err(|_| "it does not begin with the header of an image")?;
        let board = layout.board;
        if u16::from(header.board()) != board.code {
            return Err(format!("its image is not for the {board}"));
        }
        let Some(slot) = Slot::ALL
            .into_iter()
            .find(|slot| layout.range(*slot).start == offset(header.address()))
        else {
            return Err(format!("no slot begins at {:#010x}", header.address()));
        };
        let end = HEADER as usize + header.length() as usize;
        match file.get(..end) {
            Some(bytes) if end <= layout.range(slot).len() && intact(bytes, crc32).is_ok() => {
                Ok(Self {
                    slot,
                    bytes: bytes.to_vec(),
                })
            }
            _ => Err("its image is damaged".to_owned()),
        }
    }
}

impl Firmware {
    /// Writes the firmware into the flash of a board, and returns the image to make the board with. The flash has what
    /// an earlier firmware has left, if there was one; its configuration remains.
    ///
    /// If an update over the line has changed the flash, the images in it remain, except when `anew` is set. The text
    /// reports a change of the earlier firmware that a user might not expect.
    ///
    /// # Errors
    ///
    /// [`f103::Error::Image`] if the firmware does not fit into the flash.
    pub fn program(
        &self,
        layout: &Layout,
        flash: &mut Vec<u8>,
        anew: bool,
    ) -> Result<(Image, Option<&'static str>), f103::Error> {
        let held_loader = layout.holds_loader(flash);
        let is_new = flash.iter().all(|byte| *byte == 0xFF);
        let note = match self {
            Self::Alone(image) => {
                if held_loader {
                    *flash = layout.moved(flash, &[]);
                }
                let note = "an image that runs alone replaces the loader and its images; the settings were moved";
                return Ok((image.clone(), held_loader.then_some(note)));
            }
            Self::Loaded(loader, image) => {
                let fresh = layout.loaded(loader, image, flash)?;
                let is_held = |slot| {
                    let written = &flash[layout.range(slot)];
                    written.starts_with(&image.bytes)
                };
                if held_loader && !anew && !layout.is_as_programmed(flash) {
                    let held = Slot::ALL.into_iter().any(is_held);
                    let note = "the images in it remain, because an update over the line has changed it; --reflash \
                                writes the one that was built or given";
                    (!held).then_some(note)
                } else {
                    let loaders = ..LOADER as usize;
                    let replaced = fresh[loaders] != flash[loaders] || !is_held(image.slot);
                    *flash = fresh;
                    match (is_new, held_loader) {
                        (true, _) => None,
                        (false, true) => replaced.then_some("loader and image were written again"),
                        (false, false) => Some(
                            "loader and image replace an image that runs alone; the settings were moved",
                        ),
                    }
                }
            }
        };
        // What is in flash, whatever it is.
        Ok((Image::from_bytes(&flash[..LOADER as usize])?, note))
    }
}

impl Board {
    /// Returns the slot whose image runs; `None` without power, in the loader, and when an image runs alone.
    pub fn running_slot(&mut self) -> Option<Slot> {
        if !self.powered() || !self.layout().holds_loader(self.flash()) {
            return None;
        }
        let mut word = |address| {
            let mut bytes = [0; 4];
            let read = self.read_memory(address, &mut bytes);
            (read == bytes.len()).then_some(u32::from_le_bytes(bytes))
        };
        // An image copies its table of vectors to RAM. The reset vector, its second word, is in the image.
        let vectors = word(VTOR)?;
        let reset = offset(word(vectors.wrapping_add(4))?);
        let mut slots = Slot::ALL.into_iter();
        slots.find(|slot| self.layout().range(*slot).contains(&reset))
    }
}

impl Layout {
    /// Returns whether this flash has a loader: a slot begins with the header of an image.
    #[must_use]
    pub fn holds_loader(&self, flash: &[u8]) -> bool {
        let mut slots = Slot::ALL.into_iter();
        slots.any(|slot| flash.get(self.range(slot)).is_some_and(has_header))
    }

    /// Returns a slot, as a range of the flash.
    #[must_use]
    pub fn range(&self, slot: Slot) -> Range<usize> {
        let layout = self.board.layout();
        let [a, b] = layout.slots.map(offset);
        let start = match slot {
            Slot::A => a,
            Slot::B => b,
        };
        start..start + layout.slot as usize
    }

    /// Returns a flash with the loader, an image, its boot state, and the configuration of another flash.
    fn loaded(&self, loader: &Image, image: &InSlot, old: &[u8]) -> Result<Vec<u8>, f103::Error> {
        let start = self.range(image.slot).start;
        let mut flash = self.moved(old, &[(start, &image.bytes)]);
        loader.load(&mut flash, self.part.page_size)?;
        let boot = offset(self.board.layout().boot.first);
        let record = boot_state(image.slot, &image.bytes, &flash);
        flash[boot..boot + record.len()].copy_from_slice(&record);
        Ok(flash)
    }

    /// Returns an erased flash with these bytes, and the configuration of another flash where it belongs then.
    fn moved(&self, old: &[u8], bytes: &[(usize, &[u8])]) -> Vec<u8> {
        let mut flash = vec![0xFF; self.part.flash_size];
        for (at, bytes) in bytes {
            flash[*at..at + bytes.len()].copy_from_slice(bytes);
        }
        for (from, to) in self.pages(old).into_iter().zip(self.pages(&flash)) {
            flash[to].copy_from_slice(&old[from]);
        }
        flash
    }

    /// Returns whether the boot state in this flash is the one that was written with the image: no update over the line
    /// has changed it.
    fn is_as_programmed(&self, flash: &[u8]) -> bool {
        let layout = self.board.layout();
        let boot = offset(layout.boot.first);
        let pages = &flash[boot..boot + 2 * layout.boot.bytes as usize];
        Slot::ALL.into_iter().any(|slot| {
            let slot_bytes = &flash[self.range(slot)];
            let Some(rest) = pages.strip_prefix(&boot_state(slot, slot_bytes, flash)[..]) else {
                return false;
            };
            has_header(slot_bytes) && rest.iter().all(|byte| *byte == 0xFF)
        })
    }
}

fn offset(address: u32) -> usize {
    address.wrapping_sub(FLASH_BASE) as usize
}

fn has_header(slot: &[u8]) -> bool {
    Header::of(slot).is_ok()
}

/// Returns the boot state after the first start of an image by the loader in this flash, as its journal writes it: the
/// first record, with both seals. An image that the second key signed revokes the first.
fn boot_state(slot: Slot, image: &[u8], flash: &[u8]) -> Vec<u8> {
    let confirmed = u16::from(State::Confirmed.code().0);
    let (preferred, states) = match slot {
        Slot::A => (0, confirmed << 8),
        Slot::B => (1, confirmed << 12),
    };
    let [.., second] = keys::numbers(flash.get(offset(LOADER_KEYS)..).unwrap_or_default());
    let header = Header::of(image);
    let revoked = header.is_ok_and(|header| second != 0 && header.key() == second);
    let floor = header.map_or(0, |header| header.epoch());
    let bits = preferred | u16::from(revoked) << 1;
    let halves = [1, 0, bits | states, 0, floor, RECORD_LAYOUT];
    let mut record: Vec<u8> = halves.iter().flat_map(|half| half.to_le_bytes()).collect();
    let crc = crc32([&record, &[]]);
    record.extend(crc.to_le_bytes());
    let seals = [0; 4];
    record.extend(seals);
    record
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::{MODIO_02, MODIO_08};

    const SETTINGS: [(u16, u16); 2] = [(0x0103, 1), (0x0114, 2)];

    /// Returns the image for a slot with an application of these bytes.
    fn file(layout: &Layout, slot: Slot, byte: u8) -> Vec<u8> {
        let mut file = vec![0; HEADER as usize];
        file[..4].copy_from_slice(b"MODI");
        file[4..8].copy_from_slice(&[2, layout.board.code as u8, 3, 0]);
        let address = FLASH_BASE + layout.range(slot).start as u32;
        file[12..16].copy_from_slice(&address.to_le_bytes());
        file[16..20].copy_from_slice(&1024_u32.to_le_bytes());
        file.extend([byte; 1024]);
        let crc = crc32([&file[..20], &file[HEADER as usize..]]);
        file[20..24].copy_from_slice(&crc.to_le_bytes());
        file
    }

    fn loaded(byte: u8) -> Firmware {
        let image = InSlot::from_file(&MODIO_02, &file(&MODIO_02, Slot::A, byte)).unwrap();
        Firmware::Loaded(Image::from_bytes(&[byte; 64]).unwrap(), image)
    }

    fn alone() -> Firmware {
        Firmware::Alone(Image::from_bytes(&[9; 64]).unwrap())
    }

    /// Writes the firmware, and returns the text for the user.
    fn program(firmware: &Firmware, flash: &mut Vec<u8>, anew: bool) -> Option<&'static str> {
        let (image, note) = firmware.program(&MODIO_02, flash, anew).unwrap();
        image.load(flash, MODIO_02.part.page_size).unwrap();
        note
    }

    fn stored(flash: &[u8]) -> [Option<u16>; 2] {
        SETTINGS.map(|(address, _)| MODIO_02.stored(flash, address))
    }

    #[test]
    fn file_with_a_wrong_image_is_refused() {
        let right = file(&MODIO_02, Slot::B, 1);
        let refused = |layout: &Layout, file: &[u8], part: &str| {
            let what = InSlot::from_file(layout, file).unwrap_err();
            assert!(what.contains(part), "{what}");
        };
        assert!(InSlot::from_file(&MODIO_02, &right).is_ok());
        refused(&MODIO_02, b"\x7fELF", "header");
        refused(&MODIO_08, &right, "not for the modio-08");
        refused(&MODIO_02, &right[..right.len() - 1], "damaged");
        for (at, byte, part) in [
            (13, 0x99, "no slot"),
            (18, 0xFF, "damaged"),
            (600, 2, "damaged"),
        ] {
            let mut wrong = right.clone();
            wrong[at] = byte;
            refused(&MODIO_02, &wrong, part);
        }
    }

    #[test]
    fn settings_move_with_the_firmware_in_both_directions() {
        let mut flash = MODIO_02.flash_with(&SETTINGS).unwrap();
        flash[0x100] = 0;
        let note = program(&loaded(1), &mut flash, false).unwrap();
        assert!(note.contains("replace an image that runs alone"), "{note}");
        assert!(MODIO_02.holds_loader(&flash));
        assert_eq!(stored(&flash), [Some(1), Some(2)]);
        assert!(flash[0xF800..0x1_F000].iter().all(|byte| *byte == 0xFF));
        assert_eq!(
            program(&loaded(1), &mut flash, false),
            None,
            "nothing has changed"
        );

        let note = program(&alone(), &mut flash, false).unwrap();
        assert!(note.contains("replaces the loader"), "{note}");
        assert!(!MODIO_02.holds_loader(&flash));
        assert_eq!(stored(&flash), [Some(1), Some(2)]);
        assert_eq!(program(&alone(), &mut flash, false), None);
    }

    #[test]
    fn newer_firmware_is_written_unless_an_update_over_the_line_has_changed_the_flash() {
        let mut flash = vec![0xFF; MODIO_02.part.flash_size];
        assert_eq!(program(&loaded(1), &mut flash, false), None);
        assert!(MODIO_02.store(&mut flash, &SETTINGS));
        let note = program(&loaded(2), &mut flash, false).unwrap();
        assert!(note.contains("written again"), "{note}");
        assert_eq!((flash[0], flash[0x4200]), (2, 2));
        assert_eq!(stored(&flash), [Some(1), Some(2)]);

        // The application has begun to receive an update: it writes another record.
        flash[0x1_F000 + 20..][..20].fill(0);
        let before = flash.clone();
        assert_eq!(program(&loaded(2), &mut flash, false), None);
        let note = program(&loaded(3), &mut flash, false).unwrap();
        assert!(note.contains("--reflash"), "{note}");
        assert_eq!(flash, before);
        program(&loaded(3), &mut flash, true).unwrap();
        assert_eq!((flash[0], flash[0x4200]), (3, 3));
        assert_eq!(stored(&flash), [Some(1), Some(2)]);
        assert_eq!(
            program(&loaded(3), &mut flash, false),
            None,
            "as programmed"
        );
    }
}
