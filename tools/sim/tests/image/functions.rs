//! Every module through every function code that accesses a point: all spans around the slot's four points, which
//! points can be read and written, and that a refused write changes nothing.

use register_map::points::Kind::{self, BitInput, BitOutput, WordInput, WordOutput};
use sim::{Channel, Module, Time};

use crate::bench::{Bench, SLOT};

/// Values of word outputs: different bits, and both ends of the range.
const CODES: [u16; 6] = [0, 4095, 1, 0x0A5A, 0x05A5, 2048];

struct Points {
    bench: Bench,
    kinds: [Kind; 4],
    /// Value of each point.
    image: [u16; 4],
    writes: usize,
}

impl Points {
    fn new(module: Module) -> Self {
        Self {
            bench: Bench::set_up(module, &[]),
            kinds: module.points(),
            image: [0; 4],
            writes: 0,
        }
    }

    /// Returns the points of a span as indices if all of them exist and are of these kinds.
    fn span(&self, start: u16, count: u16, will_do: &[Kind]) -> Option<std::ops::Range<usize>> {
        let first = usize::from(start.checked_sub(SLOT)?);
        let range = first..first + usize::from(count);
        let kinds = self.kinds.get(range.clone())?;
        kinds
            .iter()
            .all(|kind| will_do.contains(kind))
            .then_some(range)
    }

    fn spans() -> impl Iterator<Item = (u16, u16)> {
        (SLOT.saturating_sub(2)..=SLOT + 4)
            .flat_map(|start| (1..=6).map(move |count| (start, count)))
    }

    fn read_everything(&mut self) {
        for (start, count) in Self::spans() {
            let bits = self.span(start, count, &[BitInput, BitOutput]);
            let bits = bits.map(|range| self.image[range].iter().map(|v| *v != 0).collect());
            for function in [1, 2] {
                let read = self.bench.bits(function, start, count);
                assert_eq!(read, bits.clone().ok_or(2), "{function} {start:#x}+{count}");
            }
            let words = self.span(start, count, &[WordInput, WordOutput]);
            for function in [3, 4] {
                let read = self.bench.words(function, start, count);
                match (&read, &words) {
                    (Err(2), None) => {}
                    (Ok(read), Some(range)) => {
                        let near = read.iter().zip(range.clone()).all(|(word, point)| {
                            let slack = u16::from(self.kinds[point] == WordInput);
                            word.abs_diff(self.image[point]) <= slack
                        });
                        assert!(near, "{start:#x}+{count}: {read:?}, {:?}", self.image);
                    }
                    _ => panic!("{function} {start:#x}+{count}: {read:?}"),
                }
            }
        }
    }

    /// Asserts that the outputs have the values that were written last.
    fn assert_outputs(&mut self, after: &str) {
        if self.kinds.contains(&WordOutput) {
            self.bench.board.run_for(Time::from_ms(20));
        }
        for (point, kind) in self.kinds.into_iter().enumerate() {
            let seen = match (self.bench.board.module(), kind) {
                (Module::Relay2, BitOutput) => match self.bench.board.channel(point - 1) {
                    Channel::Relay { energised, .. } => energised.into(),
                    other => panic!("{other:?}"),
                },
                (_, BitOutput | WordOutput) => match self.bench.board.channel(point + 1) {
                    Channel::Do { on } => on.into(),
                    Channel::Ao { code } => code,
                    other => panic!("{other:?}"),
                },
                _ => continue,
            };
            assert_eq!(seen, self.image[point], "point {point} after {after}");
        }
    }

    fn write_bits_everywhere(&mut self) {
        for (start, count) in Self::spans() {
            self.writes += 1;
            let pattern = 0b0110_1001_1010_usize >> (self.writes % 6);
            let bits: Vec<bool> = (0..count).map(|n| pattern >> n & 1 != 0).collect();
            let range = self.span(start, count, &[BitOutput]);
            let written = self.bench.write_bits(start, &bits);
            assert_eq!(
                written,
                range.clone().map(drop).ok_or(2),
                "{start:#x}+{count}"
            );
            if let Some(range) = range {
                let bits = bits.iter().map(|bit| u16::from(*bit));
                self.image[range]
                    .iter_mut()
                    .zip(bits)
                    .for_each(|(v, bit)| *v = bit);
            }
            self.assert_outputs(&format!("0F {start:#x}+{count} {bits:?}"));
        }
        for address in SLOT.saturating_sub(1)..=SLOT + 4 {
            for (value, good) in [(0xFF00, true), (0x0001, false), (0, true), (0xFF01, false)] {
                let range = self.span(address, 1, &[BitOutput]);
                let expected = match (good, &range) {
                    (false, _) => Err(3),
                    (true, None) => Err(2),
                    (true, Some(_)) => Ok(()),
                };
                let written = self.bench.write_single(5, address, value);
                assert_eq!(written, expected, "05 {address:#x} {value:#x}");
                if let (true, Some(range)) = (good, range) {
                    self.image[range.start] = u16::from(value != 0);
                }
                self.assert_outputs(&format!("05 {address:#x} {value:#x}"));
            }
        }
    }

    fn write_words_everywhere(&mut self) {
        for (start, count) in Self::spans() {
            self.writes += 1;
            let words = CODES.iter().cycle().skip(self.writes).take(count.into());
            let words: Vec<u16> = words.copied().collect();
            let range = self.span(start, count, &[WordOutput]);
            // One word out of range at any place refuses the whole write. The check of the address comes before that.
            for bad in 0..words.len() {
                let mut spoilt = words.clone();
                spoilt[bad] = [4096, 0xFFFF][bad % 2];
                let refused = Err(if range.is_some() { 3 } else { 2 });
                let written = self.bench.write(start, &spoilt);
                assert_eq!(written, refused, "10 {start:#x} {spoilt:?}");
            }
            self.assert_outputs("refused writes");
            let written = self.bench.write(start, &words);
            assert_eq!(
                written,
                range.clone().map(drop).ok_or(2),
                "10 {start:#x} {words:?}"
            );
            if let Some(range) = range {
                self.image[range].copy_from_slice(&words);
            }
            self.assert_outputs(&format!("10 {start:#x} {words:?}"));
        }
        for address in SLOT.saturating_sub(1)..=SLOT + 4 {
            for value in [0, 4096, 4095, 0xFFFF, 1234] {
                let range = self.span(address, 1, &[WordOutput]);
                let expected = match &range {
                    None => Err(2),
                    Some(_) if value > 4095 => Err(3),
                    Some(_) => Ok(()),
                };
                let written = self.bench.write_single(6, address, value);
                assert_eq!(written, expected, "06 {address:#x} {value}");
                if let (Ok(()), Some(range)) = (expected, range) {
                    self.image[range.start] = value;
                }
                self.assert_outputs(&format!("06 {address:#x} {value}"));
            }
        }
    }

    /// Applies these values to the inputs: a voltage, a jumper on manual, or millivolts.
    fn apply(&mut self, values: Inputs) {
        for (point, kind) in self.kinds.into_iter().enumerate() {
            let (on, millivolts) = (values.bits[point], values.millivolts[point]);
            let (channel, board) = (point + 1, &mut self.bench.board);
            let applied = match (kind, board.channel(channel)) {
                (BitInput, Channel::Relay { .. }) => board.set_manual(channel, on),
                (BitInput, _) => board.set_energised(channel, on),
                (WordInput, _) => board.set_millivolts(channel, millivolts),
                _ => continue,
            };
            applied.unwrap();
            self.image[point] = match kind {
                BitInput => on.into(),
                // A pin's 0 to 3300 mV as a code of 12 bits.
                _ => ((u32::from(millivolts) * 4095 + 1650) / 3300) as u16,
            };
        }
        self.bench.board.run_for(Time::from_ms(200));
    }

    /// Tests all accesses. A module without inputs needs one round only.
    fn check(mut self) {
        let has_inputs = self
            .kinds
            .iter()
            .any(|kind| [BitInput, WordInput].contains(kind));
        let rounds = if has_inputs { ROUNDS.len() } else { 1 };
        for values in &ROUNDS[..rounds] {
            self.apply(*values);
            self.read_everything();
            self.write_bits_everywhere();
            self.write_words_everywhere();
        }
        self.read_everything();
    }
}

/// Values of the inputs of all points, of which each uses that of its kind.
#[derive(Clone, Copy)]
struct Inputs {
    bits: [bool; 4],
    millivolts: [u16; 4],
}

const ROUNDS: [Inputs; 3] = [
    Inputs {
        bits: [true, false, false, true],
        millivolts: [0, 825, 1650, 2475],
    },
    Inputs {
        bits: [false, true, false, false],
        millivolts: [3300, 1, 3299, 100],
    },
    Inputs {
        bits: [true, true, true, false],
        millivolts: [3000, 300, 0, 3300],
    },
];

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn points_of_every_module_are_read_and_written_as_their_kinds_allow() {
    std::thread::scope(|scope| {
        for module in Module::ALL {
            let check = move || Points::new(module).check();
            let thread = std::thread::Builder::new().name(module.to_string());
            thread.spawn_scoped(scope, check).expect("a thread");
        }
    });
}
