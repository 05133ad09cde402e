//! Connects the UART and the timer of the RS-485 line to [`Line`](line::Line).
//!
//! This code also runs from RAM.

use board_support::{GapEvent, Rs485, Status};
use firmware::line::{self, GapTimer, Silence, Uart};
use modbus_server::line::Faults;

/// The RS-485 line.
pub type Line = line::Line<Rs485Uart, Rs485Gap>;

/// USART1 with PA8.
pub struct Rs485Uart(pub Rs485);

impl Uart for Rs485Uart {
    type Status = Status;

    #[inline]
    fn status(&self) -> Status {
        self.0.status()
    }

    #[inline]
    fn received(status: Status) -> bool {
        status.received()
    }

    #[inline]
    fn wants_byte(status: Status) -> bool {
        status.wants_byte()
    }

    #[inline]
    fn sent(status: Status) -> bool {
        status.sent()
    }

    #[inline]
    fn read(&mut self, status: Status) -> (u8, Faults) {
        let character = self.0.read(status);
        (character.byte, Faults::from_bits(character.faults))
    }

    #[inline]
    fn start_sending(&mut self, first: u8) {
        self.0.start_sending(first);
    }

    #[inline]
    fn send(&mut self, byte: u8) {
        self.0.send(byte);
    }

    #[inline]
    fn finish_sending(&mut self) {
        self.0.finish_sending();
    }

    #[inline]
    fn stop_sending(&mut self) {
        self.0.stop_sending();
    }

    #[inline]
    fn driver_is_off(&self) -> bool {
        self.0.driver_is_off()
    }

    #[inline]
    fn set_up(&mut self) {
        self.0.set_up();
    }
}

/// TIM2, and TIM1 for the start bit and the time limit of a reply.
pub struct Rs485Gap(pub board_support::GapTimer);

impl GapTimer for Rs485Gap {
    #[inline]
    fn restart(&mut self) {
        self.0.restart();
    }

    #[inline]
    fn stop(&mut self) {
        self.0.stop();
    }

    #[inline]
    fn is_running(&self) -> bool {
        self.0.is_running()
    }

    #[inline]
    fn is_pending(&self) -> bool {
        self.0.is_pending()
    }

    #[inline]
    fn take_event(&mut self) -> Silence {
        match self.0.take_event() {
            GapEvent::T15 => Silence::T15,
            GapEvent::T35 => Silence::T35,
            GapEvent::Nothing => Silence::None,
        }
    }

    #[inline]
    fn limit_sending(&mut self) {
        self.0.limit_sending();
    }

    #[inline]
    fn take_limit(&mut self) -> bool {
        self.0.take_limit()
    }

    #[inline]
    fn set_up(&mut self) {
        self.0.set_up();
    }
}
