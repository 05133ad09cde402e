//! Connects the UART of the second line, and the pins of a radio, to [`SecondLine`](second::SecondLine).
//!
//! ```text
//!  UART, from RAM                        task `second`, every millisecond       task `serve`
//!  on_interrupt --- RECEIVED --->        SecondLine: set-up, frames, replies <-> requests
//!              <--- TO_SEND ----
//! ```
//!
//! The task does not run while flash is erased, for up to 40 ms. A queue holds 64 bytes, which take 66 ms. On
//! clones of the part, whose erases take up to 400 ms, frames can be lost.

use core::sync::atomic::{AtomicBool, Ordering};

use board_support::{
    Damaged, IoPin, RadioIo, SecondOff, SecondProof, SecondUart, device::interrupt, fitted::If, pac,
};
use embedded_hal_nb::serial::{ErrorKind, ErrorType, Read, Write};
use firmware::{byte_queue::ByteQueue, config::RadioConfig, line::Addresses, second};
use modbus_server::Adu;
use modio_drivers::Lora;
use rtic::Mutex;

use crate::{
    board::{BOARD, Device, Events, Units},
    clock,
};

/// The second line.
pub type Second = Line<<Socket as AtSocket>::Peer>;

type Line<P> = second::SecondLine<P, Units>;

/// What is at its UART.
pub type Socket = If<{ BOARD.has_radio() }>;

/// Returns the second line, if it is in use. The image of a board without one has no code for what follows.
#[inline(always)]
pub const fn in_use(line: &mut Option<Second>) -> Option<&mut Second> {
    if BOARD.second.is_some() {
        line.as_mut()
    } else {
        None
    }
}

static RECEIVED: ByteQueue = ByteQueue::new();
static TO_SEND: ByteQueue = ByteQueue::new();
/// A received byte was damaged, or lost because the queue was full.
static DAMAGED: AtomicBool = AtomicBool::new(false);

/// The UART and the queues as a serial port. Only a board with a second line has one.
pub struct Serial(pub SecondProof);

/// What is needed to start the second line.
pub struct Start {
    pub line: SecondOff,
    /// Settings of the radio; `None` while it is off.
    pub radio: Option<RadioConfig>,
    /// The unit address; `None` while the unit has none.
    pub unit: Option<u8>,
    /// The start is a power-on.
    pub power_on: bool,
    pub adus: &'static mut [Adu],
}

/// A radio, or an RS-232 socket.
pub trait AtSocket {
    /// The peer of the line.
    type Peer: second::Peer;

    /// Sets the second line of a unit up. Returns `None` on a board without one, while a radio is off, and without a unit
    /// address.
    fn start(with: Start, rcc: &mut pac::RCC) -> Option<(Line<Self::Peer>, SecondUart)>;
}

/// A radio.
impl AtSocket for If<true> {
    type Peer = Lora<Serial, IoPin, IoPin>;

    #[inline(always)]
    fn start(with: Start, rcc: &mut pac::RCC) -> Option<(Line<Self::Peer>, SecondUart)> {
        let config = with.radio?;
        let units = Events::units(with.unit, false)?;
        let (uart, proof) = with.line.start(rcc)?;
        let RadioIo { mode, aux } = RadioIo::start()?;
        let serial = Serial(proof);
        let line = Line::radio(serial, mode, aux, config, units, with.power_on, with.adus);
        Some((line, uart))
    }
}

/// An RS-232 socket.
impl AtSocket for If<false> {
    type Peer = second::Rs232<Serial>;

    #[inline(always)]
    fn start(with: Start, rcc: &mut pac::RCC) -> Option<(Line<Self::Peer>, SecondUart)> {
        let units = Events::units(with.unit, false)?;
        let (uart, proof) = with.line.start(rcc)?;
        Some((Line::rs232(Serial(proof), units, with.adus), uart))
    }
}

/// Handles the UART's interrupt. This code runs from RAM.
#[inline(always)]
pub fn on_interrupt(uart: &mut SecondUart) {
    uart.on_interrupt(
        |byte| {
            let kept = match byte {
                Ok(byte) => RECEIVED.push(byte),
                Err(Damaged) => false,
            };
            if !kept {
                DAMAGED.store(true, Ordering::Relaxed);
            }
        },
        || TO_SEND.pop(),
    );
}

impl ErrorType for Serial {
    type Error = ErrorKind;
}

impl Read<u8> for Serial {
    fn read(&mut self) -> nb::Result<u8, ErrorKind> {
        // Reported with the bytes that are read next; they are in the same frame.
        if DAMAGED.load(Ordering::Relaxed) {
            DAMAGED.store(false, Ordering::Relaxed);
            return Err(nb::Error::Other(ErrorKind::FrameFormat));
        }
        RECEIVED.pop().ok_or(nb::Error::WouldBlock)
    }
}

impl Write<u8> for Serial {
    fn write(&mut self, byte: u8) -> nb::Result<(), ErrorKind> {
        let pushed = TO_SEND.push(byte);
        // The handler takes bytes when the UART can send them. Also pended when the queue is full, in case the UART's
        // interrupt was turned off by a disturbed register.
        rtic::pend(interrupt::SECOND);
        if pushed {
            Ok(())
        } else {
            Err(nb::Error::WouldBlock)
        }
    }

    /// The last two bytes may still be in the UART. A radio is busy until it has sent them over the air.
    fn flush(&mut self) -> nb::Result<(), ErrorKind> {
        if TO_SEND.is_empty() {
            Ok(())
        } else {
            rtic::pend(interrupt::SECOND);
            Err(nb::Error::WouldBlock)
        }
    }
}

/// The state of the task `second`.
pub struct Polling {
    polled_at: u32,
}

impl Polling {
    pub const fn new() -> Self {
        Self { polled_at: 0 }
    }

    /// Continues what the second line does. Returns whether a request waits to be served.
    pub fn run(
        &mut self,
        second: &mut impl Mutex<T = Option<Second>>,
        device: &mut impl Mutex<T = &'static mut Device>,
    ) -> bool {
        let now = clock::millis();
        let passed = now.wrapping_sub(self.polled_at);
        self.polled_at = now;
        let polled = second.lock(|second| {
            let second = in_use(second)?;
            // At most the 400 ms for which an erase may stop this task.
            let waits = second.poll(now, passed as u16);
            Some((waits, second.works()))
        });
        let Some((waits, works)) = polled else {
            return false;
        };
        device.lock(|device| device.state.radio_works = works);
        waits
    }
}
