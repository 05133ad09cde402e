//! The data model made of slices, compared with the reference.

mod common;

use common::{
    Device, UNIT, Unit, answer, pdu, read_files, write_bits, write_files, write_then_read,
    write_words,
};
use modbus_server::Tables;
use modbus_server::line::{Framing, Receiver};
use proptest::collection::vec;
use proptest::prelude::*;

fn unit(tables: Tables<'_>) -> Unit<Tables<'_>> {
    Unit::over(Receiver::rtu(UNIT, false), Framing::Rtu, tables)
}

/// The functions that need each table.
const FUNCTIONS: [&[u8]; 4] = [&[1, 5, 15], &[2], &[3, 6, 16, 22, 23], &[4]];

/// Returns tables that may be empty, without limits.
fn points() -> impl Strategy<Value = Device> {
    let bits = || prop_oneof![1 => Just(vec![]), 4 => vec(any::<bool>(), 1..20)];
    let words = || prop_oneof![1 => Just(vec![]), 4 => vec(any::<u16>(), 1..20)];
    let files = vec(vec(any::<u16>(), 0..20), 0..3);
    let tables = (bits(), bits(), words(), words(), files);
    tables.prop_map(|(bits, input_bits, words, input_words, files)| {
        let empty = [
            bits.is_empty(),
            input_bits.is_empty(),
            words.is_empty(),
            input_words.is_empty(),
        ];
        let lacks = empty.iter().zip(FUNCTIONS);
        let lacks = lacks.filter_map(|(empty, functions)| empty.then_some(functions));
        Device {
            bits,
            input_bits,
            words,
            input_words,
            files,
            max_word: u16::MAX,
            lacks: lacks.collect::<Vec<_>>().concat(),
            objects: vec![None; 256],
            ..Device::new(0, 0)
        }
    })
}

fn request() -> impl Strategy<Value = Vec<u8>> {
    let address = || prop_oneof![9 => 0_u16..25, 1 => any::<u16>()];
    let quantity = || prop_oneof![9 => 0_u16..25, 1 => any::<u16>()];
    let value = prop_oneof![Just(0xFF00_u16), Just(0), any::<u16>()];
    let words = || vec(any::<u16>(), 0..25);
    prop_oneof![
        4 => (1_u8..=4, address(), quantity()).prop_map(|(f, a, q)| pdu(f, &[a, q])),
        2 => (5_u8..=6, address(), value).prop_map(|(f, a, v)| pdu(f, &[a, v])),
        1 => (address(), vec(any::<bool>(), 0..25)).prop_map(|(a, b)| write_bits(a, &b)),
        1 => (address(), words()).prop_map(|(a, w)| write_words(a, &w)),
        1 => (address(), any::<u16>(), any::<u16>()).prop_map(|(a, b, c)| pdu(0x16, &[a, b, c])),
        1 => (address(), quantity(), address(), words())
            .prop_map(|(a, q, b, w)| write_then_read(a, q, b, &w)),
        1 => vec((0_u16..4, address(), quantity()), 1..4).prop_map(|g| read_files(&g)),
        1 => vec((0_u16..4, address(), words()), 1..4).prop_map(|g| write_files(&g)),
        1 => vec(any::<u8>(), 0..3).prop_map(|rest| [&[0x2B][..], &rest].concat()),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 2000,
        failure_persistence: None,
        ..Default::default()
    })]

    #[test]
    fn slices_are_served_as_by_the_reference(
        mut points in points(),
        requests in vec(request(), 1..12),
    ) {
        let mut start = points.clone();
        let mut files: Vec<&mut [u16]> = start.files.iter_mut().map(|f| &mut f[..]).collect();
        let mut unit = unit(Tables {
            coils: &mut start.bits,
            discrete_inputs: &mut start.input_bits,
            holding_registers: &mut start.words,
            input_registers: &mut start.input_words,
            files: &mut files,
        });
        for pdu in requests {
            // Without objects the device does not have function 2B.
            let lacks = points.lacks.contains(&pdu[0]) || pdu[0] == 0x2B;
            let expected = if lacks { Err(1) } else { answer(&mut points, &pdu) };
            let expected = expected.unwrap_or_else(|code| vec![pdu[0] | 0x80, code]);
            prop_assert_eq!(unit.request(&pdu), Some(expected), "{:02X?}", pdu);
            let tables = &unit.points;
            prop_assert_eq!(&*tables.coils, &points.bits[..]);
            prop_assert_eq!(&*tables.discrete_inputs, &points.input_bits[..]);
            prop_assert_eq!(&*tables.holding_registers, &points.words[..]);
            prop_assert_eq!(&*tables.input_registers, &points.input_words[..]);
            for (file, expected) in tables.files.iter().zip(&points.files) {
                prop_assert_eq!(&**file, &expected[..]);
            }
        }
    }
}

#[test]
fn a_table_of_all_addresses_is_served_up_to_the_last_one() {
    let mut words = vec![0; 0x1_0000];
    let mut unit = unit(Tables {
        input_registers: &mut words,
        ..Tables::default()
    });
    unit.points.input_registers[0xFFFF] = 0x1234;
    let reply = unit.request(&pdu(0x04, &[0xFFFF, 1]));
    assert_eq!(reply, Some(vec![0x04, 2, 0x12, 0x34]));
    // The functions that need no table are still supported.
    assert_eq!(unit.request(&[0x07]), Some(vec![0x07, 0]));
    assert_eq!(unit.request(&[0x11]), Some(vec![0x11, 1, 0xFF]));
}
