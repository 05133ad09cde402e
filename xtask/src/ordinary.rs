//! Runs tests without root's rights. Root may open every port and write every file, so a fault that stops every other
//! user is not seen when root runs the tests, as in a container.
//!
//! The tests keep the user root, who owns the files, but have no capability: for the kernel this is an ordinary user.

use anyhow::{Result, ensure};

use crate::error::missing;

/// The program that takes the rights away, and its arguments.
const DROP: [&str; 3] = ["setpriv", "--bounding-set=-all", "--inh-caps=-all"];

/// Returns the words in front of a program that run it as an ordinary user: none if this is one.
pub fn words() -> Result<&'static [&'static str]> {
    if !is_root() {
        return Ok(&[]);
    }
    ensure!(
        which::which(DROP[0]).is_ok(),
        missing(
            "no setpriv to run the tests as an ordinary user (on Debian: apt-get install util-linux)"
        )
    );
    Ok(&DROP)
}

#[cfg(target_os = "linux")]
fn is_root() -> bool {
    use std::os::unix::fs::MetadataExt as _;
    std::fs::metadata("/proc/self").is_ok_and(|process| process.uid() == 0)
}

#[cfg(not(target_os = "linux"))]
fn is_root() -> bool {
    false
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use std::process::Command;

    use super::*;
    use crate::command;

    #[test]
    fn programs_have_no_capability() {
        let words = [words().unwrap(), &["grep", "CapEff", "/proc/self/status"]].concat();
        let text = command::read(Command::new(words[0]).args(&words[1..])).unwrap();
        assert_eq!(text.trim(), "CapEff:\t0000000000000000");
    }
}
