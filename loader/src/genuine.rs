//! Whether an image is genuine: made for this board and this slot, not below the epoch floor, and signed by a key that
//! the loader trusts.

use board_support::loading::{slot_address, slot_bytes};
use register_map::{
    Board,
    update::{Header, Reason, Slot},
};
use salty::{PublicKey, Sha512, Signature};

/// The public keys that the loader trusts. The second one stays in a safe.
const KEYS: [[u8; 32]; 2] = include!(concat!(env!("OUT_DIR"), "/keys.rs"));

/// The board that the loader is built for.
const BOARD: &Board = match Board::named(board_support::boards::BOARD.name) {
    Some(board) => board,
    None => panic!("crate register-map has no row for this board"),
};

/// Checks the image in a slot. The length in its header is checked before anything behind the header is read.
///
/// # Errors
///
/// What is wrong with it.
pub fn check(slot: Slot, floor: u16) -> Result<(), Reason> {
    let bytes = slot_bytes(slot as usize);
    let header = Header::of(bytes)?;
    let application = header.application(bytes)?;
    header.suits(BOARD.code as u8, slot_address(slot as usize))?;
    if header.epoch() < floor {
        return Err(Reason::Epoch);
    }
    if hash(application) != header.hash() {
        return Err(Reason::Hash);
    }
    let signature = Signature::from(&header.signature());
    let is_signer = |key: &&[u8; 32]| {
        let [a, b, c, d, ..] = hash(*key);
        u32::from_be_bytes([a, b, c, d]) == header.key()
    };
    let signer = KEYS.iter().find(is_signer);
    let key = signer.and_then(|key| PublicKey::try_from(key).ok());
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
