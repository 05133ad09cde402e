//! `cargo xtask flash`: the loader and the image of a slot, or an image that runs alone, on a real board, through a debug
//! probe (probe-rs) or the part's ROM loader (stm32flash).
//!
//! The boot state and the first page of the other slot are erased, so the loader checks the image at its next start. The
//! settings move with the pages of the store, which are elsewhere without a loader.

use std::path::Path;
use std::process::Command;

use anyhow::{Context as _, Result, anyhow, ensure};
use fs_err as fs;
use register_map::layout::{HEADER, TwoPages};
use register_map::part::FLASH_BASE;
use register_map::update::{Header, Slot};
use register_map::{Row, record};

use crate::error::usage;
use crate::workspace::Workspace;
use crate::{build, command, debug, hex, image, keys, signed};

/// Bytes at addresses of the flash.
pub type Regions = Vec<(u32, Vec<u8>)>;

/// First address of the option bytes (PM0075 2.5).
const OPTION_BYTES: u32 = 0x1FFF_F800;

/// Option bytes that write-protect the loader's 16 KiB, four pages of 1 KiB or two of 2 KiB by each bit of the first
/// byte of WRP; otherwise they are those of a new part. Each byte is followed by its complement.
const PROTECTED: [u8; 16] = [
    0xA5, 0x5A, 0xFF, 0, 0xFF, 0, 0xFF, 0, 0xF0, 0x0F, 0xFF, 0, 0xFF, 0, 0xFF, 0,
];

/// What to write, and how.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    #[command(flatten)]
    board: debug::Options,

    /// Slot for the image: a or b
    #[arg(long, value_name = "LETTER", value_parser = build::slot, default_value = "a")]
    slot: Slot,

    #[command(flatten)]
    signature: signed::How,

    #[command(flatten)]
    keys: keys::Trusted,

    /// Write the image that runs without a loader. `--elf` writes such an image, too
    #[arg(long, conflicts_with_all = ["slot", "key", "epoch", "end_first_key"])]
    plain: bool,

    /// Write through the ROM loader of the part at this serial port, with stm32flash: an adapter for 3.3 V at PA9 and
    /// PA10, and BOOT0 high during a reset
    #[arg(long, value_name = "PORT", conflicts_with_all = ["probe", "chip"])]
    serial: Option<String>,

    /// Also write-protect the loader, by the option bytes. With a debug probe OpenOCD does the same: openocd -f
    /// interface/stlink.cfg -f target/stm32f1x.cfg -c "init; reset halt; flash protect 0 0 3 on; reset run; shutdown"
    #[arg(long, requires = "serial", conflicts_with_all = ["plain", "elf"])]
    protect: bool,
}

/// `cargo xtask flash`.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    // Check before the build, which is useless without a way to the board.
    match &options.serial {
        None => debug::check()?,
        Some(_) => ensure!(
            which::which("stm32flash").is_ok(),
            "stm32flash is not installed (on Debian: apt-get install stm32flash)"
        ),
    }
    options.keys.apply(workspace)?;
    let board = options.board.given.board();
    let (mut regions, entry) = options.regions(workspace)?;
    let read = |address, length| options.read(workspace, address, length);
    let is_alone = options.plain || options.board.given.is_given();
    let held = holds_loader(board, read);
    if is_alone && matches!(held, Ok(true)) {
        // Otherwise a later call would find the loader's images again, and take the settings from their store.
        regions.extend(forgotten(board, Slot::B));
    }
    match held.and_then(|held| settings(board, is_alone, held, read)) {
        Ok(Some(settings)) => {
            eprintln!("xtask: the settings move to {:#010x}", settings.0);
            regions.push(settings);
        }
        Ok(None) => {}
        Err(why) => eprintln!(
            "xtask: the board cannot be read, so settings of an image of the other kind (with or without loader) are \
             lost: {why:#}"
        ),
    }
    options.write(workspace, &regions, entry)
}

/// Returns whether a board has a loader: a slot begins with the header of an image.
fn holds_loader(board: &Row, read: impl Fn(u32, u32) -> Result<Vec<u8>>) -> Result<bool> {
    let [a, b] = board.layout().slots.map(|slot| {
        let header = read(slot, HEADER)?;
        Ok::<_, anyhow::Error>(Header::of(&header).is_ok())
    });
    // A part without a loader may be smaller, so that there is nothing to read at slot B.
    Ok(a? || b.unwrap_or(false))
}

/// Returns the settings on a board that must move, as a new address and the content of their pages. An image that runs
/// alone and an image in a slot may store the settings in different pages. `is_alone`: the image to be written runs
/// without a loader. `holds_loader`: the board has a loader now.
fn settings(
    board: &Row,
    is_alone: bool,
    holds_loader: bool,
    read: impl Fn(u32, u32) -> Result<Vec<u8>>,
) -> Result<Option<(u32, Vec<u8>)>> {
    let layout = board.layout();
    let (from, to) = match is_alone {
        true => (layout.store, board.store()),
        false => (board.store(), layout.store),
    };
    if from == to {
        return Ok(None);
    }
    let TwoPages { first, bytes } = from;
    if holds_loader != is_alone {
        return Ok(None);
    }
    let pages = read(first, 2 * bytes)?;
    let mut pages_of = pages.chunks(bytes as usize);
    let holds_settings = pages_of.any(|page| record::records(page, board).next().is_some());
    Ok(holds_settings.then_some((to.first, pages)))
}

/// Returns what is written for a slot: the loader, the image, and erased pages: the boot state, and the first page of
/// the other slot.
pub fn loaded(board: &Row, slot: Slot, loader: Vec<u8>, image: Vec<u8>) -> Regions {
    let own = board.layout().slots[slot as usize];
    let mut regions = vec![(FLASH_BASE, loader), (own, image)];
    regions.extend(forgotten(board, slot.other()));
    regions.sort_unstable_by_key(|(address, _)| *address);
    regions
}

/// Returns erased pages: the first one of a slot, and the boot state.
fn forgotten(board: &Row, slot: Slot) -> [(u32, Vec<u8>); 2] {
    let layout = board.layout();
    let erased = |pages: u32| vec![0xFF; (pages * layout.boot.bytes) as usize];
    [
        (layout.slots[slot as usize], erased(1)),
        (layout.boot.first, erased(2)),
    ]
}

impl Options {
    /// Builds the regions to be written. Returns them with the start address.
    fn regions(&self, workspace: &mut Workspace) -> Result<(Regions, u32)> {
        let board = self.board.given.board();
        let flat = |elf: &Path| {
            let bytes = image::read(elf)?;
            let entry = image::parse(&bytes).map(|elf| object::Object::entry(&elf) as u32)?;
            Ok::<_, anyhow::Error>((image::flat(&bytes, board.memory.part.flash)?, entry))
        };
        if self.plain || self.board.given.is_given() {
            let (bytes, entry) = flat(&self.board.given.elf(workspace)?)?;
            ensure!(
                !bytes.starts_with(&[0xFF; 4]),
                usage(
                    "the image of --elf is for a slot, so it does not run without a loader; use --slot instead"
                )
            );
            return Ok((vec![(FLASH_BASE, bytes)], entry));
        }
        // Before the builds, which take long.
        let signer = self.signature.signer(workspace)?;
        if signer.trusted.has_development() {
            eprintln!(
                "xtask: this unit takes firmware from anybody on its line, because everybody has the development keys; \
                 docs/update.md says how to make your own"
            );
        }
        let (loader, entry) = flat(&build::loader(workspace, board)?)?;
        let image = signed::image_by(workspace, board, self.slot, &signer)?;
        Ok((loaded(board, self.slot, loader, fs::read(image)?), entry))
    }

    /// Reads flash of the board.
    fn read(&self, workspace: &Workspace, address: u32, length: u32) -> Result<Vec<u8>> {
        let Some(port) = &self.serial else {
            let mut read = self.board.probe_rs("read");
            let words = length / 4;
            read.args(["b32", &format!("{address:#x}"), &words.to_string()]);
            return words_of(&command::read(&mut read)?, words as usize);
        };
        let file = workspace.target.join("flash.bin");
        let mut read = Command::new("stm32flash");
        read.arg("-r").arg(&file);
        read.args(["-S", &format!("{address:#x}:{length}"), port]);
        command::read(&mut read)?;
        Ok(fs::read(file)?)
    }

    /// Writes and verifies, and starts the board if that is possible.
    fn write(&self, workspace: &Workspace, regions: &Regions, entry: u32) -> Result<()> {
        let Some(port) = &self.serial else {
            let file = workspace.target.join("flash.hex");
            fs::write(&file, hex::file(regions, entry)?)?;
            let mut download = self.board.probe_rs("download");
            download.args(["--binary-format", "hex", "--verify"]);
            command::run(download.arg(file))?;
            command::run(&mut self.board.probe_rs("reset"))?;
            say!("written, verified and started");
            return Ok(());
        };
        let options = (OPTION_BYTES, PROTECTED.to_vec());
        // The option bytes last, and not verified: the part is reset when they are written.
        for (address, bytes) in regions.iter().chain(self.protect.then_some(&options)) {
            let file = workspace.target.join("flash.bin");
            fs::write(&file, bytes)?;
            let mut write = Command::new("stm32flash");
            write.args(["-f", "-S", &format!("{address:#x}:{}", bytes.len())]);
            write.args((*address != OPTION_BYTES).then_some("-v"));
            command::run(write.arg("-w").arg(file).arg(port))?;
        }
        say!("written and verified: set BOOT0 low and reset the board");
        Ok(())
    }
}

/// Returns the bytes of words that probe-rs has printed as eight hexadecimal digits each.
fn words_of(text: &str, expected: usize) -> Result<Vec<u8>> {
    let words = text.split_whitespace().filter(|word| word.len() == 8);
    let words = words.filter_map(|word| u32::from_str_radix(word, 16).ok());
    let bytes: Vec<u8> = words.flat_map(u32::to_le_bytes).collect();
    (bytes.len() == 4 * expected)
        .then_some(bytes)
        .ok_or_else(|| anyhow!("probe-rs has printed {text:?}, not {expected} words"))
        .context("the flash cannot be read")
}

#[cfg(test)]
mod tests {
    use register_map::board::{MODIO_02, MODIO_08};

    use super::*;

    /// A board with these bytes in its flash.
    fn reader(flash: &[u8]) -> impl Fn(u32, u32) -> Result<Vec<u8>> {
        |address, length| {
            let at = (address - FLASH_BASE) as usize;
            Ok(flash[at..at + length as usize].to_vec())
        }
    }

    #[test]
    fn settings_move_only_to_an_image_of_the_other_kind() {
        let mut flash = vec![0xFF; 0x2_0000];
        let moved = |flash: &[u8], is_alone| {
            let held = holds_loader(&MODIO_02, reader(flash)).unwrap();
            let moved = settings(&MODIO_02, is_alone, held, reader(flash)).unwrap();
            moved.map(|(to, pages)| (to, pages.len()))
        };
        assert_eq!(moved(&flash, false), None, "a new part");
        record::encode_page(0, &[(0x0103, 1)], &mut flash[0xFC00..0x1_0000]).unwrap();
        assert_eq!(moved(&flash, false), Some((0x0801_F800, 2048)));
        assert_eq!(moved(&flash, true), None);

        flash.fill(0xFF);
        record::encode_page(0, &[(0x0103, 1)], &mut flash[0x1_F800..0x1_FC00]).unwrap();
        flash[0x1_1800..][..512].fill(0);
        flash[0x1_1800..][..5].copy_from_slice(b"MODI\x02");
        assert_eq!(moved(&flash, false), None);
        assert_eq!(moved(&flash, true), Some((0x0800_F800, 2048)));
        // An image that runs alone replaces the loader for good.
        for (address, bytes) in forgotten(&MODIO_02, Slot::B) {
            let at = (address - FLASH_BASE) as usize;
            flash[at..at + bytes.len()].copy_from_slice(&bytes);
        }
        assert_eq!(moved(&flash, true), None);

        let unread = |_, _| Err(anyhow!("not read"));
        assert!(holds_loader(&MODIO_02, unread).is_err());
        let same = settings(&MODIO_08, false, false, unread).unwrap();
        assert_eq!(same, None, "the same pages");
    }

    #[test]
    fn boot_state_and_the_first_page_of_the_other_slot_are_erased() {
        let regions = loaded(&MODIO_02, Slot::B, vec![1; 100], vec![2; 600]);
        let places = regions
            .iter()
            .map(|(at, bytes)| (*at, bytes.len(), bytes[0]));
        let expected = [
            (0x0800_0000, 100, 1),
            (0x0800_4000, 1024, 0xFF),
            (0x0801_1800, 600, 2),
            (0x0801_F000, 2048, 0xFF),
        ];
        assert!(places.eq(expected), "{regions:?}");
    }

    #[test]
    fn words_of_probe_rs_are_little_endian_bytes() {
        let text = "49444f4d 00010002\n";
        assert_eq!(words_of(text, 2).unwrap(), *b"MODI\x02\0\x01\0");
        let table = "08004000: 49444f4d 00010002";
        assert_eq!(words_of(table, 2).unwrap().len(), 8);
        assert!(words_of("49444f4d", 2).is_err());
    }

    #[test]
    fn option_bytes_protect_16_kib_and_each_has_its_complement() {
        let pairs = PROTECTED.as_chunks::<2>().0;
        assert!(pairs.iter().all(|[byte, complement]| *byte == !complement));
        assert_eq!(PROTECTED[0], 0xA5, "not read-protected");
        assert_eq!(
            PROTECTED[8].count_zeros() * 4 * 1024,
            register_map::layout::LOADER
        );
    }
}
