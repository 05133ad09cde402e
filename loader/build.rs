//! Gives the linker the script of cortex-m-rt, and the code the public keys that it trusts.

use std::{env, fs, path::PathBuf};

/// The public keys, when the variable does not name others: the development keys. The private half of the first is beside
/// it, so everybody has it.
const DEVELOPMENT: &str = "keys/development.pub";

fn main() {
    println!("cargo::rustc-link-arg-bins=--nmagic");
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=MODIO_KEYS");
    let file = env::var("MODIO_KEYS").unwrap_or_else(|_| DEVELOPMENT.to_owned());
    println!("cargo::rerun-if-changed={file}");
    let keys = keys(&file);
    assert!(
        matches!(&keys[..], [first, second] if first.len() == 32 && second.len() == 32),
        "{file}: two lines of 64 hexadecimal digits are needed, the public keys"
    );
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let development = keys.contains(&self::keys(DEVELOPMENT)[0]);
    for (name, text) in [
        ("keys.rs", format!("{keys:?}")),
        ("development.rs", format!("{development}")),
    ] {
        fs::write(out.join(name), text).expect("OUT_DIR is writable");
    }
}

/// Returns the public keys of a file, one in each line.
fn keys(file: &str) -> Vec<Vec<u8>> {
    let text = fs::read_to_string(file).unwrap_or_else(|error| panic!("{file}: {error}"));
    text.lines().map(|line| bytes(line, file)).collect()
}

fn bytes(line: &str, file: &str) -> Vec<u8> {
    let pairs = line.as_bytes().chunks(2);
    let byte = |pair: &[u8]| {
        let text = std::str::from_utf8(pair).ok()?;
        u8::from_str_radix(text, 16).ok()
    };
    let bytes: Option<Vec<u8>> = pairs.map(byte).collect();
    bytes.unwrap_or_else(|| panic!("{file}: {line:?} is not hexadecimal"))
}
