//! The names of the keys that sign images.

use sha2::{Digest as _, Sha512};

/// The public development keys. Everybody has their private halves.
const DEVELOPMENT: &str = include_str!("../../../../loader/keys/development.pub");
/// The public keys of releases, the first and the second. Empty if the program was built from a tree without them.
const PRODUCTION: &str = include_str!(concat!(env!("OUT_DIR"), "/production.pub"));

/// Returns the name of the key with this number, if the program knows the key.
#[must_use]
pub fn key_name(number: u32) -> Option<&'static str> {
    name(number, PRODUCTION)
}

fn name(number: u32, production: &str) -> Option<&'static str> {
    let is_it = |line| number_of(line) == Some(number);
    if DEVELOPMENT.lines().any(is_it) {
        return Some("development");
    }
    let line = production.lines().position(is_it)?;
    ["first", "second"].get(line).copied()
}

/// Returns the number of a public key of 64 hexadecimal digits: the first bytes of its SHA-512.
fn number_of(digits: &str) -> Option<u32> {
    let pairs = digits.as_bytes().chunks(2);
    let byte = |pair| u8::from_str_radix(str::from_utf8(pair).ok()?, 16).ok();
    let key: Option<Vec<u8>> = pairs.map(byte).collect();
    let hash = Sha512::digest(key.filter(|key| key.len() == 32)?);
    hash.first_chunk().copied().map(u32::from_be_bytes)
}

#[cfg(test)]
mod tests {
    use register_map::update::DEVELOPMENT_KEY;

    use super::*;

    #[test]
    fn development_keys_have_the_name_of_development_and_others_none() {
        let numbers: Vec<_> = DEVELOPMENT.lines().map(number_of).collect();
        let [Some(first), Some(second)] = numbers[..] else {
            panic!("{numbers:x?}");
        };
        assert_eq!(first, DEVELOPMENT_KEY);
        assert_eq!([first, second].map(key_name), [Some("development"); 2]);
        assert_eq!([0, 1, !first].map(key_name), [None; 3]);
    }

    #[test]
    fn keys_of_releases_are_named_by_their_line() {
        let keys = ["01".repeat(32), "02".repeat(32), "short".to_owned()];
        let numbers = [0, 1].map(|key: usize| number_of(&keys[key]).unwrap());
        let names = numbers.map(|number| name(number, &(keys.join("\n") + "\n")));
        assert_eq!(names, [Some("first"), Some("second")]);
        assert_eq!(numbers.map(|number| name(number, "")), [None; 2]);
        assert_eq!(number_of(&keys[2]), None);
    }
}
