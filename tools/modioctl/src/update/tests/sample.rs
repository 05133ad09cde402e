//! Files for tests. The program's tests include this file, too.

use register_map::board::MODIO_02;
use register_map::update::{BLOCK_BYTES, Slot, crc32};
use sha2::{Digest as _, Sha512};

/// Returns an image for a slot of a modio-02, with this number of bytes of application.
pub fn image(slot: Slot, length: usize) -> Vec<u8> {
    let mut image = vec![0; 512];
    image[..8].copy_from_slice(b"MODI\x02\x01\0\0");
    image[8..12].copy_from_slice(&[0, 3, 1, 0]);
    let address = MODIO_02.layout().slots[slot as usize];
    image[12..16].copy_from_slice(&address.to_le_bytes());
    image[16..20].copy_from_slice(&(length as u32).to_le_bytes());
    image[24..28].copy_from_slice(&0x1A2B_3C4D_u32.to_le_bytes());
    image.extend((0..length).map(|n| (n * n / 7) as u8));
    sealed(image)
}

/// Returns the image with the number of the key that signed it.
pub fn signed(mut image: Vec<u8>, key: u32) -> Vec<u8> {
    image[156..160].copy_from_slice(&key.to_be_bytes());
    image
}

/// Returns the image with its SHA-512 and its CRC-32.
pub fn sealed(mut image: Vec<u8>) -> Vec<u8> {
    let crc = crc32([&image[..20], &image[512..]]);
    image[20..24].copy_from_slice(&crc.to_le_bytes());
    let hash = Sha512::digest(&image[512..]);
    image[28..92].copy_from_slice(&hash);
    image
}

/// Returns the bytes of a file with these images.
pub fn file(images: [Vec<u8>; 2]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut manifest = b"MODM\x01\0\0\0".to_vec();
    for image in images {
        manifest.extend((file.len() as u32).to_le_bytes());
        manifest.extend((image.len() as u32).to_le_bytes());
        file.extend(image);
        file.resize(file.len().next_multiple_of(BLOCK_BYTES), 0xFF);
    }
    manifest.extend(Sha512::digest(&file));
    manifest.resize(BLOCK_BYTES - 4, 0);
    let crc = crc32([&manifest, &[]]);
    manifest.extend(crc.to_le_bytes());
    file.extend(manifest);
    file
}
