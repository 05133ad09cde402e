//! Finds a way to compile for the microcontroller on this machine.
//!
//! ```text
//! target installed for the active rustc? ── yes ──> use it
//!   │ no
//! `rustup target add` works? ────────────── yes ──> use it
//!   │ no
//! Debian's rustc, sources of core and lld? ─ yes ─> /usr/bin/cargo -Zbuild-std=core
//!   │ no                          (installed by apt-get first, with --install-packages and as root)
//! say what to install
//! ```

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use anyhow::{Context as _, Result, anyhow, bail};
use semver::{Version, VersionReq};
use wait_timeout::ChildExt as _;

use crate::command;

/// The Cortex-M3, without an operating system.
pub const TARGET: &str = "thumbv7m-none-eabi";

/// Time for rustup to download a target of about 40 MB. A network that drops every packet must not block the build.
const RUSTUP_LIMIT: Duration = Duration::from_secs(300);

/// The linker that rustc looks for. In Debian's package it is a link to the lld of its LLVM, but the package does not
/// depend on that lld.
const LINKER: &str = "/usr/bin/rust-lld";

/// Debian's rustc and cargo, which are kept new enough for Firefox; the sources of `core`, because there is no package
/// for the target; lld; and clippy.
const PACKAGES: [&str; 5] = [
    "rustc-web",
    "cargo-web",
    "rust-web-src",
    "rust-web-llvm",
    "rust-web-clippy",
];

/// A way to compile for the target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// The active toolchain has the target.
    Rustup,
    /// Debian's toolchain builds `core` itself.
    Debian,
}

/// Returns the cargo that runs xtask, so that both use the same toolchain.
pub fn cargo() -> OsString {
    std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into())
}

impl Way {
    /// Returns cargo with this toolchain, set up for the target.
    pub fn cargo(self, subcommand: &str) -> Command {
        if self == Self::Rustup {
            let mut command = Command::new(cargo());
            command.args([subcommand, "--target", TARGET]);
            return command;
        }
        let mut command = Command::new("/usr/bin/cargo");
        // rustup's cargo sets these variables. With them, Debian's cargo would use rustup's rustc and libraries.
        for name in [
            "CARGO",
            "RUSTC",
            "RUSTDOC",
            "RUSTUP_TOOLCHAIN",
            "LD_LIBRARY_PATH",
        ] {
            command.env_remove(name);
        }
        let path = std::env::var("PATH").unwrap_or_default();
        command.env("PATH", format!("/usr/bin:{path}"));
        // A released rustc accepts -Zbuild-std only with RUSTC_BOOTSTRAP.
        command.env("RUSTC_BOOTSTRAP", "1");
        command.args([subcommand, "-Zbuild-std=core", "--target", TARGET]);
        command
    }
}

/// Finds a way to compile for the target, and prints it in one line. Debian packages are only installed with `install`.
pub fn find(root: &Path, install: bool) -> Result<Way> {
    Machine::default().find(root, install)
}

/// Makes rustup download a target for the active toolchain, unless it is installed.
pub fn add(root: &Path, target: &str) -> Result<()> {
    Machine::default().add(root, target)
}

/// The programs of this machine that are called.
struct Machine {
    rustc: PathBuf,
    rustup: PathBuf,
    dpkg_query: PathBuf,
    apt_get: PathBuf,
    debian_rustc: PathBuf,
}

impl Default for Machine {
    fn default() -> Self {
        Self {
            rustc: "rustc".into(),
            rustup: "rustup".into(),
            dpkg_query: "dpkg-query".into(),
            apt_get: "/usr/bin/apt-get".into(),
            debian_rustc: "/usr/bin/rustc".into(),
        }
    }
}

impl Machine {
    fn find(&self, root: &Path, install: bool) -> Result<Way> {
        let Err(rustup) = self.add(root, TARGET) else {
            eprintln!("{TARGET}: installed in the active toolchain");
            return Ok(Way::Rustup);
        };
        self.debian(install).map_err(|debian| {
            anyhow!(
                "no way to compile for {TARGET}: install rustup (https://rustup.rs) and run `rustup target add \
                 {TARGET}`, or on Debian run as root `apt-get install --no-install-recommends {}` (rustup: \
                 {rustup:#}; Debian: {debian:#})",
                PACKAGES.join(" ")
            )
        })?;
        eprintln!("{TARGET}: core built with Debian's rustc-web (rustup: {rustup:#})");
        Ok(Way::Debian)
    }

    fn add(&self, root: &Path, target: &str) -> Result<()> {
        let mut rustc = Command::new(&self.rustc);
        rustc.args(["--print", "target-libdir", "--target", target]);
        let directory = command::read(rustc.current_dir(root))?;
        if Path::new(directory.trim()).is_dir() {
            return Ok(());
        }
        let mut rustup = Command::new(&self.rustup);
        rustup.args(["target", "add", target]).current_dir(root);
        let child = rustup.stdin(Stdio::null()).spawn();
        let mut child = child.map_err(|error| command::no_start(&rustup, error))?;
        match child.wait_timeout(RUSTUP_LIMIT)? {
            Some(status) if status.success() => Ok(()),
            Some(_) => bail!("`rustup target add {target}` failed"),
            None => {
                child.kill()?;
                child.wait()?;
                bail!("`rustup target add {target}` did not end")
            }
        }
    }

    fn debian(&self, install: bool) -> Result<()> {
        if !self.has_packages() {
            if !install {
                bail!(
                    "the packages are not installed; `cargo xtask ci --install-packages` installs them as root"
                );
            }
            eprintln!("{TARGET}: apt-get installs {}", PACKAGES.join(" "));
            let mut update = Command::new(&self.apt_get);
            command::run(update.args(["-q", "update"]))?;
            self.install(&PACKAGES)?;
            if let Some(package) = missing_linker(Path::new(LINKER)) {
                self.install(&[&package])?;
            }
        }
        let version = command::read(Command::new(&self.debian_rustc).arg("--version"))?;
        new_enough(&version, env!("CARGO_PKG_RUST_VERSION"))
    }

    fn has_packages(&self) -> bool {
        let mut query = Command::new(&self.dpkg_query);
        query.args(["--show", "--showformat", "${db:Status-Status}\\n"]);
        let states = command::read(query.args(PACKAGES)).unwrap_or_default();
        let installed = states.lines().filter(|state| *state == "installed");
        installed.count() == PACKAGES.len() && missing_linker(Path::new(LINKER)).is_none()
    }

    fn install(&self, packages: &[&str]) -> Result<()> {
        let mut apt_get = Command::new(&self.apt_get);
        apt_get.env("DEBIAN_FRONTEND", "noninteractive");
        apt_get.args(["-q", "install", "-y", "--no-install-recommends"]);
        command::run(apt_get.args(packages))
    }
}

/// Returns the package of the lld that a dangling link names: `rust-lld -> lld-22` is in `lld-22`.
fn missing_linker(link: &Path) -> Option<String> {
    let target = link.read_link().ok().filter(|_| !link.exists())?;
    Some(target.file_name()?.to_str()?.to_owned())
}

/// Compares the version in `rustc 1.96.0 (...)` with one such as `1.95`.
fn new_enough(rustc: &str, least: &str) -> Result<()> {
    let found = rustc.split_whitespace().nth(1).unwrap_or_default();
    let version = Version::parse(found).with_context(|| format!("its rustc is {found:?}"))?;
    if !VersionReq::parse(&format!(">={least}"))?.matches(&version) {
        bail!("its rustc is {version}, {least} is needed");
    }
    Ok(())
}

#[cfg(all(test, unix))]
mod tests {
    use std::ffi::OsStr;

    use super::*;
    use crate::script::program;

    /// Makes a machine without the target, whose programs record their arguments.
    fn machine(directory: &Path, rustup: &str, dpkg_query: &str) -> Machine {
        let log = directory.join("log");
        let fake = |name, script: &str| {
            let text = format!("echo {name} \"$@\" >> '{}'\n{script}", log.display());
            program(directory, name, &text)
        };
        Machine {
            rustc: fake("rustc", "echo /nowhere"),
            rustup: fake("rustup", rustup),
            dpkg_query: fake("dpkg-query", dpkg_query),
            apt_get: fake("apt-get", ""),
            debian_rustc: fake("debian-rustc", "echo rustc 1.99.0"),
        }
    }

    fn installed(directory: &Path) -> String {
        let log = fs_err::read_to_string(directory.join("log")).unwrap();
        log.lines()
            .filter(|line| line.contains("install"))
            .collect()
    }

    #[test]
    fn rustup_is_preferred_to_debian() {
        let directory = tempfile::tempdir().unwrap();
        let machine = machine(directory.path(), "exit 0", "exit 1");
        let way = machine.find(directory.path(), true);
        assert_eq!(way.unwrap(), Way::Rustup);
        assert_eq!(installed(directory.path()), "");
    }

    #[test]
    fn debian_packages_are_used_and_installed_only_on_request() {
        let directory = tempfile::tempdir().unwrap();
        let five = "for n in 1 2 3 4 5; do echo installed; done";
        let machine = |dpkg_query| machine(directory.path(), "exit 1", dpkg_query);
        let way = machine(five).find(directory.path(), false);
        assert_eq!(way.unwrap(), Way::Debian);
        let error = machine("exit 1").find(directory.path(), false).unwrap_err();
        let text = format!("{error:#}");
        assert!(
            text.contains("rustup target add thumbv7m-none-eabi"),
            "{text}"
        );
        assert!(
            text.contains("apt-get install --no-install-recommends rustc-web"),
            "{text}"
        );
        assert!(!text.contains('\n'), "{text}");
        assert_eq!(installed(directory.path()), "");
        let way = machine("exit 1").find(directory.path(), true);
        assert_eq!(way.unwrap(), Way::Debian);
        assert!(installed(directory.path()).ends_with("rust-web-clippy"));
    }

    #[test]
    fn old_rustc_is_refused() {
        assert!(new_enough("rustc 1.100.0 (ac68faa20 2026-05-25)", "1.95").is_ok());
        let old = new_enough("rustc 1.85.1 (Debian)", "1.95").unwrap_err();
        assert_eq!(old.to_string(), "its rustc is 1.85.1, 1.95 is needed");
        assert!(new_enough("", "1.95").is_err());
    }

    #[test]
    fn dangling_linker_names_its_package() {
        let directory = tempfile::tempdir().unwrap();
        let link = directory.path().join("rust-lld");
        assert_eq!(missing_linker(&link), None);
        std::os::unix::fs::symlink("lld-22", &link).unwrap();
        assert_eq!(missing_linker(&link).as_deref(), Some("lld-22"));
        fs_err::write(directory.path().join("lld-22"), "").unwrap();
        assert_eq!(missing_linker(&link), None);
    }

    #[test]
    fn debian_cargo_ignores_rustups_toolchain() {
        let command = Way::Debian.cargo("build");
        let environment: Vec<_> = command.get_envs().collect();
        for cleared in ["RUSTUP_TOOLCHAIN", "RUSTC", "CARGO", "LD_LIBRARY_PATH"] {
            assert!(
                environment.contains(&(OsStr::new(cleared), None)),
                "{cleared}"
            );
        }
        assert!(Way::Rustup.cargo("build").get_envs().next().is_none());
    }
}
