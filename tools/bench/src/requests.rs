//! The measured requests: every function with its smallest and its largest request.
//!
//! The addresses are those of modio. A rival has its points from address 0 on, so its requests have other addresses
//! and are otherwise the same.

use std::collections::BTreeMap;

use register_map::codes::Mode;
use register_map::configuration::{BETA, FILTER, KEY, OPENING_KEY};
use register_map::{Module, Row};

/// Address of the unit.
pub const UNIT: u8 = 1;

/// First register of the longest range that can be written: BETA to START.
const LONG: u16 = BETA;

/// Instructions from t3.5 to the first byte: for one point that is read or written, for four, for the points of four
/// slots, for a request without points or registers, and for a setting that is written.
const POINT: u32 = 700;
const FOUR: u32 = 850;
const SIXTEEN: u32 = 1500;
const SHORT: u32 = 850;
const SETTING: u32 = 1330;
/// What a board that serves function 70 may take in addition: each frame may be a message of it.
const FAST: u32 = 40;
/// What a write of sixteen outputs may take in addition, because an output can start as it was: its command before SAFE is
/// no longer kept.
const KEPT: u32 = 80;
/// What ASCII mode may take in addition.
const ASCII: u32 = 50;

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
    /// Instructions that are allowed from t3.5 to the first byte of the reply, which is whole by then.
    pub to_first_byte: u32,
    /// Instructions that are allowed for the whole transaction, if they have a limit.
    pub transaction: Option<u32>,
    /// The PDU for a rival; `None` when the rival does not have the function.
    pub rival: Option<Vec<u8>>,
}

impl Request {
    /// Returns what is allowed for the figures of this request, by the names of the figures.
    #[must_use]
    pub fn budgets(&self) -> BTreeMap<&'static str, u32> {
        let transaction = self.transaction.map(|most| ("transaction", most));
        [("to_first_byte", self.to_first_byte)]
            .into_iter()
            .chain(transaction)
            .collect()
    }
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
pub fn all(board: &Row) -> Vec<Request> {
    let mut requests = of_any_board(board.points().start);
    if board.slots > 1 {
        requests.extend(of_all_slots(board));
        // The board with one slot has no room for function 70.
        requests
            .iter_mut()
            .for_each(|request| request.to_first_byte += FAST);
    }
    requests
}

/// Returns the requests for the points of all slots of a board.
fn of_all_slots(board: &Row) -> Vec<Request> {
    let points = board.points();
    let count = points.end - points.start;
    let request = |name: &str, most, module, pdu| Request {
        module,
        ..alone(&format!("{name}, {count}"), most, pdu)
    };
    let read = [points.start, count];
    let bits = vec![0x55; usize::from(count).div_ceil(8)];
    let words: Vec<u8> = points.flat_map(|_| 100_u16.to_be_bytes()).collect();
    vec![
        request("01 read coils", SIXTEEN, Module::Do4, pdu(1, &read)),
        request(
            "02 read discrete inputs",
            SIXTEEN,
            Module::Di4,
            pdu(2, &read),
        ),
        request(
            "04 read input registers",
            SIXTEEN,
            Module::Ai4,
            pdu(4, &read),
        ),
        request(
            "0F write multiple coils",
            SIXTEEN + KEPT,
            Module::Do4,
            with_data(0x0F, &read, &bits),
        ),
        request(
            "10 write multiple registers, outputs",
            1900 + KEPT,
            Module::Ao4,
            with_data(0x10, &read, &words),
        ),
    ]
}

/// Returns a request to a 4DI that a rival does not get.
fn alone(name: &str, to_first_byte: u32, pdu: Vec<u8>) -> Request {
    Request {
        name: name.to_owned(),
        mode: Mode::Rtu,
        module: Module::Di4,
        before: None,
        pdu,
        to_first_byte,
        transaction: None,
        rival: None,
    }
}

/// Returns the requests that every board serves, with its points from `first` on.
fn of_any_board(first: u16) -> Vec<Request> {
    let of = |name: &str, most, module, make: &dyn Fn(u16) -> Vec<u8>, address| Request {
        module,
        rival: Some(make(0)),
        ..alone(name, most, make(address))
    };
    let point = |name: &str, most, module, make: &dyn Fn(u16) -> Vec<u8>| {
        of(name, most, module, make, first)
    };
    let setting = |name: &str, most, make: &dyn Fn(u16) -> Vec<u8>, address| Request {
        before: Some(pdu(0x06, &[KEY, OPENING_KEY])),
        ..of(name, most, Module::Di4, make, address)
    };
    let own = |request: Request| Request {
        rival: None,
        ..request
    };
    let within = |transaction, request: Request| Request {
        transaction: Some(transaction),
        ..request
    };
    let ascii = |request: Request| Request {
        name: format!("ASCII: {}", request.name),
        mode: Mode::Ascii,
        to_first_byte: request.to_first_byte + ASCII,
        rival: None,
        ..request
    };
    let read_one = || {
        point("03 read holding registers, 1", POINT, Module::Ai4, &|a| {
            pdu(3, &[a, 1])
        })
    };
    let read_many = || {
        of(
            "03 read holding registers, 125",
            3000,
            Module::Di4,
            &|a| pdu(3, &[a, 125]),
            LONG,
        )
    };
    let write_many = || {
        setting(
            "10 write multiple registers, 123",
            5200,
            &|a| with_data(0x10, &[a, 123], &settings(123)),
            LONG,
        )
    };

    vec![
        point("01 read coils, 1", POINT, Module::Do4, &|a| pdu(1, &[a, 1])),
        point("01 read coils, 4", FOUR, Module::Do4, &|a| pdu(1, &[a, 4])),
        point("02 read discrete inputs, 1", POINT, Module::Di4, &|a| {
            pdu(2, &[a, 1])
        }),
        point("02 read discrete inputs, 4", FOUR, Module::Di4, &|a| {
            pdu(2, &[a, 4])
        }),
        within(2245, read_one()),
        within(21_509, read_many()),
        point("04 read input registers, 1", POINT, Module::Ai4, &|a| {
            pdu(4, &[a, 1])
        }),
        of(
            "04 read input registers, 125",
            3000,
            Module::Di4,
            &|a| pdu(4, &[a, 125]),
            LONG,
        ),
        point("05 write single coil", POINT, Module::Do4, &|a| {
            pdu(5, &[a, 0xFF00])
        }),
        point(
            "06 write single register, output",
            POINT,
            Module::Ao4,
            &|a| pdu(6, &[a, 100]),
        ),
        setting(
            "06 write single register, setting",
            SETTING,
            &|a| pdu(6, &[a, 5]),
            FILTER,
        ),
        point("0F write multiple coils, 1", POINT, Module::Do4, &|a| {
            with_data(0x0F, &[a, 1], &[1])
        }),
        point("0F write multiple coils, 4", FOUR, Module::Do4, &|a| {
            with_data(0x0F, &[a, 4], &[5])
        }),
        setting(
            "10 write multiple registers, 1",
            SETTING,
            &|a| with_data(0x10, &[a, 1], &settings(1)),
            LONG,
        ),
        write_many(),
        own(setting(
            "16 mask write register",
            SETTING,
            &|a| pdu(0x16, &[a, 0xFFFF, 0]),
            LONG,
        )),
        own(setting(
            "17 read/write registers, 1 and 1",
            2000,
            &|a| with_data(0x17, &[a, 1, a, 1], &settings(1)),
            LONG,
        )),
        own(setting(
            "17 read/write registers, 125 and 121",
            7200,
            &|a| with_data(0x17, &[a, 125, a, 121], &settings(121)),
            LONG,
        )),
        alone("07 read exception status", SHORT, pdu(7, &[])),
        alone(
            "08/00 return query data, 2 bytes",
            SHORT,
            pdu(8, &[0, 0x1234]),
        ),
        alone("08/00 return query data, 250 bytes", SHORT, {
            let mut pdu = pdu(8, &[0]);
            pdu.resize(253, 0xA5);
            pdu
        }),
        alone("08/0B return bus message count", SHORT, pdu(8, &[0x0B, 0])),
        alone("0B get comm event counter", SHORT, pdu(0x0B, &[])),
        alone("0C get comm event log", 3200, pdu(0x0C, &[])),
        alone("11 report server id", SHORT, pdu(0x11, &[])),
        alone("14 read file record, 1", 1550, {
            vec![0x14, 7, 6, 0, 1, 0, 0, 0, 1]
        }),
        alone("14 read file record, 124", 4500, {
            vec![0x14, 7, 6, 0, 1, 1, 0, 0, 124]
        }),
        alone("14 read file record, 35 groups of 2", 6600, {
            let groups = (0..35).flat_map(|group| [6, 0, 1, group, 0, 0, 2]);
            [0x14, 35 * 7].into_iter().chain(groups).collect()
        }),
        alone(
            "2B/0E device identification, one object",
            900,
            vec![0x2B, 0x0E, 4, 0],
        ),
        alone(
            "2B/0E device identification, all",
            2700,
            vec![0x2B, 0x0E, 3, 0],
        ),
        alone("an unknown function", SHORT, pdu(0x41, &[])),
        ascii(read_one()),
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
        for board in Row::ALL {
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
