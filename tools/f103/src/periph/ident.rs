//! The contents that the factory wrote: flash size and unique identity (RM0008 chapter 30), and the option bytes
//! (PM0075 2.5) with their factory values. All of them are read-only.

use crate::part::Part;

/// Start address of this memory.
pub const BASE: u32 = 0x1FFF_F7E0;
/// Bytes up to the end of the option bytes.
pub const SIZE: u32 = 0x30;

/// The read-only words at [`BASE`].
#[derive(Debug)]
pub struct Ident {
    bytes: [u8; SIZE as usize],
}

impl Ident {
    /// Returns the words of `part` with this unique identity and these write-protection bits (FLASH_WRPR:
    /// 0 = protected).
    #[must_use]
    pub fn new(part: &Part, unique_id: [u8; 12], wrpr: u32) -> Self {
        let mut bytes = [0xFF; SIZE as usize];
        let kib = (part.flash_size / 1024) as u16;
        bytes[..2].copy_from_slice(&kib.to_le_bytes());
        bytes[8..20].copy_from_slice(&unique_id);
        // Option bytes from 0x1FFF_F800: RDP, USER, Data0, Data1, WRP0 to WRP3, each with its complement.
        let wrp = wrpr.to_le_bytes();
        let options = [0xA5, 0xFF, 0xFF, 0xFF, wrp[0], wrp[1], wrp[2], wrp[3]];
        for (pair, option) in bytes[0x20..].chunks_exact_mut(2).zip(options) {
            pair.copy_from_slice(&[option, !option]);
        }
        Self { bytes }
    }

    /// Returns the word at `offset` from [`BASE`] (word aligned, below [`SIZE`]).
    #[must_use]
    pub fn read(&self, offset: u32) -> u32 {
        let at = offset as usize;
        let b = &self.bytes[at..at + 4];
        u32::from_le_bytes([b[0], b[1], b[2], b[3]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::part::{STM32F103CB, STM32F103RC};

    #[test]
    fn identity_size_and_options_are_where_the_manual_says() {
        let ident = Ident::new(&STM32F103CB, *b"0123456789ab", 0xFFFF_FFFE);
        assert_eq!(ident.read(0) & 0xFFFF, 128);
        let larger = Ident::new(&STM32F103RC, [0; 12], 0);
        assert_eq!(larger.read(0) & 0xFFFF, 256);
        assert_eq!(ident.read(0x1FFF_F7E8 - BASE), u32::from_le_bytes(*b"0123"));
        assert_eq!(ident.read(0x1FFF_F7F0 - BASE), u32::from_le_bytes(*b"89ab"));
        assert_eq!(ident.read(0x1FFF_F800 - BASE), 0x00FF_5AA5);
        assert_eq!(ident.read(0x1FFF_F808 - BASE), 0x00FF_01FE);
    }
}
