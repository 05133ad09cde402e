//! Which changes of an analog input are events.

use modbus_server::fast::{EventSource, Part, Setting, Unit};
use modbus_server::line::FastUnit;

use super::*;

/// First register of DEADBAND.
const DEADBAND: u16 = 0x0500;
const MODULES: [Module; 4] = [Module::Di4, Module::Ai4, Module::None, Module::None];
/// The first analog input.
const INPUT: u16 = 4;

/// Returns a device that reports its first analog input, which is 0.
fn reporting(settings: &[(u16, u16)]) -> Bench<4> {
    let mut bench = Bench::on(&MODIO_08, MODULES, settings);
    let device = &mut bench.device;
    let on = device
        .events
        .set(device.points.ports(), 0, 4, INPUT, Setting::Low);
    assert!(on);
    fetch(&mut bench);
    bench
}

/// Sets the input. Returns whether this is an event.
fn is_event(bench: &mut Bench<4>, value: u16) -> bool {
    let rest = bench.device.state.millis() % 100;
    bench.device.tick(100 - rest);
    bench.scan_port(1, |channels| channels.set_word(0, value));
    let count = bench.device.waiting().count;
    fetch(bench);
    assert_eq!(bench.device.waiting().count, 0);
    count > 0
}

/// Lets the unit report its events.
fn fetch(bench: &mut Bench<4>) {
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
    let (reply, _) = (bench.server).serve_fast(request, &mut unit, bench.device);
    port.send(reply, 0);
}

#[test]
fn a_change_of_the_deadband_since_the_last_report_is_an_event() {
    // 4095 codes / 256, unless it is set.
    for (settings, least) in [(None, 15), (Some(100), 100), (Some(1), 1)] {
        let settings = settings.map(|value| (DEADBAND + INPUT, value));
        let mut bench = reporting(settings.as_slice());
        assert!(!is_event(&mut bench, least - 1));
        assert!(is_event(&mut bench, least), "{least}");
        assert!(!is_event(&mut bench, 1));
        assert!(is_event(&mut bench, 0));
    }
}

#[test]
fn deadbands_are_settings_in_force_now_that_a_change_of_the_module_sets_to_0() {
    let mut bench = reporting(&[]);
    assert_eq!(bench.write(DEADBAND + INPUT, &[9]), Err(6), "locked");
    bench.unlock();
    bench.write(DEADBAND + INPUT, &[9, 8]).unwrap();
    assert_eq!(bench.read(DEADBAND, 32).unwrap()[4..7], [9, 8, 0]);
    assert!(!is_event(&mut bench, 8));
    assert!(is_event(&mut bench, 9));
    for (first, count) in [(DEADBAND - 1, 2), (DEADBAND + 31, 2), (DEADBAND + 32, 1)] {
        assert_eq!(bench.read(first, count), Err(2));
        assert_eq!(bench.write(first, &std::vec![0; count.into()]), Err(2));
    }
    bench.device.config.begin_save();
    let saved: Vec<_> = bench.device.config.to_save().changed_from(0).collect();
    let modules = [(at::MODULE, 1), (at::MODULE + 1, 4)];
    assert_eq!(
        saved,
        [&modules[..], &[(DEADBAND + 4, 9), (DEADBAND + 5, 8)]].concat()
    );
    let (loaded, rejected) = Settings::<4>::load(&MODIO_08, saved.into_iter());
    assert_eq!((&loaded, rejected), (bench.device.config.to_save(), 0));
    bench.device.config.end_save(true);
    bench.write(at::MODULE + 1, &[6]).unwrap();
    assert_eq!(bench.read(DEADBAND, 32).unwrap(), [0; 32]);
}

#[test]
fn output_that_is_changed_by_less_than_the_deadband_is_reported() {
    let modules = [Module::Ao4, Module::None, Module::None, Module::None];
    let mut bench = Bench::on(&MODIO_08, modules, &[]);
    let device = &mut bench.device;
    let on = device
        .events
        .set(device.points.ports(), 0, 3, 0, Setting::Low);
    assert!(on);
    fetch(&mut bench);
    bench.ask(&[6, 0, 0, 0, 14]);
    bench.device.tick(100);
    bench.scan_port(0, |_| {});
    assert_eq!(bench.device.waiting().count, 1);
}

#[test]
fn edge_of_an_input_that_was_switched_off_is_not_reported() {
    let mut bench = Bench::on(&MODIO_08, MODULES, &[]);
    bench.scan(|channels| channels.set_bit(0, false));
    for setting in [Setting::Low, Setting::Off] {
        let device = &mut bench.device;
        device.events.set(device.points.ports(), 0, 2, 0, setting);
        if setting == Setting::Low {
            fetch(&mut bench);
            bench.scan(|channels| channels.set_bit(0, true));
            assert_eq!(bench.device.waiting().count, 1);
        }
    }
    assert_eq!(bench.device.waiting().count, 0);
}
