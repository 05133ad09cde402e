//! What is at the UART of the second line.

use embedded_hal::digital::{InputPin, OutputPin};
use embedded_hal_nb::serial::{ErrorType, Read, Write};
use modio_drivers::Lora;

/// What is at the UART of the second line. Bytes are read and written only when it is ready.
pub trait Peer: Read<u8> + Write<u8> {
    /// Whether the peer is a radio. A radio can fail, and it delivers a frame with pauses inside.
    const IS_RADIO: bool;

    /// Continues the set-up of the peer, `passed` milliseconds after the last call.
    fn poll(&mut self, passed: u16);

    /// Returns whether the peer is set up.
    fn is_ready(&self) -> bool;

    /// Returns whether the last attempt to set up the peer has failed.
    fn has_failed(&self) -> bool;

    /// Returns whether the peer neither sends nor receives. An RS-232 socket has no pin that shows this: always true.
    fn is_free(&mut self) -> bool;
}

impl<S, M, A> Peer for Lora<S, M, A>
where
    S: Read<u8> + Write<u8>,
    M: OutputPin,
    A: InputPin + OutputPin,
{
    const IS_RADIO: bool = true;

    #[inline(always)]
    fn poll(&mut self, passed: u16) {
        self.poll(passed);
    }

    #[inline(always)]
    fn is_ready(&self) -> bool {
        self.is_ready()
    }

    #[inline(always)]
    fn has_failed(&self) -> bool {
        self.has_failed()
    }

    #[inline(always)]
    fn is_free(&mut self) -> bool {
        self.is_free()
    }
}

/// An RS-232 socket: the UART alone.
#[derive(Debug)]
pub struct Rs232<S>(pub(super) S);

impl<S: ErrorType> ErrorType for Rs232<S> {
    type Error = S::Error;
}

impl<S: Read<u8>> Read<u8> for Rs232<S> {
    fn read(&mut self) -> nb::Result<u8, Self::Error> {
        self.0.read()
    }
}

impl<S: Write<u8>> Write<u8> for Rs232<S> {
    fn write(&mut self, byte: u8) -> nb::Result<(), Self::Error> {
        self.0.write(byte)
    }

    fn flush(&mut self) -> nb::Result<(), Self::Error> {
        self.0.flush()
    }
}

impl<S: Read<u8> + Write<u8>> Peer for Rs232<S> {
    const IS_RADIO: bool = false;

    fn poll(&mut self, _: u16) {}

    fn is_ready(&self) -> bool {
        true
    }

    fn has_failed(&self) -> bool {
        false
    }

    fn is_free(&mut self) -> bool {
        true
    }
}
