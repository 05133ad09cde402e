//! Connects the radio's UART and pins to [`RadioLine`](radio::RadioLine).
//!
//! ```text
//!  USART3, from RAM                      task `radio`, every millisecond        task `serve`
//!  on_interrupt --- RECEIVED --->        RadioLine: set-up, frames, replies <-> requests
//!              <--- TO_SEND ----
//! ```
//!
//! The task does not run while flash is erased, for up to 40 ms. A queue holds 64 bytes, which take 66 ms.

use core::sync::atomic::{AtomicBool, Ordering};

use board_support::{Damaged, IoPin, RadioProof, RadioUart, device::interrupt};
use embedded_hal_nb::serial::{ErrorKind, ErrorType, Read, Write};
use firmware::{byte_queue::ByteQueue, radio};
use rtic::Mutex;

use crate::{board::Device, clock};

/// The radio line.
pub type Radio = radio::RadioLine<Serial, IoPin, IoPin>;

static RECEIVED: ByteQueue = ByteQueue::new();
static TO_SEND: ByteQueue = ByteQueue::new();
/// A received byte was damaged, or lost because the queue was full.
static DAMAGED: AtomicBool = AtomicBool::new(false);

/// The UART and the queues as a serial port, for the radio line. Only a board with a radio has one.
pub struct Serial(pub RadioProof);

/// Handles the UART's interrupt. This code runs from RAM.
#[inline(always)]
pub fn on_interrupt(uart: &mut RadioUart) {
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
        rtic::pend(interrupt::RADIO);
        if pushed {
            Ok(())
        } else {
            Err(nb::Error::WouldBlock)
        }
    }

    /// The last two bytes may still be in the UART. The module is busy until it has sent them over the air.
    fn flush(&mut self) -> nb::Result<(), ErrorKind> {
        if TO_SEND.is_empty() {
            Ok(())
        } else {
            rtic::pend(interrupt::RADIO);
            Err(nb::Error::WouldBlock)
        }
    }
}

/// The state of the task `radio`.
pub struct Polling {
    polled_at: u32,
}

impl Polling {
    pub const fn new() -> Self {
        Self { polled_at: 0 }
    }

    /// Continues what the radio line does. Returns whether a request waits to be served.
    pub fn run(
        &mut self,
        radio: &mut impl Mutex<T = Option<Radio>>,
        device: &mut impl Mutex<T = &'static mut Device>,
    ) -> bool {
        let now = clock::millis();
        let passed = now.wrapping_sub(self.polled_at);
        self.polled_at = now;
        let polled = radio.lock(|radio| {
            let radio = radio.as_mut()?;
            // At most the 40 ms for which an erase stops this task.
            let waits = radio.poll(now, passed as u16);
            Some((waits, radio.works()))
        });
        let Some((waits, works)) = polled else {
            return false;
        };
        device.lock(|device| device.state.radio_works = works);
        waits
    }
}
