//! The chip of a circuit that has wires in common with other circuits, as boards on one bus have. Their chips run in
//! turns, each a little ahead of the others, so what is computed on demand is computed only where it is needed.

use super::Chip;
use crate::machine::Limit;
use crate::periph::usart::Usart;
use crate::soc::{Circuit, Pin};
use crate::time::Time;

impl<C: Circuit> Chip<C> {
    /// Returns the USART whose transmitter is at pin `tx` as of the last instruction: what it sends next, and when. One
    /// that is off if there is none.
    #[must_use]
    pub fn usart(&self, tx: Pin) -> &Usart {
        self.bus.soc.usart(tx)
    }

    /// Returns the circuit, for changes that the part sees only at an RX pin, or not at all. Call
    /// [`wires_changed`](Self::wires_changed) after a change of the next edges at an RX pin, and [`sync`](Self::sync)
    /// before reading what the circuit has recorded.
    pub const fn circuit_mut(&mut self) -> &mut C {
        &mut self.bus.soc.circuit
    }

    /// Takes over a change of the next edges at an RX pin.
    pub fn wires_changed(&mut self) {
        self.bus.soc.wires_changed();
    }

    /// Takes over all changes that were made to the circuit.
    pub fn refresh(&mut self) {
        let now = self.now();
        self.bus.soc.refresh(now);
    }

    /// Computes everything that is computed on demand up to the present.
    pub fn sync(&mut self) {
        let now = self.now();
        self.bus.soc.sync(now);
        self.bus.take_notes();
    }

    /// Runs as [`Chip::run_until`], but neither takes over changes of the circuit before nor computes what is computed
    /// on demand after it.
    pub fn run_ahead(&mut self, t: Time) {
        if self.now() < t {
            self.run_core(Limit::until(t));
        }
    }
}
