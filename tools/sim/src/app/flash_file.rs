//! The flash in a file (`--flash`): read at the start, and kept up to date while the unit runs.
//!
//! The file has the bytes of the flash. It is never written in place: the new contents go into a file beside it, which
//! is then renamed. So the file always has the complete old or the complete new contents, also when the simulator is
//! killed.

use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use sim::Board;

/// The file and what it holds.
#[derive(Debug)]
pub struct FlashFile {
    /// Where the contents are, with links followed, so that a link stays one.
    path: PathBuf,
    /// [`Board::flash_changes`] of what it holds; `None` when it has not been written yet, or the last
    /// attempt has failed.
    holds: Option<u64>,
    /// The reason why it could not be written, which has been reported already.
    told: Option<String>,
}

impl FlashFile {
    /// The file at `path` of a flash of `size` bytes, and its contents when there is one.
    ///
    /// # Errors
    ///
    /// In one line: it cannot be read or written, or holds no flash of this part.
    pub fn open(path: &Path, size: usize) -> Result<(Self, Option<Vec<u8>>), String> {
        let told = |error: &dyn std::fmt::Display| cannot(path, error);
        let (path_to, contents) = match path.metadata() {
            Err(error) if error.kind() == io::ErrorKind::NotFound => (path.to_owned(), None),
            Err(error) => return Err(told(&error)),
            // A pipe or a device would block, or be replaced by a file.
            Ok(metadata) if !metadata.is_file() => return Err(told(&"it is not a file")),
            Ok(metadata) if metadata.len() != size as u64 => {
                return Err(told(&format_args!(
                    "it has {} bytes, the flash {size}",
                    metadata.len()
                )));
            }
            Ok(_) => {
                // Replacing it would get round a write protection that is meant.
                OpenOptions::new()
                    .write(true)
                    .open(path)
                    .map_err(|error| told(&error))?;
                let contents = fs::read(path).map_err(|error| told(&error))?;
                (
                    path.canonicalize().map_err(|error| told(&error))?,
                    Some(contents),
                )
            }
        };
        let file = Self {
            path: path_to,
            holds: None,
            told: None,
        };
        Ok((file, contents))
    }

    /// Brings the file up to date when the flash has changed since the last time.
    ///
    /// # Errors
    ///
    /// In one line, what keeps it from being written. The next call tries again.
    pub fn keep(&mut self, board: &Board) -> Result<(), String> {
        let changes = board.flash_changes();
        if self.holds == Some(changes) {
            return Ok(());
        }
        self.holds = None;
        self.replace(board.flash())
            .map_err(|error| cannot(&self.path, &error))?;
        self.holds = Some(changes);
        self.told = None;
        Ok(())
    }

    /// The same while the unit runs: a failure is reported on stderr, once as long as it stays the same.
    pub fn keep_or_tell(&mut self, board: &Board) {
        if let Err(what) = self.keep(board)
            && self.told.as_ref() != Some(&what)
        {
            // That nobody reads it is no reason to stop.
            let _ = writeln!(io::stderr(), "modio-sim: {what}");
            self.told = Some(what);
        }
    }

    fn replace(&self, contents: &[u8]) -> io::Result<()> {
        let mut name = self.path.file_name().unwrap_or_default().to_owned();
        // Two simulators on one file take turns, each with a whole one.
        name.push(format!(".{}.tmp", std::process::id()));
        let beside = self.path.with_file_name(name);
        let written = fs::write(&beside, contents)
            .and_then(|()| match self.path.metadata() {
                Ok(old) => fs::set_permissions(&beside, old.permissions()),
                Err(_) => Ok(()),
            })
            .and_then(|()| fs::rename(&beside, &self.path));
        if written.is_err() {
            // It is of no use half written; when it cannot be removed either, it was not made.
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
    fn it_is_written_when_the_flash_has_changed_and_only_then() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("flash");
        let mut board = testing::board(Module::Di4);
        let (mut file, contents) = FlashFile::open(&path, FLASH_SIZE).unwrap();
        assert_eq!(contents, None);
        file.keep(&board).unwrap();
        assert_eq!(fs::read(&path).unwrap(), board.flash());

        fs::write(&path, b"ours").unwrap();
        file.keep(&board).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"ours", "nothing has changed");

        board.patch_code(0x0800_8000, b"news").unwrap();
        file.keep(&board).unwrap();
        assert_eq!(fs::read(&path).unwrap(), board.flash());
        assert_eq!(entries(directory.path()), 1, "nothing is left beside it");
        let (_, contents) = FlashFile::open(&path, FLASH_SIZE).unwrap();
        assert_eq!(contents.as_deref(), Some(board.flash()));
    }

    #[test]
    fn what_is_no_flash_is_refused_in_one_line() {
        let directory = tempfile::tempdir().unwrap();
        let refused = |path: &Path, part: &str| {
            let text = FlashFile::open(path, FLASH_SIZE).unwrap_err();
            assert!(text.contains(part) && !text.contains('\n'), "{text}");
            assert!(text.contains(path.to_str().unwrap()), "{text}");
        };
        refused(directory.path(), "not a file");
        if cfg!(unix) {
            refused(Path::new("/dev/null"), "not a file");
        }
        let path = directory.path().join("flash");
        for length in [0, FLASH_SIZE - 1, FLASH_SIZE + 1] {
            fs::write(&path, vec![0xFF; length]).unwrap();
            refused(&path, &format!("{length} bytes"));
        }
        refused(&path.join("below"), "Not a directory");
    }

    #[test]
    fn a_folder_that_takes_no_file_is_reported_and_tried_again() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("missing").join("flash");
        let board = testing::board(Module::Di4);
        let (mut file, _) = FlashFile::open(&path, FLASH_SIZE).unwrap();
        let text = file.keep(&board).unwrap_err();
        assert!(
            text.contains("missing") && text.contains(testing::NOT_THERE),
            "{text}"
        );
        fs::create_dir(path.parent().unwrap()).unwrap();
        file.keep(&board).unwrap();
        assert_eq!(fs::read(&path).unwrap(), board.flash());
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_a_link_and_permissions_stay() {
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
