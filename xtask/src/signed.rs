//! `cargo xtask image` and `sign`: the file of an update, with the signed images for both slots.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, anyhow, ensure};
use ed25519_dalek::{Signature, Signer as _, SigningKey, VerifyingKey};
use fs_err as fs;
use register_map::layout::HEADER;
use register_map::part::FLASH_BASE;
use register_map::update::{BLOCK_BYTES, Manifest, Slot, crc32, intact};
use register_map::{Row, first_32_bits};
use sha2::{Digest as _, Sha512};

use crate::build::Program;
use crate::error::usage;
use crate::sources::Sources;
use crate::workspace::Workspace;
use crate::{build, image, keys};

/// The options of `cargo xtask image`.
#[derive(clap::Args, Debug)]
pub struct Options {
    #[command(flatten)]
    build: build::Options,

    #[command(flatten)]
    signature: How,

    #[command(flatten)]
    keys: keys::Trusted,

    /// Where to write the file; without it BOARD.modio beside the images
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// How an image is signed.
#[derive(clap::Args, Clone, Debug, Default)]
#[group(skip)]
pub struct How {
    /// Private key of `cargo xtask keygen`; without it the development key, which everybody has
    #[arg(long, value_name = "FILE")]
    key: Option<PathBuf>,

    /// The second key signs, to end the first one in every unit that confirms these images, for good
    #[arg(long)]
    end_first_key: bool,

    /// Security epoch: once an image is confirmed, no image with a lower one is accepted [default: that in the root
    /// Cargo.toml]
    #[arg(long, value_name = "NUMBER")]
    epoch: Option<u16>,
}

/// What signs images, and the epoch that they get.
pub struct Signer {
    key: SigningKey,
    epoch: Option<u16>,
    /// The keys that the loader trusts.
    pub trusted: keys::Pair,
}

impl How {
    /// Reads the keys. A private key by which the loader of this workspace would not start an image is refused.
    pub fn signer(&self, workspace: &Workspace) -> Result<Signer> {
        let key = keys::read(workspace, self.key.as_deref())?;
        let trusted = keys::Pair::of(workspace)?;
        trusted.check(&key.verifying_key(), self.end_first_key)?;
        let epoch = self.epoch;
        Ok(Signer {
            key,
            epoch,
            trusted,
        })
    }
}

/// The options of `cargo xtask sign`.
#[derive(clap::Args, Debug)]
pub struct Again {
    /// The file of an update
    #[arg(value_name = "FILE")]
    file: PathBuf,

    #[command(flatten)]
    keys: keys::Trusted,

    /// Private key of `cargo xtask keygen`
    #[arg(long, value_name = "FILE")]
    key: PathBuf,

    /// The second key signs, to end the first one in every unit that confirms this image, for good
    #[arg(long)]
    end_first_key: bool,

    /// Security epoch [default: that of the file, which must be that in the root Cargo.toml]
    #[arg(long, value_name = "NUMBER")]
    epoch: Option<u16>,

    /// Where to write the signed file; without it the file is replaced
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// `cargo xtask image`.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    options.keys.apply(workspace)?;
    let signer = options.signature.signer(workspace)?;
    if keys::is_development(&signer.key.verifying_key()) {
        eprintln!(
            "xtask: signed with a development key, which everybody has; --keys and --key name your own (docs/update.md, Keys)"
        );
    }
    let output = options.output.as_deref();
    let (_, file) = update_by(workspace, options.build.board, &signer, output)?;
    say!("{}", file.display());
    Ok(())
}

/// `cargo xtask sign`.
pub fn again(workspace: &mut Workspace, options: &Again) -> Result<()> {
    options.keys.apply(workspace)?;
    let how = How {
        key: Some(options.key.clone()),
        end_first_key: options.end_first_key,
        epoch: options.epoch,
    };
    let key = how.signer(workspace)?.key;
    let path = &options.file;
    let bytes = fs::read(path).map_err(|error| usage(error.to_string()))?;
    let mut images = images(&bytes).map_err(|why| usage(format!("{}: {why:#}", path.display())))?;
    let tree = workspace.sources()?.epoch;
    for image in &mut images {
        let own = u16::from_le_bytes([image[6], image[7]]);
        match options.epoch {
            Some(epoch) => put_epoch(image, epoch),
            None if own == tree => {}
            None => {
                return Err(usage(format!(
                    "the file has epoch {own}, and these sources have {tree}: --epoch {own} keeps it"
                )));
            }
        }
        sign(image, &key);
    }
    let output = options.output.as_ref().unwrap_or(path);
    fs::write(output, file(&images))?;
    say!("{}", output.display());
    Ok(())
}

/// Builds the images for both slots, signs them with the development key, and makes the file of an update. Returns the
/// files of the images, A first, and that file.
pub fn update(workspace: &mut Workspace, board: &Row) -> Result<([PathBuf; 2], PathBuf)> {
    let signer = How::default().signer(workspace)?;
    update_by(workspace, board, &signer, None)
}

fn update_by(
    workspace: &mut Workspace,
    board: &Row,
    signer: &Signer,
    output: Option<&Path>,
) -> Result<([PathBuf; 2], PathBuf)> {
    let mut image = |slot| image_by(workspace, board, slot, signer);
    let slots = [image(Slot::A)?, image(Slot::B)?];
    let [a, b] = &slots;
    let beside = || a.with_file_name(format!("{board}.modio"));
    let output = output.map_or_else(beside, Path::to_owned);
    fs::write(&output, file(&[fs::read(a)?, fs::read(b)?]))?;
    Ok((slots, output))
}

/// Builds the image for slot A, signs it with the development key, and returns its file.
pub fn image(workspace: &mut Workspace, board: &Row) -> Result<PathBuf> {
    let signer = How::default().signer(workspace)?;
    image_by(workspace, board, Slot::A, &signer)
}

/// Builds the image for a slot, signs it, and returns its file.
pub fn image_by(
    workspace: &mut Workspace,
    board: &Row,
    slot: Slot,
    signer: &Signer,
) -> Result<PathBuf> {
    let elf = build::program(workspace, board, Program::Slot(slot), None)?.elf;
    let mut sources = workspace.sources()?;
    sources.epoch = signer.epoch.unwrap_or(sources.epoch);
    let mut image = unsigned(board, slot, &image::read(&elf)?, &sources)?;
    sign(&mut image, &signer.key);
    let file = elf.with_extension("image");
    fs::write(&file, image)?;
    Ok(file)
}

/// Returns the image for a slot, not signed yet: the header, and the application in an ELF file.
pub fn unsigned(board: &Row, slot: Slot, elf: &[u8], sources: &Sources) -> Result<Vec<u8>> {
    let layout = board.layout();
    let address = layout.slots[slot as usize];
    let mut flash = image::flat(elf, board.memory.part.flash)?;
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
    let version = &sources.version;
    put(0, b"MODI");
    put(4, &[2, board.code as u8]);
    put(8, &[version.major as u8, version.minor as u8]);
    put(10, &(version.patch as u16).to_le_bytes());
    put(12, &address.to_le_bytes());
    put(16, &(application.len() as u32).to_le_bytes());
    put(24, &first_32_bits(&sources.commit).to_le_bytes());
    put(28, &Sha512::digest(&application));
    header.extend(application);
    put_epoch(&mut header, sources.epoch);
    Ok(header)
}

/// Gives an image a security epoch, and the CRC-32 that belongs to it.
fn put_epoch(image: &mut [u8], epoch: u16) {
    image[6..8].copy_from_slice(&epoch.to_le_bytes());
    let crc = crc32([&image[..20], &image[HEADER as usize..]]);
    image[20..24].copy_from_slice(&crc.to_le_bytes());
}

/// Returns the bytes of an image that are signed: the header up to the signature.
pub fn signed_part(image: &[u8]) -> &[u8] {
    &image[..92]
}

/// Returns the signature of an image.
pub fn signature(image: &[u8]) -> &[u8] {
    &image[92..156]
}

/// Gives an image a signature, and the number of the key that made it, which must be one of these.
/// Returns the key.
pub fn put_signature<'a>(
    image: &mut [u8],
    signature: &[u8],
    public: &'a [VerifyingKey],
) -> Result<&'a VerifyingKey> {
    let parsed = Signature::from_slice(signature);
    let parsed = parsed.map_err(|_| anyhow!("a signature has 64 bytes"))?;
    let made_it = |key: &&VerifyingKey| key.verify_strict(signed_part(image), &parsed).is_ok();
    let key = public.iter().find(made_it);
    let key = key.context("the signature is not of this image by one of the public keys")?;
    write_signature(image, &parsed, key);
    Ok(key)
}

fn write_signature(image: &mut [u8], signature: &Signature, by: &VerifyingKey) {
    image[92..156].copy_from_slice(&signature.to_bytes());
    image[156..160].copy_from_slice(&keys::first_bytes(by.as_bytes()));
}

/// Gives an image its signature.
pub fn sign(image: &mut [u8], key: &SigningKey) {
    let signature = key.sign(signed_part(image));
    write_signature(image, &signature, &key.verifying_key());
}

/// Returns the file of an update: both images, each padded to 128 bytes, and the manifest.
pub fn file(images: &[Vec<u8>; 2]) -> Vec<u8> {
    let mut file = Vec::new();
    let places = images.each_ref().map(|image| {
        let place = [file.len(), image.len()].map(|number| number as u32);
        file.extend(image);
        file.resize(file.len().next_multiple_of(BLOCK_BYTES), 0xFF);
        place
    });
    let manifest = Manifest {
        images: places,
        hash: Sha512::digest(&file).into(),
    };
    file.extend(manifest.encode());
    file
}

/// Returns the images in the file of an update. A damaged file is an error.
pub fn images(file: &[u8]) -> Result<[Vec<u8>; 2]> {
    let damaged = "not the file of an update, or damaged";
    let (body, manifest) = file.split_last_chunk().context(damaged)?;
    let manifest = Manifest::decode(manifest).context(damaged)?;
    let images = manifest.images_in(body).map(|image| {
        let image = image.filter(|image| intact(image, crc32).is_ok());
        image.map(<[u8]>::to_vec).context(damaged)
    });
    let [a, b] = images;
    let images = [a?, b?];
    // What follows from the images must be what is in the file.
    ensure!(self::file(&images) == file, damaged);
    Ok(images)
}

#[cfg(test)]
mod tests {
    use register_map::board::MODIO_02;

    use super::*;
    use crate::image::sample::{code, elf};

    fn of_slot(slot: Slot, elf: &[u8], key: &SigningKey, epoch: u16) -> Result<Vec<u8>> {
        let sources = Sources {
            version: "1.2.3-dev".parse()?,
            commit: "1a2b3c4d".to_owned(),
            epoch,
        };
        let mut image = unsigned(&MODIO_02, slot, elf, &sources)?;
        sign(&mut image, key);
        Ok(image)
    }

    #[test]
    fn image_of_a_slot_is_intact_and_signed_for_its_address() {
        let key = SigningKey::from_bytes(&[7; 32]);
        let [a, b] = MODIO_02.layout().slots;
        let bytes: Vec<u8> = (1..1002_u32).map(|n| (n * n) as u8).collect();
        let built = elf(&[code(b + HEADER, &bytes)], &[]);
        let image = of_slot(Slot::B, &built, &key, 3).unwrap();
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
        let error = of_slot(Slot::A, &built, &key, 3).unwrap_err();
        assert!(error.to_string().contains(&format!("{a:#010x}")), "{error}");
        let long = elf(&[code(b + HEADER, &vec![0; 54 * 1024 - 511])], &[]);
        assert!(of_slot(Slot::B, &long, &key, 3).is_err());
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
    fn signing_again_changes_the_signature_and_the_epoch_when_asked_and_is_the_same_each_time() {
        let [first, second] = [7, 8].map(|byte| SigningKey::from_bytes(&[byte; 32]));
        let of = |slot: Slot, key, epoch| {
            let address = MODIO_02.layout().slots[slot as usize] + HEADER;
            let built = elf(&[code(address, &[5; 1024])], &[]);
            of_slot(slot, &built, key, epoch).unwrap()
        };
        let signed = |key, epoch| file(&Slot::ALL.map(|slot| of(slot, key, epoch)));
        let [mut a, _] = images(&signed(&first, 0)).unwrap();
        let mut put = |from: Vec<u8>, public: &SigningKey| {
            let public = [public.verifying_key()];
            put_signature(&mut a, signature(&from), &public).map(drop)
        };
        assert!(put(of(Slot::A, &second, 0), &first).is_err());
        assert!(put(of(Slot::B, &first, 0), &first).is_err());
        assert!(put(of(Slot::A, &first, 4), &first).is_err());
        put(of(Slot::A, &second, 0), &second).unwrap();
        assert_eq!(a, of(Slot::A, &second, 0));

        let directory = tempfile::tempdir().unwrap();
        let [path, key, public] =
            ["modio-02.modio", "key", "keys.pub"].map(|name| directory.path().join(name));
        fs::write(&path, signed(&first, 0)).unwrap();
        fs::write(&key, "08".repeat(32)).unwrap();
        let line = |key: &SigningKey| {
            let bytes = key.verifying_key().to_bytes();
            bytes.map(|byte| format!("{byte:02x}")).concat() + "\n"
        };
        fs::write(&public, line(&first) + &line(&second)).unwrap();
        let mut options = Again {
            file: path.clone(),
            keys: keys::Trusted::of(&public),
            key,
            epoch: Some(4),
            end_first_key: true,
            output: None,
        };
        let mut workspace = Workspace::open().unwrap();
        for _ in 0..2 {
            again(&mut workspace, &options).unwrap();
            assert_eq!(fs::read(&path).unwrap(), signed(&second, 4));
        }
        options.end_first_key = false;
        let error = again(&mut workspace, &options).unwrap_err();
        assert!(error.to_string().contains("--end-first-key"), "{error}");
        options.end_first_key = true;
        for (at, length) in [(700, 3200), (3190, 3200), (0, 127)] {
            let mut damaged = signed(&first, 0);
            damaged[at] ^= 1;
            damaged.truncate(length);
            fs::write(&path, damaged).unwrap();
            let error = again(&mut workspace, &options).unwrap_err();
            assert!(error.to_string().contains("damaged"), "{at}: {error}");
        }
    }
}
