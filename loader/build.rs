//! Gives the linker the script of cortex-m-rt, and the code the name of the board and the public keys that it trusts, with their numbers.

use std::{env, fs, path::PathBuf};

use register_map::update::keys;
use sha2::{Digest, Sha512};

/// The public keys, when the variable does not name others: the development keys. Their private halves are beside
/// it, so everybody has them.
const DEVELOPMENT: &str = "keys/development.pub";

fn main() {
    println!("cargo::rustc-link-arg-bins=--nmagic");
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rerun-if-changed=build.rs");
    // From the build script of board-support.
    if let Ok(board) = env::var("DEP_MODIO_BOARD_BOARD") {
        println!("cargo::rustc-env=MODIO_BOARD={board}");
    }
    println!("cargo::rerun-if-env-changed=MODIO_KEYS");
    let file = env::var("MODIO_KEYS").unwrap_or_else(|_| DEVELOPMENT.to_owned());
    println!("cargo::rerun-if-changed={file}");
    let keys: [Vec<u8>; 2] = public(&file)
        .try_into()
        .ok()
        .filter(|keys: &[Vec<u8>; 2]| keys.iter().all(|key| key.len() == 32))
        .unwrap_or_else(|| {
            panic!("{file}: two lines of 64 hexadecimal digits are needed, the public keys")
        });
    let numbers = keys.each_ref().map(|key| number(key));
    assert_ne!(
        numbers[0], numbers[1],
        "{file}: the second key must be another one, which ends the first"
    );
    let [first, second] = &keys;
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let development = public(DEVELOPMENT).iter().any(|key| keys.contains(key));
    let [of_first, of_second] = numbers;
    for (name, text) in [
        (
            "keys.rs",
            format!("[({first:?}, {of_first}), ({second:?}, {of_second})]"),
        ),
        ("numbers.rs", format!("{:?}", keys::encode(numbers))),
        ("development.rs", format!("{development}")),
    ] {
        fs::write(out.join(name), text).expect("OUT_DIR is writable");
    }
}

/// Returns the number of a public key.
fn number(key: &[u8]) -> u32 {
    let hash: [u8; 64] = Sha512::digest(key).into();
    let [a, b, c, d, ..] = hash;
    u32::from_be_bytes([a, b, c, d])
}

/// Returns the public keys of a file, one in each line.
fn public(file: &str) -> Vec<Vec<u8>> {
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
