//! LLD-M16-M01: a LoRa radio of the Ebyte E32-433T20 class, a transparent UART over the air.
//!
//! The facts are from the maker's manual of the E32-433T20D; the section numbers below are of that manual. M0 and
//! M1 select the mode: both low is the normal mode, both high is sleep, in which the module takes commands. AUX is
//! low while the module is busy.
//!
//! ```text
//!  power-on      M0 = M1 = 1   C1 C1 C1    parameters differ: C0 + 5 bytes   M0 = M1 = 0
//!  Starting ---> Sleeping ---> Asking ---> Setting ---> Checking ----------> Waking ---> Ready
//!                                 +------- parameters are right ------------>
//! ```
//!
//! The parameters are written only when they differ, because the module stores them in its own flash. They are read
//! back, so the driver does not depend on the reply to C0, which differs between versions of the module.
//!
//! During the set-up AUX is pulled up, because a module may have an open-drain output. Afterwards the output is
//! push-pull, and AUX is pulled down: a module that is removed, or whose AUX is open, then looks busy without end and is
//! reported, and the set-up that follows finds a new module.

use embedded_hal::digital::{InputPin, OutputPin, PinState};
use embedded_hal_nb::serial::{ErrorType, Read, Write};

mod settings;
#[cfg(test)]
mod tests;

pub use settings::LoraSettings;
use settings::PARAMETERS;

/// Head of the command that sets the parameters and stores them (7).
const STORE: u8 = 0xC0;
/// The command that reads the parameters (7.2), three times this byte.
const READ: [u8; 3] = [0xC1; 3];
/// Head of parameters that are not stored (7). Some modules also use it in their reply to [`READ`].
const SET: u8 = 0xC2;

/// Time for which AUX must have been high before the mode is changed or a command is sent, in ms: the manual asks
/// for 2 (6.1).
const SETTLED_MS: u16 = 5;
/// Time after a change of M0 and M1 before AUX is trusted, in ms. The mode changes after 1 ms (6.1); the manual does
/// not say when AUX becomes low.
const MODE_MS: u16 = 40;
/// Time after the parameters were written before AUX is trusted and the reply is discarded, in ms. The six bytes
/// and a reply of the same length take 13; the manual does not say how long the module stores them.
const STORE_MS: u16 = 200;
/// Longest time that AUX may be low after power-on or a change of the mode, in ms. The manual gives no limit.
const START_MS: u16 = 2_000;
/// Longest time until the parameters have been received, in ms: nine bytes take 10.
const REPLY_MS: u16 = 500;
/// Number of packets of all that the module buffers, 512 bytes (6.2).
const PACKETS: u16 = 9;
/// Number of times that the parameters are written before the module is only asked for them. A module that does not
/// keep them would otherwise wear out its flash.
const STORES: u8 = 3;
/// Largest number of bytes that are discarded at the end of a step. A UART with a larger buffer is not expected.
const DISCARDED: u16 = 512;
/// Time between a failure and the next attempt, in ms.
const RETRY_MS: u16 = 5_000;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Starting,
    Sleeping,
    Asking,
    Setting,
    Checking,
    Waking,
    Ready,
    Failed,
}

/// The radio: its UART, at 9600 8N1 in both modes, and its pins.
///
/// Call [`poll`](Self::poll) about once a millisecond. When the radio [is ready](Self::is_ready), bytes that are
/// written are sent over the air, and bytes from the air are read. No method waits.
#[derive(Debug)]
pub struct Lora<S, M, A> {
    serial: S,
    /// M0 and M1.
    mode: [M; 2],
    aux: A,
    settings: LoraSettings,
    step: Step,
    /// Time in this step, in ms. In [`Step::Ready`] it is the time for which AUX has been low.
    elapsed: u16,
    /// Least time for which AUX has been high, in ms.
    settled: u16,
    /// Time for which the module may be sending after AUX has gone high, in ms. 0 after the first step.
    sending: u16,
    /// Number of times that parameters were written since the radio was last ready.
    stores: u8,
    /// Number of bytes of the parameters that have been received, and whether they are those wanted.
    received: u8,
    equal: bool,
}

impl<S, M, A> Lora<S, M, A>
where
    S: Read<u8> + Write<u8>,
    M: OutputPin,
    A: InputPin + OutputPin,
{
    /// Creates the driver. `mode` are M0 and M1, both high; `aux` is an input that is pulled to the level that is set,
    /// high at first. The module gets these settings.
    ///
    /// AUX goes high when the module begins to send its last packet. `sending` is the time in ms for which it may then
    /// still be sending: [`LoraSettings::packet_ms`] after a reset that the module has not had, 0 after power-on.
    pub const fn new(
        serial: S,
        mode: [M; 2],
        aux: A,
        settings: LoraSettings,
        sending: u16,
    ) -> Self {
        Self {
            serial,
            mode,
            aux,
            settings,
            step: Step::Starting,
            elapsed: 0,
            settled: 0,
            sending,
            stores: 0,
            received: 0,
            equal: true,
        }
    }

    /// Continues the set-up, `passed` milliseconds after the last call. After a failure it starts again, every 5
    /// seconds.
    pub fn poll(&mut self, passed: u16) {
        let free = self.is_free();
        self.elapsed = self.elapsed.saturating_add(passed);
        self.settled = match self.settled {
            _ if !free => 0,
            // It may have gone high just now.
            0 => 1,
            settled => settled.saturating_add(passed),
        };
        match self.step {
            Step::Starting | Step::Sleeping | Step::Setting | Step::Waking => self.settle(),
            Step::Asking | Step::Checking => match self.reply() {
                Some(true) => self.set_mode(PinState::Low, Step::Waking),
                Some(false) if self.step == Step::Asking && self.stores < STORES => {
                    self.stores = self.stores.saturating_add(1);
                    let [a, b, c, d, e] = *self.settings.parameters();
                    self.send(&[STORE, a, b, c, d, e], Step::Setting);
                }
                Some(false) => self.go(Step::Failed),
                None => self.fail_after(REPLY_MS),
            },
            Step::Ready if free => {
                self.elapsed = 0;
                // A disturbance may have changed the pins.
                self.mode.iter_mut().for_each(|pin| {
                    let _ = pin.set_low();
                });
            }
            Step::Ready => {
                let all = self.settings.packet_ms().saturating_mul(PACKETS);
                self.fail_after(all.saturating_add(START_MS));
            }
            Step::Failed if self.elapsed >= RETRY_MS => self.go(Step::Starting),
            Step::Failed => {}
        }
    }

    /// Returns whether the radio has its settings and is in the normal mode.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.step == Step::Ready
    }

    /// Returns whether the last attempt to set the radio up has failed: the module does not answer, answers wrongly,
    /// or stays busy.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.step == Step::Failed
    }

    /// Returns whether AUX is high: the module neither sends, nor outputs bytes from the air, nor starts.
    pub fn is_free(&mut self) -> bool {
        self.aux.is_high().unwrap_or(false)
    }

    /// Goes on when the module has been free for long enough after a change.
    fn settle(&mut self) {
        let after = match self.step {
            Step::Starting => 0,
            Step::Setting => STORE_MS,
            _ => MODE_MS,
        };
        if self.elapsed < after || self.settled < self.sending.max(SETTLED_MS) {
            let sent = self.sending.saturating_mul(PACKETS + 1);
            return self.fail_after(after.saturating_add(START_MS).saturating_add(sent));
        }
        match self.step {
            Step::Starting => self.set_mode(PinState::High, Step::Sleeping),
            Step::Sleeping => self.send(&READ, Step::Asking),
            Step::Setting => self.send(&READ, Step::Checking),
            _ => {
                self.stores = 0;
                self.go(Step::Ready);
            }
        }
    }

    fn go(&mut self, step: Step) {
        self.step = step;
        self.elapsed = 0;
        self.settled = 0;
        self.sending = 0;
        self.received = 0;
        self.equal = true;
        let _ = self.aux.set_state((step != Step::Ready).into());
        // What was received before this step is no reply, and no data either. The number of reads is limited, because
        // a broken UART may report an error each time.
        let _ = (0..DISCARDED).any(|_| matches!(self.serial.read(), Err(nb::Error::WouldBlock)));
    }

    fn fail_after(&mut self, ms: u16) {
        if self.elapsed >= ms {
            self.go(Step::Failed);
        }
    }

    fn set_mode(&mut self, level: PinState, then: Step) {
        let set = self.mode.iter_mut().all(|pin| pin.set_state(level).is_ok());
        self.go(if set { then } else { Step::Failed });
    }

    fn send(&mut self, command: &[u8], then: Step) {
        self.go(then);
        if command.iter().any(|byte| self.serial.write(*byte).is_err()) {
            self.go(Step::Failed);
        }
    }

    /// Returns whether the module's parameters are those wanted, once they have been received.
    fn reply(&mut self) -> Option<bool> {
        while let Ok(byte) = self.serial.read() {
            let index = usize::from(self.received);
            self.equal &= match index.checked_sub(1) {
                None => byte == STORE || byte == SET,
                Some(index) => self.settings.parameters().get(index) == Some(&byte),
            };
            self.received = self.received.saturating_add(1);
            if index == PARAMETERS {
                return Some(self.equal);
            }
        }
        None
    }
}

impl<S: ErrorType, M, A> ErrorType for Lora<S, M, A> {
    type Error = S::Error;
}

/// Reads bytes from the air. Call this only when the radio [is ready](Lora::is_ready).
impl<S: Read<u8>, M, A> Read<u8> for Lora<S, M, A> {
    fn read(&mut self) -> nb::Result<u8, Self::Error> {
        self.serial.read()
    }
}

/// Sends bytes over the air. Call this only when the radio [is ready](Lora::is_ready). The module sends a packet when
/// it has 58 bytes, or when no byte has come for three byte times (6.2), so write a frame without a pause.
impl<S: Write<u8>, M, A> Write<u8> for Lora<S, M, A> {
    fn write(&mut self, byte: u8) -> nb::Result<(), Self::Error> {
        self.serial.write(byte)
    }

    fn flush(&mut self) -> nb::Result<(), Self::Error> {
        self.serial.flush()
    }
}
