//! Checks every frame of `docs/frames.md`: a device with the module that the page states receives each request, and its
//! reply must be the one on the page.
//!
//! The test reads these lines of the page:
//!
//! | line | meaning |
//! |---|---|
//! | ``The unit has module `4do` `` ... | a new device with this module. Further words select its state, see [`Unit::new`] |
//! | `modioctl ... raw 05 0011 FF00` | the PDU of the next request |
//! | `-> 01 05 ...` or `-> :0105...` | a request, in RTU or in ASCII mode |
//! | `<- 01 05 ...` or `<- no reply` | what the device sends |
//! | a table whose first column is `request` or `reply` | the bytes of the last request or reply, in parts |

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use firmware::config::{Config, Settings};
use firmware::device::{Device, Identity};
use modbus_server::line::{Faults, Framing, Port, Receiver, Width};
use modbus_server::{Adu, Exception, Function, Server};
use modio_drivers::Channels;
use register_map::board::Modio02;
use register_map::{Module, configuration};

/// A modio-02 at unit address 1.
struct Unit {
    device: &'static mut Device<Modio02>,
    server: Server,
    port: Port<'static>,
    is_ascii: bool,
}

impl Unit {
    /// Returns the unit that a line of the page describes, after power-on.
    fn new(line: &str) -> Self {
        let name = line.split('`').nth(1).expect(line);
        let module: Module = name.parse().expect(line);
        let stored = [(configuration::module_of(5), module.code())];
        let (settings, _) = Settings::load(stored.into_iter());
        let identity = Identity {
            unit: 1,
            ..Identity::default()
        };
        let config = Config::new(settings, false);
        let device = Device::new_in(Box::leak(Box::new_uninit()), config, identity);

        let mut inputs = Channels::new();
        if line.contains("Inputs 1 and 3 are energised") {
            inputs.set_bit(0, true);
            inputs.set_bit(2, true);
        }
        if line.contains("Input 1 has 5 V") {
            inputs.set_word(0, 0x0800);
        }
        device.scanned(0, &inputs, &[None; 4], true, 1);
        if line.contains("does not answer") {
            device.points.ports_mut()[0].set_failing(0b1111);
        }

        let is_ascii = line.contains("in ASCII mode");
        let (framing, receiver) = if is_ascii {
            (Framing::ASCII, Receiver::ascii(1, Width::Eight))
        } else {
            (Framing::Rtu, Receiver::rtu(1, false))
        };
        let adus = Box::leak(Box::new([Adu::new(), Adu::new()]));
        let mut port = Port::new(receiver, adus);
        port.long_silence(0);
        Self {
            device,
            server: Server::new(framing),
            port,
            is_ascii,
        }
    }

    /// Sends the characters of a frame, and returns those of the reply; none when there is no reply.
    fn ask(&mut self, frame: &[u8]) -> Vec<u8> {
        for byte in frame {
            self.port.received(*byte, Faults::NONE);
        }
        if self.is_ascii {
            self.port.short_silence(0);
        } else {
            self.port.long_silence(0);
        }
        let Some(request) = self.port.take() else {
            return Vec::new();
        };
        let reply = self.server.serve(request, self.device);
        self.port.send(reply, 0);
        if let Some(command) = self.device.end_request() {
            self.device
                .carry_out(command, firmware::config::LineName::Rs485);
        }
        let mut reply: Vec<u8> = self.port.start().into_iter().collect();
        while let Some(byte) = self.port.next_byte() {
            reply.push(byte);
        }
        if !reply.is_empty() {
            self.port.sent();
        }
        reply
    }
}

/// Returns the bytes of text in hexadecimal, with or without spaces between them.
fn hex(text: &str) -> Vec<u8> {
    let digits: Vec<char> = text.chars().filter(|c| !c.is_whitespace()).collect();
    let byte = |pair: &[char]| {
        let pair: String = pair.iter().collect();
        u8::from_str_radix(&pair, 16).unwrap_or_else(|_| panic!("{text:?} is not hexadecimal"))
    };
    digits.chunks(2).map(byte).collect()
}

/// Returns the bytes of a frame on the page: unit address, PDU and check.
fn bytes(frame: &str) -> Vec<u8> {
    match frame {
        "no reply" => Vec::new(),
        frame => hex(frame.strip_prefix(':').unwrap_or(frame)),
    }
}

/// Returns the characters of a frame on the page as they are on the line.
fn characters(frame: &str) -> Vec<u8> {
    if frame.starts_with(':') {
        format!("{frame}\r\n").into_bytes()
    } else {
        bytes(frame)
    }
}

/// What the test has found on the page.
#[derive(Default)]
struct Found {
    functions: BTreeSet<u8>,
    exceptions: BTreeSet<u8>,
    frames: usize,
    tables: usize,
}

/// Sends every request of the page to the unit that the page describes.
///
/// # Panics
///
/// When a reply, a command or a table of the page is wrong.
fn check(page: &str) -> Found {
    let mut found = Found::default();
    let mut unit = None;
    let (mut command, mut request, mut reply) = (None, "", "");
    // The bytes of the table that is being read, and the frame that they must be.
    let mut table: Option<(Vec<u8>, Vec<u8>)> = None;
    for line in page.lines().chain([""]) {
        if let Some(row) = line.strip_prefix("| ") {
            if row.starts_with("request |") {
                table = Some((Vec::new(), bytes(request)));
            } else if row.starts_with("reply |") {
                table = Some((Vec::new(), bytes(reply)));
            } else if let Some((parts, _)) = &mut table {
                parts.extend(hex(row.split('`').nth(1).expect(line)));
            }
            continue;
        }
        if line.starts_with("|---") {
            continue;
        }
        if let Some((parts, frame)) = table.take() {
            assert_eq!(parts, frame, "the table after\n-> {request}\n<- {reply}");
            found.tables += 1;
        }
        if line.starts_with("The unit has module ") {
            unit = Some(Unit::new(line));
        } else if line.starts_with("modioctl ") {
            let (_, pdu) = line.split_once(" raw ").expect(line);
            command = Some(hex(pdu));
        } else if let Some(frame) = line.strip_prefix("-> ") {
            request = frame;
            let bytes = bytes(frame);
            let check = if frame.starts_with(':') { 1 } else { 2 };
            let pdu = &bytes[1..bytes.len() - check];
            if let Some(command) = command.take() {
                assert_eq!(command, pdu, "the command for\n-> {frame}");
            }
            found.functions.insert(pdu[0]);
        } else if let Some(frame) = line.strip_prefix("<- ") {
            reply = frame;
            let unit = unit
                .as_mut()
                .expect("the page says which module the unit has");
            let sent = unit.ask(&characters(request));
            assert_eq!(sent, characters(frame), "the reply to\n-> {request}");
            if let [_, function, code, ..] = sent[..]
                && function & Function::EXCEPTION != 0
                && !frame.starts_with(':')
            {
                found.exceptions.insert(code);
            }
            found.frames += 1;
        }
    }
    found
}

fn page() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/frames.md");
    fs::read_to_string(path).expect("the page")
}

#[test]
fn device_sends_every_reply_of_the_page() {
    let found = check(&page());
    let all = (0x01..0x80).filter(|code| Function::from_code(*code).is_some());
    let missing: Vec<u8> = all.filter(|code| !found.functions.contains(code)).collect();
    assert!(missing.is_empty(), "no request of functions {missing:02X?}");
    assert!(found.exceptions.is_superset(&[1, 2, 3, 4, 6].into()));
    assert!(found.frames > 25, "{} frames", found.frames);
    assert!(found.tables > 10, "{} tables", found.tables);
}

#[test]
#[should_panic(expected = "the reply to")]
fn wrong_reply_on_the_page_is_an_error() {
    check("The unit has module `4do`.\n-> 01 05 00 11 FF 00 DC 3F\n<- 01 05 00 11 00 00 9D CF\n");
}

#[test]
#[should_panic(expected = "the table after")]
fn wrong_table_on_the_page_is_an_error() {
    check(
        "The unit has module `4do`.\n-> 01 07 41 E2\n<- 01 07 00 22 30\n| request | |\n|---|---|\n| `01` | |\n",
    );
}

#[test]
fn page_has_the_names_of_the_exceptions() {
    let page = page();
    for exception in [
        Exception::IllegalFunction,
        Exception::IllegalDataAddress,
        Exception::IllegalDataValue,
        Exception::ServerDeviceFailure,
        Exception::Acknowledge,
        Exception::ServerDeviceBusy,
        Exception::NegativeAcknowledge,
        Exception::MemoryParityError,
        Exception::GatewayPathUnavailable,
        Exception::GatewayTargetDeviceFailedToRespond,
    ] {
        let text = exception.to_string();
        let (_, name) = text.split_once(", ").expect("the name");
        let row = format!("| {:02X} | {name} |", exception.code());
        assert!(page.contains(&row), "{row}");
    }
}
