//! Getting a bus back from a slave that holds it.
//!
//! A slave that was interrupted in the middle of a byte of its own goes on to wait for its clock pulses
//! and may hold SDA low until it has had them: nine at most, then it sees no acknowledge and lets go
//! (I2C-bus specification UM10204, 3.1.16). A slave that holds SCL cannot be helped from here.

/// A wire that somebody else holds low.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Held {
    /// SCL.
    Clock,
    /// SDA.
    Data,
}

/// The two wires, each let go or pulled low by hand.
pub(super) trait Wires {
    /// Lets SCL go or pulls it low.
    fn set_scl(&mut self, high: bool);
    /// Lets SDA go or pulls it low.
    fn set_sda(&mut self, high: bool);
    /// Whether SCL is high.
    fn scl(&self) -> bool;
    /// Whether SDA is high.
    fn sda(&self) -> bool;
    /// Half a period of SCL goes by.
    fn wait(&mut self);
}

/// Clock pulses until whoever holds SDA must have let go: eight bits and an acknowledge.
const PULSES: usize = 9;

/// Half periods that a slave may stretch the clock for.
const STRETCH: usize = 16;

/// Clocks SCL until SDA is high, then makes a stop condition. Leaves both wires let go, whatever comes
/// of it, after 340 half periods of SCL at most.
pub(super) fn free(wires: &mut impl Wires) -> Result<(), Held> {
    wires.set_sda(true);
    raise_clock(wires)?;
    for _ in 0..PULSES {
        if wires.sda() {
            break;
        }
        lower_clock(wires);
        raise_clock(wires)?;
    }
    if !wires.sda() {
        return Err(Held::Data);
    }
    // SDA rises while SCL is high.
    lower_clock(wires);
    wires.set_sda(false);
    wires.wait();
    let raised = raise_clock(wires);
    wires.set_sda(true);
    wires.wait();
    raised?;
    if wires.sda() { Ok(()) } else { Err(Held::Data) }
}

fn lower_clock(wires: &mut impl Wires) {
    wires.set_scl(false);
    wires.wait();
}

fn raise_clock(wires: &mut impl Wires) -> Result<(), Held> {
    wires.set_scl(true);
    for _ in 0..STRETCH {
        wires.wait();
        if wires.scl() {
            return Ok(());
        }
    }
    Err(Held::Clock)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bus with somebody on it who holds a wire.
    #[derive(Default)]
    struct Bus {
        scl: bool,
        sda: bool,
        /// Falling edges of SCL after which SDA is let go.
        holds_sda: usize,
        /// Half periods after each rising edge for which SCL is held.
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
    fn a_free_bus_gets_one_stop_condition_and_no_start() {
        let mut bus = Bus::new(0, 0);
        assert_eq!(free(&mut bus), Ok(()));
        assert_eq!((bus.pulses, bus.starts, bus.stops), (1, 0, 1));
    }

    #[test]
    fn a_slave_gets_its_pulses_and_then_a_stop() {
        for holds in 1..=PULSES {
            let mut bus = Bus::new(holds, 0);
            assert_eq!(free(&mut bus), Ok(()), "{holds} pulses");
            assert_eq!((bus.pulses, bus.starts, bus.stops), (holds + 1, 0, 1));
            assert!(bus.scl && bus.sda, "both are let go");
        }
    }

    #[test]
    fn one_that_stretches_the_clock_is_waited_for() {
        let mut bus = Bus::new(9, STRETCH - 1);
        assert_eq!(free(&mut bus), Ok(()));
        assert_eq!(bus.stops, 1);
    }

    #[test]
    fn nine_pulses_are_all_there_are() {
        for holds in [PULSES + 1, usize::MAX] {
            let mut bus = Bus::new(holds, 0);
            assert_eq!(free(&mut bus), Err(Held::Data));
            assert_eq!((bus.pulses, bus.stops), (PULSES, 0));
            assert!(bus.scl && bus.sda, "both are let go");
        }
    }

    #[test]
    fn a_held_clock_is_given_up_at_once() {
        let mut bus = Bus::new(0, usize::MAX);
        assert_eq!(free(&mut bus), Err(Held::Clock));
        assert_eq!(bus.pulses, 0);
        assert!(bus.waits <= STRETCH);
    }

    #[test]
    fn it_never_takes_longer_than_it_says() {
        for holds in 0..=PULSES + 1 {
            for stretches in 0..=STRETCH + 1 {
                let mut bus = Bus::new(holds, stretches);
                let _ = free(&mut bus);
                assert!(bus.waits <= 340, "{holds} {stretches}: {}", bus.waits);
                assert!(bus.scl && bus.sda, "both are let go");
            }
        }
    }
}
