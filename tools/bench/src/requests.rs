//! The measured requests: every function with its smallest and its largest request.
//!
//! The addresses are those of modio. A rival has its points from address 0 on, so its requests have other addresses
//! and are otherwise the same.

use register_map::codes::Mode;
use register_map::configuration::{BETA, FILTER, KEY, OPENING_KEY};
use register_map::{Board, Module};

/// Address of the unit.
pub const UNIT: u8 = 1;

/// First register of the longest range that can be written: BETA to START.
const LONG: u16 = BETA;

/// A request and the conditions for it.
#[derive(Clone, Debug)]
pub struct Request {
    /// The function and its parameters, as shown in the table.
    pub name: String,
    /// The transmission mode of the line.
    pub mode: Mode,
    /// The module in all slots.
    pub module: Module,
    /// A request that is sent first and not measured. It opens the lock if needed.
    pub before: Option<Vec<u8>>,
    /// The PDU for modio.
    pub pdu: Vec<u8>,
    /// The PDU for a rival; `None` when the rival does not have the function.
    pub rival: Option<Vec<u8>>,
}

/// Returns a PDU: the function code and 16-bit fields, high byte first.
fn pdu(function: u8, fields: &[u16]) -> Vec<u8> {
    let mut pdu = vec![function];
    pdu.extend(fields.iter().flat_map(|field| field.to_be_bytes()));
    pdu
}

/// Returns a PDU with a byte count and data after its fields.
fn with_data(function: u8, fields: &[u16], data: &[u8]) -> Vec<u8> {
    let mut pdu = pdu(function, fields);
    pdu.push(u8::try_from(data.len()).expect("a PDU has 253 bytes"));
    pdu.extend(data);
    pdu
}

/// Returns allowed values for `count` settings from [`LONG`] on: the factory defaults.
fn settings(count: usize) -> Vec<u8> {
    let rules = register_map::configuration::RULES;
    let values = (LONG..)
        .map_while(|address| register_map::rule_at(rules, address).map(|(rule, _)| rule.default));
    values.take(count).flat_map(u16::to_be_bytes).collect()
}

/// Returns all requests for a board.
#[must_use]
pub fn all(board: &Board) -> Vec<Request> {
    let mut requests = of_any_board(board.points().start);
    if board.slots > 1 {
        requests.extend(of_all_slots(board));
    }
    requests
}

/// Returns the requests for the points of all slots of a board.
fn of_all_slots(board: &Board) -> Vec<Request> {
    let points = board.points();
    let count = points.end - points.start;
    let request = |name: &str, module, pdu| Request {
        name: format!("{name}, {count}"),
        mode: Mode::Rtu,
        module,
        before: None,
        pdu,
        rival: None,
    };
    let read = [points.start, count];
    let bits = vec![0x55; usize::from(count).div_ceil(8)];
    let words: Vec<u8> = points.flat_map(|_| 100_u16.to_be_bytes()).collect();
    vec![
        request("01 read coils", Module::Do4, pdu(1, &read)),
        request("02 read discrete inputs", Module::Di4, pdu(2, &read)),
        request("04 read input registers", Module::Ai4, pdu(4, &read)),
        request(
            "0F write multiple coils",
            Module::Do4,
            with_data(0x0F, &read, &bits),
        ),
        request(
            "10 write multiple registers, outputs",
            Module::Ao4,
            with_data(0x10, &read, &words),
        ),
    ]
}

/// Returns the requests that every board serves, with its points from `first` on.
fn of_any_board(first: u16) -> Vec<Request> {
    let of = |name: &str, module, make: &dyn Fn(u16) -> Vec<u8>, address| Request {
        name: name.to_owned(),
        mode: Mode::Rtu,
        module,
        before: None,
        pdu: make(address),
        rival: Some(make(0)),
    };
    let open = || Some(pdu(0x06, &[KEY, OPENING_KEY]));
    let bits = |name: &str, module, make: &dyn Fn(u16) -> Vec<u8>| of(name, module, make, first);
    let setting = |name: &str, make: &dyn Fn(u16) -> Vec<u8>, address| Request {
        before: open(),
        ..of(name, Module::Di4, make, address)
    };
    let alone = |name: &str, pdu: Vec<u8>| Request {
        name: name.to_owned(),
        mode: Mode::Rtu,
        module: Module::Di4,
        before: None,
        pdu,
        rival: None,
    };
    let own = |request: Request| Request {
        rival: None,
        ..request
    };
    let ascii = |request: Request| Request {
        name: format!("ASCII: {}", request.name),
        mode: Mode::Ascii,
        rival: None,
        ..request
    };
    let read_many = || {
        of(
            "03 read holding registers, 125",
            Module::Di4,
            &|a| pdu(3, &[a, 125]),
            LONG,
        )
    };
    let write_many = || {
        setting(
            "10 write multiple registers, 123",
            &|a| with_data(0x10, &[a, 123], &settings(123)),
            LONG,
        )
    };

    vec![
        bits("01 read coils, 1", Module::Do4, &|a| pdu(1, &[a, 1])),
        bits("01 read coils, 4", Module::Do4, &|a| pdu(1, &[a, 4])),
        bits("02 read discrete inputs, 1", Module::Di4, &|a| {
            pdu(2, &[a, 1])
        }),
        bits("02 read discrete inputs, 4", Module::Di4, &|a| {
            pdu(2, &[a, 4])
        }),
        bits("03 read holding registers, 1", Module::Ai4, &|a| {
            pdu(3, &[a, 1])
        }),
        read_many(),
        bits("04 read input registers, 1", Module::Ai4, &|a| {
            pdu(4, &[a, 1])
        }),
        of(
            "04 read input registers, 125",
            Module::Di4,
            &|a| pdu(4, &[a, 125]),
            LONG,
        ),
        bits("05 write single coil", Module::Do4, &|a| {
            pdu(5, &[a, 0xFF00])
        }),
        bits("06 write single register, output", Module::Ao4, &|a| {
            pdu(6, &[a, 100])
        }),
        setting(
            "06 write single register, setting",
            &|a| pdu(6, &[a, 5]),
            FILTER,
        ),
        bits("0F write multiple coils, 1", Module::Do4, &|a| {
            with_data(0x0F, &[a, 1], &[1])
        }),
        bits("0F write multiple coils, 4", Module::Do4, &|a| {
            with_data(0x0F, &[a, 4], &[5])
        }),
        setting(
            "10 write multiple registers, 1",
            &|a| with_data(0x10, &[a, 1], &settings(1)),
            LONG,
        ),
        write_many(),
        own(setting(
            "16 mask write register",
            &|a| pdu(0x16, &[a, 0xFFFF, 0]),
            LONG,
        )),
        own(setting(
            "17 read/write registers, 1 and 1",
            &|a| with_data(0x17, &[a, 1, a, 1], &settings(1)),
            LONG,
        )),
        own(setting(
            "17 read/write registers, 125 and 121",
            &|a| with_data(0x17, &[a, 125, a, 121], &settings(121)),
            LONG,
        )),
        alone("07 read exception status", pdu(7, &[])),
        alone("08/00 return query data, 2 bytes", pdu(8, &[0, 0x1234])),
        alone("08/00 return query data, 250 bytes", {
            let mut pdu = pdu(8, &[0]);
            pdu.resize(253, 0xA5);
            pdu
        }),
        alone("08/0B return bus message count", pdu(8, &[0x0B, 0])),
        alone("0B get comm event counter", pdu(0x0B, &[])),
        alone("0C get comm event log", pdu(0x0C, &[])),
        alone("11 report server id", pdu(0x11, &[])),
        alone("14 read file record, 1", {
            vec![0x14, 7, 6, 0, 1, 0, 0, 0, 1]
        }),
        alone("14 read file record, 124", {
            vec![0x14, 7, 6, 0, 1, 1, 0, 0, 124]
        }),
        alone(
            "2B/0E device identification, one object",
            vec![0x2B, 0x0E, 4, 0],
        ),
        alone("2B/0E device identification, all", vec![0x2B, 0x0E, 3, 0]),
        alone("an unknown function", pdu(0x41, &[])),
        ascii(bits("03 read holding registers, 1", Module::Ai4, &|a| {
            pdu(3, &[a, 1])
        })),
        ascii(read_many()),
        ascii(write_many()),
    ]
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::framing::{adu, is_adu};

    #[test]
    fn requests_are_frames_and_settings_are_allowed() {
        for board in Board::ALL {
            let mut names = BTreeSet::new();
            for request in all(board) {
                assert!(request.pdu.len() <= 253, "{}", request.name);
                let frame = adu(request.mode, &request.pdu);
                assert!(is_adu(request.mode, &frame), "{}", request.name);
                assert!(names.insert(request.name.clone()), "{}", request.name);
            }
        }
        assert_eq!(settings(123).len(), 246);
    }
}
