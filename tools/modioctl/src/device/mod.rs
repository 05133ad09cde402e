//! A unit on the line: its registers and points. Errors are texts for the user.

mod learn;
mod orders;
mod other;
mod several;

use modbus_line::adu::{pdu, words_of, write_words};
use modbus_line::names;

pub use learn::{fetch, fetch_set, known};
pub use orders::with_modules;

use crate::bus::endpoint::{Endpoint, Place};
use crate::bus::{Master, Observer, adu, is_busy};
use crate::failure::Failure;

/// Largest number of registers that one request can read (V1.1b3, 6.3).
const MOST_WORDS: u16 = 125;
/// Largest number of registers that one request can write (V1.1b3, 6.12).
const MOST_WRITTEN: usize = 123;
/// Largest number of bits that one request reads here: less than the standard's 2000, and more than any unit has.
const MOST_BITS: u16 = 256;

/// A unit and the line to it.
pub struct Device {
    /// The line.
    pub master: Master,
    /// The unit's address.
    pub unit: u8,
    /// Whether the unit's description is read from the unit even if it is stored on this computer.
    pub refresh: bool,
}

impl Device {
    /// Opens the line to the endpoint's unit.
    pub async fn open(endpoint: Endpoint, observer: Option<Observer>) -> Result<Self, Failure> {
        let unit = endpoint.unit;
        let master = Master::open(endpoint, observer).await?;
        Ok(Self {
            master,
            unit,
            refresh: false,
        })
    }

    /// Sends a request. An exception is a failure; `about` describes the request in its text.
    pub async fn ask(&mut self, pdu: &[u8], about: &str) -> Result<Vec<u8>, Failure> {
        match self.master.ask(self.unit, pdu).await {
            Ok(response) if is_busy(pdu, &response) => Err(self.busy(&response, about)),
            Ok(response) => match response[..] {
                [function, code] if function & 0x80 != 0 => Err(self.exception(code, about)),
                _ => Ok(response),
            },
            Err(lost) => Err(self.lost(Some(pdu), &lost)),
        }
    }

    /// Reads registers from `first` on, by function 03.
    pub async fn read_words(&mut self, first: u16, count: u16) -> Result<Vec<u16>, Failure> {
        let mut words = Vec::new();
        let mut done = 0;
        while done < count {
            let now = (count - done).min(MOST_WORDS);
            let from = first.wrapping_add(done);
            let about = format!("reading {}", span(from, now));
            let response = self.ask(&pdu(3, from, now), &about).await?;
            words.extend(words_of(&response));
            done += now;
        }
        Ok(words)
    }

    /// Reads bits from `first` on, by function 01.
    pub async fn read_bits(&mut self, first: u16, count: u16) -> Result<Vec<bool>, Failure> {
        let count = count.min(MOST_BITS);
        let about = format!("reading {}", span(first, count));
        let response = self.ask(&pdu(1, first, count), &about).await?;
        let bytes = response.get(2..).unwrap_or_default();
        let each = |byte: &u8| [0, 1, 2, 3, 4, 5, 6, 7].map(|bit| byte >> bit & 1 == 1);
        let bits = bytes.iter().flat_map(each);
        Ok(bits.take(count.into()).collect())
    }

    /// Writes registers: a single one by function 06, several by function 10.
    pub async fn write_words(
        &mut self,
        first: u16,
        words: &[u16],
        about: &str,
    ) -> Result<(), Failure> {
        if let [word] = words {
            self.ask(&pdu(6, first, *word), about).await?;
            return Ok(());
        }
        for (n, words) in (0_u16..).zip(words.chunks(MOST_WRITTEN)) {
            let from = first.wrapping_add(n * MOST_WRITTEN as u16);
            self.ask(&write_words(from, words), about).await?;
        }
        Ok(())
    }

    /// Writes one bit, by function 05.
    pub async fn write_bit(&mut self, address: u16, on: bool, about: &str) -> Result<(), Failure> {
        let word = if on { 0xFF00 } else { 0 };
        self.ask(&pdu(5, address, word), about).await?;
        Ok(())
    }

    /// Reads records of a file, by function 14, as bytes.
    pub async fn read_records(
        &mut self,
        file: u16,
        first: u16,
        count: u16,
    ) -> Result<Vec<u8>, Failure> {
        let mut request = vec![0x14, 7, 6];
        request.extend([file, first, count].map(u16::to_be_bytes).as_flattened());
        let about = format!("reading file {file}");
        let response = self.ask(&request, &about).await?;
        // After function, total length, length of the group and reference type.
        Ok(response.get(4..).unwrap_or_default().to_vec())
    }

    /// Returns whether a change of the unit's line settings also concerns this computer's port.
    pub const fn is_serial(&self) -> bool {
        self.master.endpoint().place.is_serial()
    }

    /// Returns the failure for a read that the unit, or a gateway, had no time for.
    pub fn busy(&self, response: &[u8], about: &str) -> Failure {
        let unit = self.unit;
        let code = response.last().copied().unwrap_or_default();
        let name = names::exception(code).unwrap_or_default();
        Failure::Busy(format!(
            "{about}: unit {unit}, or a gateway in front of it, is busy (exception {code:02X}, {name}): try again, with more `--retries`"
        ))
    }

    /// Returns the failure for an exception, with its meaning.
    pub fn exception(&self, code: u8, about: &str) -> Failure {
        let unit = self.unit;
        let name = names::exception(code).unwrap_or("unknown exception");
        let meaning = match code {
            1 if self.master.endpoint().framing == adu::Framing::Mbap => {
                "the unit does not have this function, or the gateway does not pass it"
            }
            1 => "the unit does not have this function",
            2 => "there is no such point or register, or it cannot be written",
            3 => "the unit does not allow this value",
            4 => {
                "the module in the slot does not answer: check that it is plugged in and that MODULE names it"
            }
            6 => {
                "the configuration is locked, a save is under way, there were too many saves (wait for a minute), or LORA is 2 and this came over the air (use the cable)"
            }
            _ => "see the manual of the unit",
        };
        Failure::Refused(format!(
            "{about}: unit {unit} refuses with exception {code:02X} ({name}): {meaning}"
        ))
    }
}

/// Describes an endpoint for people.
pub fn place(endpoint: &Endpoint) -> String {
    match &endpoint.place {
        Place::Serial(path) => format!("{path}, {} bit/s {}", endpoint.baud, endpoint.format),
        Place::Tcp(address) => address.clone(),
        Place::ModbusTcp(address) => format!("{address} (Modbus TCP)"),
    }
}

fn span(first: u16, count: u16) -> String {
    match count {
        1 => format!("{first:#06X}"),
        _ => format!("{first:#06X} to {:#06X}", first.wrapping_add(count - 1)),
    }
}
