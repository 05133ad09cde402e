//! What a line needs of the hardware: a UART and a timer. The tests of the line implement these traits, too.

/// A character received from the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Character {
    /// Its eight data bits. With seven data bits, bit 7 is the parity bit or the first stop bit.
    pub byte: u8,
    /// Errors: bit 0 parity, bit 1 framing (the stop bit was low), bit 3 overrun (a character after this one was
    /// lost). Bit 2, noise, is never set: it means that the samples of a bit differed. The UART uses the majority,
    /// and the frame's checksum detects a wrong result.
    pub faults: u8,
}

/// A UART with the driver enable of its transceiver.
pub trait Uart {
    /// State of the UART at the time of a [`status`](Self::status) call.
    type Status: Copy;

    /// Reads the state of the UART.
    fn status(&self) -> Self::Status;
    /// Returns whether a character is waiting to be [read](Self::read) or was lost.
    fn received(status: Self::Status) -> bool;
    /// Returns whether the UART wants the next byte and can [send](Self::send) it.
    fn wants_byte(status: Self::Status) -> bool;
    /// Returns whether the last stop bit has been sent.
    fn sent(status: Self::Status) -> bool;

    /// Reads the character that [`received`](Self::received) reported.
    fn read(&mut self, status: Self::Status) -> Character;
    /// Turns the receiver off and the driver on, and sends the first byte of a reply.
    fn start_sending(&mut self, first: u8);
    /// Sends the next byte.
    fn send(&mut self, byte: u8);
    /// Ends the sending: the last byte was given to the UART. [`sent`](Self::sent) reports when it has been sent.
    fn finish_sending(&mut self);
    /// Turns the driver off and the receiver on.
    fn stop_sending(&mut self);
    /// Turns off the interrupts that no line uses, after an interrupt without a cause: a disturbed bit may have enabled
    /// one, which would then occur again and again. Returns whether one was enabled.
    fn disable_other_interrupts(&mut self) -> bool;
    /// Returns whether the driver is off.
    fn driver_is_off(&self) -> bool;

    /// Turns the driver off, sets every register up, and turns the receiver on.
    fn set_up(&mut self);
}

/// The timer that measures a line's silences, limits the duration of a reply, and has the times of an arbitration.
///
/// Such a time is a 16-bit count that wraps, in the high half of a `u32`, with fractions of a tick in the low half.
pub trait GapTimer {
    /// Restarts the silence: a character was received.
    fn restart(&mut self);
    /// Stops measuring: silences do not matter while a reply is being sent.
    fn stop(&mut self);
    /// Returns whether a silence is being measured.
    fn is_running(&self) -> bool;
    /// Returns whether an event waits to be [taken](Self::take_event).
    fn is_pending(&self) -> bool;
    /// Acknowledges its interrupt and returns the reason.
    fn take_event(&mut self) -> Silence;
    /// Starts the time limit of a reply that has just begun.
    fn limit_sending(&mut self);
    /// Acknowledges the interrupt of [`limit_sending`](Self::limit_sending) and [`wake_at`](Self::wake_at), and returns
    /// the reasons.
    fn take_alarms(&mut self) -> Alarms;

    /// Returns the present time.
    fn now(&self) -> u32;
    /// Returns the time at which the line fell last, if it has fallen since the last call or
    /// [`restart`](Self::restart).
    fn fell(&mut self) -> Option<u32>;
    /// Returns the time at which the character ends that was received just now.
    fn end_of(&self, character: u8) -> u32;
    /// Raises an interrupt at this time. Returns `false` when it has passed.
    fn wake_at(&mut self, time: u32) -> bool;

    /// Sets every register up.
    fn set_up(&mut self);
}

/// The reasons of an interrupt of the timer that is not about silences.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Alarms {
    /// A reply has reached its time limit.
    pub limit: bool,
    /// The time of [`GapTimer::wake_at`] has come.
    pub wake: bool,
}

/// A silence on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Silence {
    /// t1.5 has passed.
    T15,
    /// t3.5 has passed.
    T35,
    /// Neither; the interrupt had no cause.
    None,
}
