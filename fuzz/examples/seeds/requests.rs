//! Seeds with requests for the server. `modio_fuzz::pdu` describes the format.

use modbus_reference::{
    UNIT, pdu, read_files, write_bits, write_files, write_then_read, write_words,
};

use crate::{Seed, string};

/// Returns requests of every function: the smallest and the largest, near its limits, and with every error that the
/// standard names.
pub fn requests() -> Vec<(String, Vec<u8>)> {
    let mut all: Vec<(String, Vec<u8>)> = Vec::new();
    let mut add = |name: String, pdu: Vec<u8>| all.push((name, pdu));
    for (function, most, end) in [
        (1, 2000, 2010),
        (2, 2000, 2010),
        (3, 125, 130),
        (4, 125, 130),
    ] {
        for count in [0, 1, most, most + 1] {
            add(
                format!("{function:02x}-{count}"),
                pdu(function, &[0, count]),
            );
        }
        add(format!("{function:02x}-last"), pdu(function, &[end - 1, 1]));
        add(
            format!("{function:02x}-beyond"),
            pdu(function, &[end - 1, 2]),
        );
        add(
            format!("{function:02x}-no-wrap"),
            pdu(function, &[0xFFFF, 2]),
        );
        add(format!("{function:02x}-short"), pdu(function, &[0]));
        add(format!("{function:02x}-long"), pdu(function, &[0, 1, 0]));
    }
    for (function, value) in [
        (5, 0xFF00),
        (5, 0),
        (5, 0x1234),
        (6, 0),
        (6, 0xFFF0),
        (6, 0xFFF1),
    ] {
        add(
            format!("{function:02x}-{value:04x}"),
            pdu(function, &[3, value]),
        );
        add(
            format!("{function:02x}-{value:04x}-beyond"),
            pdu(function, &[0xFFFF, value]),
        );
    }
    for count in [1, 7, 8, 9, 1968] {
        add(format!("0f-{count}"), write_bits(2, &vec![true; count]));
    }
    for count in [1, 2, 123] {
        let words: Vec<u16> = (0..count).collect();
        add(format!("10-{count}"), write_words(2, &words));
        let mut odd = write_words(2, &words);
        odd[5] = odd[5].wrapping_sub(1);
        add(format!("10-{count}-odd"), odd);
    }
    add("0f-0".into(), write_bits(0, &[]));
    add("10-0".into(), write_words(0, &[]));
    add("10-refused".into(), write_words(0, &[1, 2, 0xFFFF]));
    add("10-beyond".into(), write_words(129, &[1, 2]));
    add("16".into(), pdu(0x16, &[4, 0x00F2, 0x0025]));
    add("16-refused".into(), pdu(0x16, &[4, 0, 0xFFFF]));
    add("17".into(), write_then_read(0, 125, 0, &[7; 121]));
    add("17-apart".into(), write_then_read(0, 3, 20, &[0xAAAA]));
    add("17-beyond".into(), write_then_read(129, 2, 0, &[1]));
    add("17-refused".into(), write_then_read(0, 1, 0, &[1, 0xFFFF]));
    for (name, groups) in [
        ("1", &[(1, 0, 1)][..]),
        ("124", &[(1, 1, 124)]),
        ("125", &[(1, 0, 125)]),
        ("most-groups", &[(3, 9_999, 1); 35]),
        ("beyond", &[(1, 0, 1), (1, 124, 2)]),
        ("10000", &[(3, 9_999, 2)]),
        ("no-file", &[(0, 0, 1)]),
        ("empty-file", &[(2, 0, 1)]),
        ("no-records", &[(1, 0, 0)]),
        ("none", &[]),
    ] {
        let words = |(file, record, count): &(u16, u16, u16)| {
            (*file, *record, vec![7; usize::from((*count).min(122))])
        };
        let writes: Vec<_> = groups.iter().take(20).map(words).collect();
        add(format!("14-{name}"), read_files(groups));
        add(format!("15-{name}"), write_files(&writes));
    }
    add(
        "15-refused".into(),
        write_files(&[(1, 0, vec![1]), (3, 0, vec![0xFFFF])]),
    );
    for function in [0x07, 0x0B, 0x0C, 0x11, 0x00, 0x63, 0x80, 0x83, 0xFF] {
        add(format!("{function:02x}"), vec![function]);
        add(format!("{function:02x}-long"), vec![function, 0]);
    }
    for sub in 0..0x16 {
        add(format!("08-{sub:02x}"), pdu(0x08, &[sub, 0]));
    }
    for (sub, data) in [
        (1, 0xFF00),
        (1, 0x00FF),
        (3, 0x2300),
        (3, 0x3A00),
        (4, 1),
        (0x0A, 1),
    ] {
        add(format!("08-{sub:02x}-{data:04x}"), pdu(0x08, &[sub, data]));
    }
    add("08-echo".into(), [&[0x08, 0, 0][..], &[0xA5; 250]].concat());
    for code in 0..6 {
        for object in [0, 1, 6, 7, 0x80, 0x83, 0xFF] {
            add(
                format!("2b-{code}-{object:02x}"),
                vec![0x2B, 0x0E, code, object],
            );
        }
    }
    add("2b-canopen".into(), vec![0x2B, 0x0D, 0, 0]);
    all
}

/// Returns a request of a script, to this unit.
fn to_unit(pdu: &[u8]) -> Vec<u8> {
    [vec![0], string(pdu)].concat()
}

/// Returns the seeds of target `pdu`.
pub fn seeds() -> Vec<Seed> {
    // In RTU and in ASCII mode. Every point with an address of one byte can be written.
    const SETTINGS: [u8; 2] = [0, 255];
    const ASCII: [u8; 2] = [1, 255];
    let mut seeds: Vec<Seed> = requests()
        .into_iter()
        .map(|(name, pdu)| (name, [&SETTINGS, &to_unit(&pdu)[..]].concat()))
        .collect();
    let every = |settings: [u8; 2], keep: &dyn Fn(&[u8]) -> bool, tag: u8| {
        let all = requests()
            .into_iter()
            .filter(|(_, pdu)| keep(pdu) && pdu.len() < 20);
        let all = all.flat_map(|(_, pdu)| [vec![tag], string(&pdu)].concat());
        settings.into_iter().chain(all).collect::<Vec<u8>>()
    };
    let all = |_: &[u8]| true;
    seeds.push(("every-ascii".into(), every(ASCII, &all, 0)));
    seeds.push(("every-broadcast".into(), every(SETTINGS, &all, 1)));
    for state in 4..8 {
        let points = |pdu: &[u8]| ![7, 8, 11, 12, 17].contains(&pdu[0]);
        let name = format!("every-in-state-{state}");
        seeds.push((name, every(SETTINGS, &points, state << 5)));
    }
    seeds.push(("every-read-only".into(), every([0, 2], &all, 0)));
    let only_listens = [
        to_unit(&pdu(8, &[4, 0])),
        to_unit(&pdu(3, &[0, 1])),
        to_unit(&pdu(8, &[0x0B, 0])),
        to_unit(&pdu(8, &[1, 0xFF00])),
        to_unit(&[0x0C]),
    ];
    let only_listens = [&SETTINGS, &only_listens.concat()[..]].concat();
    seeds.push(("only-listens".into(), only_listens));
    let bad = [
        vec![3],
        string(&[0, 1, 0, 1]),
        to_unit(&[0x0C]),
        to_unit(&pdu(8, &[0x14, 0])),
    ];
    let bad = [
        &SETTINGS,
        &[bad.concat(), to_unit(&pdu(8, &[0x12, 0]))].concat()[..],
    ]
    .concat();
    seeds.push(("bad-frames".into(), bad));
    let many = [vec![3], string(&[1; 200]), to_unit(&[0x0C])].concat();
    seeds.push((
        "more-bad-frames-than-the-log-holds".into(),
        [&SETTINGS, &many[..]].concat(),
    ));
    let other = [
        vec![2],
        string(&[UNIT + 1, 3, 0, 0, 0, 1]),
        vec![2],
        string(&[UNIT]),
    ]
    .concat();
    seeds.push((
        "to-another-and-to-nobody".into(),
        [&SETTINGS, &other[..]].concat(),
    ));
    seeds
}
