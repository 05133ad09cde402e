//! Tests of the commands in section 5 of the data sheet.

use super::*;

const WRITE: u8 = ADDRESS << 1;
const READ: u8 = ADDRESS << 1 | 1;

fn send(dac: &mut Mcp4728, bytes: &[u8], now: Time) -> usize {
    assert!(dac.address(WRITE, now));
    let taken = bytes.iter().take_while(|&&b| dac.write(b, now)).count();
    dac.stop(now);
    taken
}

fn read_all(dac: &mut Mcp4728, now: Time) -> [u8; 24] {
    assert!(dac.address(READ, now));
    let bytes = std::array::from_fn(|_| dac.read(now));
    dac.stop(now);
    bytes
}

fn outputs(dac: &Mcp4728) -> [u16; 4] {
    [0, 1, 2, 3].map(|n| dac.output(n))
}

#[test]
fn fast_write_sets_channels_in_order_and_leaves_the_eeprom() {
    let mut dac = Mcp4728::default();
    let bytes = [0x0F, 0xFF, 0x01, 0x23, 0x08, 0x00, 0x00, 0x01];
    assert_eq!(send(&mut dac, &bytes, Time::ZERO), 8);
    assert_eq!(outputs(&dac), [4095, 0x123, 2048, 1]);
    // The transfer ends after the high byte of channel B, so only channel A changes.
    assert_eq!(send(&mut dac, &[0x01, 0x00, 0x02], Time::ZERO), 3);
    assert_eq!(outputs(&dac), [0x100, 0x123, 2048, 1]);
    assert_eq!(dac.eeprom(), [Setting::default(); 4]);
    // PD = 01 powers channel A down, so its output is 0.
    send(&mut dac, &[0x15, 0x55], Time::ZERO);
    assert_eq!(outputs(&dac)[0], 0);
    assert_eq!(dac.registers()[0].code, 0x555);
}

#[test]
fn multi_write_sets_the_named_channels_and_leaves_the_eeprom() {
    let mut dac = Mcp4728::default();
    // C = 0x800 with the internal reference and gain 2, then A = 0x001.
    let bytes = [0x45, 0x98, 0x00, 0x40, 0x00, 0x01];
    assert_eq!(send(&mut dac, &bytes, Time::ZERO), 6);
    assert_eq!(outputs(&dac), [1, 0, 0x800, 0]);
    let c = dac.registers()[2];
    assert!(c.internal_reference && c.double_gain);
    assert_eq!(dac.eeprom(), [Setting::default(); 4]);
}

#[test]
fn sequential_write_also_writes_the_eeprom_which_is_busy_then() {
    let mut dac = Mcp4728::default();
    let t = Time::from_ms(10);
    // From channel B there are three pairs. The byte after them is not acknowledged.
    let bytes = [0x52, 0x01, 0x11, 0x02, 0x22, 0x03, 0x33, 0x04];
    assert_eq!(send(&mut dac, &bytes, t), 7);
    assert_eq!(outputs(&dac), [0, 0x111, 0x222, 0x333]);
    assert_eq!(dac.eeprom()[3].code, 0x333);
    assert_eq!(read_all(&mut dac, t)[0], 0x40, "busy");
    // While the EEPROM is busy, a single write changes the register only.
    send(&mut dac, &[0x58, 0x07, 0x77], t + Time::from_ms(1));
    assert_eq!((dac.output(0), dac.eeprom()[0].code), (0x777, 0));
    let ready = t + EEPROM_WRITE;
    assert_eq!(read_all(&mut dac, ready)[0], 0xC0, "ready");
    send(&mut dac, &[0x58, 0x07, 0x77], ready);
    assert_eq!(dac.eeprom()[0].code, 0x777);
}

#[test]
fn read_returns_register_and_eeprom_of_each_channel() {
    let mut dac = Mcp4728::default();
    send(&mut dac, &[0x5E, 0x9A, 0xBC], Time::ZERO);
    send(&mut dac, &[0x0F, 0xFE], Time::ZERO);
    let bytes = read_all(&mut dac, Time::from_secs(1));
    assert_eq!(bytes[..6], [0xC0, 0x0F, 0xFE, 0xC0, 0x00, 0x00]);
    assert_eq!(bytes[18..], [0xF0, 0x9A, 0xBC, 0xF0, 0x9A, 0xBC]);
}

#[test]
fn reference_gain_and_power_down_commands_change_their_bits() {
    let mut dac = Mcp4728::default();
    assert_eq!(send(&mut dac, &[0x8A, 0x00], Time::ZERO), 1);
    assert_eq!(send(&mut dac, &[0xC1], Time::ZERO), 1);
    assert_eq!(send(&mut dac, &[0xA6, 0x70], Time::ZERO), 2);
    let r = dac.registers();
    assert_eq!(r.map(|s| s.internal_reference), [true, false, true, false]);
    assert_eq!(r.map(|s| s.double_gain), [false, false, false, true]);
    assert_eq!(r.map(|s| s.power_down), [1, 2, 1, 3]);
    // General call wake-up.
    assert!(dac.address(0, Time::ZERO) && dac.write(0x09, Time::ZERO));
    assert_eq!(dac.registers().map(|s| s.power_down), [0; 4]);
}

#[test]
fn general_call_reset_loads_the_eeprom() {
    let mut dac = Mcp4728::default();
    send(&mut dac, &[0x58, 0x01, 0x00], Time::ZERO);
    send(&mut dac, &[0x0F, 0xFF, 0x0F, 0xFF], Time::ZERO);
    assert!(dac.address(0, Time::ZERO) && dac.write(0x06, Time::ZERO));
    assert_eq!(outputs(&dac), [0x100, 0, 0, 0]);
    assert!(!dac.address(0x61 << 1, Time::ZERO));
}
