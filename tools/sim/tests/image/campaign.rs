//! `modioctl`'s plan of an update on a line with several boards, in virtual time.

use modioctl::update::{Campaign, File, Patience, Stage, Step, Unit};
use register_map::codes::Baud;
use register_map::configuration::BAUD;
use register_map::update::{BLOCK_BYTES, Slot};
use sim::line::Settings;
use sim::{Board, Bus, Module, Time};

use crate::LAYOUT;
use crate::in_slots::{CHECK, START, flash, image, made};
use crate::rig::{FIRST, adu, file};

/// Returns the flash of a board with an image in slot A alone, a 4DI and this rate.
pub fn stored(baud: Baud) -> Vec<u8> {
    flash([&image(0), &[]], Module::Di4, &[(BAUD, baud.code())])
}

/// A line with boards that run from slot A.
pub struct Line {
    bus: Bus,
    units: u8,
    settings: Settings,
    /// One wrong bit in this number of bits, the same for all units; 0 for none.
    errors: u64,
    /// State of the generator of the errors.
    noise: u64,
    /// Each unit is asked for its points once a second.
    pub polls: bool,
    /// Time within which the answer to a poll has to begin.
    pub patience: Time,
    due: Time,
    /// Polls, and those without an answer.
    pub polled: [u32; 2],
    /// Beginning of the first block, end of the last one.
    blocks: Option<(Time, Time)>,
    last: Time,
    /// After this number of blocks the first board loses its supply for a moment.
    pub cut_after: Option<usize>,
}

impl Line {
    pub fn new(baud: Baud, units: u8) -> Self {
        let boards = (1..=units).map(|unit| made(stored(baud), Module::Di4, unit));
        Self::of(baud, boards.collect())
    }

    /// The same, with these boards, whose addresses count from 1.
    pub fn of(baud: Baud, boards: Vec<Board>) -> Self {
        let units = boards.len() as u8;
        let mut line = Self {
            bus: Bus::new(boards),
            units,
            settings: Settings {
                baud: baud.bits_per_second(),
                ..Settings::default()
            },
            errors: 0,
            noise: 1,
            polls: false,
            patience: Time::from_ms(100),
            due: Time::ZERO,
            polled: [0; 2],
            blocks: None,
            last: Time::ZERO,
            cut_after: None,
        };
        line.bus.line().set_settings(line.settings);
        line.bus.run_for(CHECK + START);
        line
    }

    /// Inverts bits as the line does.
    fn disturb(&mut self, bytes: &mut [u8]) {
        for byte in bytes {
            for bit in 0..8 {
                self.noise ^= self.noise << 13;
                self.noise ^= self.noise >> 7;
                self.noise ^= self.noise << 17;
                if self.errors > 0 && self.noise.is_multiple_of(self.errors) {
                    *byte ^= 1 << bit;
                }
            }
        }
    }

    /// Sends a frame, and runs until it has ended and the line was silent for t3.5.
    fn send(&mut self, unit: u8, pdu: &[u8]) {
        let mut bytes = adu(&[&[unit], pdu].concat());
        self.disturb(&mut bytes);
        let now = self.bus.now();
        let end = self.bus.line().send(now, &bytes);
        self.bus.run_until(end + self.gap());
    }

    /// The silence that a master keeps between frames: t3.5 and a character.
    fn gap(&self) -> Time {
        sim::line::frame_silence(self.settings) + self.settings.characters(1)
    }

    /// Returns the PDU of an answer that begins within `time`.
    fn answer(&mut self, unit: u8, time: Time) -> Option<Vec<u8>> {
        let until = self.bus.now() + time;
        while self.bus.line().received().next().is_none() && self.bus.now() < until {
            self.bus.run_for(Time::from_ms(1));
        }
        let mut count = 0;
        while self.bus.line().received().count() > count {
            count = self.bus.line().received().count();
            self.bus.run_for(self.gap());
        }
        let received = self.bus.line().take_received();
        let mut bytes: Vec<u8> = received.iter().map(|received| received.byte).collect();
        self.disturb(&mut bytes);
        let body = bytes.get(..bytes.len().checked_sub(2)?)?;
        (bytes == adu(body) && body[0] == unit).then(|| body[1..].to_vec())
    }

    fn ask(&mut self, unit: u8, pdu: &[u8], patience: Patience) -> Option<Vec<u8>> {
        let (time, times) = match patience {
            Patience::Little => (Time::from_ms(100), 1),
            Patience::Usual => (Time::from_ms(1000), 3),
        };
        (0..times).find_map(|_| {
            self.send(unit, pdu);
            self.answer(unit, time)
        })
    }

    /// Carries out a plan to its end.
    fn run(&mut self, campaign: &mut Campaign) {
        loop {
            let sent = campaign.blocks().0;
            let Some(step) = campaign.next_step() else {
                return;
            };
            if self.polls && self.bus.now() >= self.due {
                self.due = self.bus.now() + Time::from_ms(1000);
                for unit in 1..=self.units {
                    self.send(unit, &[2, 0, FIRST, 0, 4]);
                    let answer = self.answer(unit, self.patience);
                    self.polled[0] += 1;
                    self.polled[1] += u32::from(answer.is_none());
                }
            }
            let begins = self.bus.now();
            let answer = match step {
                Step::Wait(time) => {
                    self.bus.run_for(Time::from_us(time.as_micros() as u64));
                    None
                }
                Step::Probe(pdu) => {
                    self.send(0, &pdu);
                    self.answer(0, Time::from_ms(100))
                }
                Step::Broadcast { pdu, apart, pause } => {
                    let time =
                        |duration: std::time::Duration| Time::from_us(duration.as_micros() as u64);
                    let at = (self.bus.now() + time(pause)).max(self.last + time(apart));
                    self.bus.run_until(at);
                    self.last = at;
                    self.send(0, &pdu);
                    None
                }
                Step::Ask {
                    unit,
                    pdu,
                    patience,
                } => self.ask(unit, &pdu, patience),
            };
            if campaign.blocks().0 > sent {
                let (first, _) = self.blocks.unwrap_or((begins, begins));
                self.blocks = Some((first, self.bus.now()));
            }
            if self
                .cut_after
                .is_some_and(|blocks| campaign.blocks().0 >= blocks)
            {
                self.cut_after = None;
                self.bus.cycle(0);
            }
            campaign.take_answer(answer.as_deref());
        }
    }

    /// Updates all units. Returns the time of the blocks as a multiple of that of the image's bytes.
    pub fn update(&mut self) -> f64 {
        let update = std::fs::read(file(&format!("{}.modio", LAYOUT.board)));
        let update = File::of(&update.expect("the file of the update")).expect("it is whole");
        let image = update.image(Slot::B);
        let units =
            (1..=self.units).map(|unit| Unit::new(unit, Slot::B, image.words, Stage::Waiting));
        let mut campaign = Campaign::new(&image.blocks, units.collect(), false);
        let begins = self.bus.now();
        self.run(&mut campaign);
        let ends = self.bus.now();
        for unit in campaign.units() {
            assert_eq!(unit.stage, Stage::Done, "unit {}", unit.address);
        }
        let (first, last) = self.blocks.expect("blocks");
        let took = |from: Time, to: Time| (to - from).as_ps() as f64 / 1e12;
        let bytes = self
            .settings
            .characters((image.blocks.len() * BLOCK_BYTES) as u64);
        let ratio = took(first, last) / took(Time::ZERO, bytes);
        println!(
            "{} units at {}: prepare {:.1} s, {} blocks of {} in {:.1} s = {ratio:.2}, restart {:.1} s; polls {:?}",
            self.units,
            self.settings.baud,
            took(begins, first),
            campaign.blocks().0,
            image.blocks.len(),
            took(first, last),
            took(last, ends),
            self.polled,
        );
        ratio
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn bit_errors_delay_an_update_and_do_not_stop_it() {
    let mut line = Line::new(Baud::B115200, 1);
    line.errors = 10_000;
    let ratio = line.update();
    assert!(ratio < 2.0, "{ratio}");
}
