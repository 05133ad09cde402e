//! The self-description, file 1: the meaning of this unit's registers, as CBOR.
//!
//! ```text
//!  record    0         1      2 ...
//!         +--------+-------+----------------------+---------------+
//!         | length | CRC   | fixed part, made by  | ports, made   |
//!         |        |       | the build script     | when read     |
//!         +--------+-------+----------------------+---------------+
//! ```
//!
//! Only the modules in force differ between units with the same firmware, and they are at the end of the document.
//! Therefore the document is never stored in RAM, and its CRC is continued from the CRC of the fixed part.
//! docs/self-description.md describes the format.

use core::slice;

use modbus_server::{Exception, Span, WordsOut, crc};
use register_map::FixedPort;
use register_map::board::{Board, Each, Row};

use crate::config::Config;

include!(concat!(env!("OUT_DIR"), "/self_description.rs"));

/// The part of a document that all units with this firmware share.
#[derive(Clone, Copy, Debug)]
struct Fixed {
    /// The code of the board.
    board: u16,
    /// The document up to its ports.
    document: &'static [u8],
    /// CRC of `document`.
    crc: u16,
}

impl Fixed {
    /// Returns the fixed part for this board.
    ///
    /// # Panics
    ///
    /// When the register map does not have the board. Call this function in a constant, so that it fails at compile
    /// time.
    const fn of(board: &Row) -> Self {
        let mut rest: &[Self] = &BOARDS;
        while let [first, others @ ..] = rest {
            if first.board == board.code {
                return *first;
            }
            rest = others;
        }
        panic!("the build script describes every board of the register map")
    }
}

/// The document of a unit.
#[derive(Debug)]
pub(super) struct Description {
    fixed: &'static Fixed,
    crc: u16,
}

impl Description {
    pub(super) fn new<B: Board>(config: &Config<B>) -> Self {
        let fixed = const { &Fixed::of(B::ROW) };
        let ports = ports(config);
        let crc = ports.as_flattened().iter();
        let crc = crc.fold(fixed.crc, |crc, byte| crc::step(crc, *byte));
        Self { fixed, crc }
    }

    /// Returns the CRC of the whole document, register 0x020F.
    pub(super) const fn crc(&self) -> u16 {
        self.crc
    }

    /// Checks whether these records of a file can be read.
    ///
    /// # Errors
    ///
    /// Exception 02 for another file and for records after the end.
    pub(super) fn check_read<B: Board>(&self, file: u16, records: Span) -> Result<(), Exception> {
        let end = usize::from(HEAD) + self.length::<B>().div_ceil(2);
        if file == FILE && records.end() as usize <= end {
            Ok(())
        } else {
            Err(Exception::IllegalDataAddress)
        }
    }

    /// Appends records that [`Self::check_read`] has accepted.
    pub(super) fn read<B: Board>(&self, config: &Config<B>, records: Span, out: &mut WordsOut<'_>) {
        let mut out = out.rest().iter_mut();
        let head = [self.length::<B>() as u16, self.crc].map(u16::to_be_bytes);
        let head = head.as_flattened();
        let start = usize::from(records.start()) * 2;
        copy(head, start, &mut out);
        let start = start.saturating_sub(head.len());
        copy(self.fixed.document, start, &mut out);
        if out.len() > 0 {
            let start = start.saturating_sub(self.fixed.document.len());
            copy(ports(config).as_flattened(), start, &mut out);
        }
    }

    /// Returns the length of the document in bytes.
    const fn length<B: Board>(&self) -> usize {
        self.fixed.document.len() + PORT_BYTES * B::PORTS
    }
}

/// Copies bytes from a position on to `out`, as far as there is room.
fn copy(bytes: &[u8], at: usize, out: &mut slice::IterMut<'_, u8>) {
    let bytes = bytes.get(at..).unwrap_or_default();
    for (byte, slot) in bytes.iter().zip(out) {
        *slot = *byte;
    }
}

/// Returns the end of the document: for each port its number, the number of missing channels, and the module.
#[inline(never)]
fn ports<B: Board>(config: &Config<B>) -> Each<B::Ports, [u8; PORT_BYTES]> {
    let (first, modules) = (B::ROW.first_port, config.modules());
    Each::of(|index| {
        let module = modules.get(index).map_or(0, |module| module.code());
        let port = first.wrapping_add(index as u16);
        let fixed = B::ROW.fixed(port);
        let lacks = fixed.map_or(0, FixedPort::lacks);
        [port as u8, lacks, module as u8]
    })
}
