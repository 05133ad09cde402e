//! Fast Modbus, function 70: finding units, requests by serial number, and events.
//!
//! This is Wiren Board's open extension of Modbus RTU (`docs/protocol.en.md` in the repository
//! wirenboard/wb-modbus-ext-scanner). A request to all units has the address [`ADDRESS`]. Units that want to reply decide
//! by [arbitration](crate::line::Arbitration) which of them does. Its function 0x60 is an older form and not here.
//!
//! | sub-function | from | what |
//! |---|---|---|
//! | 01, 02 | master | starts or continues a scan: units that were not found yet arbitrate with their serial numbers |
//! | 03, 04 | unit | its serial number and unit address; or no unit is left |
//! | 08, 09 | master, unit | a request to a serial number, and its reply. Works when two units have the same address |
//! | 10 | master | fetches events: units arbitrate with priority and unit address |
//! | 11, 12 | unit | events; or there are none |
//! | 18 | master, to a unit | switches the events of points on and off |
//!
//! A line with a [`FastUnit`](crate::line::FastUnit) recognises these messages at their last byte
//! ([`Port::ends_fast_message`](crate::line::Port::ends_fast_message)), because units begin to arbitrate, and masters to
//! send the next request, before t3.5 has passed. A [`Unit`] serves the requests with
//! [`Server::serve_fast`](crate::Server::serve_fast), and [`Port::arbitrate`](crate::line::Port::arbitrate) takes the
//! reply. Sub-function 18 has the unit's own address: a data model serves it as a user-defined function, with
//! [`check_settings`] and [`apply_settings`].

mod events;
mod settings;
mod unit;

pub use events::{EventSource, Kind, Packet, Waiting};
pub use settings::{Setting, apply_settings, check_settings};
pub use unit::{Contest, Part, Unit};

/// The unit address of requests to all units.
pub const ADDRESS: u8 = 0xFD;
/// The function code.
pub const FUNCTION: u8 = 0x46;

/// Sub-functions.
pub(crate) mod sub {
    pub const START_SCAN: u8 = 0x01;
    pub const CONTINUE_SCAN: u8 = 0x02;
    pub const FOUND: u8 = 0x03;
    pub const NONE_LEFT: u8 = 0x04;
    pub const REQUEST: u8 = 0x08;
    pub const REPLY: u8 = 0x09;
    pub const FETCH: u8 = 0x10;
    pub const EVENTS: u8 = 0x11;
    pub const NO_EVENTS: u8 = 0x12;
    pub const SETTINGS: u8 = 0x18;
}

/// Length of what stands in front of the PDU of a request to a serial number, less the unit address of a usual frame.
pub(crate) const SERIAL_AHEAD: u8 = 6;
