//! Tests of the worker: with the bus of embedded-hal-mock for every transfer and failure, and with a model of the
//! MCP4728 for the effect of a transfer.

extern crate std;
use std::vec::Vec;

use embedded_hal::i2c::{ErrorType, NoAcknowledgeSource, Operation};
use embedded_hal_mock::eh1::i2c::{Mock, Transaction};

use super::*;

const NO_ANSWER: ErrorKind = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address);

/// Multi-Write of four codes: VDD as reference, gain 1, not powered down, output updated immediately.
fn transfer(codes: [u16; 4]) -> Transaction {
    transfer_to(0x60, codes)
}

fn transfer_to(address: u8, codes: [u16; 4]) -> Transaction {
    let bytes = (0..4).zip(codes).flat_map(|(channel, code)| {
        let [high, low] = code.to_be_bytes();
        [0b0100_0000 | channel << 1, high, low]
    });
    Transaction::write(address, bytes.collect())
}

fn wanted(codes: [u16; 4]) -> Option<[Code; 4]> {
    Some(codes.map(Code::new))
}

#[test]
fn nothing_is_transferred_without_codes() {
    let mut bus = Mock::new(&[]);
    let mut worker = DacWorker::new(0x60);
    assert!((0..100).all(|_| worker.work(&mut bus, None) == Ok(false)));
    bus.done();
}

#[test]
fn a_transfer_is_one_multi_write_of_codes_and_configuration() {
    let bytes = std::vec![
        0x40, 0x00, 0x00, 0x42, 0x01, 0x23, 0x44, 0x0A, 0xBC, 0x46, 0x0F, 0xFF,
    ];
    let mut bus = Mock::new(&[Transaction::write(0x60, bytes)]);
    let mut worker = DacWorker::new(0x60);
    assert_eq!(
        worker.work(&mut bus, wanted([0, 0x123, 0xABC, 0xFFF])),
        Ok(true)
    );
    bus.done();
}

#[test]
fn a_code_above_the_range_does_not_change_the_configuration() {
    let mut bus = Mock::new(&[transfer([0xFFF, 0xFFF, 0xFFF, 1])]);
    let mut worker = DacWorker::new(0x60);
    assert_eq!(
        worker.work(&mut bus, wanted([0x1000, 0x8001, 0xFFFF, 1])),
        Ok(true)
    );
    bus.done();
}

#[test]
fn a_change_is_sent_at_the_next_call_and_all_codes_at_every_tenth() {
    let mut bus = Mock::new(&[
        transfer([1, 2, 3, 4]),
        transfer([1, 2, 3, 5]),
        transfer([1, 2, 3, 5]),
        transfer([1, 2, 3, 5]),
    ]);
    let mut worker = DacWorker::new(0x60);
    let mut codes = wanted([1, 2, 3, 4]);
    assert_eq!(worker.work(&mut bus, codes), Ok(true));
    assert_eq!(worker.work(&mut bus, codes), Ok(false));
    codes = wanted([1, 2, 3, 5]);
    assert_eq!(worker.work(&mut bus, codes), Ok(true));
    let transfers: Vec<_> = (1..=20)
        .filter(|_| worker.work(&mut bus, codes) == Ok(true))
        .collect();
    assert_eq!(transfers, [10, 20]);
    bus.done();
}

#[test]
fn the_dac_fails_after_two_failures_until_a_transfer_succeeds() {
    let mut bus = Mock::new(&[
        transfer([9; 4]).with_error(NO_ANSWER),
        transfer([9; 4]),
        transfer([7; 4]).with_error(NO_ANSWER),
        transfer([7; 4]).with_error(ErrorKind::Bus),
        transfer([8; 4]),
    ]);
    let mut worker = DacWorker::new(0x60);
    let mut codes = wanted([9; 4]);
    assert!(worker.work(&mut bus, codes).is_err());
    assert!(!worker.failed());
    assert_eq!(worker.work(&mut bus, codes), Ok(true));
    assert!(!worker.failed());

    codes = wanted([7; 4]);
    assert!(worker.work(&mut bus, codes).is_err());
    assert!(!worker.failed());
    assert!(worker.work(&mut bus, codes).is_err());
    assert!(worker.failed());
    codes = wanted([8; 4]);
    assert_eq!(worker.work(&mut bus, codes), Ok(false));
    assert!(worker.failed(), "no transfer was tried");
    assert_eq!(
        worker.work(&mut bus, codes),
        Ok(true),
        "with the newest codes"
    );
    assert!(!worker.failed());
    bus.done();
}

#[test]
fn tries_become_rarer_down_to_one_in_seventeen_calls_and_never_stop() {
    let mut bus = Mock::new(&std::vec![transfer([1; 4]).with_error(NO_ANSWER); 300]);
    let mut worker = DacWorker::new(0x60);
    let codes = wanted([1; 4]);
    let tries: Vec<_> = (0..6_000)
        .filter(|_| worker.work(&mut bus, codes).is_err())
        .take(300)
        .collect();
    assert_eq!(tries[..8], [0, 1, 3, 6, 11, 20, 37, 54]);
    assert_eq!(
        tries.len(),
        300,
        "far more failures than a counter of 8 bits holds"
    );
    assert!(tries[5..].windows(2).all(|pair| pair[1] - pair[0] == 17));
    bus.done();
}

/// A model of the MCP4728 with Multi-Write only. Every other command fails the test, including those that write the
/// EEPROM.
struct Dac {
    powered: bool,
    /// For each channel: reference, power-down, gain and code, as in its register.
    eeprom: [u16; 4],
    input: [u16; 4],
    output: [u16; 4],
    /// The bus loses the acknowledge after this many bytes.
    cut_after: usize,
}

impl Dac {
    /// Creates a DAC whose EEPROM selects the internal reference, gain 2 and power-down, so that every setting is
    /// wrong.
    fn new() -> Self {
        let eeprom = [0b1111_1000_0000_0000; 4];
        Self {
            powered: true,
            eeprom,
            input: eeprom,
            output: eeprom,
            cut_after: usize::MAX,
        }
    }

    fn power(&mut self, on: bool) {
        self.powered = on;
        (self.input, self.output) = (self.eeprom, self.eeprom);
    }
}

impl ErrorType for Dac {
    type Error = ErrorKind;
}

impl I2c for Dac {
    fn transaction(
        &mut self,
        address: u8,
        operations: &mut [Operation<'_>],
    ) -> Result<(), ErrorKind> {
        assert_eq!(address, 0x60);
        let [Operation::Write(bytes)] = operations else {
            panic!("the worker must only write");
        };
        if !self.powered {
            return Err(NO_ANSWER);
        }
        for channel in bytes[..bytes.len().min(self.cut_after)].chunks_exact(3) {
            assert_eq!(channel[0] & 0b1111_1000, 0b0100_0000, "not Multi-Write");
            let number = usize::from(channel[0] >> 1 & 0b11);
            self.input[number] = u16::from_be_bytes([channel[1], channel[2]]);
            if channel[0] & 1 == 0 {
                self.output[number] = self.input[number];
            }
        }
        if bytes.len() > self.cut_after {
            return Err(ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data));
        }
        Ok(())
    }
}

#[test]
fn a_dac_is_configured_by_one_transfer_and_again_after_a_loss_of_power() {
    let mut worker = DacWorker::new(0x60);
    let mut bus = Dac::new();
    let mut codes = wanted([0, 819, 2048, 4095]);
    assert_eq!(worker.work(&mut bus, codes), Ok(true));
    assert_eq!(bus.output, [0, 819, 2048, 4095]);

    // The power is lost for too short a time to be noticed on the bus.
    bus.power(false);
    bus.power(true);
    assert_ne!(bus.output, [0, 819, 2048, 4095]);
    for _ in 0..REFRESH_CALLS {
        worker.work(&mut bus, codes).unwrap();
    }
    assert_eq!(bus.output, [0, 819, 2048, 4095]);

    // The power is lost for longer, and the codes change.
    bus.power(false);
    for _ in 0..1000 {
        let _ = worker.work(&mut bus, codes);
    }
    assert!(worker.failed());
    codes = wanted([1, 2, 3, 4]);
    bus.power(true);
    let calls = (1..)
        .find(|_| worker.work(&mut bus, codes) == Ok(true))
        .unwrap();
    assert!(calls <= PAUSE_MAX_CALLS + 1, "{calls} calls");
    assert!(!worker.failed());
    assert_eq!(bus.output, [1, 2, 3, 4]);
}

#[test]
fn an_interrupted_transfer_is_repeated_completely() {
    for cut_after in 0..12 {
        let mut worker = DacWorker::new(0x60);
        let mut bus = Dac::new();
        let codes = wanted([10, 20, 30, 40]);
        bus.cut_after = cut_after;
        assert_eq!(
            worker.work(&mut bus, codes),
            Err(ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data))
        );
        bus.cut_after = usize::MAX;
        assert_eq!(worker.work(&mut bus, codes), Ok(true));
        assert_eq!(bus.output, [10, 20, 30, 40], "cut {cut_after}");
    }
}

#[test]
fn a_change_that_failed_half_way_is_undone_when_the_old_codes_are_wanted() {
    let mut worker = DacWorker::new(0x60);
    let mut bus = Dac::new();
    let mut codes = wanted([1; 4]);
    assert_eq!(worker.work(&mut bus, codes), Ok(true));
    codes = wanted([2; 4]);
    bus.cut_after = 6;
    assert!(worker.work(&mut bus, codes).is_err());
    assert_eq!(bus.output, [2, 2, 1, 1]);
    codes = wanted([1; 4]);
    bus.cut_after = usize::MAX;
    assert_eq!(
        worker.work(&mut bus, codes),
        Ok(true),
        "without waiting for a refresh"
    );
    assert_eq!(bus.output, [1; 4]);
}

#[test]
fn workers_with_different_addresses_share_a_bus() {
    let mut bus = Mock::new(&[
        transfer_to(0x60, [1; 4]).with_error(NO_ANSWER),
        transfer_to(0x63, [2; 4]),
        transfer_to(0x60, [1; 4]),
    ]);
    let (first, second) = (wanted([1; 4]), wanted([2; 4]));
    let (mut near, mut far) = (DacWorker::new(0x60), DacWorker::new(0x63));
    assert!(near.work(&mut bus, first).is_err());
    assert_eq!(far.work(&mut bus, second), Ok(true));
    assert_eq!(near.work(&mut bus, first), Ok(true));
    assert_eq!(far.work(&mut bus, second), Ok(false));
    bus.done();
}
