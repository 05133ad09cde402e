//! The module: its power, pins and modes, and what others see of it. [`events`] lets its time pass.

mod events;

use super::antenna::Antenna;
use super::command::{Command, Memory};
use super::packet::{News, Packet, Sender};
use super::parameters::{Mode, Parameters, SLEEP_UART};
use super::sending::Sending;
use super::timing;
use crate::uart::Uart;
use f103::corner::Corner;
use f103::periph::gpio::Drive;
use f103::time::Time;

/// A fault of a module. It stays in a power cycle. A module whose fault ends starts as at power-on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fault {
    /// No fault.
    #[default]
    None,
    /// The module is not there: its pins are open.
    Absent,
    /// The module hangs: AUX is low, and it does nothing.
    Hung,
}

/// A module: that of a board ([`Board::radio`](crate::Board::radio)), or that of the gateway
/// ([`Air::gateway`](super::Air::gateway)).
#[derive(Clone, Debug)]
pub struct Module {
    pub(crate) corner: Corner,
    pub(crate) sender: Sender,
    powered: bool,
    fault: Fault,
    /// End of the start or the reconfiguration; `None` if the module works.
    ready_at: Option<Time>,
    /// The mode in force; `None` while the module does not work.
    mode: Option<Mode>,
    /// The mode of the pins M0 and M1, and since when.
    wanted: Mode,
    wanted_since: Time,
    /// The module is idle since this instant; `None` while it is not.
    idle_since: Option<Time>,
    memory: Memory,
    pub(super) uart: Uart,
    /// Bytes that may become a command, and when the UART has been silent after them.
    collected: Vec<u8>,
    silent_at: Time,
    /// The command that is carried out, and the instant of its answer.
    command: Option<(Time, Command)>,
    sending: Sending,
    antenna: Antenna,
    sent: u64,
    received: u64,
    news: Vec<News>,
    /// Instant from which on the module uses fixed transmission; `None` if that was reported.
    unmodelled: Option<Time>,
    now: Time,
}

impl Module {
    /// Returns a module without power, which keeps `stored`. Its pins M0 and M1 are open, which is high.
    pub(crate) fn new(sender: Sender, stored: Parameters, corner: Corner) -> Self {
        Self {
            corner,
            sender,
            powered: false,
            fault: Fault::None,
            ready_at: None,
            mode: None,
            wanted: Mode::Sleep,
            wanted_since: Time::ZERO,
            idle_since: None,
            memory: Memory::new(stored),
            uart: Uart::default(),
            collected: Vec::new(),
            silent_at: Time::ZERO,
            command: None,
            sending: Sending::default(),
            antenna: Antenna::off(),
            sent: 0,
            received: 0,
            news: Vec::new(),
            unmodelled: None,
            now: Time::ZERO,
        }
    }

    /// Returns the mode in force. `None` while the module does not work: without power, during its start and
    /// reconfiguration, or with a fault.
    #[must_use]
    pub const fn mode(&self) -> Option<Mode> {
        self.mode
    }

    /// Returns the level of AUX as the module drives it: high when it is idle. Low without power.
    #[must_use]
    pub fn aux(&self) -> bool {
        self.works()
            && self.ready_at.is_none()
            && self.command.is_none()
            && self.sending.is_empty()
            && self.uart.sent_until() <= self.now
    }

    /// Returns the parameters in force.
    #[must_use]
    pub const fn parameters(&self) -> Parameters {
        self.memory.in_force
    }

    /// Returns the parameters that the module keeps without power.
    #[must_use]
    pub const fn stored(&self) -> Parameters {
        self.memory.stored
    }

    /// Returns the number of packets that the module has begun to send.
    #[must_use]
    pub const fn packets_sent(&self) -> u64 {
        self.sent
    }

    /// Returns the number of packets that the module has received.
    #[must_use]
    pub const fn packets_received(&self) -> u64 {
        self.received
    }

    /// Returns the fault of the module.
    #[must_use]
    pub const fn fault(&self) -> Fault {
        self.fault
    }

    /// Causes or ends a fault.
    pub fn set_fault(&mut self, fault: Fault) {
        if fault == self.fault {
            return;
        }
        self.stop();
        self.fault = fault;
        if self.works() {
            self.start();
        }
    }

    /// Replaces the parameters that the module keeps without power. Those in force stay until its next start.
    pub fn set_stored(&mut self, stored: Parameters) {
        self.memory.stored = stored;
    }

    /// Returns how the module drives its pin AUX.
    #[must_use]
    pub fn drive_aux(&self) -> Drive {
        match (self.is_there(), self.aux()) {
            (false, _) => Drive::Floating,
            (true, false) => Drive::Low,
            (true, true) if self.memory.in_force.push_pull() => Drive::High,
            (true, true) => Drive::Floating,
        }
    }

    /// Returns whether the module has power and is not absent.
    pub(crate) fn is_there(&self) -> bool {
        self.powered && self.fault != Fault::Absent
    }

    /// Returns whether the module has power and no fault.
    fn works(&self) -> bool {
        self.powered && self.fault == Fault::None
    }

    /// Switches the supply at the present instant of the module.
    pub(crate) fn set_power(&mut self, on: bool) {
        if on == self.powered {
            return;
        }
        if !on {
            self.stop();
        }
        self.powered = on;
        if self.works() {
            self.start();
        }
    }

    /// Sets the levels at M0 and M1. Returns whether the mode of the pins has changed.
    pub(crate) fn set_pins(&mut self, m0: bool, m1: bool) -> bool {
        let wanted = Mode::of_pins(m0, m1);
        let changed = wanted != self.wanted;
        if changed {
            self.wanted = wanted;
            self.wanted_since = self.now;
        }
        changed
    }

    /// Puts parameters in force at the present instant, and stores them. The module must be idle.
    pub(super) fn retune(&mut self, parameters: Parameters) {
        self.memory = Memory::new(parameters);
        if let Some(mode) = self.mode {
            self.enter(mode, self.now);
        }
    }

    /// Makes the module work in normal mode at the present instant, without a start.
    pub(super) fn start_in_normal_mode(&mut self) {
        self.powered = true;
        self.set_pins(false, false);
        self.enter(Mode::Normal, self.now);
    }

    /// Returns whether the module neither sends a packet nor has bytes on their way.
    pub(super) fn is_idle(&self) -> bool {
        self.aux() && !self.sending.is_on_air() && self.collected.is_empty()
    }

    /// Begins the self-check.
    fn start(&mut self) {
        self.memory.restart();
        self.mode = None;
        self.antenna.stop();
        self.uart.set(SLEEP_UART, false, self.now);
        self.ready_at = Some(self.now + timing::START_UP);
        self.idle_since = None;
    }

    /// Stops all work at the present instant, as without power.
    fn stop(&mut self) {
        if self.sending.cut() {
            self.news.push(News::Cut(self.sender, self.sent, self.now));
        }
        self.uart.cut(self.now);
        self.uart.set(SLEEP_UART, false, self.now);
        self.antenna.stop();
        self.antenna.ignore(self.now);
        self.collected.clear();
        (self.command, self.ready_at) = (None, None);
        (self.mode, self.idle_since) = (None, None);
    }

    /// Enters a mode at `now`.
    fn enter(&mut self, mode: Mode, now: Time) {
        self.mode = Some(mode);
        let parameters = self.memory.in_force;
        match mode {
            Mode::Sleep => self.uart.set(SLEEP_UART, true, now),
            Mode::PowerSaving => self.uart.set(parameters.uart(), false, now),
            Mode::Normal | Mode::WakeUp => self.uart.set(parameters.uart(), true, now),
        }
        match mode {
            Mode::Sleep => self.antenna.stop(),
            _ => self.antenna.listen(now),
        }
        if mode == Mode::Normal {
            self.news.push(News::Tuned(now, parameters));
        }
        if mode.sends() && parameters.fixed_transmission() {
            self.unmodelled = Some(now);
        }
    }

    /// Returns the UART.
    pub(crate) const fn uart(&self) -> &Uart {
        &self.uart
    }

    /// Returns the UART, for the transmitter at RXD.
    pub(crate) const fn uart_mut(&mut self) -> &mut Uart {
        &mut self.uart
    }

    /// Returns the instant up to which the module is computed.
    pub(crate) const fn now(&self) -> Time {
        self.now
    }

    /// Adds a packet of another transmitter, with the probability that this module loses it.
    pub(crate) fn add(&mut self, packet: &Packet, loss: f64) {
        if packet.sender == self.sender {
            return;
        }
        self.antenna.add(packet, loss, self.now);
        if !self.works() {
            self.antenna.ignore(self.now);
        }
    }

    /// Ends packet `number` of another transmitter at `at`, before its planned end.
    pub(crate) fn cut(&mut self, sender: Sender, number: u64, at: Time) {
        self.antenna.cut(sender, number, at);
    }

    /// Removes and returns the news since the last call.
    pub(crate) fn take_news(&mut self) -> Vec<News> {
        core::mem::take(&mut self.news)
    }

    /// Returns whether there is news to take.
    pub(crate) fn has_news(&self) -> bool {
        !self.news.is_empty()
    }

    /// Returns the instant at which the module has begun to use a feature that is not modelled, since the last call.
    pub(crate) fn take_unmodelled(&mut self) -> Option<Time> {
        self.unmodelled.take()
    }
}
