//! A release from files that were built without a key, and from their signatures.

use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use ed25519_dalek::VerifyingKey;
use fs_err as fs;
use register_map::Board;
use register_map::first_32_bits;
use register_map::update::Header;

use super::board;
use crate::keys::Release;
use crate::signed;
use crate::sources::Sources;

/// Files of the first step that the release has not: they are in those that are made of them.
const UNSIGNED: [&str; 2] = [".image", ".tbs"];

/// Copies the files that need no signature, and makes those of the boards that do.
pub fn finish(
    files: &Path,
    signatures: &Path,
    sources: &Sources,
    (public, keys): (&[VerifyingKey; 2], &Release),
    out: &Path,
) -> Result<()> {
    for file in fs::read_dir(files)? {
        let name = file?.file_name().to_string_lossy().into_owned();
        let is_unsigned = UNSIGNED.iter().any(|ending| name.ends_with(ending));
        if !is_unsigned && name != "SHA256SUMS" {
            fs::copy(files.join(&name), out.join(&name))?;
        }
    }
    for board in Board::ALL {
        let signed = board::slots(board).map(|name| {
            let of = || -> Result<Vec<u8>> {
                let mut image = fs::read(files.join(format!("{name}.image")))?;
                of_these(&image, sources)?;
                let signature = fs::read(signatures.join(format!("{name}.sig")))?;
                let by = signed::put_signature(&mut image, &signature, public)?;
                keys.check_second(public, by)?;
                Ok(image)
            };
            of().with_context(|| name.clone())
        });
        let [a, b] = signed;
        board::finish(board, out, &[a?, b?])?;
    }
    Ok(())
}

/// Refuses an image of other sources.
fn of_these(image: &[u8], sources: &Sources) -> Result<()> {
    let header = Header::of(image).ok().context("not an image")?;
    ensure!(
        header.commit() == first_32_bits(&sources.commit) && header.epoch() == sources.epoch,
        "commit {:08x} and epoch {} are not those of these sources",
        header.commit(),
        header.epoch()
    );
    Ok(())
}
