//! Seeds with flash pages and device histories for the store. `modio_fuzz::store` and `modio_fuzz::pages` describe
//! the format.

use crate::{Seed, string};

const START: u8 = 2;
const SPARE: u8 = 4;

/// A page that was never used.
const ERASED: [u8; 1] = [0];

fn save(seed: u8, size: u8) -> Vec<u8> {
    vec![0, seed, size]
}

fn cut(after: u8, kind: u8, operand: u16) -> Vec<u8> {
    let [low, high] = operand.to_le_bytes();
    vec![3, after, kind, low, high]
}

/// Returns a record of a page with this sequence number, and with settings of this size.
fn record(sequence: u16, size: u8) -> Vec<u8> {
    let [low, high] = sequence.to_le_bytes();
    vec![2, low, high, 0, sequence as u8, size]
}

/// Returns a page with a mark and these pieces.
fn page(pieces: &[Vec<u8>]) -> Vec<u8> {
    [vec![1], pieces.concat(), vec![0]].concat()
}

fn seed(name: &str, pages: [&[u8]; 2], events: &[Vec<u8>]) -> Seed {
    let base = [0; 4];
    let bytes = [&base, pages[0], pages[1], &events.concat()].concat();
    (name.to_owned(), bytes)
}

/// Returns the seeds of target `store`.
pub fn seeds() -> Vec<Seed> {
    let both = [page(&[record(1, 3), record(2, 9)]), page(&[record(3, 5)])];
    let both = [both[0].as_slice(), both[1].as_slice()];
    let new = [&ERASED[..], &ERASED];
    let full: Vec<Vec<u8>> = (1..=7).map(|sequence| record(sequence, 25)).collect();
    let full = page(&full);
    let damaged = page(&[record(1, 9), vec![3], record(2, 9)[1..].to_vec(), vec![4]]);
    let damaged = [&damaged[..damaged.len() - 2], &[5, 0]].concat();
    let noise: Vec<u8> = (0..=254_u8).map(|n| n.wrapping_mul(0x9D)).collect();
    let noise = [&[4][..], &string(&noise), &[0]].concat();
    let unknown = page(&[vec![
        2, 1, 0, 3, 0x00, 0x01, 7, 0, 0x01, 0x01, 12, 0, 0x10, 0x01, 99, 0,
    ]]);
    let many: Vec<Vec<u8>> = (0..30).map(|seed| save(seed, 40)).collect();
    let spared: Vec<Vec<u8>> = (0..25)
        .flat_map(|seed| [save(seed, 50), vec![SPARE]])
        .collect();
    let mut seeds = vec![
        seed("first-start", new, &[]),
        seed(
            "first-saves",
            new,
            &[save(1, 0), save(2, 5), vec![START], vec![7]],
        ),
        seed("every-setting", new, &[vec![1, 3], vec![START], vec![1, 4]]),
        seed("two-pages", both, &[vec![START]]),
        seed(
            "the-newest-on-the-first-page",
            [both[1], both[0]],
            &[save(5, 7)],
        ),
        seed("a-full-page", [&full, &ERASED], &[vec![START], save(8, 25)]),
        seed("both-full", [&full, &full], &[vec![START], save(8, 25)]),
        seed(
            "a-damaged-record",
            [&damaged, &ERASED],
            &[vec![START], save(8, 2)],
        ),
        seed("noise", [&noise, &ERASED], &[vec![START]]),
        seed("noise-on-both", [&noise, &noise], &[save(1, 1)]),
        seed(
            "unknown-addresses-and-values",
            [&unknown, &ERASED],
            &[vec![START], save(1, 1)],
        ),
        seed("a-beginning", [&[1, 6, 0], &ERASED], &[save(1, 1)]),
        seed(
            "something-near-the-end",
            [&[1, 7, 9, 6, 0], &ERASED],
            &[save(1, 1)],
        ),
        seed("zeros", [&[4, 4, 0, 0, 0, 0, 0], &ERASED], &[save(1, 1)]),
        seed("many-saves", new, &many),
        seed("many-saves-with-spares", new, &spared),
        seed(
            "a-worn-half-word",
            new,
            &[save(1, 4), vec![5, 30, 0], save(2, 9), save(3, 9)],
        ),
        seed(
            "a-worn-second-page",
            both,
            &[vec![5, 9, 0x80], save(2, 9), vec![START], save(3, 9)],
        ),
        seed(
            "two-settings",
            new,
            &[vec![6, 1, 96, 0, 0x60, 0xD0, 7], vec![START]],
        ),
    ];
    // Nothing was ever stored, and several starts in a row were interrupted.
    let half_marked = [4, 2, 0x6F, 0xFF, 0];
    for kind in 0..6 {
        let events = [cut(0, kind, 1024), vec![SPARE], save(1, 3)];
        let name = format!("half-marked-{kind}");
        seeds.push(seed(&name, [&half_marked, &half_marked], &events));
        let name = format!("half-marked-and-erased-{kind}");
        seeds.push(seed(&name, [&ERASED, &half_marked], &events));
    }
    // The wrap of the sequence numbers.
    for (name, base) in [("wrap", u32::MAX), ("sign", 0x7FFF_FFFF)] {
        let (_, mut bytes) = seed(name, both, &[vec![START], save(1, 3), vec![START]]);
        bytes[..4].copy_from_slice(&base.to_le_bytes());
        seeds.push((name.to_owned(), bytes));
    }
    for kind in 0..6 {
        for after in [0, 1, 5, 12] {
            let events = [
                save(1, 6),
                cut(after, kind, 600),
                save(2, 9),
                vec![START],
                save(3, 3),
            ];
            seeds.push(seed(&format!("cut-{kind}-{after}"), new, &events));
        }
        let events = [
            vec![START],
            cut(0, kind, 77),
            vec![SPARE],
            vec![START],
            save(1, 30),
        ];
        seeds.push(seed(
            &format!("cut-a-spare-{kind}"),
            [&full, both[1]],
            &events,
        ));
    }
    seeds
}
