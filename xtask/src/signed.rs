//! `cargo xtask image`: the file of an update, with the signed images for both slots.

use std::path::PathBuf;

use anyhow::{Context as _, Result, ensure};
use ed25519_dalek::{Signer as _, SigningKey};
use fs_err as fs;
use register_map::layout::HEADER;
use register_map::part::FLASH_BASE;
use register_map::update::{Slot, crc32};
use register_map::{Board, first_32_bits};
use semver::Version;
use sha2::{Digest as _, Sha512};

use crate::error::usage;
use crate::workspace::Workspace;
use crate::{build, image};

/// The key that everybody has.
const DEVELOPMENT: &str = "loader/keys/development.key";

/// The options of `cargo xtask image`.
#[derive(clap::Args, Debug)]
pub struct Options {
    #[command(flatten)]
    build: build::Options,

    /// Private key, 64 hexadecimal digits; without it the development key, which everybody has
    #[arg(long, value_name = "FILE")]
    key: Option<PathBuf>,

    /// Security epoch: once an image is confirmed, no image with a lower one is accepted
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    epoch: u16,

    /// Where to write the file; without it BOARD.modio beside the images
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
}

impl Options {
    /// Returns the options for a board, with the development key.
    pub fn of(board: &'static Board) -> Self {
        Self {
            build: build::Options { board },
            key: None,
            epoch: 0,
            output: None,
        }
    }
}

/// `cargo xtask image`.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let (_, file) = update(workspace, options)?;
    say!("{}", file.display());
    Ok(())
}

/// Builds and signs the images for both slots, and makes the file of an update. Returns the files of the images, A
/// first, and that file.
pub fn update(workspace: &mut Workspace, options: &Options) -> Result<([PathBuf; 2], PathBuf)> {
    let mut image = |slot| image(workspace, options, slot);
    let slots = [image(Slot::A)?, image(Slot::B)?];
    let [a, b] = &slots;
    let board = options.build.board;
    let beside = || a.with_file_name(format!("{board}.modio"));
    let output = options.output.clone().unwrap_or_else(beside);
    fs::write(&output, file(&[fs::read(a)?, fs::read(b)?]))?;
    Ok((slots, output))
}

/// Builds the image for a slot, signs it, and returns its file.
pub fn image(workspace: &mut Workspace, options: &Options, slot: Slot) -> Result<PathBuf> {
    let board = options.build.board;
    let path = options.key.clone();
    let path = path.unwrap_or_else(|| workspace.root.join(DEVELOPMENT));
    let key = key(&fs::read_to_string(&path).map_err(|error| usage(error.to_string()))?)
        .with_context(|| path.display().to_string())?;
    let elf = build::slot(workspace, board, slot)?;
    let image = of_slot(board, slot, &image::read(&elf)?, &key, options.epoch)?;
    let file = elf.with_extension("image");
    fs::write(&file, image)?;
    Ok(file)
}

/// Returns the key of a file with 64 hexadecimal digits.
fn key(text: &str) -> Result<SigningKey> {
    let digits = text.trim();
    let byte = |at| u8::from_str_radix(digits.get(at..at + 2)?, 16).ok();
    let bytes: Option<Vec<u8>> = (0..digits.len()).step_by(2).map(byte).collect();
    let bytes = bytes.and_then(|bytes| <[u8; 32]>::try_from(bytes).ok());
    let bytes = bytes.context("not a private key: 64 hexadecimal digits are needed")?;
    Ok(SigningKey::from_bytes(&bytes))
}

/// Returns the signed image for a slot: the header, and the application in an ELF file.
pub fn of_slot(
    board: &Board,
    slot: Slot,
    elf: &[u8],
    key: &SigningKey,
    epoch: u16,
) -> Result<Vec<u8>> {
    let layout = board.layout();
    let address = layout.slots[slot as usize];
    let mut flash = image::flat(elf, board.memory().part.flash)?;
    let start = (address + HEADER - FLASH_BASE) as usize;
    let erased = |bytes: &[u8]| bytes.iter().all(|byte| *byte == 0xFF);
    let begins = flash
        .get(start..start + 4)
        .is_some_and(|bytes| !erased(bytes));
    ensure!(
        begins && erased(&flash[..start]),
        "the image is not linked for {address:#010x}"
    );
    let mut application = flash.split_off(start);
    application.resize(application.len().next_multiple_of(4), 0xFF);
    ensure!(
        application.len() as u32 <= layout.slot - HEADER,
        "the image takes {} bytes, more than the {} of a slot",
        application.len(),
        layout.slot - HEADER
    );
    let mut header = vec![0; HEADER as usize];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    let version: Version = env!("CARGO_PKG_VERSION").parse()?;
    put(0, b"MODI");
    put(4, &[2, board.code as u8]);
    put(6, &epoch.to_le_bytes());
    put(8, &[version.major as u8, version.minor as u8]);
    put(10, &(version.patch as u16).to_le_bytes());
    put(12, &address.to_le_bytes());
    put(16, &(application.len() as u32).to_le_bytes());
    put(24, &first_32_bits(register_map::commit!()).to_le_bytes());
    put(28, &Sha512::digest(&application));
    let crc = crc32([&header[..20], &application]);
    header[20..24].copy_from_slice(&crc.to_le_bytes());
    let signature = key.sign(&header[..92]).to_bytes();
    header[92..156].copy_from_slice(&signature);
    let fingerprint = Sha512::digest(key.verifying_key().as_bytes());
    header[156..160].copy_from_slice(&fingerprint[..4]);
    header.extend(application);
    Ok(header)
}

/// Returns the file of an update: both images, each padded to 128 bytes, and the manifest.
fn file(images: &[Vec<u8>]) -> Vec<u8> {
    const BLOCK: usize = 128;
    let mut file = Vec::new();
    let mut manifest = b"MODM\x01\0\0\0".to_vec();
    for image in images {
        for number in [file.len(), image.len()] {
            manifest.extend((number as u32).to_le_bytes());
        }
        file.extend(image);
        file.resize(file.len().next_multiple_of(BLOCK), 0xFF);
    }
    manifest.extend(Sha512::digest(&file));
    manifest.resize(BLOCK - 4, 0);
    let crc = crc32([&manifest, &[]]);
    manifest.extend(crc.to_le_bytes());
    file.extend(manifest);
    file
}

#[cfg(test)]
mod tests {
    use register_map::board::MODIO_02;
    use register_map::update::intact;

    use super::*;
    use crate::image::sample::{code, elf};

    #[test]
    fn image_of_a_slot_is_intact_and_signed_for_its_address() {
        let key = SigningKey::from_bytes(&[7; 32]);
        let [a, b] = MODIO_02.layout().slots;
        let bytes: Vec<u8> = (1..1002_u32).map(|n| (n * n) as u8).collect();
        let built = elf(&[code(b + HEADER, &bytes)], &[]);
        let image = of_slot(&MODIO_02, Slot::B, &built, &key, 3).unwrap();
        assert_eq!(image.len(), 512 + 1004);
        let mut slot = image.clone();
        slot.resize(54 * 1024, 0xFF);
        let header = intact(&slot, crc32).unwrap();
        assert_eq!(header.suits(MODIO_02.code as u8, b), Ok(()));
        assert_eq!(header.epoch(), 3);
        let signature = ed25519_dalek::Signature::from_bytes(&header.signature());
        let public = key.verifying_key();
        assert!(public.verify_strict(header.signed(), &signature).is_ok());
        assert_eq!(header.hash()[..], Sha512::digest(&image[512..])[..]);
        let error = of_slot(&MODIO_02, Slot::A, &built, &key, 3).unwrap_err();
        assert!(error.to_string().contains(&format!("{a:#010x}")), "{error}");
        let long = elf(&[code(b + HEADER, &vec![0; 54 * 1024 - 511])], &[]);
        assert!(of_slot(&MODIO_02, Slot::B, &long, &key, 3).is_err());
    }

    #[test]
    fn file_has_both_images_and_a_manifest_that_covers_them() {
        let images = [vec![1; 1000], vec![2; 1024]];
        let file = file(&images);
        assert_eq!(file.len(), 1024 + 1024 + 128);
        let (body, manifest) = file.split_at(2048);
        let number = |at: usize| u32::from_le_bytes(manifest[at..at + 4].try_into().unwrap());
        assert_eq!(&manifest[..5], b"MODM\x01");
        assert_eq!([8, 12, 16, 20].map(number), [0, 1000, 1024, 1024]);
        assert_eq!(manifest[24..88], Sha512::digest(body)[..]);
        assert_eq!(number(124), crc32([&manifest[..124], &[]]));
        assert_eq!(body[1000..1024], [0xFF; 24]);
    }

    #[test]
    fn development_key_belongs_to_the_first_public_key_of_the_loader() {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../loader/keys/development");
        let private = key(&fs::read_to_string(format!("{root}.key")).unwrap()).unwrap();
        let public = fs::read_to_string(format!("{root}.pub")).unwrap();
        let digits: String = private
            .verifying_key()
            .as_bytes()
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        assert_eq!(public.lines().next(), Some(&digits[..]));
        for wrong in ["", "12", "zz", &"é".repeat(32), &"00".repeat(33)] {
            assert!(key(wrong).is_err(), "{wrong}");
        }
    }
}
