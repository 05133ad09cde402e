//! Whether an image is genuine: made for this board and this slot, not below the epoch floor, and signed by a key that
//! the loader trusts.

use register_map::update::{Header, Reason};
use salty::{PublicKey, Sha512, Signature};

/// A public key, and its number, by which the header of an image names it.
pub type Key = ([u8; 32], u32);

/// Checks the image in a slot at an address. The length in its header is checked before anything behind the header is
/// read. The signature must be by one of `keys`.
///
/// # Errors
///
/// What is wrong with it.
pub fn check(slot: &[u8], address: u32, board: u8, floor: u16, keys: &[Key]) -> Result<(), Reason> {
    let header = Header::of(slot)?;
    let application = header.application(slot)?;
    header.suits(board, address)?;
    if header.epoch() < floor {
        return Err(Reason::Epoch);
    }
    if hash(application) != header.hash() {
        return Err(Reason::Hash);
    }
    let signature = Signature::from(&header.signature());
    let signer = keys.iter().find(|(_, number)| *number == header.key());
    let key = signer.and_then(|(key, _)| PublicKey::try_from(key).ok());
    match key.map(|key| key.verify(header.signed(), &signature)) {
        Some(Ok(())) => Ok(()),
        _ => Err(Reason::Signature),
    }
}

fn hash(bytes: &[u8]) -> [u8; 64] {
    let mut hash = Sha512::new();
    hash.update(bytes);
    hash.finalize()
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use salty::Keypair;

    use super::*;

    const ADDRESS: u32 = 0x0801_1800;
    const FLOOR: u16 = 4;

    fn pair(seed: u8) -> Keypair {
        Keypair::from(&[seed; 32])
    }

    /// Returns a slot with an image of 1 KiB that `change` may change before it is signed.
    fn signed(by: &Keypair, change: impl FnOnce(&mut [u8])) -> Vec<u8> {
        let mut slot = std::vec![0xFF; 4096];
        slot[..512].fill(0);
        slot[..8].copy_from_slice(&[b'M', b'O', b'D', b'I', 2, 1, 4, 0]);
        slot[12..16].copy_from_slice(&ADDRESS.to_le_bytes());
        slot[16..20].copy_from_slice(&1024u32.to_le_bytes());
        (0..1024).for_each(|n| slot[512 + n] = (n / 3) as u8);
        let application = hash(&slot[512..512 + 1024]);
        slot[28..92].copy_from_slice(&application);
        change(&mut slot);
        let signature = by.sign(&slot[..92]).to_bytes();
        slot[92..156].copy_from_slice(&signature);
        slot[156..160].copy_from_slice(&hash(by.public.as_bytes())[..4]);
        slot
    }

    /// Returns the keys of the loader, as its build script does.
    fn keys() -> [Key; 2] {
        [pair(1), pair(2)].map(|pair| {
            let key = pair.public.as_bytes();
            let [a, b, c, d, ..] = hash(key);
            (*key, u32::from_be_bytes([a, b, c, d]))
        })
    }

    fn verdict(slot: &[u8]) -> Result<(), Reason> {
        check(slot, ADDRESS, 1, FLOOR, &keys())
    }

    #[test]
    fn image_that_either_key_signed_is_genuine() {
        for seed in [1, 2] {
            assert_eq!(verdict(&signed(&pair(seed), |_| {})), Ok(()));
            assert_eq!(verdict(&signed(&pair(seed), |slot| slot[6] = 5)), Ok(()));
        }
    }

    #[test]
    fn signed_image_for_another_place_or_of_another_content_has_its_reason() {
        let cases: [(usize, u8, Reason); 6] = [
            (0, b'X', Reason::Magic),
            (5, 2, Reason::Board),
            (12, 1, Reason::Address),
            (17, 3, Reason::Hash),
            (19, 1, Reason::Length),
            (6, 3, Reason::Epoch),
        ];
        for (at, byte, reason) in cases {
            let slot = signed(&pair(1), |slot| slot[at] = byte);
            assert_eq!(verdict(&slot), Err(reason), "byte {at}");
        }
        let mut slot = signed(&pair(1), |_| {});
        slot[512 + 1023] ^= 1;
        assert_eq!(verdict(&slot), Err(Reason::Hash));
    }

    #[test]
    fn revoked_key_signs_no_genuine_image() {
        let [_, second] = keys();
        for (seed, verdict) in [(1, Err(Reason::Signature)), (2, Ok(()))] {
            let slot = signed(&pair(seed), |_| {});
            assert_eq!(check(&slot, ADDRESS, 1, FLOOR, &[second]), verdict);
        }
    }

    #[test]
    fn wrong_signature_or_unknown_key_is_refused() {
        assert_eq!(verdict(&signed(&pair(3), |_| {})), Err(Reason::Signature));
        let right = signed(&pair(1), |_| {});
        for byte in (20..28).chain((92..160).step_by(7)) {
            let mut slot = right.clone();
            slot[byte] ^= 0x10;
            assert_eq!(verdict(&slot), Err(Reason::Signature), "byte {byte}");
        }
    }
}
