//! Transfers in the sequence that stm32f1xx-hal 0.11 uses, their times, and bus faults.

use super::bits::{offset, sr2};
use super::*;
use crate::peripheral::Peripheral;

const HZ: u32 = 36_000_000;
const ON: u32 = cr1::PE | cr1::ACK;

/// The only device on the bus. It has address 0x60, acknowledges every byte, and sends 1, 2, 3 and so on.
struct Device {
    present: bool,
    received: Vec<u8>,
    sent: u8,
    /// Levels of the wires as the device holds them.
    held: Wires,
    /// Levels of the part's pins as GPIO outputs.
    pins: Wires,
}

impl Bus for Device {
    fn wires(&self) -> Wires {
        Wires {
            scl: self.held.scl && self.pins.scl,
            sda: self.held.sda && self.pins.sda,
        }
    }

    fn address(&mut self, byte: u8, _now: Time) -> bool {
        self.sent = 0;
        self.received.clear();
        self.present && byte >> 1 == 0x60
    }

    fn write(&mut self, byte: u8, _now: Time) -> bool {
        self.received.push(byte);
        true
    }

    fn read(&mut self, _now: Time) -> u8 {
        self.sent += 1;
        self.sent
    }

    fn stop(&mut self, _now: Time) {}
}

/// The block and the bus, and a time that each register access moves on.
struct Rig {
    i2c: I2c,
    device: Device,
    now: Time,
}

impl Rig {
    /// 400 kHz from 36 MHz: CCR = 30, three cycles each: 2.5 us a bit.
    fn new() -> Self {
        let mut rig = Self {
            i2c: I2c::default(),
            device: Device {
                present: true,
                received: Vec::new(),
                sent: 0,
                held: Wires::FREE,
                pins: Wires::FREE,
            },
            now: Time::ZERO,
        };
        rig.i2c.set_clock(HZ, Time::ZERO);
        rig.i2c.set_connected(true, Time::ZERO);
        rig.init();
        rig
    }

    fn init(&mut self) {
        self.write(offset::CR2, 36);
        self.write(offset::TRISE, 11);
        self.write(offset::CCR, ccr::FAST | 30);
        self.write(offset::CR1, ON);
    }

    fn write(&mut self, offset: u32, value: u32) {
        let done = self.try_write(offset, value);
        assert_eq!(done, Ok(()), "{offset:#x} <- {value:#x}");
    }

    fn try_write(&mut self, offset: u32, value: u32) -> Result<(), Unmodelled> {
        self.i2c.exchange(&mut self.device, self.now);
        self.i2c.write(offset, value, self.now)
    }

    fn read(&mut self, offset: u32) -> u32 {
        self.i2c.exchange(&mut self.device, self.now);
        self.i2c.read(offset, self.now).expect("modelled")
    }

    fn set(&mut self, bits: u32) {
        let cr1 = self.read(offset::CR1);
        self.write(offset::CR1, cr1 | bits);
    }

    fn clear(&mut self, bits: u32) {
        let cr1 = self.read(offset::CR1);
        self.write(offset::CR1, cr1 & !bits);
    }

    /// Waits for one of `flags` in SR1, event by event; `false` when there is no further event.
    fn wait(&mut self, flags: u32) -> bool {
        while self.read(offset::SR1) & flags == 0 {
            match self.i2c.next_event() {
                Some(at) => self.now = at,
                None => return false,
            }
        }
        true
    }

    fn address(&mut self, byte: u8) -> bool {
        self.set(cr1::START);
        assert!(self.wait(sr1::SB));
        self.write(offset::DR, u32::from(byte));
        assert!(self.wait(sr1::ADDR | sr1::AF));
        self.read(offset::SR1) & sr1::AF == 0
    }

    fn clear_addr(&mut self) {
        self.read(offset::SR1);
        self.read(offset::SR2);
    }

    fn stop(&mut self) {
        self.set(cr1::STOP);
        self.until_stopped();
    }

    fn until_stopped(&mut self) {
        while self.read(offset::CR1) & cr1::STOP != 0 {
            self.now = self.i2c.next_event().expect("a stop ends");
        }
    }

    fn send(&mut self, bytes: &[u8]) {
        assert!(self.address(0xC0));
        self.clear_addr();
        for &byte in bytes {
            assert!(self.wait(sr1::TXE));
            self.write(offset::DR, u32::from(byte));
        }
        assert!(self.wait(sr1::BTF));
        self.stop();
        assert_eq!(self.device.received, bytes);
    }

    fn bits(n: u64) -> Time {
        Time::cycles(n * 90, HZ)
    }
}

#[test]
fn a_fast_write_takes_nine_bits_a_byte() {
    let mut rig = Rig::new();
    rig.send(&[0x0F, 0xFF, 0x01, 0x23]);
    // Start, address, four bytes, stop.
    assert_eq!(rig.now, Rig::bits(1 + 9 + 4 * 9 + 1));
    assert_eq!(rig.read(offset::SR2), 0);
    assert_eq!(rig.read(offset::SR1), 0);
}

#[test]
fn flags_of_a_write_match_the_manual() {
    let mut rig = Rig::new();
    rig.set(cr1::START);
    assert!(rig.wait(sr1::SB));
    assert_eq!(rig.read(offset::SR2), sr2::MSL | sr2::BUSY);
    rig.write(offset::DR, 0xC0);
    assert!(rig.wait(sr1::ADDR));
    assert_eq!(rig.read(offset::SR1), sr1::ADDR | sr1::TXE);
    assert_eq!(rig.read(offset::SR2), sr2::MSL | sr2::BUSY | sr2::TRA);
    // The clock is stretched until a byte is written. The byte then moves directly to the shift register.
    assert_eq!(rig.i2c.next_event(), None);
    rig.write(offset::DR, 0x00);
    assert_eq!(rig.read(offset::SR1), sr1::TXE);
    rig.write(offset::DR, 0x10);
    assert_eq!(rig.read(offset::SR1), 0);
    assert!(rig.wait(sr1::TXE));
    assert!(rig.wait(sr1::BTF));
    assert_eq!(rig.read(offset::SR1), sr1::TXE | sr1::BTF);
    // One more byte clears BTF.
    rig.write(offset::DR, 0x00);
    assert_eq!(rig.read(offset::SR1), sr1::TXE);
    assert!(rig.wait(sr1::BTF));
    rig.stop();
}

#[test]
fn an_absent_device_is_not_acknowledged() {
    let mut rig = Rig::new();
    rig.device.present = false;
    rig.write(offset::CR2, 36 | cr2::ITERREN);
    assert!(!rig.address(0xC0));
    assert_eq!(rig.now, Rig::bits(10));
    assert!(rig.i2c.irq_error());
    rig.write(offset::SR1, !sr1::AF);
    assert!(!rig.i2c.irq_error());
    rig.stop();
    assert_eq!(rig.read(offset::SR2), 0);
    rig.device.present = true;
    rig.send(&[0x01, 0x00]);
}

/// Reads `n` bytes the way the HAL's blocking driver does for 1, 2 and more.
fn receive(rig: &mut Rig, n: usize) -> Vec<u8> {
    assert!(rig.address(0xC1));
    let mut bytes = Vec::new();
    let mut take = |rig: &mut Rig| bytes.push(rig.read(offset::DR) as u8);
    match n {
        1 => {
            rig.clear(cr1::ACK);
            rig.clear_addr();
            rig.set(cr1::STOP);
            assert!(rig.wait(sr1::RXNE));
            take(rig);
        }
        2 => {
            rig.set(cr1::POS | cr1::ACK);
            rig.clear_addr();
            rig.clear(cr1::ACK);
            assert!(rig.wait(sr1::BTF));
            rig.set(cr1::STOP);
            take(rig);
            take(rig);
        }
        _ => {
            rig.clear_addr();
            for _ in 0..n - 3 {
                assert!(rig.wait(sr1::RXNE));
                take(rig);
            }
            assert!(rig.wait(sr1::BTF));
            rig.clear(cr1::ACK);
            take(rig);
            rig.set(cr1::STOP);
            take(rig);
            assert!(rig.wait(sr1::RXNE));
            take(rig);
        }
    }
    rig.until_stopped();
    rig.clear(cr1::POS);
    rig.set(cr1::ACK);
    bytes
}

#[test]
fn one_two_and_twenty_four_bytes_are_read_back() {
    let mut rig = Rig::new();
    for n in [1, 2, 3, 4, 24] {
        let began = rig.now;
        assert_eq!(
            receive(&mut rig, n),
            Vec::from_iter(1..=n as u8),
            "{n} bytes"
        );
        assert_eq!(rig.read(offset::SR1), 0);
        assert_eq!(rig.read(offset::SR2), 0);
        // The program takes no time, so the clock is never stretched and the duration is exact to the bit.
        let bits = 1 + 9 + 9 * n as u64 + 1;
        let off = (rig.now - began).as_ps().abs_diff(Rig::bits(bits).as_ps());
        assert!(off < 100, "{n} bytes: {off} ps");
    }
}

#[test]
fn repeated_start_changes_the_direction() {
    let mut rig = Rig::new();
    assert!(rig.address(0xC0));
    rig.clear_addr();
    rig.write(offset::DR, 0x08);
    assert!(rig.wait(sr1::BTF));
    assert_eq!(rig.device.received, [0x08]);
    assert_eq!(receive(&mut rig, 2), [1, 2]);
}

#[test]
fn a_held_clock_stretches_and_goes_on() {
    let mut rig = Rig::new();
    assert!(rig.address(0xC0));
    rig.clear_addr();
    rig.write(offset::DR, 0x0F);
    rig.device.held.scl = false;
    assert!(!rig.wait(sr1::BTF), "nothing will happen");
    rig.now += Time::from_ms(5);
    rig.device.held.scl = true;
    assert!(rig.wait(sr1::BTF));
    rig.write(offset::DR, 0xFF);
    assert!(rig.wait(sr1::BTF));
    rig.stop();
    assert_eq!(rig.device.received, [0x0F, 0xFF]);
}

#[test]
fn a_held_data_wire_keeps_the_bus_busy_until_it_is_clocked_free() {
    let mut rig = Rig::new();
    rig.device.held.sda = false;
    rig.set(cr1::START);
    assert!(!rig.wait(sr1::SB));
    assert_eq!(rig.read(offset::SR2), sr2::BUSY);
    // A software reset alone does not help: the wire is still low.
    rig.write(offset::CR1, cr1::PE | cr1::SWRST);
    rig.write(offset::CR1, 0);
    rig.init();
    assert_eq!(rig.read(offset::SR2), sr2::BUSY);
    // Nine pulses by hand, after which the device releases SDA, then a stop condition by hand: SDA rises while SCL is
    // high.
    for scl in [false, true].into_iter().cycle().take(18) {
        rig.device.pins = Wires { scl, sda: true };
        rig.read(offset::SR2);
    }
    rig.device.held.sda = true;
    for (scl, sda) in [(false, true), (false, false), (true, false), (true, true)] {
        rig.device.pins = Wires { scl, sda };
        rig.read(offset::SR2);
    }
    assert_eq!(rig.read(offset::SR2), 0);
    rig.send(&[0x02, 0x00]);
}

#[test]
fn a_pulse_on_the_clock_leaves_busy_that_only_a_reset_clears() {
    let mut rig = Rig::new();
    rig.device.held.scl = false;
    rig.read(offset::SR1);
    rig.device.held.scl = true;
    assert_eq!(rig.read(offset::SR2), sr2::BUSY);
    rig.set(cr1::START);
    assert!(!rig.wait(sr1::SB));
    rig.write(offset::CR1, cr1::PE | cr1::SWRST);
    rig.write(offset::CR1, 0);
    rig.init();
    rig.send(&[0x02, 0x00]);
}

#[test]
fn a_data_wire_pulled_low_in_mid_byte_loses_arbitration() {
    let mut rig = Rig::new();
    assert!(rig.address(0xC0));
    rig.clear_addr();
    rig.write(offset::DR, 0x0F);
    rig.device.held.sda = false;
    assert!(rig.wait(sr1::ARLO));
    assert_eq!(rig.read(offset::SR2), sr2::BUSY);
    assert_eq!(rig.device.received, []);
}

#[test]
fn interrupts_follow_their_enables() {
    let mut rig = Rig::new();
    rig.write(offset::CR2, 36 | cr2::ITEVTEN);
    rig.set(cr1::START);
    assert!(rig.wait(sr1::SB));
    assert!(rig.i2c.irq_event() && !rig.i2c.irq_error());
    rig.write(offset::DR, 0xC0);
    assert!(!rig.i2c.irq_event());
    assert!(rig.wait(sr1::ADDR));
    rig.clear_addr();
    assert!(!rig.i2c.irq_event(), "TXE needs ITBUFEN");
    rig.write(offset::CR2, 36 | cr2::ITEVTEN | cr2::ITBUFEN);
    assert!(rig.i2c.irq_event());
}

#[test]
fn misuse_is_reported() {
    let mut rig = Rig::new();
    assert!(rig.try_write(offset::CCR, 180).is_err(), "PE = 1");
    assert!(rig.try_write(offset::CR1, ON | cr1::STOP).is_err());
    assert!(rig.try_write(offset::DR, 0).is_err());
    assert!(rig.try_write(offset::CR2, 36 | 1 << 11).is_err(), "DMA");
    assert!(rig.try_write(offset::CR1, ON | 2).is_err(), "SMBus");
    rig.write(offset::CR1, ON);
    rig.set(cr1::START);
    assert!(rig.try_write(offset::CR1, ON).is_err(), "START pending");
    assert!(rig.read(0x20) == 11 && rig.i2c.read(0x24, Time::ZERO).is_err());
    for (cr2, ccr) in [(8, 180), (36, 3), (36, 179), (36, ccr::FAST | 29)] {
        let mut rig = Rig::new();
        rig.write(offset::CR1, 0);
        rig.write(offset::CR2, cr2);
        rig.write(offset::CCR, ccr);
        assert!(rig.try_write(offset::CR1, ON).is_err(), "{cr2} {ccr}");
    }
}

#[test]
fn transfer_starts_only_once_the_pins_are_configured() {
    let mut rig = Rig::new();
    rig.i2c.set_connected(false, rig.now);
    let cr1 = rig.read(offset::CR1);
    assert!(rig.try_write(offset::CR1, cr1 | cr1::START).is_err());
    assert!(!rig.wait(sr1::SB));
    rig.i2c.set_connected(true, rig.now);
    assert!(rig.wait(sr1::SB));
}

#[test]
fn byte_stands_still_while_the_pins_are_not_the_block_s() {
    let mut rig = Rig::new();
    rig.set(cr1::START);
    assert!(rig.wait(sr1::SB));
    rig.write(offset::DR, 0xC0);
    rig.i2c.set_connected(false, rig.now);
    assert!(!rig.wait(sr1::ADDR | sr1::AF));
    rig.i2c.set_connected(true, rig.now);
    assert!(rig.wait(sr1::ADDR));
}

/// Drives the wires by hand, with the pins as outputs.
fn by_hand(rig: &mut Rig, scl: bool, sda: bool) {
    rig.device.pins = Wires { scl, sda };
    rig.i2c.exchange(&mut rig.device, rig.now);
}

#[test]
fn locked_filters_keep_busy_set_until_edges_on_both_wires_and_a_software_reset() {
    let mut rig = Rig::new();
    rig.i2c.lock_filters(rig.now);
    let busy = |rig: &mut Rig| rig.read(offset::SR2) & sr2::BUSY != 0;
    let reset = |rig: &mut Rig| {
        rig.write(offset::CR1, cr1::SWRST);
        rig.write(offset::CR1, 0);
        rig.init();
    };
    assert!(busy(&mut rig));
    rig.i2c.reset(rig.now);
    reset(&mut rig);
    assert!(busy(&mut rig), "no reset helps");
    rig.set(cr1::START);
    assert!(!rig.wait(sr1::SB));
    by_hand(&mut rig, false, true);
    by_hand(&mut rig, true, true);
    reset(&mut rig);
    assert!(busy(&mut rig), "SDA had no edge");
    by_hand(&mut rig, true, false);
    by_hand(&mut rig, true, true);
    assert!(busy(&mut rig), "only a software reset clears it");
    reset(&mut rig);
    assert!(!busy(&mut rig));
    rig.set(cr1::START);
    assert!(rig.wait(sr1::SB));
}

#[test]
fn start_condition_of_another_is_a_bus_error_in_a_byte_and_busy_on_a_free_bus() {
    let mut rig = Rig::new();
    rig.i2c.disturb();
    assert_eq!(rig.read(offset::SR2), sr2::BUSY);
    rig.write(offset::CR1, cr1::SWRST);
    rig.write(offset::CR1, 0);
    rig.init();
    rig.set(cr1::START);
    assert!(rig.wait(sr1::SB));
    rig.write(offset::DR, 0xC0);
    rig.i2c.disturb();
    assert_eq!(rig.read(offset::SR1), sr1::BERR);
    assert!(rig.wait(sr1::ADDR), "the transfer goes on");
    rig.write(offset::SR1, !sr1::BERR & 0xFFFF);
    assert_eq!(rig.read(offset::SR1) & sr1::BERR, 0);
}
