//! Damaged frames.

use fastrand::Rng;
use sim::line::{Character, Settings};

use super::traffic::{self, Outputs};
use crate::rig::adu;

/// Kind of damage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// One to eight inverted bits anywhere.
    Bits,
    /// Inverted bits within 16 bits in a row: a CRC of 16 bits detects all such bursts.
    Burst,
    /// The end is missing.
    CutShort,
    /// The beginning is missing.
    Beheaded,
    /// Additional bytes within the frame.
    Inserted,
    /// Missing bytes within the frame.
    Left,
    /// The CRC with its high byte first.
    Swapped,
    /// Two frames without a silence.
    Joined,
    /// Random bytes, without any part of a frame.
    Noise,
    /// A valid CRC, but more bytes than a frame may have.
    Overlong,
    /// All bytes are right, but a character has no stop bit.
    StopBit,
    /// All bytes are right, but the parity bit of one is wrong; without parity, its stop bit is missing.
    Parity,
}

/// All kinds of damage.
pub const KINDS: [Kind; 12] = [
    Kind::Bits,
    Kind::Burst,
    Kind::CutShort,
    Kind::Beheaded,
    Kind::Inserted,
    Kind::Left,
    Kind::Swapped,
    Kind::Joined,
    Kind::Noise,
    Kind::Overlong,
    Kind::StopBit,
    Kind::Parity,
];

/// A damaged frame.
#[derive(Debug)]
pub struct Damaged {
    pub kind: Kind,
    pub bytes: Vec<u8>,
    /// Index of the character with a fault.
    fault: usize,
}

impl Damaged {
    /// Returns whether a character has a fault that makes the frame invalid.
    pub fn has_fault(&self) -> bool {
        matches!(self.kind, Kind::StopBit | Kind::Parity)
    }

    /// Returns the characters of the frame.
    pub fn characters(&self, settings: Settings) -> impl Iterator<Item = Character> {
        let fault = self.has_fault().then_some(self.fault);
        let parity = self.kind == Kind::Parity && settings.format.parity().is_some();
        (0..).zip(&self.bytes).map(move |(index, byte)| {
            let character = Character::new(settings, *byte);
            if fault != Some(index) {
                character
            } else if parity {
                character.with_wrong_parity()
            } else {
                character.with_bad_stop(settings)
            }
        })
    }
}

/// Returns a damaged frame, usually one that would change an output if it were executed.
pub fn damaged(rng: &mut Rng, outputs: &Outputs) -> Damaged {
    let kind = *rng.choice(&KINDS).expect("KINDS is not empty");
    let sent = frame(rng, outputs);
    loop {
        let bytes = damage(kind, rng, outputs, &sent);
        if kind == Kind::StopBit || kind == Kind::Parity || bytes != sent {
            let fault = rng.usize(0..bytes.len());
            return Damaged { kind, bytes, fault };
        }
    }
}

fn frame(rng: &mut Rng, outputs: &Outputs) -> Vec<u8> {
    if rng.u8(0..4) == 0 {
        return adu(&traffic::request(rng, &mut outputs.clone()).0);
    }
    let unit = u8::from(rng.u8(0..4) != 0);
    adu(&[&[unit], &traffic::write(rng, outputs).0[..]].concat())
}

fn damage(kind: Kind, rng: &mut Rng, outputs: &Outputs, sent: &[u8]) -> Vec<u8> {
    let mut bytes = sent.to_vec();
    match kind {
        Kind::Bits => {
            for _ in 0..rng.usize(1..=8) {
                flip(&mut bytes, rng.usize(0..sent.len() * 8));
            }
        }
        Kind::Burst => {
            let first = rng.usize(0..sent.len() * 8 - 16);
            flip(&mut bytes, first);
            for bit in 1..16 {
                if rng.bool() {
                    flip(&mut bytes, first + bit);
                }
            }
        }
        Kind::CutShort => bytes.truncate(rng.usize(1..sent.len())),
        Kind::Beheaded => drop(bytes.drain(..rng.usize(1..sent.len()))),
        Kind::Inserted => {
            for _ in 0..rng.usize(1..=4) {
                bytes.insert(rng.usize(0..=bytes.len()), rng.u8(..));
            }
        }
        Kind::Left => {
            for _ in 0..rng.usize(1..=3) {
                bytes.remove(rng.usize(0..bytes.len()));
            }
        }
        Kind::Swapped => {
            let last = bytes.len() - 1;
            bytes.swap(last - 1, last);
            if bytes == sent {
                // Both bytes of the CRC were the same.
                bytes[last] ^= 1;
            }
        }
        Kind::Joined => bytes.extend(frame(rng, outputs)),
        Kind::Noise => {
            let most = if rng.u8(0..20) == 0 { 320 } else { 12 };
            bytes = (0..rng.usize(1..=most)).map(|_| rng.u8(..)).collect();
        }
        Kind::Overlong => {
            // An echo request with more data than the function allows.
            let mut request = vec![1, 8, 0, 0];
            request.extend((0..rng.usize(251..280)).map(|_| rng.u8(..)));
            bytes = adu(&request);
        }
        Kind::StopBit | Kind::Parity => {}
    }
    bytes
}

fn flip(bytes: &mut [u8], bit: usize) {
    bytes[bit / 8] ^= 1 << (bit % 8);
}
