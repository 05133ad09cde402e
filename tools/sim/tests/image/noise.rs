//! Endurance: the device answers the next valid request after any bytes on the line, and never answers a damaged
//! request.
//!
//! `cargo xtask soak` runs [`soak`] with a million frames.

mod damage;
mod traffic;

use std::env;
use std::time::{Duration, Instant};

use fastrand::Rng;
use register_map::configuration::{BAUD, FORMAT, STRICT_T15};
use sim::{Channel, Module, Time};

use crate::rig::{Most, Rig, adu, corner, crc};
use damage::{Damaged, KINDS};
use traffic::Outputs;

/// Number of frames in each test when the environment variable is not set.
const FRAMES: usize = 10_000;
const VARIABLE: &str = "MODIO_SOAK_FRAMES";

/// Longest time that an interrupt of the line may be delayed.
const WAIT: Most = Most(Time::from_us(6), Time::from_us(11));

/// Line settings of the soak test: BAUD, FORMAT, `STRICT_T15`.
const LINES: [[u16; 3]; 4] = [[96, 0, 0], [192, 1, 1], [1152, 3, 0], [9216, 2, 1]];

/// Sends valid frames and frames damaged in every way, with the shortest allowed silence between them. The unit must
/// answer or obey every valid frame for it, ignore frames for other units, and only count damaged frames. The exception
/// is damage that a CRC cannot detect: the damaged frame has a valid CRC by chance.
#[test]
#[ignore = "needs the image: cargo xtask test, cargo xtask soak"]
fn soak() {
    let frames = env::var(VARIABLE).map_or(FRAMES, |number| number.parse().expect(VARIABLE));
    let mut soak = Soak::new(frames);
    for (index, line) in LINES.into_iter().enumerate() {
        soak.line(index, line, frames * (index + 1) / LINES.len());
    }
    soak.sum_up();
}

fn is_good(frame: &[u8]) -> bool {
    let split = frame.len().saturating_sub(2);
    (4..=256).contains(&frame.len()) && frame[split..] == crc(&frame[..split])
}

/// Numbers of frames sent on all lines.
struct Soak {
    frames: usize,
    good: usize,
    answered: usize,
    damaged: [usize; KINDS.len()],
    /// Number of damaged frames whose CRC is valid nevertheless.
    undetectable: usize,
    begin: Instant,
    told: Instant,
}

impl Soak {
    fn new(frames: usize) -> Self {
        Self {
            frames,
            good: 0,
            answered: 0,
            damaged: [0; KINDS.len()],
            undetectable: 0,
            begin: Instant::now(),
            told: Instant::now(),
        }
    }

    fn sent(&self) -> usize {
        self.good + self.undetectable + self.damaged.iter().sum::<usize>()
    }

    /// Continues on this line until `until` frames have been sent on all lines together.
    fn line(&mut self, index: usize, [baud, format, strict]: [u16; 3], until: usize) {
        let stored = [(BAUD, baud), (FORMAT, format), (STRICT_T15, strict)];
        let mut rig = Rig::set_up(Module::Do4, &stored);
        // Other work that is due at the end of the silence delays a reply.
        rig.patience = Time::from_us(60);
        let mut rng = Rng::with_seed(0x6D6F_6469_6F02 + index as u64);
        let mut outputs = Outputs::default();
        let (good, bad) = (self.good, self.damaged.iter().sum::<usize>());
        let undetectable = self.undetectable;
        while self.sent() < until {
            self.round(&mut rig, &mut rng, &mut outputs);
            self.tell();
        }
        for (channel, on) in (1..).zip(outputs.0) {
            assert_eq!(rig.board.channel(channel), Channel::Do { on });
        }
        // The unit must have counted the same number of frames, in 16 bits.
        let good = self.good - good + self.undetectable - undetectable;
        let bad = self.damaged.iter().sum::<usize>() - bad;
        for (sub, count) in [(0x0B, good + 1), (0x0C, bad)] {
            let [high, low] = (count as u16).to_be_bytes();
            let reply = rig.ask(1, &[8, 0, sub, 0, 0]);
            assert_eq!(reply, Some(vec![8, 0, sub, high, low]), "{count} counted");
        }
    }

    /// Sends some damaged frames, then a valid one.
    fn round(&mut self, rig: &mut Rig, rng: &mut Rng, outputs: &mut Outputs) {
        // A receiver that has lost the start of a character may see the end of a damaged frame as a character that
        // ends almost one character later. The unit measures the silence from the interrupt, which may be delayed.
        let silence = rig.t35() + rig.characters(1) + WAIT.of(corner());
        let mut at = rig.board.now();
        let mut before = Vec::new();
        for _ in 0..rng.usize(0..4) {
            let damaged = damage::damaged(rng, outputs);
            if !damaged.has_fault() && is_good(&damaged.bytes) {
                // The unit may treat this frame as valid, so send it alone and switch the outputs off afterwards.
                self.undetectable += 1;
                rig.board.run_until(at);
                rig.exchange(&damaged.bytes);
                rig.ask(1, &outputs.all_off())
                    .expect("the unit executes the write");
                self.good += 1;
                self.answered += 1;
                at = rig.board.now();
                continue;
            }
            self.damaged[damaged.kind as usize] += 1;
            at = send(rig, at, &damaged) + silence;
            before.push(damaged);
        }
        let (request, reply) = traffic::request(rng, outputs);
        rig.sent = rig.board.line().send(at, &adu(&request));
        let received = rig.answer_after(rig.sent);
        let expected = reply.map(|reply| adu(&reply)).unwrap_or_default();
        assert!(
            received == expected,
            "{request:02X?} got {received:02X?}, not {expected:02X?}, after {before:02X?}"
        );
        self.good += 1;
        self.answered += usize::from(!received.is_empty());
    }

    /// Prints the progress from time to time.
    fn tell(&mut self) {
        if self.told.elapsed() > Duration::from_secs(10) {
            self.told = Instant::now();
            let time = self.begin.elapsed().as_secs();
            eprintln!("{} of {} frames in {time} s", self.sent(), self.frames);
        }
    }

    fn sum_up(&self) {
        let damaged: usize = self.damaged.iter().sum();
        println!(
            "{} good frames, of which {} needed a reply: none was lost",
            self.good, self.answered
        );
        println!("{damaged} damaged frames: none was accepted");
        for (kind, count) in KINDS.iter().zip(self.damaged) {
            println!("  {count:>8}  {kind:?}");
        }
        println!(
            "{} more damaged frames had a valid CRC by chance",
            self.undetectable
        );
        // If every damage had the same probability, the average would be one in 65 536. Here it is less.
        assert!(self.undetectable <= 5 + damaged / 10_000);
        assert!(self.frames < 1000 || self.damaged.iter().all(|count| *count > 0));
    }
}

/// Sends the frame at `at`. Returns the end of the last stop bit.
fn send(rig: &mut Rig, at: sim::Time, damaged: &Damaged) -> sim::Time {
    let line = rig.board.line();
    let settings = line.settings();
    damaged
        .characters(settings)
        .fold(at, |at, character| line.send_character(at, character))
}
