//! The timers TIM2 to TIM4 and, of TIM1, what they share with it (RM0008 14 and 15): counting up, one-pulse
//! mode, output compare as flags and interrupts, input capture of the channel's own input.
//!
//! Output pins are not wired: a compare mode that would drive one is reported. So are down and centre-aligned
//! counting, slave modes, triggers, DMA, capture filters and the repetition counter. A flag that raises no
//! interrupt causes no event: it is calculated when the register is read.
//!
//! In one-pulse mode every update event stops the counter, including the event that UG makes: see OPM in 15.4.1.

mod channels;
mod counter;

#[cfg(test)]
mod tests;

use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;
use counter::{Counter, UPDATE, compare};

/// Register offsets, RM0008 15.4.19 and 14.4.21.
mod offset {
    pub const CR1: u32 = 0x00;
    pub const CR2: u32 = 0x04;
    pub const SMCR: u32 = 0x08;
    pub const DIER: u32 = 0x0C;
    pub const SR: u32 = 0x10;
    pub const EGR: u32 = 0x14;
    pub const CCMR1: u32 = 0x18;
    pub const CCMR2: u32 = 0x1C;
    pub const CCER: u32 = 0x20;
    pub const CNT: u32 = 0x24;
    pub const PSC: u32 = 0x28;
    pub const ARR: u32 = 0x2C;
    pub const RCR: u32 = 0x30;
    pub const CCR1: u32 = 0x34;
    pub const CCR4: u32 = 0x40;
    pub const BDTR: u32 = 0x44;
}

/// CR1, 15.4.1.
mod cr1 {
    pub const CEN: u32 = 1 << 0;
    pub const UDIS: u32 = 1 << 1;
    pub const URS: u32 = 1 << 2;
    pub const OPM: u32 = 1 << 3;
    pub const DIR_CMS: u32 = 7 << 4;
    pub const ARPE: u32 = 1 << 7;
    pub const MASK: u32 = 0x3FF;
}

/// UIF and CC1IF to CC4IF, in SR and, as enables, in DIER.
const FLAGS: u32 = 0x1F;
/// All of SR that this model sets: also CC1OF to CC4OF.
const SR_MASK: u32 = 0x1E1F;
/// CC1OF in SR.
const OVERCAPTURE: u32 = 1 << 9;
/// BDTR.MOE.
const MOE: u32 = 1 << 15;

/// The kind of a timer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// TIM2, TIM3, TIM4.
    General,
    /// TIM1.
    Advanced,
}

impl Kind {
    /// Returns the bits that a register keeps: `general` were read back from two boards after all ones were written
    /// (labwired-core, stm32f1_mmio_diff.rs), `advanced` are those of RM0008 14.4.
    const fn keeps(self, general: u32, advanced: u32) -> u32 {
        match self {
            Self::General => general,
            Self::Advanced => advanced,
        }
    }
}

/// A timer.
#[derive(Clone, Debug)]
pub struct Timer {
    kind: Kind,
    hz: u32,
    counter: Counter,
    cr1: u32,
    cr2: u32,
    smcr: u32,
    dier: u32,
    sr: u32,
    ccmr: [u32; 2],
    ccer: u32,
    rcr: u32,
    bdtr: u32,
    /// Cycles after which the flags of UG appear in SR.
    ug_delay: u32,
    /// Flags of UG that have not appeared in SR yet, and when they do.
    late: Option<(Time, u32)>,
}

impl Timer {
    /// Returns a timer after reset, without a clock.
    #[must_use]
    pub fn new(kind: Kind) -> Self {
        Self {
            kind,
            hz: 0,
            counter: Counter::new(0, Time::ZERO),
            cr1: 0,
            cr2: 0,
            smcr: 0,
            dier: 0,
            sr: 0,
            ccmr: [0; 2],
            ccer: 0,
            rcr: 0,
            bdtr: 0,
            ug_delay: 0,
            late: None,
        }
    }

    /// Sets after how many cycles the flags of UG appear in SR.
    #[must_use]
    pub const fn with_ug_delay(mut self, cycles: u32) -> Self {
        self.ug_delay = cycles;
        self
    }

    /// Returns the level of TIM1's update interrupt, TIM1_UP.
    #[must_use]
    pub const fn update_irq(&self) -> bool {
        self.sr & self.dier & UPDATE != 0
    }

    /// Returns the level of TIM1's capture and compare interrupt, TIM1_CC.
    #[must_use]
    pub const fn capture_compare_irq(&self) -> bool {
        self.sr & self.dier & FLAGS & !UPDATE != 0
    }

    /// Returns the flags among `flags` that can rise: compare flags are those of outputs.
    fn risen(&self, flags: u32) -> u32 {
        let inputs: u32 = (0..4)
            .filter(|&n| self.selection(n) != 0)
            .map(compare)
            .sum();
        flags & !inputs
    }

    fn sync(&mut self, now: Time) {
        let flags = self.counter.run(now);
        self.sr |= self.risen(flags);
        if let Some((_, flags)) = self.late.take_if(|(at, _)| *at <= now) {
            self.sr |= flags;
        }
    }

    fn write_cr1(&mut self, value: u32) -> Result<(), Unmodelled> {
        self.cr1 = value & cr1::MASK;
        self.counter.one_pulse = value & cr1::OPM != 0;
        self.counter.no_updates = value & cr1::UDIS != 0;
        if value & cr1::ARPE == 0 {
            let reload = self.counter.reload.preload;
            self.counter.reload.write(reload, false);
        }
        if value & cr1::CEN != 0 {
            self.counter.start();
        } else {
            self.counter.running = false;
        }
        if value & cr1::DIR_CMS != 0 {
            return Err(Unmodelled("timer counting down or centre-aligned (CR1)"));
        }
        Ok(())
    }

    fn write_egr(&mut self, value: u32, now: Time) -> Result<(), Unmodelled> {
        if value & 1 != 0 {
            let mut flags = self.counter.restart();
            flags = self.risen(flags);
            if self.cr1 & (cr1::UDIS | cr1::URS) == 0 {
                flags |= UPDATE;
            }
            if self.ug_delay == 0 {
                self.sr |= flags;
            } else {
                let earlier = self.late.map_or(0, |(_, flags)| flags);
                let at = now + Time::cycles(self.ug_delay.into(), self.hz);
                self.late = Some((at, flags | earlier));
            }
        }
        for n in 0..4 {
            if value & compare(n) != 0 {
                if self.selection(n) == 0 {
                    self.sr |= compare(n);
                } else {
                    self.capture(n);
                }
            }
        }
        if value & !FLAGS & 0xFF != 0 {
            return Err(Unmodelled(
                "timer trigger, commutation or break event (EGR)",
            ));
        }
        Ok(())
    }
}

impl Peripheral for Timer {
    fn read(&mut self, offset: u32, now: Time) -> Result<u32, Unmodelled> {
        self.sync(now);
        Ok(match offset {
            offset::CR1 => self.cr1 & !cr1::CEN | u32::from(self.counter.running),
            offset::CR2 => self.cr2,
            offset::SMCR => self.smcr,
            offset::DIER => self.dier,
            offset::SR => self.sr,
            // 15.4.6: write only.
            offset::EGR => 0,
            offset::CCMR1 => self.ccmr[0],
            offset::CCMR2 => self.ccmr[1],
            offset::CCER => self.ccer,
            offset::CNT => self.counter.count(),
            offset::PSC => self.counter.divider.preload,
            offset::ARR => self.counter.reload.preload,
            offset::CCR1..=offset::CCR4 => self.read_ccr((offset - offset::CCR1) as usize / 4),
            offset::RCR if self.kind == Kind::Advanced => self.rcr,
            offset::BDTR if self.kind == Kind::Advanced => self.bdtr,
            _ => return Err(Unmodelled("timer register")),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: Time) -> Result<(), Unmodelled> {
        self.sync(now);
        let unless_zero = |value: u32, name| match value {
            0 => Ok(()),
            _ => Err(Unmodelled(name)),
        };
        match offset {
            offset::CR1 => return self.write_cr1(value),
            offset::CR2 => {
                self.cr2 = value & self.kind.keeps(0xF8, 0x7FFF);
                return unless_zero(self.cr2, "timer master mode and idle states (CR2)");
            }
            offset::SMCR => {
                self.smcr = value & 0xFFF7;
                return unless_zero(self.smcr, "timer slave mode (SMCR)");
            }
            offset::DIER => {
                self.dier = value & self.kind.keeps(0x5F5F, 0x7FFF);
                return unless_zero(self.dier & !FLAGS, "timer trigger, break or DMA (DIER)");
            }
            offset::SR => self.sr &= value & SR_MASK,
            offset::EGR => return self.write_egr(value, now),
            offset::CCMR1 => return self.write_ccmr(0, value),
            offset::CCMR2 => return self.write_ccmr(1, value),
            offset::CCER => {
                self.ccer = value & self.kind.keeps(0x3333, 0x3FFF);
                return self.check_outputs();
            }
            offset::CNT => self.counter.set_count(value & 0xFFFF),
            offset::PSC => self.counter.divider.write(value & 0xFFFF, true),
            offset::ARR => {
                let buffered = self.cr1 & cr1::ARPE != 0;
                self.counter.reload.write(value & 0xFFFF, buffered);
            }
            offset::CCR1..=offset::CCR4 => {
                self.write_ccr((offset - offset::CCR1) as usize / 4, value);
            }
            offset::RCR if self.kind == Kind::Advanced => {
                self.rcr = value & 0xFF;
                return unless_zero(self.rcr, "timer repetition counter (RCR)");
            }
            offset::BDTR if self.kind == Kind::Advanced => {
                self.bdtr = value & 0xFFFF;
                return self.check_outputs();
            }
            _ => return Err(Unmodelled("timer register")),
        }
        Ok(())
    }

    fn next_event(&self) -> Option<Time> {
        let wanted = self.dier & FLAGS & !self.sr;
        let late = self.late.filter(|(_, flags)| flags & wanted != 0);
        let counter = self.counter.next(self.risen(wanted));
        [counter, late.map(|(at, _)| at)]
            .into_iter()
            .flatten()
            .min()
    }

    fn advance(&mut self, now: Time) {
        // When no interrupt is due, the counter is only updated when it is read.
        if self.next_event().is_some_and(|at| at <= now) {
            self.sync(now);
        }
    }

    fn irq(&self) -> bool {
        self.sr & self.dier & FLAGS != 0
    }

    fn reset(&mut self, now: Time) {
        *self = Self {
            hz: self.hz,
            counter: Counter::new(self.hz, now),
            ..Self::new(self.kind).with_ug_delay(self.ug_delay)
        };
    }

    fn set_clock(&mut self, hz: u32, now: Time) {
        let flags = self.counter.set_clock(hz, now);
        self.sr |= self.risen(flags);
        self.hz = hz;
    }
}
