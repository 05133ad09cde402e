//! Files that the user names.

use std::fs::{File, metadata};
use std::io::Read as _;
use std::path::Path;

/// Reads a file of at most this number of bytes. Refuses a pipe or a device, because a read of it may not end.
///
/// # Errors
///
/// What is wrong with the file.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>, String> {
    let said = |error: std::io::Error| error.to_string();
    // To open a pipe would wait for somebody who writes to it.
    if !metadata(path).map_err(said)?.is_file() {
        return Err(
            "not a file, but a pipe, a device or a folder: copy it to a file first".to_owned(),
        );
    }
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(said)?;
    file.take(most + 1).read_to_end(&mut bytes).map_err(said)?;
    if bytes.len() as u64 > most {
        return Err(format!("longer than {} KiB", most / 1024));
    }
    Ok(bytes)
}
