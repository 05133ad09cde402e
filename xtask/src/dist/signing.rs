//! A release from files that were built without a key, and from their signatures.

use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use fs_err as fs;
use register_map::layout::HEADER;
use register_map::update::{Slot, crc32, intact};
use register_map::{Row, first_32_bits};
use sha2::{Digest as _, Sha512};

use super::{board, sums};
use crate::keys::{Pair, Release};
use crate::signed;
use crate::sources::Sources;

/// Files of the first step that the release has not: they are in those that are made of them.
const UNSIGNED: [&str; 2] = [".image", ".tbs"];

/// The check sums of the files.
pub const SUMS: &str = "SHA256SUMS";

/// Copies the files that need no signature, and makes those of the boards that do.
pub fn finish(
    files: &Path,
    signatures: &Path,
    sources: &Sources,
    (pair, keys): (&Pair, &Release),
    out: &Path,
) -> Result<()> {
    let listed = fs::read_to_string(files.join(SUMS))?;
    ensure!(
        listed == sums(files)?,
        "the files in {} are not those of its {SUMS}",
        files.display()
    );
    for file in fs::read_dir(files)? {
        let name = file?.file_name().to_string_lossy().into_owned();
        let is_unsigned = UNSIGNED.iter().any(|ending| name.ends_with(ending));
        if !is_unsigned && name != SUMS {
            fs::copy(files.join(&name), out.join(&name))?;
        }
    }
    for board in Row::ALL {
        let signed = |slot: Slot| {
            let name = &board::slots(board)[slot as usize];
            let of = || -> Result<Vec<u8>> {
                let mut image = fs::read(files.join(format!("{name}.image")))?;
                check(&image, board, slot, sources)?;
                let signature = fs::read(signatures.join(format!("{name}.sig")))?;
                let by = signed::put_signature(&mut image, &signature, pair.keys())?;
                keys.check(pair, by)?;
                Ok(image)
            };
            of().with_context(|| name.clone())
        };
        board::finish(board, out, &[signed(Slot::A)?, signed(Slot::B)?])?;
    }
    Ok(())
}

/// Refuses an image that is damaged, of another board or slot, or of other sources.
pub fn check(image: &[u8], board: &Row, slot: Slot, sources: &Sources) -> Result<()> {
    let header = intact(image, crc32)
        .ok()
        .context("not an image, or damaged")?;
    let (commit, epoch) = (header.commit(), header.epoch());
    ensure!(
        commit == first_32_bits(&sources.commit) && epoch == sources.epoch,
        "commit {commit:08x} and epoch {epoch} are not those of these sources, {} and {}",
        sources.commit,
        sources.epoch
    );
    let address = board.layout().slots[slot as usize];
    let suits = header.suits(board.code as u8, address).is_ok();
    // The signature covers the header alone, which has this sum.
    let application = Sha512::digest(&image[HEADER as usize..]);
    ensure!(
        suits && header.hash()[..] == application[..],
        "the image is not the one of this board and slot"
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use register_map::board::{MODIO_02, MODIO_08};

    use super::*;
    use crate::image::sample::{code, elf};

    #[test]
    fn image_that_is_damaged_or_of_another_board_slot_or_commit_is_refused() {
        let sources = |commit: &str, epoch| Sources {
            version: "1.2.3".parse().unwrap(),
            commit: commit.to_owned(),
            epoch,
        };
        let own = sources("1a2b3c4d", 2);
        let address = MODIO_02.layout().slots[0] + HEADER;
        let built = elf(&[code(address, &[5; 1024])], &[]);
        let image = signed::unsigned(&MODIO_02, Slot::A, &built, &own).unwrap();
        let refused = |image: &[u8], board, slot, sources: &Sources, part: &str| {
            let error = check(image, board, slot, sources).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        };
        assert!(check(&image, &MODIO_02, Slot::A, &own).is_ok());
        refused(&image, &MODIO_02, Slot::B, &own, "this board and slot");
        refused(&image, &MODIO_08, Slot::A, &own, "this board and slot");
        let other = sources("1a2b3c4e", 2);
        refused(
            &image,
            &MODIO_02,
            Slot::A,
            &other,
            "commit 1a2b3c4d and epoch 2",
        );
        refused(&image, &MODIO_02, Slot::A, &sources("1a2b3c4d", 3), "and 3");
        let mut damaged = image.clone();
        damaged[900] ^= 1;
        refused(&damaged, &MODIO_02, Slot::A, &own, "damaged");
        // Another application with a CRC-32 that fits.
        let crc = crc32([&damaged[..20], &damaged[HEADER as usize..]]);
        damaged[20..24].copy_from_slice(&crc.to_le_bytes());
        refused(&damaged, &MODIO_02, Slot::A, &own, "this board and slot");
    }
}
