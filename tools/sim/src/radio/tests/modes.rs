//! Power, modes, commands, and faults.

use super::host::{Host, ms, near};
use crate::radio::{Fault, Mode, Parameters, timing};
use f103::periph::gpio::Drive;
use f103::periph::usart::Wire;
use f103::serial::{Format, Settings};
use f103::time::Time;

const FACTORY: [u8; 6] = [0xC0, 0x00, 0x00, 0x1A, 0x17, 0x44];
const OTHER: [u8; 6] = [0xC0, 0x00, 0x05, 0x3D, 0x0A, 0x47];

#[test]
fn module_checks_itself_after_power_on_with_aux_low() {
    let mut host = Host::off(Parameters::FACTORY);
    host.run_for(ms(10));
    assert_eq!(host.module().drive_aux(), Drive::Floating);
    assert_eq!(host.radio.next_event(), None);
    host.radio.module.set_power(true);
    assert_eq!(host.module().drive_aux(), Drive::Low);
    assert_eq!(host.module().mode(), None);
    host.run_until(ms(10) + timing::START_UP + ms(1));
    assert_eq!(host.aux, [(ms(10), false), (ms(510), true)]);
    assert_eq!(
        host.module().mode(),
        Some(Mode::Sleep),
        "M0 and M1 are open"
    );
    assert_eq!(host.module().drive_aux(), Drive::High);
    assert_eq!(
        host.radio.next_event(),
        None,
        "an idle module has no events"
    );
}

#[test]
fn parameters_are_read_and_stored_by_commands_in_sleep() {
    let mut host = Host::in_sleep();
    assert_eq!(host.command(&[0xC1; 3]), FACTORY);
    assert_eq!(host.command(&OTHER), OTHER);
    assert_eq!(host.command(&[0xC1; 3]), OTHER);
    assert_eq!(host.command(&[0xC3; 3]), [0xC3, 0x32, 0x10, 0x24]);
    host.radio.module.set_power(false);
    host.run_for(ms(10));
    host.radio.module.set_power(true);
    host.run_for(timing::START_UP + ms(1));
    assert_eq!(host.command(&[0xC1; 3]), OTHER);
    assert_eq!(host.command(&FACTORY), FACTORY);
    assert_eq!(host.module().stored(), Parameters::FACTORY);
}

#[test]
fn parameters_of_c2_are_lost_at_a_reset() {
    let mut host = Host::in_sleep();
    let mut temporary = OTHER;
    temporary[0] = 0xC2;
    assert_eq!(host.command(&temporary), temporary);
    assert_eq!(host.module().parameters().address(), 5);
    let end = host.send(&[0xC4; 3]);
    host.run_until(end + ms(10));
    assert!(!host.module().aux(), "the self-check");
    host.run_for(timing::START_UP + ms(1));
    assert_eq!(host.command(&[0xC1; 3]), FACTORY);
}

#[test]
fn aux_is_low_from_the_end_of_a_command_to_the_end_of_its_answer() {
    let mut host = Host::in_sleep();
    let end = host.send(&[0xC1; 3]);
    host.run_until(end + ms(100));
    let (_, start, _) = host.received()[0];
    let byte = Time::cycles(10, 9600);
    assert!(near(start, end + byte * 3 + timing::ANSWER));
    let edges = host.aux_since(end);
    let [(fall, false), (rise, true)] = edges[..] else {
        panic!("{edges:?}");
    };
    assert!(near(fall, end + byte * 3));
    assert!(near(rise, start + byte * 6));
}

#[test]
fn incomplete_or_interrupted_command_is_ignored() {
    let mut host = Host::in_sleep();
    assert!(host.command(&[0xC1, 0xC1]).is_empty());
    assert!(host.command(&[0xC1; 4]).is_empty());
    assert!(host.command(&[0; 40]).is_empty());
    let end = host.send(&OTHER[..3]);
    host.run_until(end + ms(4));
    assert!(host.command(&OTHER[3..]).is_empty());
    assert_eq!(host.command(&[0xC1; 3]), FACTORY);
}

#[test]
fn command_at_another_rate_is_garbage() {
    let mut host = Host::in_sleep();
    host.settings.baud = 19_200;
    assert!(host.command(&[0xC1; 3]).is_empty());
    host.settings.baud = 9600;
    assert_eq!(host.command(&[0xC1; 3]), FACTORY);
}

#[test]
fn command_while_another_one_is_carried_out_is_lost() {
    let mut host = Host::in_sleep();
    let end = host.send(&OTHER);
    host.run_until(end + ms(10));
    host.send(&[0xC1; 3]);
    host.run_for(ms(200));
    assert_eq!(super::host::bytes(&host.received()), OTHER);
}

#[test]
fn module_leaves_sleep_with_a_reconfiguration_and_enters_it_after_a_millisecond() {
    let mut host = Host::in_sleep();
    host.run_for(ms(20));
    let begin = host.now();
    host.set_pins(false, false);
    host.run_for(ms(200));
    let low = host.aux_since(begin);
    assert_eq!(low, [(begin + ms(1), false), (begin + ms(101), true)]);
    assert_eq!(host.module().mode(), Some(Mode::Normal));
    let begin = host.now();
    host.set_pins(true, true);
    host.run_until(begin + ms(1) - Time::from_us(1));
    assert_eq!(host.module().mode(), Some(Mode::Normal));
    host.run_until(begin + ms(1));
    assert_eq!(host.module().mode(), Some(Mode::Sleep));
    assert!(host.aux_since(begin).is_empty(), "AUX stays high");
}

#[test]
fn mode_that_the_pins_have_for_less_than_a_millisecond_is_not_entered() {
    let mut host = Host::in_sleep();
    host.run_for(ms(20));
    let begin = host.now();
    host.set_pins(false, true);
    host.run_for(Time::from_us(900));
    host.set_pins(false, false);
    host.run_for(Time::from_us(900));
    assert_eq!(host.module().mode(), Some(Mode::Sleep));
    host.run_for(Time::from_us(100));
    assert_eq!(host.module().mode(), None, "the reconfiguration");
    host.run_until(begin + ms(200));
    assert_eq!(host.module().mode(), Some(Mode::Normal));
}

#[test]
fn mode_changes_only_when_the_module_is_idle() {
    let mut host = Host::in_normal_mode(Parameters::FACTORY);
    let end = host.send(b"x");
    host.run_until(end);
    host.set_pins(true, true);
    host.run_for(ms(50));
    assert_eq!(host.module().mode(), Some(Mode::Normal), "a packet is sent");
    assert!(host.module().aux(), "the last packet has begun");
    let packet = host.air().packets().next_back().cloned().expect("a packet");
    host.run_until(packet.end + ms(2));
    assert_eq!(host.module().mode(), Some(Mode::Sleep));

    // The mode changes two milliseconds after the rising edge of AUX at the earliest.
    let end = host.send(&[0xC1; 3]);
    host.run_until(end + ms(10));
    host.set_pins(false, false);
    host.run_for(ms(200));
    let rises = host.aux.iter().filter(|&&(at, level)| level && at > end);
    let (rise, _) = *rises.clone().next().expect("the end of the answer");
    let falls = host.aux_since(rise);
    assert_eq!(falls[1], (rise + ms(2), false));
}

#[test]
fn uart_has_the_set_rate_and_format_outside_sleep() {
    let [.., sped, channel, option] = OTHER;
    let fast = Parameters::from_bytes([0, 0, sped & 7 | 0b10_110_000, channel, option]);
    let mut host = Host::in_normal_mode(fast);
    assert_eq!(
        host.settings,
        Settings {
            baud: 57_600,
            format: Format::E1
        }
    );
    host.send(b"hello");
    host.run_for(ms(100));
    let sent: Vec<_> = host.air().packets().map(|p| p.bytes.clone()).collect();
    assert_eq!(sent, [b"hello"]);
    let now = host.now();
    let end = host.air().send(now, b"world");
    host.run_until(end + ms(100));
    assert_eq!(super::host::bytes(&host.received()), b"world");
}

#[test]
fn absent_module_leaves_its_pins_open_and_a_hung_one_holds_aux_low() {
    let mut host = Host::in_sleep();
    host.radio.module.set_fault(Fault::Absent);
    assert_eq!(host.module().drive_aux(), Drive::Floating);
    assert_eq!(host.radio.rx_drive(), Drive::Floating);
    assert!(host.command(&[0xC1; 3]).is_empty());
    host.radio.module.set_fault(Fault::Hung);
    assert_eq!(host.module().drive_aux(), Drive::Low);
    assert!(host.command(&[0xC1; 3]).is_empty());
    host.radio.module.set_power(false);
    host.radio.module.set_power(true);
    host.run_for(timing::START_UP + ms(1));
    assert!(!host.module().aux(), "a power cycle does not end the fault");
    host.radio.module.set_fault(Fault::None);
    host.run_for(timing::START_UP + ms(1));
    assert!(host.module().aux());
    assert_eq!(host.command(&[0xC1; 3]), FACTORY);
}

#[test]
fn aux_without_push_pull_outputs_is_only_pulled_low() {
    let open = Parameters::from_bytes([0, 0, 0x1A, 0x17, 0x04]);
    let mut host = Host::off(open);
    host.radio.module.set_power(true);
    assert_eq!(host.module().drive_aux(), Drive::Low);
    host.run_for(timing::START_UP);
    assert_eq!(host.module().drive_aux(), Drive::Floating);
}

#[test]
fn fixed_transmission_is_reported_as_not_modelled() {
    let fixed = Parameters::from_bytes([0, 0, 0x1A, 0x17, 0xC4]);
    let mut host = Host::in_normal_mode(fixed);
    assert_eq!(host.radio.module.take_unmodelled(), Some(timing::START_UP));
    assert_eq!(host.radio.module.take_unmodelled(), None);
}
