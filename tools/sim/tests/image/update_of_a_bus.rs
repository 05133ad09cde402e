//! The plan of `modioctl update` with several units on one line, in virtual time.

use std::time::Duration;

use modioctl::update::{Campaign, Patience, Stage, Step, Unit};
use register_map::configuration::BAUD;
use register_map::update::{BLOCK_BYTES, Header, Slot};
use sim::line::{Format, Received, Settings};
use sim::{Board, Bus, Config, Image, Time, chip};

use crate::LAYOUT;
use crate::bench::{adu, corner, path};
use crate::slots::{CHECK, START, image, signed, unit};

/// Rate of the line.
const RATE: u32 = 115_200;

/// Longest time until an answer begins.
const LITTLE: Time = Time::from_ms(60);
const USUAL: Time = Time::from_ms(1000);

fn time(duration: Duration) -> Time {
    Time::from_ns(duration.as_nanos() as u64)
}

/// The line, as `modioctl` uses it.
struct Line {
    bus: Bus,
    settings: Settings,
    /// Beginning of the last block.
    block: Time,
}

impl Line {
    /// Returns units 1 to `count`, which run the image in slot A.
    fn new(count: u8) -> Self {
        let loader = Image::read(&path("MODIO_LOADER")).expect("the loader can be read");
        let mut first = unit([&image(0), &[]], &[(BAUD, (RATE / 100) as u16)]);
        first.board.run_for(CHECK + START);
        let flash = first.board.flash().to_vec();
        let board = |dip| {
            let mut chip = chip::Config::holding(flash.clone());
            chip.corner = corner();
            let config = Config {
                dip,
                layout: LAYOUT,
                chip,
                ..Config::default()
            };
            Board::new(&loader, config).expect("the image fits")
        };
        let mut bus = Bus::new((1..=count).map(board).collect());
        let settings = Settings {
            baud: RATE,
            format: Format::N2,
        };
        bus.line().set_settings(settings);
        bus.run_for(START);
        Self {
            bus,
            settings,
            block: Time::ZERO,
        }
    }

    fn silence(&self) -> Time {
        sim::line::frame_silence(self.settings)
    }

    /// Sends a request and waits until t3.5 after it.
    fn send(&mut self, unit: u8, pdu: &[u8]) {
        let now = self.bus.now();
        let end = self.bus.line().send(now, &adu(&[&[unit], pdu].concat()));
        self.bus.run_until(end + self.silence());
    }

    /// Returns what is received within this time, until t3.5 after it.
    fn receive(&mut self, within: Time) -> Option<Vec<u8>> {
        let character = self.settings.characters(1);
        let end = self.bus.now() + within;
        while self.bus.line().received().next().is_none() && self.bus.now() < end {
            self.bus.run_for(character);
        }
        loop {
            let last = self.bus.line().received().next_back().map(|last| last.end);
            if last.is_none_or(|last| last + self.silence() <= self.bus.now()) {
                break;
            }
            self.bus.run_for(character);
        }
        let received = self.bus.line().take_received();
        assert!(received.iter().all(Received::is_good), "{received:?}");
        let bytes: Vec<_> = received.iter().map(|received| received.byte).collect();
        let body = bytes.get(..bytes.len().checked_sub(2)?)?;
        assert_eq!(bytes, adu(body), "the CRC");
        Some(body[1..].to_vec())
    }

    /// Carries out a plan. Returns the time from the first block to the last one. Calls `after` with the number of
    /// blocks that were sent, after each of them.
    fn run(&mut self, campaign: &mut Campaign, mut after: impl FnMut(&mut Bus, usize)) -> Time {
        let (mut first, mut last) = (None, Time::ZERO);
        let mut sent = 0;
        while let Some(step) = campaign.next_step() {
            let begin = self.bus.now();
            let answer = match step {
                Step::Wait(pause) => {
                    self.bus.run_for(time(pause));
                    None
                }
                Step::Probe(pdu) => {
                    self.send(0, &pdu);
                    self.receive(LITTLE)
                }
                Step::Broadcast { pdu, apart, pause } => {
                    let from = self.bus.now() + time(pause);
                    self.bus.run_until(from.max(self.block + time(apart)));
                    self.block = self.bus.now();
                    self.send(0, &pdu);
                    None
                }
                Step::Ask {
                    unit,
                    pdu,
                    patience,
                } => {
                    self.send(unit, &pdu);
                    self.receive(match patience {
                        Patience::Little => LITTLE,
                        Patience::Usual => USUAL,
                    })
                }
            };
            campaign.take_answer(answer.as_deref());
            let (now_sent, _) = campaign.blocks();
            if now_sent > sent {
                sent = now_sent;
                first = first.or(Some(begin));
                last = self.bus.now();
                after(&mut self.bus, sent);
            }
        }
        last - first.expect("blocks were sent")
    }
}

/// Returns the blocks of an image.
fn blocks(image: &[u8]) -> Vec<[u8; BLOCK_BYTES]> {
    let mut image = image.to_vec();
    image.resize(image.len().next_multiple_of(BLOCK_BYTES), 0xFF);
    image.as_chunks().0.to_vec()
}

/// Returns the plan that brings an image with another epoch to units 1 to `count`.
fn plan(count: u8) -> Campaign {
    let new = signed(1, |image| image[6] = 1);
    let words = Header::of(&new).expect("a header").words();
    let units = (1..=count).map(|unit| Unit::new(unit, Slot::B, words, Stage::Waiting));
    Campaign::new(&blocks(&new), units.collect(), false)
}

fn assert_all_done(campaign: &Campaign) {
    let mut units = campaign.units().iter();
    assert!(units.all(|unit| unit.stage == Stage::Done), "{campaign:?}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn units_on_one_line_are_updated_in_the_time_of_one() {
    let mut line = Line::new(2);
    let mut campaign = plan(2);
    let taken = line.run(&mut campaign, |_, _| ());
    assert_all_done(&campaign);
    let image = blocks(&image(1)).as_flattened().len();
    let image = line.settings.characters(image as u64);
    let percent = taken.as_ps() * 100 / image.as_ps();
    assert!(percent <= 130, "{percent} % of the time of the image");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_unit_that_loses_its_supply_during_an_update_begins_again() {
    let mut line = Line::new(2);
    let mut campaign = plan(2);
    line.run(&mut campaign, |bus, sent| {
        if sent == 200 {
            bus.cycle(1);
        }
    });
    assert_all_done(&campaign);
    let (sent, all) = (campaign.blocks().0, blocks(&image(1)).len());
    assert!((2 * all - 10..2 * all + 60).contains(&sent), "{sent}");
}
