//! Modbus servers on other crates, each with the same points.

#![no_std]

#[cfg(feature = "host")]
extern crate std;

#[cfg(feature = "host")]
pub mod host;
pub mod modbus_core;
pub mod rmodbus;

/// Unit address of every server.
pub const UNIT: u8 = 1;
/// Number of coils and of discrete inputs, at addresses from 0 on. A multiple of 16, because pymodbus stores words.
pub const BITS: usize = 2096;
/// Number of holding registers and of input registers, at addresses from 0 on.
pub const WORDS: usize = 200;
/// Longest frame of V1.02 2.5.1, in bytes.
pub const LONGEST: usize = 256;

/// A server.
pub trait Server {
    /// Takes a complete frame with its CRC. Writes the reply with its CRC, and returns its length; `None` for no reply.
    fn answer(&mut self, frame: &[u8], reply: &mut [u8; LONGEST]) -> Option<usize>;
}
