//! Finds a way to compile for the microcontroller on whatever machine this is.
//!
//! ```text
//! target installed for the active rustc? ── yes ──> use it
//!   │ no
//! `rustup target add` works? ────────────── yes ──> use it
//!   │ no
//! Debian's rustc, sources of core and lld? ─ yes ─> /usr/bin/cargo -Zbuild-std=core
//!   │ no                                    (installed with apt-get where that is allowed)
//! say what to install
//! ```

use std::process::Command;

use crate::{Failure, Result};

mod machine;

pub use machine::ThisMachine;

/// The Cortex-M3, without an operating system.
pub const TARGET: &str = "thumbv7m-none-eabi";

/// What the toolchain is wanted for; the later can do what the earlier can.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Need {
    /// Compile the image.
    Build,
    /// Lint it as well.
    Lint,
}

impl Need {
    /// The Debian packages for it: rustc and cargo as Debian keeps them new enough for Firefox, the
    /// sources of `core`, which has no package built for the target, and lld.
    #[must_use]
    pub fn debian_packages(self) -> &'static [&'static str] {
        const ALL: [&str; 5] = [
            "rustc-web",
            "cargo-web",
            "rust-web-src",
            "rust-web-llvm",
            "rust-web-clippy",
        ];
        match self {
            Self::Build => ALL.split_at(4).0,
            Self::Lint => &ALL,
        }
    }
}

/// A way to compile for the target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// The active toolchain has the target.
    Rustup,
    /// Debian's toolchain builds `core` itself.
    Debian,
}

impl Way {
    /// Cargo with this toolchain, set up for the target.
    #[must_use]
    pub fn cargo(self, subcommand: &str) -> Command {
        match self {
            Self::Rustup => {
                let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
                let mut command = Command::new(cargo);
                command.args([subcommand, "--target", TARGET]);
                command
            }
            Self::Debian => {
                let mut command = Command::new("/usr/bin/cargo");
                // What an outer cargo of rustup leaves behind would lead this one to rustup's rustc
                // and libraries. -Zbuild-std needs RUSTC_BOOTSTRAP with a released rustc.
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
                command
                    .env("PATH", format!("/usr/bin:{path}"))
                    .env("RUSTC_BOOTSTRAP", "1")
                    .args([subcommand, "-Zbuild-std=core", "--target", TARGET]);
                command
            }
        }
    }
}

/// What the search asks of a machine, so that the search can be tested without one.
pub trait Machine {
    /// Whether the active rustc has the target's `core`.
    fn has_target(&mut self) -> bool;
    /// Has rustup fetch it; the error says why it could not.
    fn add_target(&mut self) -> std::result::Result<(), String>;
    /// Whether all these Debian packages are installed.
    fn has_packages(&mut self, packages: &[&str]) -> bool;
    /// Whether packages may be installed here: the reason when not.
    fn may_install(&mut self) -> std::result::Result<(), String>;
    /// Installs packages with apt-get; the error says why it could not.
    fn install(&mut self, packages: &[&str]) -> std::result::Result<(), String>;
    /// Whether Debian's rustc is new enough: the reason when not.
    fn debian_is_new_enough(&mut self) -> std::result::Result<(), String>;
}

/// Finds a way to compile for the target, and says in one line which.
///
/// # Errors
///
/// When there is none: what to install, and why each way failed.
pub fn find(machine: &mut dyn Machine, need: Need, say: &mut dyn FnMut(&str)) -> Result<Way> {
    if machine.has_target() {
        say(&format!("{TARGET}: installed in the active toolchain"));
        return Ok(Way::Rustup);
    }
    let rustup = match machine.add_target() {
        Ok(()) => {
            say(&format!(
                "{TARGET}: added to the active toolchain by rustup"
            ));
            return Ok(Way::Rustup);
        }
        Err(why) => why,
    };
    let packages = need.debian_packages();
    match debian(machine, packages, &rustup, say) {
        Ok(()) => Ok(Way::Debian),
        Err(debian) => Err(Failure::new(format!(
            "no way to compile for {TARGET}: install rustup (https://rustup.rs) and run \
             `rustup target add {TARGET}`, or on Debian run as root `apt-get install \
             --no-install-recommends {}` (rustup: {rustup}; Debian: {debian})",
            packages.join(" ")
        ))),
    }
}

fn debian(
    machine: &mut dyn Machine,
    packages: &[&str],
    rustup: &str,
    say: &mut dyn FnMut(&str),
) -> std::result::Result<(), String> {
    if machine.has_packages(packages) {
        machine.debian_is_new_enough()?;
        say(&format!(
            "{TARGET}: core built with Debian's {} (rustup: {rustup})",
            packages[0]
        ));
        return Ok(());
    }
    machine.may_install()?;
    say(&format!(
        "{TARGET}: core built with Debian's {}, which apt-get installs now (rustup: {rustup})",
        packages[0]
    ));
    machine.install(packages)?;
    machine.debian_is_new_enough()
}

#[cfg(test)]
mod tests;
