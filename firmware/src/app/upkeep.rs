//! Repairs disturbed registers and a disturbed line, once per millisecond.
//!
//! This code also runs from RAM.

use core::sync::atomic::{AtomicBool, Ordering};

use board_support::{Part, Registers, ScanTimer, Wrong};
use firmware::repairs::Repairs;

use crate::line_setup::Line;

/// Something was repaired since the last [`take_repaired`].
static REPAIRED: AtomicBool = AtomicBool::new(false);

/// Returns whether something was repaired since the last call. Only one task may call this.
pub fn take_repaired() -> bool {
    let repaired = REPAIRED.load(Ordering::Relaxed);
    if repaired {
        REPAIRED.store(false, Ordering::Relaxed);
    }
    repaired
}

/// The settings of the registers and the recent repairs.
pub struct Upkeep {
    registers: Registers,
    repairs: Repairs,
    /// This millisecond is for the registers outside the line; the next one for the state of the line.
    others: bool,
}

impl Upkeep {
    /// Takes the present settings of the registers as the right ones.
    pub fn new(line: bool, second: bool) -> Self {
        Self {
            registers: Registers::record(&Part, line, second),
            repairs: Repairs::default(),
            others: false,
        }
    }

    /// Returns whether the device can go on. If repairs do not help, the watchdog must restart it.
    #[inline(always)]
    pub fn helps(&self) -> bool {
        self.repairs.help()
    }

    /// Runs the checks of a millisecond, and the line's response delay. Returns whether the UART of the second line must be
    /// set up.
    #[inline(always)]
    pub fn run(&mut self, line: &mut Option<Line>, scan_timer: &mut ScanTimer) -> bool {
        let is_sending = line.as_ref().is_some_and(Line::is_sending);
        // In turn, because a byte waits for this task.
        self.others = !self.others;
        let wrong = self.registers.check(&mut Part, is_sending, self.others);
        let mut repaired = wrong.is_some();
        if wrong == Some(Wrong::ScanTimer) {
            scan_timer.start();
        }
        if let Some(line) = line {
            if wrong == Some(Wrong::Line) {
                line.repair();
            }
            repaired |= line.on_millisecond(!self.others);
        } else {
            board_support::disable_driver();
        }
        if self.repairs.end_millisecond(repaired) {
            REPAIRED.store(true, Ordering::Relaxed);
        }
        wrong == Some(Wrong::Second)
    }
}
