//! Events of function 70: which changes are events, and what a packet has that lost its arbitration.

use modbus_server::fast::{EventSource, Part, Setting, Unit};
use modbus_server::line::FastUnit;

use super::*;

/// First register of DEADBAND.
const DEADBAND: u16 = 0x0500;
const MODULES: [Module; 4] = [Module::Di4, Module::Ai4, Module::None, Module::None];
/// The first analog input.
const INPUT: u16 = 4;

/// Returns a device that reports its first analog input, which is 0.
fn reporting(settings: &[(u16, u16)]) -> Rig<Modio08> {
    let mut rig = Rig::<Modio08>::on(MODULES, settings);
    let device = &mut rig.device;
    let on = device
        .events
        .set(device.points.ports(), 0, 4, INPUT, Setting::Low);
    assert!(on);
    fetch(&mut rig);
    rig
}

/// Sets the input. Returns whether this is an event.
fn is_event(rig: &mut Rig<Modio08>, value: u16) -> bool {
    let rest = rig.device.state.millis() % 100;
    rig.device.tick(100 - rest);
    rig.scan_port(1, |channels| channels.set_word(0, value));
    let count = rig.device.waiting().count;
    fetch(rig);
    assert_eq!(rig.device.waiting().count, 0);
    count > 0
}

/// Lets the unit report its events.
fn fetch(rig: &mut Rig<Modio08>) {
    packet(rig);
    rig.device.sent();
}

/// Returns number, length and events of a packet that loses its arbitration.
fn packet(rig: &mut Rig<Modio08>) -> std::vec::Vec<u8> {
    let units = FastUnit {
        unit: 1,
        is_fast: true,
    };
    let mut adus = [Adu::new(), Adu::new()];
    let mut port = Port::new(Receiver::rtu(units, false), &mut adus);
    port.long_silence(0);
    // The fetch with room for 100 bytes, and its CRC.
    for byte in [0xFD, 0x46, 0x10, 0, 100, 0, 0, 0xB9, 0x75] {
        let _ = port.received(byte, Faults::NONE);
    }
    assert!(port.ends_fast_message(0));
    let request = port.take().unwrap();
    let mut unit = Unit::new(1, 1, Part::Everything);
    let (reply, _) = (rig.server).serve_fast(request, &mut unit, rig.device);
    port.send(reply, 0);
    let mut bytes = std::vec![port.start().unwrap()];
    bytes.extend(core::iter::from_fn(|| port.next_byte()));
    // Behind address, function, sub-function and flag, in front of the CRC.
    bytes.get(4..bytes.len() - 2).unwrap_or_default().to_vec()
}

#[test]
fn a_change_of_the_deadband_since_the_last_report_is_an_event() {
    // 4095 codes / 256, unless it is set.
    for (settings, least) in [(None, 15), (Some(100), 100), (Some(1), 1)] {
        let settings = settings.map(|value| (DEADBAND + INPUT, value));
        let mut rig = reporting(settings.as_slice());
        assert!(!is_event(&mut rig, least - 1));
        assert!(is_event(&mut rig, least), "{least}");
        assert!(!is_event(&mut rig, 1));
        assert!(is_event(&mut rig, 0));
    }
}

#[test]
fn deadbands_are_settings_in_force_now_that_a_change_of_the_module_sets_to_0() {
    let mut rig = reporting(&[]);
    assert_eq!(rig.write(DEADBAND + INPUT, &[9]), Err(6), "locked");
    rig.unlock();
    rig.write(DEADBAND + INPUT, &[9, 8]).unwrap();
    assert_eq!(rig.read(DEADBAND, 32).unwrap()[4..7], [9, 8, 0]);
    assert!(!is_event(&mut rig, 8));
    assert!(is_event(&mut rig, 9));
    for (first, count) in [(DEADBAND - 1, 2), (DEADBAND + 127, 2), (DEADBAND + 128, 1)] {
        assert_eq!(rig.read(first, count), Err(2));
        assert_eq!(rig.write(first, &std::vec![0; count.into()]), Err(2));
    }
    rig.device.config.begin_save();
    let saved: Vec<_> = rig.device.config.to_save().changed_from(0).collect();
    let modules = [(at::MODULE, 1), (at::MODULE + 1, 4)];
    assert_eq!(
        saved,
        [&modules[..], &[(DEADBAND + 4, 9), (DEADBAND + 5, 8)]].concat()
    );
    let (loaded, rejected) = Settings::<Modio08>::load(saved.into_iter());
    assert_eq!((&loaded, rejected), (rig.device.config.to_save(), 0));
    rig.device.config.end_save(true);
    rig.write(at::MODULE + 1, &[6]).unwrap();
    assert_eq!(rig.read(DEADBAND, 32).unwrap(), [0; 32]);
}

#[test]
fn output_that_is_changed_by_less_than_the_deadband_is_reported() {
    let modules = [Module::Ao4, Module::None, Module::None, Module::None];
    let mut rig = Rig::<Modio08>::on(modules, &[]);
    let device = &mut rig.device;
    let on = device
        .events
        .set(device.points.ports(), 0, 3, 0, Setting::Low);
    assert!(on);
    fetch(&mut rig);
    rig.ask(&[6, 0, 0, 0, 14]);
    rig.device.tick(100);
    rig.scan_port(0, |_| {});
    assert_eq!(rig.device.waiting().count, 1);
}

#[test]
fn edge_of_an_input_that_was_switched_off_is_not_reported() {
    let mut rig = Rig::<Modio08>::on(MODULES, &[]);
    rig.scan(|channels| channels.set_bit(0, false));
    for setting in [Setting::Low, Setting::Off] {
        let device = &mut rig.device;
        device.events.set(device.points.ports(), 0, 2, 0, setting);
        if setting == Setting::Low {
            fetch(&mut rig);
            rig.scan(|channels| channels.set_bit(0, true));
            assert_eq!(rig.device.waiting().count, 1);
        }
    }
    assert_eq!(rig.device.waiting().count, 0);
}

/// Returns a device that reports its first two digital inputs, and has reported that they are open.
fn with_two_inputs() -> Rig<Modio08> {
    let mut rig = Rig::<Modio08>::on(MODULES, &[]);
    rig.scan(|channels| (0..2).for_each(|n| channels.set_bit(n, false)));
    for input in 0..2 {
        let device = &mut rig.device;
        device
            .events
            .set(device.points.ports(), 0, 2, input, Setting::Low);
    }
    rig.device.start_is_known();
    fetch(&mut rig);
    rig
}

#[test]
fn packet_that_loses_is_made_again_without_what_was_switched_off() {
    let mut rig = with_two_inputs();
    let [off, on] = [0, 1].map(|value| move |input| [1, 2, 0, input, value]);
    rig.scan(|channels| channels.set_bit(0, true));
    rig.scan(|channels| channels.set_bit(1, true));
    assert_eq!(packet(&mut rig), [&[2, 10][..], &on(0), &on(1)].concat());
    let device = &mut rig.device;
    device
        .events
        .set(device.points.ports(), 0, 2, 0, Setting::Off);
    assert_eq!(packet(&mut rig), [&[1, 5][..], &on(1)].concat());
    // Edges while the unit arbitrates are not in the packet.
    rig.scan(|channels| channels.set_bit(0, false));
    rig.scan(|channels| channels.set_bit(1, false));
    rig.device.sent();
    assert_eq!(packet(&mut rig), [&[1, 5][..], &off(1)].concat());
    // It is known only now that this packet was on the line, and the point was switched off since.
    let device = &mut rig.device;
    device
        .events
        .set(device.points.ports(), 0, 2, 1, Setting::Off);
    device
        .events
        .set(device.points.ports(), 0, 2, 1, Setting::Low);
    rig.device.sent();
    assert_eq!(
        packet(&mut rig),
        [&[1, 5][..], &off(1)].concat(),
        "its state"
    );
}

#[test]
fn states_follow_the_event_that_edges_were_lost() {
    let mut rig = with_two_inputs();
    for n in 0..33 {
        rig.scan(|channels| channels.set_bit(0, n % 2 == 0));
    }
    assert_eq!(rig.device.waiting().count, 33);
    // 12 of 32 edges have room in a packet.
    for left in [33, 21] {
        assert_eq!(packet(&mut rig)[..2], [left, 60]);
        rig.device.sent();
    }
    let mut last: std::vec::Vec<u8> = std::vec![11, 54];
    last.extend((0..8).flat_map(|n| [1, 2, 0, 0, 1 - n % 2]));
    last.extend([0, 0x80, 0, 0, 1, 2, 0, 0, 1, 1, 2, 0, 1, 0]);
    for _ in 0..2 {
        assert_eq!(packet(&mut rig), last);
    }
    rig.device.sent();
    assert_eq!(rig.device.waiting().count, 0);
}

register_map::on_boards! {
    board_without_events_has_no_registers_or_functions_of_them: Modio02, EthIo5r
}

fn board_without_events_has_no_registers_or_functions_of_them<B: Board>() {
    let mut rig = Rig::<B>::on([], &[]);
    rig.unlock();
    assert_eq!(rig.read(DEADBAND, 1), Err(2));
    assert_eq!(rig.write(DEADBAND, &[1]), Err(2));
    let start = at::START + B::ROW.points().start;
    assert_eq!(rig.write(start, &[at::AS_IT_WAS]), Err(3));
    assert_eq!(rig.write(start, &[1]), Ok(()));
    assert_eq!(rig.ask(&[70, 0x18, 0]), [70 | 0x80, 1]);
}
