//! Recovery of a bus that a slave holds.
//!
//! A slave that was interrupted while it sent a byte waits for the remaining clock pulses and may hold SDA low
//! until it has received them. After at most nine pulses it finds no acknowledge and releases SDA (I2C-bus
//! specification UM10204, 3.1.16). The master cannot release a wire when a slave holds SCL.

/// The two wires, each released or pulled low by software.
pub(super) trait Wires {
    /// Releases SCL or pulls it low.
    fn set_scl(&mut self, high: bool);
    /// Releases SDA or pulls it low.
    fn set_sda(&mut self, high: bool);
    /// Returns whether SCL is high.
    fn scl(&self) -> bool;
    /// Returns whether SDA is high.
    fn sda(&self) -> bool;
    /// Waits for half a period of SCL.
    fn wait(&mut self);
}

/// Number of clock pulses after which a slave must have released SDA: eight bits and an acknowledge.
const PULSES: usize = 9;

/// Number of half periods for which a slave may stretch the clock.
const STRETCH: usize = 16;

/// Clocks SCL until SDA is high, then sends a stop condition. Returns whether nobody holds a wire low any more. Takes at most 340 half periods of SCL and leaves both
/// wires released, also on failure.
pub(super) fn free(wires: &mut impl Wires) -> bool {
    wires.set_sda(true);
    if !raise_clock(wires) {
        return false;
    }
    for _ in 0..PULSES {
        if wires.sda() {
            break;
        }
        lower_clock(wires);
        if !raise_clock(wires) {
            return false;
        }
    }
    if !wires.sda() {
        return false;
    }
    // Stop condition: SDA rises while SCL is high.
    lower_clock(wires);
    wires.set_sda(false);
    wires.wait();
    let raised = raise_clock(wires);
    wires.set_sda(true);
    wires.wait();
    raised && wires.sda()
}

fn lower_clock(wires: &mut impl Wires) {
    wires.set_scl(false);
    wires.wait();
}

fn raise_clock(wires: &mut impl Wires) -> bool {
    wires.set_scl(true);
    (0..STRETCH).any(|_| {
        wires.wait();
        wires.scl()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bus with one slave that holds a wire.
    #[derive(Default)]
    struct Bus {
        scl: bool,
        sda: bool,
        /// Number of falling edges of SCL after which the slave releases SDA.
        holds_sda: usize,
        /// Number of half periods after each rising edge for which the slave holds SCL low.
        stretches: usize,
        held_for: usize,
        waits: usize,
        pulses: usize,
        starts: usize,
        stops: usize,
    }

    impl Bus {
        fn new(holds_sda: usize, stretches: usize) -> Self {
            Self {
                scl: true,
                sda: true,
                holds_sda,
                stretches,
                ..Self::default()
            }
        }
    }

    impl Wires for Bus {
        fn set_scl(&mut self, high: bool) {
            if self.scl && !high {
                self.pulses += 1;
                self.holds_sda = self.holds_sda.saturating_sub(1);
            }
            if !self.scl && high || self.waits == 0 {
                self.held_for = self.stretches;
            }
            self.scl = high;
        }
        fn set_sda(&mut self, high: bool) {
            if high != self.sda && self.scl() && self.holds_sda == 0 {
                if high {
                    self.stops += 1;
                } else {
                    self.starts += 1;
                }
            }
            self.sda = high;
        }
        fn scl(&self) -> bool {
            self.scl && self.held_for == 0
        }
        fn sda(&self) -> bool {
            self.sda && self.holds_sda == 0
        }
        fn wait(&mut self) {
            self.waits += 1;
            self.held_for = self.held_for.saturating_sub(1);
        }
    }

    #[test]
    fn a_free_bus_receives_one_stop_condition_and_no_start() {
        let mut bus = Bus::new(0, 0);
        assert!(free(&mut bus));
        assert_eq!((bus.pulses, bus.starts, bus.stops), (1, 0, 1));
    }

    #[test]
    fn a_slave_receives_its_pulses_and_then_a_stop() {
        for holds in 1..=PULSES {
            let mut bus = Bus::new(holds, 0);
            assert!(free(&mut bus), "{holds} pulses");
            assert_eq!((bus.pulses, bus.starts, bus.stops), (holds + 1, 0, 1));
            assert!(bus.scl && bus.sda, "both wires are released");
        }
    }

    #[test]
    fn a_slave_that_stretches_the_clock_is_waited_for() {
        let mut bus = Bus::new(9, STRETCH - 1);
        assert!(free(&mut bus));
        assert_eq!(bus.stops, 1);
    }

    #[test]
    fn recovery_fails_after_nine_pulses() {
        for holds in [PULSES + 1, usize::MAX] {
            let mut bus = Bus::new(holds, 0);
            assert!(!free(&mut bus));
            assert_eq!((bus.pulses, bus.stops), (PULSES, 0));
            assert!(bus.scl && bus.sda, "both wires are released");
        }
    }

    #[test]
    fn a_held_clock_fails_without_pulses() {
        let mut bus = Bus::new(0, usize::MAX);
        assert!(!free(&mut bus));
        assert_eq!(bus.pulses, 0);
        assert!(bus.waits <= STRETCH);
    }

    #[test]
    fn recovery_takes_at_most_340_half_periods() {
        for holds in 0..=PULSES + 1 {
            for stretches in 0..=STRETCH + 1 {
                let mut bus = Bus::new(holds, stretches);
                let _ = free(&mut bus);
                assert!(bus.waits <= 340, "{holds} {stretches}: {}", bus.waits);
                assert!(bus.scl && bus.sda, "both wires are released");
            }
        }
    }
}
