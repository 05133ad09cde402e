//! Learns the names of a unit: from the unit's own description of its registers, or from a stored copy.

use std::path::{Path, PathBuf};

use etcetera::BaseStrategy;
use modio_description::{Description, FILE, HEAD, checksum, describe, records};
use register_map::configuration::{MODULE, RANGE, SCALE};
use register_map::{Module, Row, points, state};

use super::{Device, with_modules};
use crate::failure::Failure;
use crate::names::Book;

/// Number of records that one request reads. A response can contain 124; the margin is for gateways with small
/// buffers.
const RECORDS: u16 = 100;

/// Number of times that a description with a wrong CRC is read again: the modules of the unit may have changed
/// during the read.
const TIMES: u8 = 2;

/// Knowledge about a unit.
#[derive(Clone, Debug)]
pub struct Learned {
    /// Names of the unit.
    pub book: Book,
    /// Source of the description, for people.
    pub source: String,
}

/// Learns the names of a unit. A unit that is not a modio has no names, only addresses.
pub async fn fetch(device: &mut Device) -> Result<Learned, Failure> {
    let Some((description, source)) = description(device).await? else {
        return Ok(Learned {
            book: Book::default(),
            source: "nothing: the unit is not a modio".to_owned(),
        });
    };
    let readings = readings(device, &description).await?;
    Ok(Learned {
        book: Book::new(description, readings),
        source,
    })
}

/// Learns the names of a unit as they are with the modules that were set last. Settings by point and links belong to these
/// modules, which may not be in force yet.
pub async fn fetch_set(device: &mut Device) -> Result<Book, Failure> {
    let book = fetch(device).await?.book;
    let description = book.of_modio()?.clone();
    let modules = device.read_words(MODULE, points::PORTS).await?;
    let set = |port: u8| modules.get(usize::from(port.max(1)) - 1).copied();
    let description = with_modules(description, set);
    let readings = readings(device, &description).await?;
    Ok(Book::new(description, readings))
}

/// Returns the unit's description and its source; `None` for a unit that is not a modio.
async fn description(device: &mut Device) -> Result<Option<(Description, String)>, Failure> {
    if !is_modio(device).await? {
        return Ok(None);
    }
    let known = known(device).await?;
    let Some([own]) = read(device, state::DESCRIPTION_CRC).await? else {
        // The firmware is too old to describe itself.
        return Ok(known.map(|known| (known, "this program: the unit has none".to_owned())));
    };
    let same = |description: &Description| checksum(&description.encode()) == own;
    if !device.refresh
        && let Some(known) = known.filter(same)
    {
        return Ok(Some((known, "this program, which knows it".to_owned())));
    }
    let path = path(device).await?;
    if !device.refresh
        && let Some(path) = &path
        && let Some(kept) = kept(path).filter(same)
    {
        return Ok(Some((kept, format!("file {}", path.display()))));
    }
    let file = read_file(device).await?;
    let read = Description::open(&file).map_err(|error| {
        Failure::Refused(format!(
            "the unit's description cannot be used ({error}): a newer modioctl may be needed"
        ))
    })?;
    let kept = match &path {
        Some(path) => keep(path, &file).map_err(|error| format!("{}: {error}", path.display())),
        None => Err("the unit has no identity, or this user has no home directory".to_owned()),
    };
    if let Err(why) = kept {
        eprintln!(
            "modioctl: the description is not stored, so the next command reads it again ({why})"
        );
    }
    Ok(Some((read, "the unit".to_owned())))
}

/// Returns what this program knows about the unit from its own register map, without asking for the unit's
/// description; `None` for a unit that is not a modio, or whose board is newer than this program.
pub async fn known(device: &mut Device) -> Result<Option<Description>, Failure> {
    let head = read(device, state::PRODUCT_CODE).await?;
    let Some([high, low, version, patch, _, code]) = head else {
        return Ok(None);
    };
    let product = u32::from(high) << 16 | u32::from(low);
    let Some(board) = Row::from_code(code).filter(|_| product == state::PRODUCT) else {
        return Ok(None);
    };
    let modules = device
        .read_words(state::MODULE_IN_FORCE, points::PORTS)
        .await?;
    // The first firmware has no such register.
    let [build] = read(device, state::BUILD).await?.unwrap_or_default();
    let firmware = state::version([version, patch], build).to_string();
    let module = |port: u16| {
        let code = modules.get(usize::from(port) - 1).copied();
        code.and_then(Module::from_code).unwrap_or(Module::None)
    };
    Ok(Some(describe(board, &firmware, module)))
}

async fn is_modio(device: &mut Device) -> Result<bool, Failure> {
    let words = read(device, state::PRODUCT_CODE).await?;
    Ok(words == Some([(state::PRODUCT >> 16) as u16, state::PRODUCT as u16]))
}

/// Reads registers; `None` for a unit that refuses.
async fn read<const N: usize>(
    device: &mut Device,
    first: u16,
) -> Result<Option<[u16; N]>, Failure> {
    match device.read_words(first, N as u16).await {
        Ok(words) => Ok(words.try_into().ok()),
        Err(Failure::Refused(_)) => Ok(None),
        Err(failure) => Err(failure),
    }
}

/// Returns file 1 of the unit, as bytes with a valid CRC.
async fn read_file(device: &mut Device) -> Result<Vec<u8>, Failure> {
    eprintln!("modioctl: reading the unit's description");
    let mut last = None;
    for _ in 0..TIMES {
        let mut file = device.read_records(FILE, 0, HEAD).await?;
        let length = file
            .first_chunk::<2>()
            .map_or(0, |length| u16::from_be_bytes(*length));
        let mut next = HEAD;
        while next < records(length) {
            let count = (records(length) - next).min(RECORDS);
            file.extend(device.read_records(FILE, next, count).await?);
            next += count;
        }
        match Description::open(&file) {
            Err(
                error @ (modio_description::Error::Crc { .. }
                | modio_description::Error::Short { .. }),
            ) => {
                last = Some(error);
            }
            _ => return Ok(file),
        }
    }
    let why = last.map_or_else(String::new, |error| error.to_string());
    Err(Failure::Garbled(format!(
        "the unit's description cannot be read completely ({why})"
    )))
}

/// Returns RANGE and SCALE of every point.
async fn readings(
    device: &mut Device,
    description: &Description,
) -> Result<Vec<(u16, u16)>, Failure> {
    let address = |name: &str, known: u16| {
        let register = description.registers.iter().find(|r| r.name == name);
        register.map_or(known, |register| register.address)
    };
    let (range, scale) = (address("RANGE", RANGE), address("SCALE", SCALE));
    let ranges = device.read_words(range, points::COUNT).await?;
    let scales = device.read_words(scale, points::COUNT).await?;
    Ok(ranges.into_iter().zip(scales).collect())
}

/// Returns the file that stores the unit's description; `None` without a home directory, or when the unit has no unique
/// identity. Its name has the identity and the version of the firmware: a CRC of 16 bits could be that of another unit.
async fn path(device: &mut Device) -> Result<Option<PathBuf>, Failure> {
    let Ok(strategy) = etcetera::choose_base_strategy() else {
        return Ok(None);
    };
    let identity: Option<[u16; 6]> = read(device, state::UNIQUE_ID).await?;
    let version: Option<[u16; 2]> = read(device, state::FIRMWARE_VERSION).await?;
    let (Some(identity), Some(version)) = (identity, version) else {
        return Ok(None);
    };
    let words = identity.iter().chain(&version);
    let digits: String = words.map(|word| format!("{word:04x}")).collect();
    let directory = strategy.cache_dir().join("modio");
    Ok(Some(directory.join(format!("description-{digits}.bin"))))
}

fn kept(path: &Path) -> Option<Description> {
    Description::open(&std::fs::read(path).ok()?).ok()
}

/// Stores a description.
fn keep(path: &Path, file: &[u8]) -> std::io::Result<()> {
    // Write another file and rename it, so that the file is never incomplete.
    let new = path.with_extension(format!("{}.new", std::process::id()));
    let written = path
        .parent()
        .map_or(Ok(()), std::fs::create_dir_all)
        .and_then(|()| std::fs::write(&new, file));
    let kept = written.and_then(|()| std::fs::rename(&new, path));
    if kept.is_err() {
        let _ = std::fs::remove_file(&new);
    }
    kept
}
