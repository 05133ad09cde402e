//! Files that the user names.

use std::fs::{File, metadata};
use std::io::Read as _;
use std::path::Path;

/// Longest file that is read, in bytes: more than any file for this program has.
const MOST: u64 = 1 << 20;

/// Reads a file. Refuses a pipe or a device, because a read of it may not end.
///
/// # Errors
///
/// What is wrong with the file.
pub fn read(path: &Path) -> Result<Vec<u8>, String> {
    let said = |error: std::io::Error| error.to_string();
    // To open a pipe would wait for somebody who writes to it.
    if !metadata(path).map_err(said)?.is_file() {
        return Err(
            "not a file, but a pipe, a device or a folder: copy it to a file first".to_owned(),
        );
    }
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(said)?;
    file.take(MOST + 1).read_to_end(&mut bytes).map_err(said)?;
    if bytes.len() as u64 > MOST {
        return Err(format!("longer than {} KiB", MOST / 1024));
    }
    Ok(bytes)
}

/// Returns the text in the bytes of a file.
///
/// # Errors
///
/// What the file is instead.
pub fn text(bytes: &[u8]) -> Result<&str, &'static str> {
    if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
        return Err("is UTF-16, as `>` of PowerShell writes it, and not UTF-8");
    }
    let text = str::from_utf8(bytes).map_err(|_| "is not a text in UTF-8")?;
    // Some editors begin a file with a byte order mark.
    Ok(text.trim_start_matches('\u{FEFF}'))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_device_or_a_pipe_is_refused_before_it_is_read_and_so_is_a_long_file() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        for path in [&pipe, Path::new("/dev/zero")] {
            let why = "not a file, but a pipe, a device or a folder: copy it to a file first";
            assert_eq!(read(path).unwrap_err(), why);
        }
        let long = folder.path().join("long");
        let file = File::create(&long).unwrap();
        file.set_len(MOST + 1).unwrap();
        assert_eq!(read(&long).unwrap_err(), "longer than 1024 KiB");
    }
}
