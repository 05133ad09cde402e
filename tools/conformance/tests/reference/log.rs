//! Counters, event log and listen-only mode (V1.02 appendix A, V1.1b3 6.8 to 6.10).

use std::collections::VecDeque;

use super::fault::Fault;

/// Counters by sub-function, 0B to 12.
pub const COUNTERS: usize = 8;

/// What the line has seen.
#[derive(Default)]
pub struct Log {
    counters: [u16; COUNTERS],
    pub listen_only: bool,
    pub events: u16,
    log: VecDeque<u8>,
    fault: Option<Fault>,
}

impl Log {
    pub fn new(fault: Option<Fault>) -> Self {
        let mut log = Self {
            fault,
            ..Self::default()
        };
        log.counters[7] = u16::from(fault == Some(Fault::OverrunsStay)) * 3;
        log
    }

    /// Counts one more; `sub` is 0B to 12.
    pub fn count(&mut self, sub: usize) {
        self.counters[sub - 0x0B] = self.counters[sub - 0x0B].wrapping_add(1);
    }

    /// A receive event (V1.1b3 6.10): bit 1 communication error, bit 6 broadcast; bit 5 is the mode.
    pub fn received(&mut self, bits: u8) {
        self.event(0x80 | self.mode_bit() | bits);
    }

    /// A send event (V1.1b3 6.10), with or without a reply: bits 0 to 3 are the kind of exception; bit 5 is
    /// the mode.
    pub fn sent(&mut self, bits: u8) {
        self.event(0x40 | self.mode_bit() | bits);
    }

    /// A counter by its place, 0 to 7: that of sub-function 0B and up.
    pub fn counter(&self, place: u16) -> u16 {
        self.counters[usize::from(place)]
    }

    fn mode_bit(&self) -> u8 {
        u8::from(self.listen_only && self.fault != Some(Fault::ModeUnlogged)) << 5
    }

    /// A new event, the newest first.
    fn event(&mut self, event: u8) {
        self.log.push_front(event);
        self.log.truncate(64);
    }

    pub fn event_counter(&self) -> Vec<u8> {
        [[0, 0], self.events.to_be_bytes()].concat()
    }

    fn has(&self, fault: Fault) -> bool {
        self.fault == Some(fault)
    }

    pub fn read(&self) -> Vec<u8> {
        let mut log: Vec<u8> = self.log.iter().copied().collect();
        if self.has(Fault::LogBackwards) {
            log.reverse();
        }
        let head = [
            [0, 0],
            (self.events + u16::from(self.has(Fault::LogCountDiffers)) * 7).to_be_bytes(),
            self.counters[0].to_be_bytes(),
        ]
        .concat();
        [vec![(6 + log.len()) as u8], head, log].concat()
    }

    /// A sub-function other than 00 and 03: the data of its reply. `clears` is how many counters it clears
    /// where all are to be.
    pub fn diagnose(&mut self, sub: u16, data: &[u8], clears: usize) -> Result<Vec<u8>, u8> {
        let zero = if data == [0, 0] || self.has(Fault::IgnoresDiagnosticData) {
            Ok(())
        } else {
            Err(3)
        };
        match sub {
            1 => {
                match data {
                    [0, 0] => {}
                    [0xFF, 0] if self.has(Fault::KeepsLog) => {}
                    [0xFF, 0] => self.log.clear(),
                    _ if self.has(Fault::TakesAnyRestart) => {}
                    _ => return Err(3),
                }
                self.listen_only = false;
                if self.fault != Some(Fault::RestartUnlogged) {
                    self.event(0);
                }
                if !self.has(Fault::RestartKeepsCounters) {
                    self.clear(clears);
                }
                Ok(data.to_vec())
            }
            2 if self.has(Fault::ShortRegister) => zero.map(|()| vec![0]),
            2 => zero.map(|()| vec![0, 0]),
            4 => zero.map(|()| {
                self.listen_only = true;
                if self.fault != Some(Fault::EntryUnlogged) {
                    self.event(4);
                }
                Vec::new()
            }),
            0x0A => zero.map(|()| {
                self.clear(clears);
                vec![0, 0]
            }),
            0x0B..=0x12 => zero.map(|()| {
                self.counters[usize::from(sub) - 0x0B]
                    .to_be_bytes()
                    .to_vec()
            }),
            0x14 => zero.map(|()| {
                if !self.has(Fault::OverrunsStay) {
                    self.counters[7] = 0;
                }
                vec![0, 0]
            }),
            _ if self.has(Fault::EchoesAnySubFunction) => Ok(data.to_vec()),
            _ => Err(1),
        }
    }

    fn clear(&mut self, clears: usize) {
        self.counters[..clears].fill(0);
        if clears > 0 {
            self.events = 0;
        }
    }
}
