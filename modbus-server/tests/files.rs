//! File records, functions 14 and 15 (V1.1b3 6.14, 6.15): the checks and their order, and the lengths of requests
//! and replies.

mod common;

use common::{MAX_WORD, Points, UNIT, Unit, frame, read_files, write_files};
use modbus_server::Exception;

/// Returns a unit with four files: 1 with 20 records, 2 with none, 3 with the maximum, 4 with 10.
fn unit() -> Unit {
    let mut points = Points::new(1, 1);
    points.files = vec![vec![0x0101; 20], vec![], vec![0x0303; 10_000], vec![0; 10]];
    Unit::new(points)
}

#[test]
fn the_standards_example_of_a_read_returns_its_reply() {
    let mut unit = unit();
    unit.points.files[3][1..3].copy_from_slice(&[0x0DFE, 0x0020]);
    unit.points.files[2][9..11].copy_from_slice(&[0x33CD, 0x0040]);
    let request = [
        0x14, 0x0E, 0x06, 0x00, 0x04, 0x00, 0x01, 0x00, 0x02, 0x06, 0x00, 0x03, 0x00, 0x09, 0x00,
        0x02,
    ];
    let reply = [
        0x14, 0x0C, 0x05, 0x06, 0x0D, 0xFE, 0x00, 0x20, 0x05, 0x06, 0x33, 0xCD, 0x00, 0x40,
    ];
    assert_eq!(unit.raw(&frame(UNIT, &request)), Some(frame(UNIT, &reply)));
}

#[test]
fn the_standards_example_of_a_write_is_echoed_and_written() {
    let mut unit = unit();
    let request = [
        0x15, 0x0D, 0x06, 0x00, 0x04, 0x00, 0x07, 0x00, 0x03, 0x06, 0xAF, 0x04, 0xBE, 0x10, 0x0D,
    ];
    assert_eq!(
        unit.raw(&frame(UNIT, &request)),
        Some(frame(UNIT, &request))
    );
    let expected = [0, 0, 0, 0, 0, 0, 0, 0x06AF, 0x04BE, 0x100D];
    assert_eq!(unit.points.files[3], expected);
}

#[test]
fn a_byte_count_that_is_not_allowed_or_wrong_returns_illegal_data_value() {
    let mut unit = unit();
    for function in [0x14, 0x15] {
        assert_eq!(unit.refused(&[function]), 3);
        for (byte_count, len) in [
            (0, 0),
            (6, 6),
            (7, 6),
            (7, 8),
            (255, 7),
            (8, 8),
            (246, 246),
            (252, 251),
        ] {
            let mut request = vec![function, byte_count];
            request.extend([6, 0, 1, 0, 0, 0, 1].into_iter().cycle().take(len));
            assert_eq!(unit.refused(&request), 3, "{request:02X?}");
        }
    }
    let mut cut_short = write_files(&[(1, 0, vec![1, 2])]);
    cut_short.pop();
    cut_short[1] -= 1;
    assert_eq!(unit.refused(&cut_short), 3);
    assert_eq!(unit.refused(&read_files(&[(1, 0, 1), (1, 0, 0)])), 3);
    assert_eq!(
        unit.refused(&write_files(&[(1, 0, vec![1]), (1, 0, vec![])])),
        3
    );
}

#[test]
fn a_read_returns_as_many_records_as_fit_253_bytes() {
    let mut unit = unit();
    let reply = unit.request(&read_files(&[(3, 9_876, 124)])).unwrap();
    assert_eq!(reply[..4], [0x14, 250, 249, 6]);
    assert_eq!(reply[4..], [3; 248]);
    assert_eq!(unit.refused(&read_files(&[(3, 0, 125)])), 3);
    // The largest number of groups, and as many records as then fit.
    let mut groups = vec![(3, 0, 1); 34];
    groups.push((1, 0, 57));
    assert_eq!(unit.refused(&read_files(&groups)), 3);
    groups[34] = (3, 9_944, 56);
    unit.points.files[2][9_944..].fill(0x1234);
    let reply = unit.request(&read_files(&groups)).unwrap();
    assert_eq!(reply[..2], [0x14, 34 * 4 + 2 + 112]);
    assert_eq!(reply[2..2 + 34 * 4], [3, 6, 3, 3].repeat(34));
    assert_eq!(
        reply[2 + 34 * 4..],
        [&[113, 6][..], &[0x12, 0x34].repeat(56)].concat()
    );
}

#[test]
fn a_write_accepts_as_many_records_as_fit_a_frame() {
    let mut unit = unit();
    let words: Vec<u16> = (0..122).collect();
    let request = write_files(&[(3, 9_878, words.clone())]);
    assert_eq!((request.len(), request[1]), (253, 0xFB));
    assert_eq!(unit.request(&request).unwrap(), request);
    assert_eq!(unit.points.files[2][9_878..], words);
}

#[test]
fn a_group_that_does_not_exist_returns_illegal_data_address() {
    let mut unit = unit();
    for (file, record, count) in [
        (0, 0, 1),
        (2, 0, 1),
        (5, 0, 1),
        (0xFFFF, 0, 1),
        (1, 20, 1),
        (1, 19, 2),
        (3, 10_000, 1),
        (3, 9_999, 2),
        (3, 0xFFFF, 1),
        (3, 0xFFFF, 2),
    ] {
        let good = (1, 0, 1);
        let bad = (file, record, count);
        for groups in [&[bad][..], &[good, bad], &[bad, good]] {
            assert_eq!(unit.refused(&read_files(groups)), 2, "{groups:?}");
            let writes: Vec<_> = groups
                .iter()
                .map(|(file, record, count)| (*file, *record, vec![7; usize::from(*count)]))
                .collect();
            // The request is rejected as a whole: the valid group is not written.
            assert_eq!(unit.refused(&write_files(&writes)), 2, "{groups:?}");
        }
    }
    for reference in [0, 5, 7, 255] {
        for mut request in [read_files(&[(1, 0, 1)]), write_files(&[(1, 0, vec![7])])] {
            request[2] = reference;
            assert_eq!(unit.refused(&request), 2, "{reference}");
        }
    }
}

#[test]
fn form_is_checked_before_address_before_value_before_state_over_all_groups() {
    let mut unit = unit();
    unit.points.state = Some(Exception::MemoryParityError.code());
    let (bad_value, bad_address) = ((1, 0, vec![MAX_WORD + 1]), (9, 0, vec![1]));
    let bad_form = (1, 0, vec![]);
    let good = (1, 0, vec![1]);
    let groups = [good.clone(), bad_value.clone(), bad_address.clone()];
    assert_eq!(
        unit.refused(&write_files(&[&groups[..], &[bad_form]].concat())),
        3
    );
    assert_eq!(unit.refused(&write_files(&groups)), 2);
    assert_eq!(unit.refused(&write_files(&[good.clone(), bad_value])), 3);
    assert_eq!(unit.refused(&write_files(&[good])), 8);
    assert_eq!(unit.refused(&read_files(&[(1, 0, 1), (9, 0, 1)])), 2);
    assert_eq!(unit.refused(&read_files(&[(1, 0, 1)])), 8);
}

#[test]
fn groups_are_written_in_order_also_by_broadcasts() {
    let mut unit = unit();
    let request = write_files(&[(1, 0, vec![1, 2]), (1, 1, vec![3]), (4, 9, vec![4])]);
    assert_eq!(unit.raw(&frame(0, &request)), None);
    assert_eq!(unit.points.files[0][..3], [1, 3, 0x0101]);
    assert_eq!(unit.points.files[3][9], 4);
    assert_eq!(unit.raw(&frame(0, &read_files(&[(1, 0, 1)]))), None);
    unit.must_answer();
}

#[test]
fn a_device_without_files_returns_illegal_function_before_any_other_check() {
    let mut unit = Unit::new(Points::new(1, 1));
    for request in [
        read_files(&[(1, 0, 1)]),
        write_files(&[(1, 0, vec![1])]),
        vec![0x14],
        vec![0x15, 0],
    ] {
        assert_eq!(unit.refused(&request), 1, "{request:02X?}");
    }
}
