//! Programs made of a shell script, for tests to have called in place of the real ones.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Makes a program of that name.
///
/// Another process writes it. Written by this one, it would be open for writing in every process that a
/// test beside this one starts meanwhile, for an instant; a program that is so cannot be executed.
pub fn program(directory: &Path, name: &str, script: &str) -> PathBuf {
    let program = directory.join(name);
    let status = Command::new("sh")
        .args([
            "-c",
            r#"printf '#!/bin/sh\n%s\n' "$2" > "$1" && chmod +x "$1""#,
            "sh",
        ])
        .args([program.as_os_str(), script.as_ref()])
        .status();
    assert!(status.is_ok_and(|status| status.success()));
    program
}
