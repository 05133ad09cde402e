//! Tests of the CBOR form: every unit is restored after encoding and decoding, and no bytes make the decoder panic.

use minicbor::Encoder;
use modio_description::{
    Description, Error, FILE, Field, HEAD, Narrower, PORT_BYTES, Port, Reading, Register, Scope,
    Unit, VERSION, Value, Values, checksum, describe, records,
};
use proptest::prelude::*;
use register_map::board::{MODIO_02, MODIO_08};
use register_map::{Module, Row};

fn unit(module: Module) -> Description {
    describe(&MODIO_02, "0.1.0", |_| module)
}

fn register<'a>(unit: &'a Description, name: &str) -> &'a Register {
    let mut registers = unit.registers.iter();
    registers.find(|register| register.name == name).unwrap()
}

#[test]
fn every_board_with_every_module_round_trips() {
    for board in Row::ALL {
        for module in Module::ALL {
            let unit = describe(board, "1.2.3", |_| module);
            assert_eq!(Description::decode(&unit.encode()), Ok(unit.clone()));
            assert_eq!(Description::open(&unit.file()), Ok(unit));
        }
    }
}

#[test]
fn the_ports_are_the_last_bytes() {
    let [none, mixed] = [Module::None; 2].map(|_| describe(&MODIO_08, "0.1.0", |_| Module::None));
    let mixed = Description {
        ports: (1..=4)
            .map(|number| Port {
                number,
                module: u16::from(number),
                lacks: number - 1,
            })
            .collect(),
        ..mixed
    };
    let (none, mixed) = (none.encode(), mixed.encode());
    assert_eq!(none.len(), mixed.len());
    let (same, last) = mixed.split_at(mixed.len() - 4 * PORT_BYTES);
    assert!(none.starts_with(same));
    assert_eq!(last, [1, 0, 1, 2, 1, 2, 3, 2, 3, 4, 3, 4]);
}

#[test]
fn the_file_begins_with_length_and_crc() {
    let unit = unit(Module::Ai4);
    let (document, file) = (unit.encode(), unit.file());
    let words = [document.len() as u16, checksum(&document)].map(u16::to_be_bytes);
    assert_eq!(&file[..4], words.as_flattened());
    assert_eq!(file.len(), usize::from(records(document.len() as u16)) * 2);
    assert_eq!((FILE, HEAD, records(3), records(4)), (1, 2, 4, 4));
    // The check value of CRC-16/MODBUS in the catalogue of parametrised CRC algorithms.
    assert_eq!(checksum(b"123456789"), 0x4B37);
}

#[test]
fn pages_name_the_sizes_of_the_files_of_all_boards() {
    let lengths = Row::ALL.map(|board| {
        let unit = describe(board, env!("CARGO_PKG_VERSION"), |_| Module::None);
        unit.file().len()
    });
    let kib = |length: Option<&usize>| *length.unwrap() as f64 / 1024.0;
    let (least, most) = (kib(lengths.iter().min()), kib(lengths.iter().max()));
    let sizes = format!("{least:.1} to {most:.1} KiB");
    for page in ["architecture.md", "self-description.md"] {
        let path = format!("{}/../../docs/{page}", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(path).unwrap();
        assert!(text.contains(&sizes), "{page} needs {sizes:?}: {lengths:?}");
    }
}

#[test]
fn a_damaged_or_short_file_is_rejected() {
    let file = unit(Module::Ai4).file();
    let length = u16::from_be_bytes([file[0], file[1]]);
    let short = |found| Error::Short { length, found };
    assert_eq!(Description::open(&file[..100]), Err(short(96)));
    assert!(matches!(
        Description::open(&file[..3]),
        Err(Error::Short { length: 0, .. })
    ));
    let mut damaged = file.clone();
    damaged[1000] ^= 0x10;
    let error = Description::open(&damaged).unwrap_err();
    assert!(matches!(error, Error::Crc { .. }), "{error}");
}

#[test]
fn a_newer_version_of_the_format_is_rejected_with_its_number() {
    let mut document = unit(Module::Ai4).encode();
    assert_eq!(document[1], VERSION as u8);
    document[1] = 7;
    assert_eq!(Description::decode(&document), Err(Error::Version(7)));
    assert_eq!(
        Error::Version(7).to_string(),
        "the self-description has format version 7, and this program reads versions up to 1: use a newer program"
    );
    document[1] = 0;
    let error = Description::decode(&document).unwrap_err();
    assert_eq!(
        error.to_string(),
        "not a self-description: format version 0"
    );
}

#[test]
fn bytes_after_the_document_are_rejected() {
    let document = [unit(Module::Ai4).encode(), vec![0]].concat();
    let error = Description::decode(&document).unwrap_err();
    assert!(matches!(error, Error::Form(_)), "{error}");
}

/// Appends a field to each array of a document that a later version may extend, and adds a new kind of value,
/// scope, table and kind of set.
fn of_a_later_version() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut e = Encoder::new(&mut bytes);
    let written: Result<(), minicbor::encode::Error<std::convert::Infallible>> = (|| {
        e.array(4)?.u16(1)?.array(8)?;
        e.str("board")?.str("model")?.str("9.0.0")?.u16(12)?;
        // Kinds of point.
        e.array(1)?.array(5)?.str("matrix")?.u8(9)?.bool(true)?;
        e.array(1)?.array(8)?.u8(0)?.u8(1)?.i32(-5)?.i32(70_000)?;
        e.str("V")?.i8(-3)?.i16(2)?.null()?;
        e.map(1)?.str("new")?.begin_array()?.u8(1)?.end()?;
        // Modules.
        e.array(1)?.array(4)?.u16(300)?.str("8ai")?;
        e.bytes(&[0; 4])?.u8(1)?;
        // Registers.
        e.array(2)?.array(11)?.u16(0x400)?.str("MATRIX")?;
        e.array(3)?.u8(77)?.f64(1.5)?;
        e.tag(minicbor::data::Tag::new(42))?.u8(3)?;
        e.str("about")?.u16(8)?.u8(9)?.u8(0x83)?;
        e.array(2)?.u8(9)?.str("prime")?;
        e.u16(5)?;
        e.array(5)?.u8(0)?.array(2)?.u8(1)?.u8(2)?.u16(3)?;
        e.array(5)?.u8(0)?.str("ms")?.i8(0)?.i16(0)?.undefined()?;
        e.u8(0)?;
        e.array(0)?;
        e.array(4)?.u16(0x500)?.str("PLAIN")?;
        e.array(3)?.u8(2)?.map(1)?.u8(1)?.str("one")?.bool(false)?;
        e.str("")?;
        // More fields of the firmware, the ports, and more fields of the unit.
        e.u8(1)?.bytes(&[2, 1, 44])?.str("for a later reader")?;
        Ok(())
    })();
    written.unwrap();
    bytes
}

#[test]
fn fields_and_kinds_of_a_later_version_are_skipped() {
    let mut bytes = of_a_later_version();
    // The narrower values of MATRIX are a single 2 instead of a range, which the format does not allow.
    assert!(Description::decode(&bytes).is_err());
    let range = [0x85, 0x00, 0x82, 0x01, 0x02, 0x03];
    let at = bytes.windows(6).position(|window| window == range).unwrap();
    // A set of kind 2 may have any number of values.
    bytes[at + 3] = 2;
    let unit = Description::decode(&bytes).unwrap();
    assert_eq!(
        (unit.kinds[0].table, unit.kinds[0].readings[0].max),
        (None, 70_000)
    );
    assert_eq!(unit.modules[0].code, 300);
    let expected = Register {
        address: 0x400,
        count: 8,
        name: "MATRIX".to_owned(),
        scope: Scope::Unit,
        value: Value::Opaque,
        writable: true,
        restart: true,
        values: Values::Range(0, 0xFFFF),
        default: 5,
        narrower: Some(Narrower {
            kind: 0,
            values: Values::OneOf(vec![2]),
            default: 3,
            value: Some(Value::Number(Unit {
                code: "ms".to_owned(),
                ..Unit::default()
            })),
        }),
        about: "about".to_owned(),
    };
    assert_eq!(unit.registers[0], expected);
    let plain = Value::Codes(vec![(1, "one".to_owned())]);
    assert_eq!(register(&unit, "PLAIN").value, plain);
    let port = Port {
        number: 2,
        module: 0x2C,
        lacks: 1,
    };
    assert_eq!(unit.ports, [port]);
}

#[test]
fn errors_contain_the_byte_position() {
    let error = Description::decode(&[0x83, 1, 0x61]).unwrap_err();
    assert!(error.to_string().contains("(byte 2)"), "{error}");
    let error = Description::decode(&[0x9F, 1, 0xFF]).unwrap_err();
    assert!(
        error.to_string().contains("an array without a length"),
        "{error}"
    );
}

#[test]
fn a_length_beyond_the_bytes_allocates_no_memory() {
    // An outer array, and a list of kinds, that claim 2^60 elements.
    let long = [0x9B, 0x10, 0, 0, 0, 0, 0, 0, 0];
    assert!(Description::decode(&long).is_err());
    let kinds = [&[0x83, 1, 0x87, 0x60, 0x60, 0x60, 1], &long[..]].concat();
    assert!(Description::decode(&kinds).is_err());
}

#[test]
fn an_index_of_an_unknown_kind_is_rejected() {
    let mut unit = unit(Module::Ai4);
    unit.modules[1].points[2] = unit.kinds.len() as u8;
    assert!(Description::decode(&unit.encode()).is_err());
}

#[test]
fn a_text_that_is_too_long_or_has_control_characters_is_rejected() {
    let decoded = |text: &str, change: fn(&mut Description, String)| {
        let mut unit = unit(Module::Ai4);
        change(&mut unit, text.to_owned());
        Description::decode(&unit.encode()).map_err(|error| error.to_string())
    };
    let board: fn(&mut Description, String) = |unit, text| unit.board = text;
    let about: fn(&mut Description, String) = |unit, text| unit.registers[0].about = text;
    for (change, most) in [(board, 64), (about, 512)] {
        assert!(decoded(&"x".repeat(most), change).is_ok());
        let error = decoded(&"x".repeat(most + 1), change).unwrap_err();
        assert!(error.contains("more than"), "{error}");
        for text in [
            "a\nb",
            "\u{1B}[2J",
            "\u{9B}2J",
            "\u{202E}",
            "\u{2028}",
            "\0",
        ] {
            let error = decoded(text, change).unwrap_err();
            assert!(error.contains("control character"), "{text:?}: {error}");
        }
        assert!(decoded("20 °C, 5 µA {{ x }} $", change).is_ok());
    }
}

#[test]
fn numbers_beyond_the_limits_are_rejected() {
    type Change = fn(&mut Description);
    let changes: [(Change, bool); 18] = [
        // One register with all addresses was 65535 items, each with its own texts.
        (|unit| run(unit, 0, 0xFFFF, Scope::Unit), false),
        (|unit| run(unit, 0x1000, 0x1001, Scope::Unit), false),
        (|unit| run(unit, 0x1000, 0, Scope::Unit), false),
        (|unit| run(unit, 0xFFFF, 1, Scope::Unit), true),
        (|unit| run(unit, 0xFFFF, 2, Scope::Unit), false),
        (|unit| run(unit, 0xFFE0, 1, Scope::Point), true),
        (|unit| run(unit, 0xFFE1, 1, Scope::Point), false),
        // Each is a value for each of 32 points.
        (
            |unit| (0..200).for_each(|_| run(unit, 0, 1, Scope::Point)),
            false,
        ),
        (|unit| unit.ports[0].number = 0, false),
        (|unit| unit.ports[0].number = 9, false),
        (|unit| unit.ports.push(unit.ports[0]), false),
        (
            |unit| last(unit).value = Value::Codes(vec![(0, String::new()); 64]),
            true,
        ),
        (
            |unit| last(unit).value = Value::Codes(vec![(0, String::new()); 65]),
            false,
        ),
        (|unit| last(unit).values = Values::OneOf(vec![0; 65]), false),
        (
            |unit| last(unit).value = Value::Bits(vec![(16, String::new())]),
            false,
        ),
        (|unit| last(unit).value = Value::Number(power(-19)), false),
        (|unit| reading(unit).max = 65_536, false),
        (|unit| reading(unit).min = -32_769, false),
    ];
    for (index, (change, is_usable)) in changes.into_iter().enumerate() {
        let mut unit = unit(Module::Ai4);
        change(&mut unit);
        let decoded = Description::decode(&unit.encode());
        assert_eq!(decoded.is_ok(), is_usable, "change {index}: {decoded:?}");
    }
}

/// Returns a reading of a kind of point.
fn reading(unit: &mut Description) -> &mut Reading {
    let mut readings = unit.kinds.iter_mut().flat_map(|kind| &mut kind.readings);
    readings.next().unwrap()
}

fn last(unit: &mut Description) -> &mut Register {
    unit.registers.last_mut().unwrap()
}

/// Appends a run of registers.
fn run(unit: &mut Description, address: u16, count: u16, scope: Scope) {
    let run = Register {
        address,
        count,
        scope,
        value: Value::Number(Unit::default()),
        ..last(unit).clone()
    };
    unit.registers.push(run);
}

fn power(exponent: i8) -> Unit {
    Unit {
        exponent,
        ..Unit::default()
    }
}

fn text() -> impl Strategy<Value = String> {
    "[ -~äµ°]{0,32}"
}

fn units() -> impl Strategy<Value = Unit> {
    (text(), -18..=18_i8, any::<i16>()).prop_map(|(code, exponent, offset)| Unit {
        code,
        exponent,
        offset,
    })
}

fn meanings() -> impl Strategy<Value = Value> {
    let parts = (text(), numbers(), sets(), any::<u16>());
    let field = parts.prop_map(|(name, value, values, default)| Field {
        name,
        value,
        values,
        default,
    });
    prop_oneof![
        numbers(),
        (0..5_u8, prop::collection::vec(field, 1..4))
            .prop_map(|(kind, fields)| Value::Fields { kind, fields }),
    ]
}

fn numbers() -> impl Strategy<Value = Value> {
    prop_oneof![
        units().prop_map(Value::Number),
        units().prop_map(Value::Long),
        prop::collection::vec((any::<u16>(), text()), 0..4).prop_map(Value::Codes),
        prop::collection::vec((0..16_u8, text()), 0..4).prop_map(Value::Bits),
        Just(Value::Opaque),
        Just(Value::Point),
    ]
}

fn sets() -> impl Strategy<Value = Values> {
    prop_oneof![
        Just(Values::Range(0, 0xFFFF)),
        any::<[u16; 2]>().prop_map(|[a, b]| Values::Range(a, b)),
        any::<[u16; 3]>().prop_map(|[a, b, c]| Values::RangeOr(a, b, c)),
        prop::collection::vec(any::<u16>(), 0..30).prop_map(Values::OneOf),
    ]
}

fn narrowers() -> impl Strategy<Value = Narrower> {
    let parts = (0..5_u8, sets(), any::<u16>(), prop::option::of(numbers()));
    parts.prop_map(|(kind, values, default, value)| Narrower {
        kind,
        values,
        default,
        value,
    })
}

fn registers() -> impl Strategy<Value = Register> {
    let scopes = prop::sample::select(vec![Scope::Unit, Scope::Port, Scope::Point]);
    let anywhere = (0..0xFC00_u16, 1..1000_u16, any::<u16>()).prop_map(<[u16; 3]>::from);
    let numbers = prop_oneof![Just([0x100, 1, 0]), anywhere];
    let flags = any::<[bool; 2]>();
    let parts = (
        numbers,
        text(),
        scopes,
        meanings(),
        flags,
        sets(),
        prop::option::of(narrowers()),
        text(),
    );
    parts.prop_map(
        |([address, count, default], name, scope, value, flags, values, narrower, about)| {
            let [writable, restart] = flags;
            Register {
                address,
                count,
                name,
                scope,
                value,
                writable,
                restart,
                values,
                default,
                narrower,
                about,
            }
        },
    )
}

proptest! {
    #[test]
    fn any_registers_round_trip(registers in prop::collection::vec(registers(), 0..4)) {
        let unit = Description { registers, ..unit(Module::Di4) };
        prop_assert_eq!(Description::decode(&unit.encode()), Ok(unit));
    }

    #[test]
    fn arbitrary_bytes_do_not_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = Description::decode(&bytes);
        let _ = Description::open(&bytes);
        let _ = Description::decode(&[&[0x83, 1, 0x87, 0x60, 0x60, 0x60, 1], &bytes[..]].concat());
    }

    #[test]
    fn mutated_documents_do_not_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        end in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let mut bytes = unit(Module::Ai2Ao2).encode();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if let Some(end) = end {
            bytes.truncate(end.index(bytes.len()));
        }
        if let Ok(unit) = Description::decode(&bytes) {
            prop_assert_eq!(Description::decode(&unit.encode()), Ok(unit));
        }
    }
}
