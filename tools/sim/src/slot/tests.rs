//! Tests of a slot: changes of its channels, and their effect at the part's pins and on the I2C bus.

use super::*;

#[test]
fn channels_accept_only_changes_of_their_own_kind() {
    let mut slot = Slot::new(Module::Di4);
    assert_eq!(slot.set_energised(1, true), Ok(()));
    assert_eq!(slot.set_energised(0, true), Err(Error::Channel));
    assert_eq!(slot.set_energised(5, true), Err(Error::Channel));
    assert_eq!(slot.set_manual(1, true), Err(Error::Channel));
    assert_eq!(slot.set_millivolts(1, 0), Err(Error::Channel));
    assert_eq!(slot.channel(1), Channel::Di { energised: true });
    assert_eq!(slot.channel(0), Channel::None);

    slot.set_module(Module::Relay2);
    assert_eq!(slot.set_manual(2, true), Ok(()));
    assert_eq!(slot.set_manual(3, true), Err(Error::Channel));
    assert_eq!(slot.set_energised(1, true), Err(Error::Channel));
    assert_eq!(slot.channel(3), Channel::None);

    slot.set_module(Module::Ai2Ao2);
    assert_eq!(slot.set_millivolts(2, 3300), Ok(()));
    assert_eq!(
        slot.set_millivolts(2, 3301),
        Err(Error::Range("an analog input takes 0 to 3300 mV"))
    );
    assert_eq!(slot.set_millivolts(3, 0), Err(Error::Channel));
    assert_eq!(slot.channel(2), Channel::Ai { millivolts: 3300 });
    assert_eq!(slot.channel(3), Channel::Ao { code: 0 });
}

#[test]
fn each_module_drives_and_reads_its_lines() {
    let mut slot = Slot::new(Module::Di4);
    slot.set_energised(3, true).expect("a digital input");
    assert_eq!([1, 3].map(|n| slot.drive(n)), [Drive::Floating, Drive::Low]);

    slot.set_module(Module::Do4);
    slot.set_line(4, true);
    slot.set_line(0, true);
    slot.set_line(5, true);
    assert_eq!(
        [1, 2, 3, 4].map(|n| slot.channel(n)),
        [false, false, false, true].map(|on| Channel::Do { on })
    );

    slot.set_module(Module::Relay2);
    slot.set_manual(2, true).expect("a relay");
    slot.set_line(3, true);
    assert_eq!(
        [1, 2, 3].map(|n| slot.drive(n)),
        [Drive::Floating, Drive::Low, Drive::Floating]
    );
    let relays = [(true, false), (false, true)];
    assert_eq!(
        [1, 2].map(|n| slot.channel(n)),
        relays.map(|(energised, manual)| Channel::Relay { energised, manual })
    );

    slot.set_module(Module::Ai4);
    slot.set_millivolts(4, 1650).expect("an analog input");
    assert_eq!(slot.drive(4), Drive::Millivolts(1650));
}

#[test]
fn outputs_are_off_without_power_and_the_dac_starts_from_its_eeprom() {
    let mut slot = Slot::new(Module::Do4);
    slot.set_line(1, true);
    slot.set_power(false, Time::ZERO);
    assert_eq!(slot.channel(1), Channel::Do { on: false });

    let mut slot = Slot::new(Module::Ao4);
    assert!(slot.address(0xC0, Time::ZERO));
    for byte in [0x01, 0x00, 0x02, 0x00] {
        assert!(slot.write(byte, Time::ZERO));
    }
    slot.stop(Time::ZERO);
    assert_eq!(slot.channel(2), Channel::Ao { code: 0x200 });
    slot.set_power(false, Time::ZERO);
    assert_eq!(slot.channel(2), Channel::Ao { code: 0 });
    assert!(!slot.address(0xC0, Time::ZERO));
    slot.set_power(true, Time::ZERO);
    assert_eq!(slot.channel(2), Channel::Ao { code: 0 });
    assert!(slot.address(0xC0, Time::ZERO));
}

#[test]
fn stuck_data_wire_is_released_after_its_clock_pulses() {
    let mut slot = Slot::new(Module::Ao4);
    slot.set_bus_fault(BusFault::HoldsSda { clocks: Some(9) });
    for pulse in 0..9 {
        assert!(!slot.wires().sda, "pulse {pulse}");
        for scl in [false, true] {
            slot.set_pins(Wires { scl, sda: true });
        }
    }
    assert_eq!(slot.wires(), Wires::FREE);
    slot.set_bus_fault(BusFault::HoldsSda { clocks: None });
    slot.set_pins(Wires {
        scl: false,
        sda: true,
    });
    slot.set_pins(Wires::FREE);
    assert!(!slot.held().sda);
}

#[test]
fn only_modules_with_a_dac_answer_on_the_i2c_bus() {
    for module in Module::ALL {
        let mut slot = Slot::new(module);
        assert_eq!(slot.address(0xC0, Time::ZERO), slot.has_dac(), "{module}");
        slot.set_bus_fault(BusFault::Absent);
        assert!(!slot.address(0xC0, Time::ZERO), "{module}");
    }
}
