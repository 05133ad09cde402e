//! The machine xtask runs on, asked for toolchains.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use super::{Machine, TARGET};
use crate::command;

/// rustup fetches some 30 MB; a network that swallows packets must not hold the build for ever.
const RUSTUP_LIMIT: Duration = Duration::from_secs(120);

/// apt-get fetches some 150 MB.
const APT_LIMIT: Duration = Duration::from_secs(900);

/// The linker that rustc looks for. Debian's package brings it as a link to the lld of its LLVM, and
/// leaves that lld out.
const LINKER: &str = "/usr/bin/rust-lld";

type Answer = Result<(), String>;

/// This machine.
#[derive(Debug)]
pub struct ThisMachine {
    root: PathBuf,
}

impl ThisMachine {
    /// The machine, as seen from a project's directory, which may choose its toolchain.
    #[must_use]
    pub fn new(root: &Path) -> Self {
        Self {
            root: root.to_owned(),
        }
    }
}

impl Machine for ThisMachine {
    fn has_target(&mut self) -> bool {
        let sysroot = Command::new("rustc")
            .args(["--print", "sysroot"])
            .current_dir(&self.root)
            .output();
        sysroot.is_ok_and(|output| {
            let sysroot = String::from_utf8_lossy(&output.stdout);
            let target = Path::new(sysroot.trim()).join("lib/rustlib").join(TARGET);
            output.status.success() && target.join("lib").is_dir()
        })
    }

    fn add_target(&mut self) -> Answer {
        bounded(
            RUSTUP_LIMIT,
            Command::new("rustup")
                .args(["target", "add", TARGET])
                // Of its complaint one line is told, not a backtrace.
                .env_remove("RUST_BACKTRACE")
                .current_dir(&self.root),
        )
    }

    fn has_packages(&mut self, packages: &[&str]) -> bool {
        let output = Command::new("dpkg-query")
            .args(["--show", "--showformat", "${db:Status-Status}\\n"])
            .args(packages)
            .output();
        output.is_ok_and(|output| {
            let states = String::from_utf8_lossy(&output.stdout);
            states.lines().filter(|state| *state == "installed").count() == packages.len()
        }) && Path::new(LINKER).exists()
    }

    fn may_install(&mut self) -> Answer {
        if !Path::new("/usr/bin/apt-get").exists() {
            return Err("there is no apt-get here".to_owned());
        }
        let user =
            command::read(Command::new("id").arg("-u")).map_err(|error| error.to_string())?;
        if user.trim() == "0" {
            Ok(())
        } else {
            Err("the packages are not installed, and only root may install them".to_owned())
        }
    }

    fn install(&mut self, packages: &[&str]) -> Answer {
        let apt = || {
            let mut command = Command::new("/usr/bin/apt-get");
            command.env("DEBIAN_FRONTEND", "noninteractive").args([
                "-q",
                "-o",
                "Acquire::Retries=1",
                "-o",
                "Acquire::http::Timeout=15",
            ]);
            command
        };
        bounded(APT_LIMIT, apt().arg("update"))?;
        let install = |packages: &[&str]| {
            bounded(
                APT_LIMIT,
                apt()
                    .args(["install", "-y", "--no-install-recommends"])
                    .args(packages),
            )
        };
        install(packages)?;
        match missing_linker(Path::new(LINKER)) {
            Some(package) => install(&[&package]),
            None => Ok(()),
        }
    }

    fn debian_is_new_enough(&mut self) -> Answer {
        let version = command::read(Command::new("/usr/bin/rustc").arg("--version"))
            .map_err(|error| error.to_string())?;
        new_enough(&version, env!("CARGO_PKG_RUST_VERSION"))
    }
}

/// The package of the lld that a dangling link names: `rust-lld -> lld-22` is in `lld-22`.
fn missing_linker(link: &Path) -> Option<String> {
    if link.exists() {
        return None;
    }
    let target = link.read_link().ok()?;
    Some(target.file_name()?.to_str()?.to_owned())
}

fn bounded(limit: Duration, command: &mut Command) -> Answer {
    let output = command::within(limit, command).map_err(|error| error.to_string())?;
    if output.status.success() {
        Ok(())
    } else {
        Err(gist(&command::complaint(&output)).to_owned())
    }
}

/// The head of a complaint, without the chain of causes that rustup hangs on it.
fn gist(complaint: &str) -> &str {
    let complaint = ["error: ", "E: "].iter().fold(complaint, |text, mark| {
        text.strip_prefix(mark).unwrap_or(text)
    });
    complaint.split(": ").next().unwrap_or(complaint)
}

/// Compares the first two numbers of `rustc 1.96.0 (...)` with a version such as `1.95`.
fn new_enough(rustc: &str, least: &str) -> Answer {
    let number = |text: &str| -> Option<(u32, u32)> {
        let mut parts = text.split('.');
        Some((parts.next()?.parse().ok()?, parts.next()?.parse().ok()?))
    };
    let found = rustc.split_whitespace().nth(1);
    match (found.and_then(number), number(least)) {
        (Some(found), Some(least)) if found >= least => Ok(()),
        _ => Err(format!(
            "its rustc is {}, {least} is needed",
            found.unwrap_or("unknown")
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_compared_as_numbers() {
        assert_eq!(
            new_enough("rustc 1.96.0 (ac68faa20 2026-05-25)", "1.95"),
            Ok(())
        );
        assert_eq!(new_enough("rustc 1.95.0", "1.95"), Ok(()));
        assert_eq!(new_enough("rustc 1.100.0", "1.95"), Ok(()));
        assert_eq!(new_enough("rustc 2.0.0", "1.95"), Ok(()));
        let old = new_enough("rustc 1.85.1 (Debian)", "1.95").unwrap_err();
        assert_eq!(old, "its rustc is 1.85.1, 1.95 is needed");
        assert!(new_enough("", "1.95").is_err());
    }

    #[test]
    fn of_a_chain_of_causes_the_head_is_told() {
        let rustup = "error: component download failed: could not download: timed out";
        assert_eq!(gist(rustup), "component download failed");
        assert_eq!(
            gist("E: Unable to locate package x"),
            "Unable to locate package x"
        );
    }

    #[cfg(unix)]
    #[test]
    fn a_dangling_linker_names_its_package() {
        let directory = tempfile::tempdir().unwrap();
        let link = directory.path().join("rust-lld");
        assert_eq!(missing_linker(&link), None, "no link, nothing known");
        std::os::unix::fs::symlink("lld-22", &link).unwrap();
        assert_eq!(missing_linker(&link).as_deref(), Some("lld-22"));
        std::fs::write(directory.path().join("lld-22"), "").unwrap();
        assert_eq!(missing_linker(&link), None);
    }

    #[test]
    fn a_failed_program_is_told_in_one_line() {
        let script = "echo 'info: downloading' >&2; echo 'error: no network' >&2; exit 1";
        let answer = bounded(
            Duration::from_secs(60),
            Command::new("sh").args(["-c", script]),
        );
        assert_eq!(answer, Err("no network".to_owned()));
    }
}
