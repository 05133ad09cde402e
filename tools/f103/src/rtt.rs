//! The firmware's log: up channel 0 of its RTT control block in SRAM, read as a debug probe reads it.
//!
//! The block is found by its ID, because a part may start one of several images. A reset removes the ID: the next image
//! may have its block at another address, and the old one would be found first.
//!
//! ```text
//! +0   "SEGGER RTT\0..." 16 bytes     +24  up channel 0: name, buffer, size, write offset, read offset, flags
//! +16  number of up channels                (32-bit words)
//! +20  number of down channels
//! ```
//! The read offset is moved at fixed instants of the virtual time, [`POLL`] apart, whatever the pieces in which a
//! caller lets the time pass. So the state of the buffer at an instant is the same in every run.

use crate::memory::RAM_BASE;
use crate::time::Time;

/// From one emptying of the buffer to the next.
pub const POLL: Time = Time::from_ms(10);

const ID: &[u8] = b"SEGGER RTT\0";
const UP_CHANNELS: usize = 16;
const UP_0: usize = 24;
const BUFFER: usize = UP_0 + 4;
const SIZE: usize = UP_0 + 8;
const WRITE: usize = UP_0 + 12;
const READ: usize = UP_0 + 16;

/// The text read so far.
#[derive(Debug, Default)]
pub struct Log {
    /// The control block's offset into SRAM, where it was found last.
    block: usize,
    text: Vec<u8>,
    /// Bytes of the buffer that a caller has been given although they are still in it.
    shown: usize,
}

/// The unread part of the buffer: where it is in SRAM, and the two offsets.
struct Unread {
    start: usize,
    size: usize,
    write: usize,
    read: usize,
}

impl Log {
    /// Empties the firmware's buffer, as a probe does.
    pub fn poll(&mut self, ram: &mut [u8]) {
        if let Some(unread) = self.unread(ram) {
            let bytes = unread.bytes(ram);
            self.text.extend(bytes.into_iter().skip(self.shown));
            let at = self.block + READ;
            ram[at..at + 4].copy_from_slice(&(unread.write as u32).to_le_bytes());
        }
        self.shown = 0;
    }

    /// Empties the firmware's buffer before a reset of the part.
    pub fn reset(&mut self, ram: &mut [u8]) {
        self.poll(ram);
        if has_id(ram, self.block) {
            ram[self.block..self.block + ID.len()].fill(0);
        }
    }

    /// Returns everything written since the last call, also what still is in the buffer.
    pub fn take(&mut self, ram: &[u8]) -> String {
        let mut text = core::mem::take(&mut self.text);
        if let Some(unread) = self.unread(ram) {
            let bytes = unread.bytes(ram);
            let shown = self.shown.min(bytes.len());
            self.shown = bytes.len();
            text.extend(bytes.into_iter().skip(shown));
        }
        String::from_utf8_lossy(&text).into_owned()
    }

    /// Returns the channel as it stands, if the block has been set up and makes sense.
    fn unread(&mut self, ram: &[u8]) -> Option<Unread> {
        if !has_id(ram, self.block) {
            let mut words = (0..ram.len()).step_by(4);
            self.block = words.find(|at| has_id(ram, *at))?;
        }
        let header = ram.get(self.block..self.block + READ + 4)?;
        if word(header, UP_CHANNELS) == 0 {
            return None;
        }
        let unread = Unread {
            start: (word(header, BUFFER).wrapping_sub(RAM_BASE)) as usize,
            size: word(header, SIZE) as usize,
            write: word(header, WRITE) as usize,
            read: word(header, READ) as usize,
        };
        let fits = unread.start < ram.len() && unread.size <= ram.len() - unread.start;
        (fits && unread.write < unread.size && unread.read < unread.size).then_some(unread)
    }
}

impl Unread {
    fn bytes(&self, ram: &[u8]) -> Vec<u8> {
        let buffer = &ram[self.start..self.start + self.size];
        if self.read <= self.write {
            buffer[self.read..self.write].to_vec()
        } else {
            [&buffer[self.read..], &buffer[..self.write]].concat()
        }
    }
}

fn has_id(ram: &[u8], at: usize) -> bool {
    ram.get(at..).is_some_and(|block| block.starts_with(ID))
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ram(write: u32, read: u32) -> Vec<u8> {
        let mut ram = vec![0; 256];
        ram[16..16 + ID.len()].copy_from_slice(ID);
        for (at, value) in [
            (UP_CHANNELS, 1),
            (BUFFER, RAM_BASE + 128),
            (SIZE, 8),
            (WRITE, write),
            (READ, read),
        ] {
            ram[16 + at..20 + at].copy_from_slice(&u32::to_le_bytes(value));
        }
        ram[128..136].copy_from_slice(b"abcdefgh");
        ram
    }

    #[test]
    fn nothing_is_shown_twice_or_lost_around_the_end_of_the_ring() {
        let mut log = Log::default();
        let mut memory = ram(2, 6);
        assert_eq!(log.take(&memory), "ghab");
        assert_eq!(log.take(&memory), "");
        memory[16 + WRITE] = 4;
        log.poll(&mut memory);
        assert_eq!(memory[16 + READ], 4);
        assert_eq!(log.take(&memory), "cd");
        assert_eq!(log.take(&memory), "");
    }

    #[test]
    fn after_a_reset_the_block_of_the_next_image_is_found() {
        let mut log = Log::default();
        let mut memory = ram(2, 0);
        log.reset(&mut memory);
        assert_eq!(log.take(&memory), "ab");
        memory.copy_within(16..64, 64);
        memory[64..64 + ID.len()].copy_from_slice(ID);
        memory[64 + READ] = 0;
        assert_eq!(log.take(&memory), "ab");
        log.poll(&mut memory);
        assert_eq!(memory[64 + READ], 2);
    }

    #[test]
    fn a_block_that_makes_no_sense_is_left_alone() {
        let mut log = Log::default();
        assert_eq!(log.take(&ram(9, 0)), "", "offset beyond the buffer");
        assert_eq!(log.take(&[0; 64]), "", "not set up");
        let cut = &ram(2, 0)[..16 + READ];
        assert_eq!(log.take(cut), "", "the end of SRAM is in the block");
    }
}
