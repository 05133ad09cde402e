//! Every module through every function code that accesses a point: all spans around the slot's four points, which
//! points can be read and written, and that a refused write changes nothing.

use sim::{Channel, Module, Time};

use Kind::{BitInput, BitOutput, Nothing, WordInput, WordOutput};

use crate::bench::{Bench, SLOT};

/// Kind of a point according to the manual, written out here so that the test does not use the firmware's table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Nothing,
    BitInput,
    BitOutput,
    WordInput,
    WordOutput,
}

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
    fn new(module: Module, kinds: [Kind; 4]) -> Self {
        Self {
            bench: Bench::set_up(module, &[]),
            kinds,
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

    /// Tests all accesses; `outside` applies each of the values in `inputs` to the input pins.
    fn check(mut self, outside: impl Fn(&mut Bench, [u16; 4]), inputs: &[[u16; 4]]) {
        for given in inputs {
            outside(&mut self.bench, *given);
            self.bench.board.run_for(Time::from_ms(200));
            for (point, kind) in self.kinds.into_iter().enumerate() {
                match kind {
                    BitInput => self.image[point] = given[point],
                    // A pin's 0 to 3300 mV as a code of 12 bits.
                    WordInput => {
                        self.image[point] = ((u32::from(given[point]) * 4095 + 1650) / 3300) as u16
                    }
                    _ => {}
                }
            }
            self.read_everything();
            self.write_bits_everywhere();
            self.write_words_everywhere();
        }
        self.read_everything();
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn an_empty_slot_has_no_points() {
    Points::new(Module::None, [Nothing; 4]).check(|_, _| {}, &[[0; 4]]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_4di_is_read_as_bits_and_refuses_writes() {
    let energise = |bench: &mut Bench, given: [u16; 4]| {
        for (channel, on) in (1..).zip(given) {
            bench.board.set_energised(channel, on != 0).unwrap();
        }
    };
    Points::new(Module::Di4, [BitInput; 4]).check(energise, &[[1, 0, 0, 1], [0, 1, 0, 0]]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_4do_is_read_and_written_as_bits() {
    Points::new(Module::Do4, [BitOutput; 4]).check(|_, _| {}, &[[0; 4]]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_2relay_has_two_jumpers_to_read_and_two_coils_to_write() {
    let jumpers = |bench: &mut Bench, given: [u16; 4]| {
        for (relay, manual) in [(1, given[0]), (2, given[1])] {
            bench.board.set_manual(relay, manual != 0).unwrap();
        }
    };
    let kinds = [BitInput, BitInput, BitOutput, BitOutput];
    let inputs = [[0, 0, 0, 0], [0, 1, 0, 0], [1, 0, 0, 0], [1, 1, 0, 0]];
    Points::new(Module::Relay2, kinds).check(jumpers, &inputs);
}

fn apply(bench: &mut Bench, millivolts: &[u16]) {
    for (channel, millivolts) in (1..).zip(millivolts) {
        bench.board.set_millivolts(channel, *millivolts).unwrap();
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_4ai_is_read_as_words_and_refuses_writes() {
    Points::new(Module::Ai4, [WordInput; 4]).check(
        |bench, given| apply(bench, &given),
        &[[0, 825, 1650, 2475], [3300, 1, 3299, 100]],
    );
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_4ao_is_read_and_written_as_words() {
    Points::new(Module::Ao4, [WordOutput; 4]).check(|_, _| {}, &[[0; 4]]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_2ai2ao_has_two_words_to_read_and_two_to_write() {
    Points::new(
        Module::Ai2Ao2,
        [WordInput, WordInput, WordOutput, WordOutput],
    )
    .check(
        |bench, given| apply(bench, &given[..2]),
        &[[3000, 300, 0, 0], [0, 3300, 0, 0]],
    );
}
