//! The independent watchdog, RM0008 chapter 19: a 12-bit down-counter on the LSI that only a reset stops.
//!
//! PR and RLR are in the LSI's clock domain. A write takes effect after up to five cycles of the LSI (19.4.4); PVU
//! or RVU is set until then. Without the LSI the write never takes effect: the flag stays set, and further writes
//! are lost. A program that waits for the flag never goes on, so a read of it is reported. The start by 0xCCCC turns
//! the LSI on (7.2.9). At the start and at each reload the counter uses the values of PR and RLR that are in effect at
//! that moment.

use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;

/// LSI cycles until a write to PR or RLR takes effect, at most (RM0008 19.4.4).
const UPDATE_CYCLES: u64 = 5;

/// Finding when a program looks at PVU or RVU while it cannot clear.
pub const STUCK: &str = "IWDG_PR or IWDG_RLR was written while the LSI is off: PVU or RVU stays set, and a wait for \
                         it never ends (start the watchdog or set LSION first)";

const KEY_RELOAD: u32 = 0xAAAA;
const KEY_ACCESS: u32 = 0x5555;
const KEY_START: u32 = 0xCCCC;

/// PR or RLR.
#[derive(Debug)]
struct Setting {
    in_force: u32,
    /// A value that was written but is not yet in effect, and when it was written.
    written: Option<(u32, Time)>,
}

impl Setting {
    const fn new(in_force: u32) -> Self {
        Self {
            in_force,
            written: None,
        }
    }

    /// Puts a written value into effect once it is due, on an LSI of `hz` Hz that has run since `lsi`.
    fn advance(&mut self, lsi: Option<Time>, hz: u32, now: Time) {
        if let (Some((value, at)), Some(lsi)) = (self.written, lsi)
            && at.max(lsi) + Time::cycles(UPDATE_CYCLES, hz) <= now
        {
            self.in_force = value;
            self.written = None;
        }
    }
}

/// The watchdog.
#[derive(Debug)]
pub struct Iwdg {
    /// The LSI's rate in Hz.
    hz: u32,
    open: bool,
    prescaler: Setting,
    reload: Setting,
    /// Instant from which the LSI runs; it may be in the future.
    lsi: Option<Time>,
    started: bool,
    /// Instant at which the counter reaches 0 and requests a reset; `None` until it counts.
    reset_at: Option<Time>,
    reset_requested: bool,
    /// SR was read while PVU or RVU cannot clear.
    stuck: bool,
}

impl Iwdg {
    /// Returns a watchdog that has not been started, on an LSI of `hz` Hz.
    #[must_use]
    pub fn new(hz: u32) -> Self {
        Self {
            hz,
            open: false,
            prescaler: Setting::new(0),
            reload: Setting::new(0xFFF),
            lsi: None,
            started: false,
            reset_at: None,
            reset_requested: false,
            stuck: false,
        }
    }

    /// Returns whether it has been started.
    #[must_use]
    pub fn running(&self) -> bool {
        self.started
    }

    /// Sets the rate of the LSI, in Hz. A count under way keeps its end.
    pub fn set_rate(&mut self, hz: u32) {
        self.hz = hz;
    }

    /// Sets the instant from which the LSI runs; `None` while it is off.
    pub fn set_lsi(&mut self, since: Option<Time>) {
        self.lsi = since;
        if self.started && self.reset_at.is_none() && !self.reset_requested {
            self.reset_at = since.map(|since| since + self.timeout());
        }
    }

    /// Returns whether the watchdog has requested a reset since the last call.
    pub fn take_reset_request(&mut self) -> bool {
        core::mem::take(&mut self.reset_requested)
    }

    /// Returns whether SR was read since the last call while PVU or RVU stays set because the LSI is off.
    pub fn take_stuck(&mut self) -> bool {
        core::mem::take(&mut self.stuck)
    }

    /// Returns the time from a reload to the reset (RM0008 table 96).
    fn timeout(&self) -> Time {
        // PR 0 to 6 divide by 4 to 256; 7 also divides by 256.
        let divider = 4u64 << self.prescaler.in_force.min(6);
        Time::cycles(u64::from(self.reload.in_force + 1) * divider, self.hz)
    }
}

impl Peripheral for Iwdg {
    fn read(&mut self, offset: u32, _now: Time) -> Result<u32, Unmodelled> {
        Ok(match offset {
            0x00 => 0,
            0x04 => self.prescaler.in_force,
            0x08 => self.reload.in_force,
            0x0C => {
                let [pvu, rvu] = [&self.prescaler, &self.reload]
                    .map(|setting| u32::from(setting.written.is_some()));
                self.stuck |= self.lsi.is_none() && pvu | rvu != 0;
                pvu | rvu << 1
            }
            _ => return Err(Unmodelled("a reserved address of IWDG")),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: Time) -> Result<(), Unmodelled> {
        match offset {
            0x00 => {
                self.open = value & 0xFFFF == KEY_ACCESS;
                match value & 0xFFFF {
                    KEY_START if !self.started => {
                        self.started = true;
                        self.reset_at = self.lsi.map(|since| now.max(since) + self.timeout());
                    }
                    KEY_RELOAD if self.reset_at.is_some() => {
                        self.reset_at = Some(now + self.timeout());
                    }
                    _ => {}
                }
            }
            0x04 if !self.open => return Err(Unmodelled("IWDG_PR written while protected")),
            0x08 if !self.open => return Err(Unmodelled("IWDG_RLR written while protected")),
            0x04 if self.prescaler.written.is_some() => {
                return Err(Unmodelled("IWDG_PR written while PVU is set"));
            }
            0x08 if self.reload.written.is_some() => {
                return Err(Unmodelled("IWDG_RLR written while RVU is set"));
            }
            0x04 => self.prescaler.written = Some((value & 7, now)),
            0x08 => self.reload.written = Some((value & 0xFFF, now)),
            0x0C => {}
            _ => return Err(Unmodelled("a reserved address of IWDG")),
        }
        Ok(())
    }

    fn next_event(&self) -> Option<Time> {
        self.reset_at
    }

    fn advance(&mut self, now: Time) {
        self.prescaler.advance(self.lsi, self.hz, now);
        self.reload.advance(self.lsi, self.hz, now);
        if self.reset_at.is_some_and(|at| at <= now) {
            self.reset_at = None;
            self.reset_requested = true;
        }
    }

    fn reset(&mut self, _now: Time) {
        *self = Self {
            lsi: self.lsi,
            ..Self::new(self.hz)
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::periph::clocks::Oscillators;

    fn at(dog: &mut Iwdg, us: u64) -> Time {
        let now = Time::from_us(us);
        dog.advance(now);
        now
    }

    /// Returns a watchdog whose LSI runs from instant 0 and whose settings are unlocked.
    fn open() -> Iwdg {
        let mut dog = Iwdg::new(Oscillators::TYPICAL.lsi);
        dog.set_lsi(Some(Time::ZERO));
        dog.write(0, KEY_ACCESS, Time::ZERO).unwrap();
        dog
    }

    #[test]
    fn it_resets_after_its_timeout_unless_reloaded() {
        let mut dog = open();
        dog.write(0, KEY_START, Time::ZERO).unwrap();
        assert_eq!(
            dog.next_event(),
            Some(Time::from_us(409_600)),
            "the longest at /4"
        );
        dog.write(0, KEY_ACCESS, Time::ZERO).unwrap();
        dog.write(4, 2, Time::ZERO).unwrap();
        dog.write(8, 999, Time::ZERO).unwrap();
        let now = at(&mut dog, 1_000);
        dog.write(0, KEY_RELOAD, now).unwrap();
        assert_eq!(
            dog.next_event(),
            Some(Time::from_ms(401)),
            "1000 x 16 / 40 kHz"
        );
        assert!(dog.write(8, 1, now).is_err(), "a reload closes the access");
        dog.advance(Time::from_ms(400));
        assert!(!dog.take_reset_request());
        dog.advance(Time::from_ms(401));
        assert!(dog.take_reset_request());
    }

    #[test]
    fn settings_arrive_after_five_cycles_and_writes_until_then_are_lost() {
        let mut dog = open();
        dog.write(4, 2, Time::ZERO).unwrap();
        dog.write(8, 999, Time::ZERO).unwrap();
        let now = at(&mut dog, 124);
        let read = |dog: &mut Iwdg, now| [4, 8, 0x0C].map(|offset| dog.read(offset, now).unwrap());
        assert_eq!(read(&mut dog, now), [0, 0xFFF, 3]);
        assert!(dog.write(4, 3, now).is_err() && dog.write(8, 5, now).is_err());
        let now = at(&mut dog, 125);
        assert_eq!(read(&mut dog, now), [2, 999, 0]);
        let now = at(&mut dog, 1_000);
        assert_eq!(read(&mut dog, now), [2, 999, 0]);
    }

    #[test]
    fn reload_before_the_settings_arrive_uses_the_old_ones() {
        let mut dog = open();
        dog.write(0, KEY_START, Time::ZERO).unwrap();
        dog.write(0, KEY_ACCESS, Time::ZERO).unwrap();
        dog.write(8, 0, Time::ZERO).unwrap();
        let now = at(&mut dog, 100);
        dog.write(0, KEY_RELOAD, now).unwrap();
        assert_eq!(dog.next_event(), Some(Time::from_us(409_700)));
    }

    #[test]
    fn settings_are_locked_without_their_key() {
        let mut dog = Iwdg::new(Oscillators::TYPICAL.lsi);
        dog.set_lsi(Some(Time::ZERO));
        assert!(dog.write(4, 1, Time::ZERO).is_err() && dog.write(8, 1, Time::ZERO).is_err());
        assert_eq!(dog.read(0x0C, Time::ZERO), Ok(0));
    }

    #[test]
    fn without_the_lsi_pvu_and_rvu_stick_and_nothing_counts() {
        let mut dog = Iwdg::new(Oscillators::TYPICAL.lsi);
        dog.write(0, KEY_ACCESS, Time::ZERO).unwrap();
        dog.write(4, 2, Time::ZERO).unwrap();
        dog.write(8, 999, Time::ZERO).unwrap();
        dog.write(0, KEY_START, Time::ZERO).unwrap();
        let now = at(&mut dog, 60_000_000);
        assert!(!dog.take_stuck());
        assert_eq!(dog.read(0x0C, now), Ok(3));
        assert!(dog.take_stuck() && !dog.take_stuck());
        assert_eq!((dog.next_event(), dog.running()), (None, true));
        dog.set_lsi(Some(now));
        assert_eq!(dog.read(0x0C, now), Ok(3));
        assert!(!dog.take_stuck(), "they clear soon");
        assert_eq!(dog.next_event(), Some(now + Time::from_us(409_600)));
        let now = at(&mut dog, 60_000_125);
        assert_eq!(dog.read(0x0C, now), Ok(0));
    }
}
