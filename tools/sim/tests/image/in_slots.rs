//! Boards with the loader, and signed images in their slots.

use std::{fs, sync::LazyLock};

use ed25519_dalek::{Signer as _, SigningKey};
use register_map::configuration::MODULE;
use register_map::part::FLASH_BASE;
use register_map::update::crc32;
use sha2::{Digest as _, Sha512};
use sim::{Board, Config, Module, Time, chip};

use crate::{
    LAYOUT,
    rig::{self, PORT, Rig, corner, file, flash_with_settings, pages},
};

/// Offset of the application in an image, and of fields in the header.
pub const APPLICATION: usize = 512;
pub const LENGTH: usize = 16;
pub const CRC: usize = 20;
pub const HASH: usize = 28;
pub const SIGNATURE: usize = 92;
pub const KEY: usize = 156;
const RAM: u32 = 0x2000_0000;

/// Time from power-on to the first answer, when the loader checks no signature.
pub const START: Time = Time::from_ms(400);
/// The longest check of an image, at the slow corner.
pub const CHECK: Time = Time::from_ms(4_000);

/// The images for slots A and B.
static BUILT: LazyLock<[Vec<u8>; 2]> = LazyLock::new(|| {
    ["modio-a.image", "modio-b.image"]
        .map(|name| fs::read(file(name)).expect("the image can be read"))
});

/// Returns the image for a slot, 0 or 1.
pub fn image(slot: usize) -> Vec<u8> {
    BUILT[slot].clone()
}

/// A private development key: digits in hexadecimal.
pub const FIRST_KEY: &str = include_str!("../../../../loader/keys/development.key");
/// The second one, by whose image the first key is revoked.
pub const SECOND_KEY: &str = include_str!("../../../../loader/keys/development-second.key");

/// Returns the image for a slot with changes, and with the hash and the signature that belong to it.
pub fn signed(slot: usize, change: impl FnOnce(&mut [u8])) -> Vec<u8> {
    signed_by(FIRST_KEY, slot, change)
}

/// The same, with the signature of this key.
pub fn signed_by(key: &str, slot: usize, change: impl FnOnce(&mut [u8])) -> Vec<u8> {
    let mut image = image(slot);
    change(&mut image);
    let hash = Sha512::digest(&image[APPLICATION..]);
    image[HASH..HASH + 64].copy_from_slice(&hash);
    image[KEY..KEY + 4].copy_from_slice(&number(key));
    sign(&mut image, key);
    image
}

/// Gives an image the CRC-32 and the signature of a key that belong to its header.
pub fn sign(image: &mut [u8], key: &str) {
    with_crc(image);
    let signature = pair(key).sign(&image[..SIGNATURE]);
    image[SIGNATURE..SIGNATURE + 64].copy_from_slice(&signature.to_bytes());
}

/// Returns the number of a key.
pub fn number(key: &str) -> [u8; 4] {
    let hash = Sha512::digest(pair(key).verifying_key());
    core::array::from_fn(|n| hash[n])
}

fn pair(digits: &str) -> SigningKey {
    let byte = |n| u8::from_str_radix(&digits[2 * n..][..2], 16).unwrap();
    SigningKey::from_bytes(&core::array::from_fn(byte))
}

/// Gives an image the CRC-32 that belongs to it.
pub fn with_crc(image: &mut [u8]) {
    let crc = crc32([&image[..CRC], &image[APPLICATION..]]);
    image[CRC..CRC + 4].copy_from_slice(&crc.to_le_bytes());
}

/// Returns a board just powered on, with these images in its slots, and a 4DI and these settings in its configuration.
pub fn unit(slots: [&[u8]; 2], settings: &[(u16, u16)]) -> Rig {
    holding(flash(slots, Module::Di4, settings), 1)
}

/// Returns a flash that was never started, with these images in its slots, and with a module and these settings in the
/// store.
pub fn flash(slots: [&[u8]; 2], module: Module, settings: &[(u16, u16)]) -> Vec<u8> {
    let module = [(MODULE + PORT - 1, module.code())];
    let [stored, _] = pages();
    let page = flash_with_settings(&[&module, settings].concat())[stored.clone()].to_vec();
    let mut flash = vec![0xFF; LAYOUT.part.flash_size];
    flash[stored].copy_from_slice(&page);
    for (address, image) in LAYOUT.board.layout().slots.into_iter().zip(slots) {
        let at = (address - FLASH_BASE) as usize;
        flash[at..at + image.len()].copy_from_slice(image);
    }
    flash
}

/// Returns a board just powered on, with these bytes in its flash, this switch and a 4DI.
pub fn holding(flash: Vec<u8>, dip: u8) -> Rig {
    fitted(flash, Module::Di4, dip)
}

/// The same, with a module.
pub fn fitted(flash: Vec<u8>, module: Module, dip: u8) -> Rig {
    let mut rig = Rig::of(made(flash, module, dip));
    // The loader's reset after a check.
    rig.tolerant = true;
    rig
}

/// Returns a board for a bus with several.
pub fn made(flash: Vec<u8>, module: Module, dip: u8) -> Board {
    let mut config = Config {
        dip,
        module,
        chip: chip::Config::holding(flash),
        ..Config::default()
    };
    config.chip.corner = corner();
    rig::board(config)
}

/// Runs until the unit answers, and returns that time.
pub fn answers(rig: &mut Rig, within: Time) -> Option<Time> {
    answers_as(rig, 1, within)
}

/// Runs until the unit answers with this address, and returns that time.
pub fn answers_as(rig: &mut Rig, unit: u8, within: Time) -> Option<Time> {
    let end = rig.board.now() + within;
    while rig.board.now() < end {
        rig.board.run_for(Time::from_ms(20));
        if rig.ask(unit, &[3, 2, 5, 0, 1]).is_some() {
            let module = rig.ask(unit, &[3, 2, 0x0F + PORT as u8, 0, 1]);
            assert_ne!(module.as_deref(), Some(&[3, 2, 0, 0][..]), "it is stored");
            assert_eq!(rig.board.findings(), []);
            return Some(rig.board.now());
        }
    }
    None
}

/// Returns the slot whose code runs.
pub fn runs_from(rig: &mut Rig) -> usize {
    let [a, b] = LAYOUT.board.layout().slots;
    // A handler may run in RAM.
    while rig.board.pc() >= RAM {
        rig.board.run_for(Time::from_us(1));
    }
    let pc = rig.board.pc();
    assert!(pc >= a, "the loader runs");
    usize::from(pc >= b)
}
