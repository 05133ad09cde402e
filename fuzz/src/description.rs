//! Target `description`: a CBOR document of any content, as a unit sends it in file 1.
//!
//! A description that the decoder accepts stays within its limits and is the same after encoding and decoding.

use modio_description::{Description, Value};

/// Target `description`.
pub fn run(input: &[u8]) {
    let _ = Description::open(input);
    let Ok(unit) = Description::decode(input) else {
        return;
    };
    let again = Description::decode(&unit.encode());
    assert_eq!(again.as_ref(), Ok(&unit), "encoded and decoded");
    let count = |count: u16| usize::from(count);
    let registers: usize = unit.registers.iter().map(|run| count(run.count)).sum();
    assert!(registers <= 4096 && unit.ports.len() <= 8);
    for run in &unit.registers {
        assert!(count(run.address) + count(run.count) <= 0x1_0000);
        if let Value::Bits(names) = &run.value {
            assert!(names.iter().all(|(bit, _)| *bit < 16));
        }
        for text in [&run.name, &run.about] {
            assert!(text.len() <= 512 && !text.contains(char::is_control));
        }
    }
    for text in [&unit.board, &unit.model, &unit.firmware] {
        assert!(text.len() <= 64 && !text.contains(char::is_control));
    }
}
