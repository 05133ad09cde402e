//! Gives the program the public keys of releases, if the tree has them.

use std::path::PathBuf;
use std::{env, fs, io};

const KEYS: &str = "../../loader/keys";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    // The folder, because cargo would run this again in every build for a file that does not exist.
    println!("cargo::rerun-if-changed={KEYS}");
    let file = format!("{KEYS}/production.pub");
    let text = match fs::read_to_string(&file) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
        text => text.unwrap_or_else(|error| panic!("{file}: {error}")),
    };
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::write(out.join("production.pub"), text).expect("OUT_DIR is writable");
}
