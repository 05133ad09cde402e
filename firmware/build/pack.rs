//! Packs the self-description, so that it takes a sixth less flash.
//!
//! The most frequent pair of neighbours is replaced by a code from 0x80 on, then the most frequent pair of the result,
//! and so on (byte-pair encoding). Each code is then looked up as the whole phrase that it stands for, so that
//! `src/device/packed.rs` unpacks without a stack. No code crosses a position that is a multiple of [`BLOCK`].

use std::{cmp::Reverse, collections::BTreeMap};

/// Bytes of the document that are packed separately.
pub const BLOCK: usize = 32;

/// First byte that is a code. A smaller byte is itself.
const FIRST: u8 = 0x80;

/// A packed document.
pub struct Packed {
    /// The packed blocks, one after another.
    pub bytes: Vec<u8>,
    /// Offset of each block in `bytes`.
    pub blocks: Vec<u16>,
    /// For each code from [`FIRST`] on: offset and length of its phrase in `text`.
    pub phrases: Vec<[u8; 2]>,
    /// The phrases, which may overlap.
    pub text: Vec<u8>,
}

/// Packs a document.
pub fn pack(document: &[u8]) -> Packed {
    let mut blocks: Vec<Vec<u8>> = document.chunks(BLOCK).map(<[u8]>::to_vec).collect();
    // A byte of the document from `FIRST` on is the code of itself.
    let mut phrases: Vec<Vec<u8>> = (0..=u8::MAX).map(|byte| vec![byte]).collect();
    let codes = (FIRST..=u8::MAX).filter(|code| !document.contains(code));
    for code in codes {
        let Some(pair) = most_frequent(&blocks) else {
            break;
        };
        for block in &mut blocks {
            *block = replaced(block, pair, code);
        }
        phrases[usize::from(code)] = pair.map(|one| phrases[usize::from(one)].clone()).concat();
    }
    let phrases = phrases.split_off(FIRST.into());
    let text = text(&phrases);
    let place = |phrase: &Vec<u8>| {
        let offset = find(&text, phrase).expect("the text has every phrase");
        [offset, phrase.len()].map(|n| u8::try_from(n).expect("the text is short"))
    };
    let starts = blocks.iter().scan(0, |end, block| {
        let start = *end;
        *end += block.len();
        Some(u16::try_from(start).expect("a document is shorter than 64 KiB"))
    });
    Packed {
        blocks: starts.collect(),
        bytes: blocks.concat(),
        phrases: phrases.iter().map(place).collect(),
        text,
    }
}

/// Returns the pair of neighbours that occurs most often, if one occurs more than once.
fn most_frequent(blocks: &[Vec<u8>]) -> Option<[u8; 2]> {
    // Sorted, so that every build makes the same bytes.
    let mut counts = BTreeMap::new();
    for pair in blocks.iter().flat_map(|block| block.windows(2)) {
        *counts.entry([pair[0], pair[1]]).or_insert(0) += 1;
    }
    let (pair, count) = counts.into_iter().max_by_key(|(_, count)| *count)?;
    (count > 1).then_some(pair)
}

fn replaced(block: &[u8], pair: [u8; 2], code: u8) -> Vec<u8> {
    let mut made = Vec::new();
    let mut rest = block;
    while let [first, others @ ..] = rest {
        if rest.starts_with(&pair) {
            made.push(code);
            rest = &rest[2..];
        } else {
            made.push(*first);
            rest = others;
        }
    }
    made
}

/// Returns a text that contains every phrase.
fn text(phrases: &[Vec<u8>]) -> Vec<u8> {
    let mut longest_first: Vec<&Vec<u8>> = phrases.iter().collect();
    longest_first.sort_by_key(|phrase| Reverse(phrase.len()));
    longest_first
        .into_iter()
        .fold(Vec::new(), |mut text, phrase| {
            if find(&text, phrase).is_none() {
                text.extend(phrase);
            }
            text
        })
}

fn find(text: &[u8], phrase: &[u8]) -> Option<usize> {
    text.windows(phrase.len())
        .position(|window| window == phrase)
}
