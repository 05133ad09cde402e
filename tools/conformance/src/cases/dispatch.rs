//! Function codes that a unit does not have.

use crate::case::{Case, Check, Stop, case};
use crate::frame::Reply;
use crate::tester::Tester;

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("dispatch/unknown-function", "V1.1b3 7", "a function that the unit does not have is exception 01", &[],
        unknown),
    case("dispatch/unknown-function-longest", "V1.1b3 7", "the same with the longest PDU, 253 bytes", &[], longest),
    case("dispatch/function-00-and-80-up", "V1.1b3 4.1",
        "function 00 and those from 80 on get silence or exception 01, never what looks like a reply", &[],
        not_functions).interpretation(),
    case("dispatch/unknown-function-elsewhere", "V1.02 2.2", "an unknown function for another unit gets silence", &[],
        elsewhere),
];

/// Functions that the unit does not have. On other devices than a modio only codes that no maker is known to use,
/// because the effect of a maker's own function is unknown.
pub(super) fn unknown_functions(tester: &Tester<'_>) -> Vec<u8> {
    let lacking = |function: &u8| !tester.target.has(*function);
    if tester.target.modio.is_some() {
        (1..=0x7F).filter(lacking).collect()
    } else {
        let unassigned = [0x19, 0x2C, 0x30, 0x3F, 0x4A, 0x6F];
        unassigned.into_iter().filter(lacking).collect()
    }
}

/// Returns a function that the unit does not have. Without one the case is skipped.
pub(super) fn unknown_function(tester: &Tester<'_>) -> Check<u8> {
    let one = unknown_functions(tester).pop();
    one.ok_or_else(|| Stop::Skip("every function exists".to_owned()))
}

/// Returns a function that the unit does not have, and a good frame of a request for it with this number of data
/// bytes.
pub(super) fn with_data(tester: &Tester<'_>, data: usize) -> (u8, Vec<u8>) {
    let function = unknown_functions(tester).pop().unwrap_or(0x6F);
    let pdu = [vec![function], vec![0x33; data]].concat();
    (function, tester.frame(&pdu))
}

fn unknown(tester: &mut Tester<'_>) -> Check {
    for function in unknown_functions(tester) {
        tester.exception(&[function], 1)?;
    }
    for function in unknown_functions(tester).into_iter().step_by(9) {
        tester.exception(&[function, 0, 0, 0, 1], 1)?;
    }
    Ok(())
}

fn longest(tester: &mut Tester<'_>) -> Check {
    let Some(function) = unknown_functions(tester).pop() else {
        return Ok(());
    };
    let pdu = [vec![function], vec![0x33; 252]].concat();
    tester.exception(&pdu, 1)
}

fn not_functions(tester: &mut Tester<'_>) -> Check {
    for function in [0, 0x80, 0x81, 0x83, 0x86, 0x90, 0xAB, 0xC1, 0xFE, 0xFF] {
        for data in [&[][..], &[0, 0, 0, 1], &[2]] {
            let reply = tester.ask(&[&[function], data].concat())?;
            let refused = Reply::Pdu(vec![function | 0x80, 1]);
            let right = reply == Reply::Silence || reply == refused;
            tester.ensure(right, "silence, or exception 01")?;
        }
    }
    tester.alive("invalid function codes")
}

fn elsewhere(tester: &mut Tester<'_>) -> Check {
    let other = tester.other();
    for function in [0x41, 0x65, 0x00, 0x80] {
        let silent = tester.ask_unit(other, &[function, 1, 2, 3])? == Reply::Silence;
        tester.ensure(silent, "silence: the request is for another unit")?;
    }
    Ok(())
}
