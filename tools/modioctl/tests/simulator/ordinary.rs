//! The program as an ordinary user runs it. Root may open every port, so a test that root runs proves nothing about
//! ports.

use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;

const NOBODY: u32 = 65534;

/// The program in a folder that every user may read.
pub struct Ordinary {
    folder: tempfile::TempDir,
    /// Whether this test may give files and processes to other users.
    pub is_root: bool,
}

impl Ordinary {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::set_permissions(folder.path(), PermissionsExt::from_mode(0o755)).unwrap();
        // By another process: a child that a thread starts while this process writes the file would keep it open, and
        // a program that is open for writing cannot be started.
        let copied = Command::new("cp")
            .arg(env!("CARGO_BIN_EXE_modioctl"))
            .arg(folder.path())
            .status();
        assert!(copied.unwrap().success());
        let is_root = chown(folder.path(), Some(NOBODY), None).is_ok();
        Self { folder, is_root }
    }

    /// Gives a port to the ordinary user.
    pub fn give(&self, port: &Path) {
        if self.is_root {
            chown(port, Some(NOBODY), Some(NOBODY)).unwrap();
        }
    }

    /// Returns the program with these arguments.
    pub fn modioctl(&self, arguments: &[&str]) -> Command {
        self.command(self.folder.path().join("modioctl"), arguments)
    }

    /// Returns any program with these arguments.
    pub fn command(&self, program: impl AsRef<Path>, arguments: &[&str]) -> Command {
        let mut command = Command::new(program.as_ref());
        command.args(arguments);
        if self.is_root {
            command.uid(NOBODY).gid(NOBODY);
        }
        command
    }
}
