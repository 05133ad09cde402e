//! Gives the code the commit that it is built from. For the image, also gives the linker the memory layout and the
//! script of cortex-m-rt.

use std::{env, fs, path::PathBuf, process::Command};

/// What the image is made of, beside the lock file: with a change in any of it the commit does not say what is in the
/// image.
const SOURCES: [&str; 6] = [
    "../firmware",
    "../board-support",
    "../modio-drivers",
    "../modbus-server",
    "../register-map",
    "../Cargo.lock",
];

fn main() {
    tell_commit();
    println!("cargo::rerun-if-changed=memory.x");
    println!("cargo::rerun-if-changed=build.rs");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::copy("memory.x", out.join("memory.x")).expect("memory.x can be copied");
    println!("cargo::rustc-link-search={}", out.display());
    println!("cargo::rustc-link-arg-bins=--nmagic");
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
}

/// Sets MODIO_COMMIT to the commit's first eight digits, and MODIO_CHANGED when the sources are not those of the
/// commit. Without git, or outside a repository, neither.
fn tell_commit() {
    for source in SOURCES {
        println!("cargo::rerun-if-changed={source}");
    }
    // HEAD names the branch, and its log gets a line with every commit and checkout.
    for name in ["HEAD", "logs/HEAD"] {
        if let Some(path) = git(&["rev-parse", "--git-path", name]) {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    if let Some(commit) =
        git(&["rev-parse", "HEAD"]).and_then(|head| Some(head.get(..8)?.to_owned()))
    {
        println!("cargo::rustc-env=MODIO_COMMIT={commit}");
        let status = [&["status", "--porcelain", "--"], &SOURCES[..]].concat();
        if git(&status).is_none_or(|changes| !changes.is_empty()) {
            println!("cargo::rustc-env=MODIO_CHANGED=1");
        }
    }
}

/// What git prints, without the end of the line; `None` when it fails or is not there.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = output.status.success().then_some(output.stdout)?;
    Some(String::from_utf8(text).ok()?.trim_end().to_owned())
}
