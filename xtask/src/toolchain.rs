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
use std::process::Command;
use std::time::Duration;

use anyhow::{Context as _, Result, anyhow, bail, ensure};
use semver::{Version, VersionReq};

use crate::command;
use crate::group::Group;

/// The Cortex-M3, without an operating system.
pub const TARGET: &str = "thumbv7m-none-eabi";

/// Time for rustup to download a target of about 40 MB. A network that drops every packet must not block the build.
const RUSTUP_LIMIT: Duration = Duration::from_secs(300);

/// The linker that rustc looks for. In Debian's package it is a link to the lld of its LLVM, but the package does not
/// depend on that lld.
const LINKER: &str = "/usr/bin/rust-lld";

/// Debian's rustc and cargo, which are kept new enough for Firefox; the sources of `core`, because there is no package
/// for the target; lld; and clippy.
const PACKAGES: &str = "rustc-web cargo-web rust-web-src rust-web-llvm rust-web-clippy";

/// Variables that rustup's cargo sets. With them, Debian's cargo would use rustup's rustc and libraries.
const RUSTUPS: &str = "CARGO RUSTC RUSTDOC RUSTUP_TOOLCHAIN LD_LIBRARY_PATH";

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
        for name in RUSTUPS.split(' ') {
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

/// The directory of the programs that are called. An empty path stands for the PATH.
#[derive(Default)]
pub struct Machine(PathBuf);

impl Machine {
    fn program(&self, name: &str) -> Command {
        Command::new(self.0.join(name))
    }

    /// Finds a way to compile for the target, and prints it in one line. Debian packages are only installed with
    /// `install`.
    pub fn find(&self, install: bool) -> Result<Way> {
        let Err(rustup) = self.add(TARGET) else {
            eprintln!("{TARGET}: installed in the active toolchain");
            return Ok(Way::Rustup);
        };
        self.debian(install).map_err(|debian| {
            anyhow!(
                "no way to compile for {TARGET}: install rustup (https://rustup.rs) and run `rustup target add \
                 {TARGET}`, or on Debian run as root `apt-get install --no-install-recommends {PACKAGES}` (rustup: \
                 {rustup:#}; Debian: {debian:#})"
            )
        })?;
        eprintln!("{TARGET}: core built with Debian's rustc-web (rustup: {rustup:#})");
        Ok(Way::Debian)
    }

    /// Makes rustup download a target for the active toolchain, unless it is installed.
    pub fn add(&self, target: &str) -> Result<()> {
        let mut rustc = self.program("rustc");
        let directory = ["--print", "target-libdir", "--target", target];
        let directory = command::read(rustc.args(directory))?;
        if Path::new(directory.trim()).is_dir() {
            return Ok(());
        }
        let mut rustup = self.program("rustup");
        rustup.args(["target", "add", target]);
        match Group::start(rustup)?.wait(RUSTUP_LIMIT)? {
            Some(status) if status.success() => Ok(()),
            Some(_) => bail!("`rustup target add {target}` failed"),
            None => bail!("`rustup target add {target}` did not end"),
        }
    }

    fn debian(&self, install: bool) -> Result<()> {
        let mut version = self.rustc_web();
        if install && version.is_none() {
            eprintln!("{TARGET}: apt-get installs {PACKAGES}");
            command::run(self.program("apt-get").args(["-q", "update"]))?;
            self.install(PACKAGES)?;
            if let Some(package) = missing_linker(Path::new(LINKER)) {
                self.install(&package)?;
            }
            version = self.rustc_web();
        }
        let version = version.context(
            "the packages are not installed; `cargo xtask ci --install-packages` installs them as root",
        )?;
        new_enough(&version, env!("CARGO_PKG_RUST_VERSION"))
    }

    /// Returns the version of Debian's rustc, if all packages are installed.
    fn rustc_web(&self) -> Option<String> {
        let mut query = self.program("dpkg-query");
        let format = "${db:Status-Status} ${Version}\\n";
        query.args(["--show", "--showformat", format]);
        let states = command::read(query.args(PACKAGES.split(' '))).ok()?;
        let mut versions = states.lines().map(|line| line.strip_prefix("installed "));
        let first = versions.next()??;
        let all = versions.all(|version| version.is_some());
        let linked = missing_linker(Path::new(LINKER)).is_none();
        (all && linked).then(|| first.to_owned())
    }

    fn install(&self, packages: &str) -> Result<()> {
        let mut apt_get = self.program("apt-get");
        apt_get.env("DEBIAN_FRONTEND", "noninteractive");
        apt_get.args(["-q", "install", "-y", "--no-install-recommends"]);
        command::run(apt_get.args(packages.split(' ')))
    }
}

/// Returns the package of the lld that a dangling link names: `rust-lld -> lld-22` is in `lld-22`.
fn missing_linker(link: &Path) -> Option<String> {
    let target = link.read_link().ok().filter(|_| !link.exists())?;
    Some(target.file_name()?.to_str()?.to_owned())
}

/// Compares the version of a Debian package, `1.96.0+dfsg1-1`, with one such as `1.95`.
fn new_enough(package: &str, least: &str) -> Result<()> {
    let upstream = package.split(['+', '-', '~']).next().unwrap_or_default();
    let version = Version::parse(upstream).with_context(|| format!("its rustc is {package:?}"))?;
    let enough = VersionReq::parse(&format!(">={least}"))?.matches(&version);
    ensure!(enough, "its rustc is {version}, {least} is needed");
    Ok(())
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use crate::script::program;

    /// Makes a machine without the target, whose rustup and dpkg-query are these scripts, and whose apt-get records its
    /// arguments.
    fn machine(directory: &Path, rustup: &str, dpkg_query: &str) -> Machine {
        program(directory, "rustc", "echo /nowhere");
        program(directory, "rustup", rustup);
        program(directory, "dpkg-query", dpkg_query);
        let log = directory.join("log").display().to_string();
        program(directory, "apt-get", &format!("echo \"$@\" >> '{log}'"));
        Machine(directory.to_owned())
    }

    #[test]
    fn rustup_is_preferred_and_debian_packages_are_installed_only_on_request() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path();
        let packages = |version| format!("for n in 1 2 3 4 5; do echo installed {version}; done");
        let find = |rustup, dpkg_query: &str, install| {
            let way = machine(path, rustup, dpkg_query).find(install);
            way.map_err(|error| format!("{error:#}"))
        };
        assert_eq!(find("exit 0", "exit 1", true), Ok(Way::Rustup));
        let new = packages("1.196.0+dfsg1-1~deb13u1");
        assert_eq!(find("exit 1", &new, false), Ok(Way::Debian));
        let old = find("exit 1", &packages("1.85.0+dfsg3-1"), false).unwrap_err();
        assert!(old.contains("its rustc is 1.85.0, 1.95 is needed"), "{old}");
        let text = find("exit 1", "exit 1", false).unwrap_err();
        for part in [
            "rustup target add thumbv7m",
            "--no-install-recommends rustc-web",
            "as root",
        ] {
            assert!(text.contains(part) && !text.contains('\n'), "{text}");
        }
        assert!(!path.join("log").exists(), "nothing was installed");
        assert!(find("exit 1", "exit 1", true).is_err());
        let installed = fs_err::read_to_string(path.join("log")).unwrap();
        assert!(installed.ends_with("rust-web-clippy\n"), "{installed}");
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
}
