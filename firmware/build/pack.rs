//! Packs the self-description by byte-pair encoding, so that it takes a third less flash.
//!
//! The most frequent pair of neighbours is replaced by a byte from 0x80 on that the document does not use, then the
//! most frequent pair of the result, and so on. `src/device/packed.rs` unpacks the bytes from any position that is a
//! multiple of [`BLOCK`], because no pair crosses such a position.

use std::collections::BTreeMap;

/// Bytes of the document that are packed separately.
pub const BLOCK: usize = 256;

/// First byte that can stand for a pair.
const FIRST: u8 = 0x80;

/// A packed document.
pub struct Packed {
    /// The packed blocks, one after another.
    pub bytes: Vec<u8>,
    /// Offset of each block in `bytes`.
    pub blocks: Vec<u16>,
    /// For each byte from [`FIRST`] on: the pair that it stands for, or the byte itself, twice.
    pub pairs: Vec<[u8; 2]>,
    /// Largest number of bytes that wait while a byte is being unpacked.
    pub depth: usize,
}

/// Packs a document.
pub fn pack(document: &[u8]) -> Packed {
    let mut blocks: Vec<Vec<u8>> = document.chunks(BLOCK).map(<[u8]>::to_vec).collect();
    let mut pairs: Vec<[u8; 2]> = (FIRST..=u8::MAX).map(|byte| [byte; 2]).collect();
    let mut depths = [0; 256];
    let unused = (FIRST..=u8::MAX).filter(|byte| !document.contains(byte));
    for code in unused {
        let Some(pair) = most_frequent(&blocks) else {
            break;
        };
        for block in &mut blocks {
            *block = replaced(block, pair, code);
        }
        pairs[usize::from(code - FIRST)] = pair;
        let [first, second] = pair.map(usize::from);
        depths[usize::from(code)] = depths[second].max(depths[first] + 1);
    }
    let ends = blocks.iter().scan(0, |end, block| {
        let start = *end;
        *end += block.len() as u16;
        Some(start)
    });
    Packed {
        blocks: ends.collect(),
        bytes: blocks.concat(),
        pairs,
        depth: depths.into_iter().max().unwrap_or_default(),
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
