//! Keeps the flash in a file (`--flash`): read at the start, and kept up to date while the unit runs.
//!
//! The file has the bytes of the flash. It is never written in place: the simulator writes the new contents into a file
//! beside it and renames that file. So the file always has the complete old or the complete new contents, also when the
//! simulator is killed.

use std::fs::{self, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use sim::Board;

/// The file, and which state of the flash it has.
#[derive(Debug)]
pub struct FlashFile {
    /// Path of the file itself, with symlinks followed, so that a symlink is not replaced.
    path: PathBuf,
    /// [`sim::Chip::flash_changes`] of the contents; `None` if the file has not been written yet, or if the last
    /// attempt has failed.
    holds: Option<u64>,
    /// The last write error.
    reported: Option<String>,
    /// A change that the start made to the firmware in the file, if a user might not expect the change.
    pub note: Option<&'static str>,
}

impl FlashFile {
    /// Returns the flash file at `path`, and its contents if it exists. `size` is the size of the flash in bytes.
    ///
    /// # Errors
    ///
    /// In one line: the file cannot be read or written, or has another size.
    pub fn open(path: &Path, size: usize) -> Result<(Self, Option<Vec<u8>>), String> {
        let failed = |error: &dyn std::fmt::Display| cannot(path, error);
        let (path_to, contents) = match path.metadata() {
            Err(error) if error.kind() == io::ErrorKind::NotFound => (path.to_owned(), None),
            Err(error) => return Err(failed(&error)),
            // Reading a pipe or a device could block, and renaming would replace it by a file.
            Ok(metadata) if !metadata.is_file() => return Err(failed(&"it is not a file")),
            Ok(metadata) if metadata.len() != size as u64 => {
                return Err(failed(&format_args!(
                    "it has {} bytes, but the flash has {size}",
                    metadata.len()
                )));
            }
            Ok(_) => {
                // Respect a write protection of the file: renaming would ignore it.
                OpenOptions::new()
                    .write(true)
                    .open(path)
                    .map_err(|error| failed(&error))?;
                let contents = fs::read(path).map_err(|error| failed(&error))?;
                (
                    path.canonicalize().map_err(|error| failed(&error))?,
                    Some(contents),
                )
            }
        };
        let file = Self {
            path: path_to,
            holds: None,
            reported: None,
            note: None,
        };
        Ok((file, contents))
    }

    /// Returns what [`note`](Self::note) says of the file.
    pub fn noted(&self) -> Option<String> {
        let note = self.note?;
        Some(format!("{}: {note}", self.path.display()))
    }

    /// Writes the file if the flash has changed since the last call.
    ///
    /// # Errors
    ///
    /// In one line, why the file cannot be written. The next call tries again.
    pub fn keep(&mut self, board: &Board) -> Result<(), String> {
        let changes = board.flash_changes();
        if self.holds == Some(changes) {
            return Ok(());
        }
        self.holds = None;
        self.replace(board.flash())
            .map_err(|error| cannot(&self.path, &error))?;
        self.holds = Some(changes);
        self.reported = None;
        Ok(())
    }

    /// Does the same as [`keep`](Self::keep). Returns an error, but not the same one again and again.
    pub fn keep_or_report(&mut self, board: &Board) -> Option<String> {
        let what = self.keep(board).err()?;
        let is_new = self.reported.as_ref() != Some(&what);
        self.reported = Some(what);
        self.reported.clone().filter(|_| is_new)
    }

    fn replace(&self, contents: &[u8]) -> io::Result<()> {
        let mut name = self.path.file_name().unwrap_or_default().to_owned();
        // The process number keeps two simulators with the same flash file from writing into the same new file.
        name.push(format!(".{}.tmp", std::process::id()));
        let beside = self.path.with_file_name(name);
        let written = fs::write(&beside, contents)
            .and_then(|()| match self.path.metadata() {
                Ok(old) => fs::set_permissions(&beside, old.permissions()),
                Err(_) => Ok(()),
            })
            .and_then(|()| fs::rename(&beside, &self.path));
        if written.is_err() {
            // Remove what was written. This fails if the file could not be made at all, which does not matter.
            let _ = fs::remove_file(&beside);
        }
        written
    }
}

fn cannot(path: &Path, why: &dyn std::fmt::Display) -> String {
    format!("cannot keep the flash in {}: {why}", path.display())
}

#[cfg(test)]
mod tests {
    use super::super::testing;
    use super::*;

    const FLASH_SIZE: usize = sim::board::MODIO_02.part.flash_size;
    use register_map::Module;

    fn entries(directory: &Path) -> usize {
        fs::read_dir(directory).unwrap().count()
    }

    #[test]
    fn file_is_written_only_when_the_flash_has_changed() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("flash");
        let mut board = testing::board(Module::Di4);
        let (mut file, contents) = FlashFile::open(&path, FLASH_SIZE).unwrap();
        assert_eq!(contents, None);
        file.keep(&board).unwrap();
        assert_eq!(fs::read(&path).unwrap(), board.flash());

        fs::write(&path, b"ours").unwrap();
        file.keep(&board).unwrap();
        assert_eq!(
            fs::read(&path).unwrap(),
            b"ours",
            "the flash has not changed"
        );

        board.patch_code(0x0800_8000, b"news").unwrap();
        file.keep(&board).unwrap();
        assert_eq!(fs::read(&path).unwrap(), board.flash());
        assert_eq!(entries(directory.path()), 1, "no temporary file is left");
        let (_, contents) = FlashFile::open(&path, FLASH_SIZE).unwrap();
        assert_eq!(contents.as_deref(), Some(board.flash()));
    }

    #[test]
    fn file_that_is_not_a_flash_is_refused_in_one_line() {
        let directory = tempfile::tempdir().unwrap();
        let refused = |path: &Path, part: &str| {
            let text = FlashFile::open(path, FLASH_SIZE).unwrap_err();
            assert!(text.contains(part) && !text.contains('\n'), "{text}");
            assert!(text.contains(path.to_str().unwrap()), "{text}");
        };
        refused(directory.path(), "not a file");
        let path = directory.path().join("flash");
        for length in [0, FLASH_SIZE - 1, FLASH_SIZE + 1] {
            fs::write(&path, vec![0xFF; length]).unwrap();
            refused(&path, &format!("{length} bytes"));
        }
        if cfg!(unix) {
            refused(Path::new("/dev/null"), "not a file");
            refused(&path.join("below"), "Not a directory");
        }
    }

    #[test]
    fn missing_directory_is_reported_and_the_write_is_tried_again() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("missing").join("flash");
        let board = testing::board(Module::Di4);
        let (mut file, _) = FlashFile::open(&path, FLASH_SIZE).unwrap();
        let text = file.keep(&board).unwrap_err();
        assert!(
            text.contains("missing") && text.contains(testing::NO_DIRECTORY),
            "{text}"
        );
        fs::create_dir(path.parent().unwrap()).unwrap();
        file.keep(&board).unwrap();
        assert_eq!(fs::read(&path).unwrap(), board.flash());
    }

    #[cfg(unix)]
    #[test]
    fn replacing_the_file_keeps_a_symlink_and_the_permissions() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("flash");
        let link = directory.path().join("link");
        fs::write(&path, vec![0xFF; FLASH_SIZE]).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).unwrap();
        symlink(&path, &link).unwrap();
        let board = testing::board(Module::Di4);
        let (mut file, _) = FlashFile::open(&link, FLASH_SIZE).unwrap();
        file.keep(&board).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&path).unwrap(), board.flash());
        assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o600);
    }
}
