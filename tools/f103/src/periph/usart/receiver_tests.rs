//! The words and flags that the receiver produces from the edges at its pin, and how its flags are cleared.

use super::*;
use crate::serial::{Character, Rate};

const HZ: u32 = 72_000_000;
/// 115200 baud at 72 MHz: 625 cycles a bit (RM0008 table 192).
const BRR: u32 = 0x271;
const ON: u32 = cr1::UE | cr1::RE;

fn cycles(n: u64) -> Time {
    Time::cycles(n, HZ)
}

fn receiver(cr1: u32, cr2: u32) -> Usart {
    let mut usart = Usart::default();
    usart.set_clock(HZ, Time::ZERO);
    for (offset, value) in [
        (offset::BRR, BRR),
        (offset::CR2, cr2),
        (offset::CR1, ON | cr1),
    ] {
        assert_eq!(usart.write(offset, value, Time::ZERO), Ok(()));
    }
    usart
}

fn settings(format: Format) -> Settings {
    Settings {
        baud: 115_200,
        format,
    }
}

/// Returns a character in format 8N1.
fn byte(data: u8) -> Character {
    Character::new(settings(Format::N1), data)
}

fn play(usart: &mut Usart, c: Character) {
    for bit in 0..c.bits {
        usart.receive_edge(c.start + c.bit * u64::from(bit), c.level(bit));
    }
    usart.receive_edge(c.end(), true);
}

/// SR without IDLE, which another test checks.
fn status(usart: &mut Usart, at: Time) -> u32 {
    usart.advance(at);
    usart.read(offset::SR, at).expect("modelled") & !sr::IDLE
}

fn data(usart: &mut Usart, at: Time) -> u32 {
    usart.advance(at);
    usart.read(offset::DR, at).expect("modelled")
}

/// A sample of the receiver, and right after it the edge of a start bit: what is sampled counts from there.
const SAMPLED: Time =
    Time::from_ps(Time::cycles(185 * 625, 16 * HZ).as_ps() - Time::cycles(625, 16 * HZ).as_ps());
const START: Time = Time::from_ps(SAMPLED.as_ps() + 1);

#[test]
fn rxne_rises_at_the_tenth_sample_of_the_stop_bit() {
    let mut usart = receiver(cr1::RXNEIE, 0);
    assert!(usart.awaits_start());
    play(&mut usart, byte(0x5A).at(START));
    usart.advance(START);
    assert!(!usart.awaits_start());
    // 9 bits and 10/16: 9.625 * 625 = 6015.6 cycles = 83.55 us.
    let due = SAMPLED + Rate::from_clock(BRR, HZ).sixteenths(9 * 16 + 10);
    assert_eq!(usart.next_event(), Some(due));
    usart.advance(due - Time::from_ps(1));
    assert!(!usart.irq());
    usart.advance(due);
    assert!(usart.irq());
    assert_eq!(status(&mut usart, due), sr::RESET | sr::RXNE);
    assert_eq!(data(&mut usart, due), 0x5A);
    assert!(!usart.irq());
    assert!(usart.awaits_start());
}

#[test]
fn rxne_jitters_by_a_sixteenth_of_a_bit() {
    let exact = Rate::from_clock(BRR, HZ).sixteenths(9 * 16 + 10);
    let sixteenth = Rate::from_clock(BRR, HZ).sixteenths(1);
    let mut jitter = (Time::MAX, Time::ZERO);
    for n in 0..100 {
        let mut usart = receiver(cr1::RXNEIE, 0);
        let start = Time::from_us(100) + Time::from_ns(37 * n);
        play(&mut usart, byte(0x5A).at(start));
        usart.advance(start);
        let due = usart.next_event().expect("a character");
        assert_eq!(data(&mut usart, due), 0x5A);
        let early = start + exact - due;
        jitter = (jitter.0.min(early), jitter.1.max(early));
    }
    assert!(jitter.0 < Time::from_ns(40), "{jitter:?}");
    assert!(jitter.1 > sixteenth - Time::from_ns(40), "{jitter:?}");
    assert!(jitter.1 <= sixteenth + Time::from_ps(1), "{jitter:?}");
}

#[test]
fn a_pulse_between_two_samples_is_not_seen() {
    let mut usart = receiver(0, 0);
    usart.receive_edge(START, false);
    usart.receive_edge(START + Time::from_ns(400), true);
    let start = START + Time::from_us(4);
    play(&mut usart, byte(0x42).at(start));
    let end = START + Time::from_us(100);
    assert_eq!(status(&mut usart, end), sr::RESET | sr::RXNE);
    assert_eq!(data(&mut usart, end), 0x42);
}

#[test]
fn overrun_keeps_the_first_byte_and_is_cleared_by_reading_sr_then_dr() {
    let mut usart = receiver(cr1::RXNEIE, 0);
    let c = |data, n: u64| byte(data).at(START + Time::from_us(100) * n);
    play(&mut usart, c(0x11, 0));
    play(&mut usart, c(0x22, 1));
    let t = START + Time::from_us(200);
    assert_eq!(status(&mut usart, t), sr::RESET | sr::RXNE | sr::ORE);
    assert_eq!(data(&mut usart, t), 0x11);
    assert_eq!(status(&mut usart, t), sr::RESET);

    // ORE that comes between the two reads is not cleared by them.
    play(&mut usart, c(0x33, 3));
    let between = START + Time::from_us(390);
    assert_eq!(status(&mut usart, between), sr::RESET | sr::RXNE);
    play(&mut usart, c(0x44, 4));
    let after = START + Time::from_us(490);
    assert_eq!(data(&mut usart, after), 0x33);
    assert!(usart.irq(), "ORE alone interrupts by RXNEIE");
    assert_eq!(status(&mut usart, after), sr::RESET | sr::ORE);
    // RXNE = 0: what DR holds has been read before.
    assert_eq!(data(&mut usart, after), 0x33);
    assert_eq!(status(&mut usart, after), sr::RESET);
}

#[test]
fn parity_framing_and_noise_errors_have_their_flags() {
    let nine = cr1::M | cr1::PCE;
    // The parity bit of 0x31 with three ones is 1 for even and 0 for odd. It is the ninth bit; with words of eight bits
    // it is the eighth, and seven data bits are left.
    for (format, cr1, parity) in [
        (Format::E1, nine, 0x100),
        (Format::O1, nine | cr1::PS, 0),
        (Format::SevenE1, cr1::PCE, 0x80),
        (Format::SevenO1, cr1::PCE | cr1::PS, 0),
    ] {
        let mut usart = receiver(cr1, 0);
        let c = Character::new(settings(format), 0x31).at(START);
        play(&mut usart, c);
        let t = START + Time::from_us(100);
        assert_eq!(status(&mut usart, t), sr::RESET | sr::RXNE, "{format:?}");
        assert_eq!(data(&mut usart, t), 0x31 | parity);
        play(&mut usart, c.with_wrong_parity().at(t));
        let t = t + Time::from_us(100);
        assert_eq!(status(&mut usart, t), sr::RESET | sr::RXNE | sr::PE);
        data(&mut usart, t);
        assert_eq!(status(&mut usart, t), sr::RESET);
    }

    let mut usart = receiver(0, 0);
    let n1 = settings(Format::N1);
    play(&mut usart, byte(0xFF).with_bad_stop(n1).at(START));
    let t = START + Time::from_us(100);
    assert_eq!(status(&mut usart, t), sr::RESET | sr::RXNE | sr::FE);
    assert_eq!(data(&mut usart, t), 0xFF);
    // A glitch of a sixteenth on sample 9 of the first data bit.
    usart.receive_edge(t, false);
    usart.receive_edge(t + cycles(625), true);
    let rate = Rate::from_clock(BRR, HZ);
    usart.receive_edge(t + rate.sixteenths(24) + cycles(5), false);
    usart.receive_edge(t + rate.sixteenths(25) + cycles(5), true);
    let t = t + Time::from_us(100);
    assert_eq!(status(&mut usart, t), sr::RESET | sr::RXNE | sr::NE);
    assert_eq!(data(&mut usart, t), 0xFF);
}

#[test]
fn a_break_is_a_framing_error_once_and_the_next_start_needs_an_edge() {
    let mut usart = receiver(0, 0);
    usart.receive_edge(START, false);
    let t = START + Time::from_ms(5);
    assert_eq!(status(&mut usart, t), sr::RESET | sr::RXNE | sr::FE);
    assert_eq!(data(&mut usart, t), 0);
    assert_eq!(status(&mut usart, t + Time::from_ms(5)), sr::RESET);
    usart.receive_edge(t + Time::from_ms(6), true);
    play(&mut usart, byte(0x42).at(t + Time::from_ms(7)));
    assert_eq!(data(&mut usart, t + Time::from_ms(8)), 0x42);
}

#[test]
fn receiver_enabled_in_mid_character_waits_for_the_next_edge() {
    let mut usart = receiver(0, 0);
    usart
        .write(offset::CR1, cr1::UE, Time::ZERO)
        .expect("modelled");
    assert!(!usart.awaits_start());
    play(&mut usart, byte(0x00).at(START));
    // Switched on during the low data bits: no edge before the stop bit, nothing received.
    let on = START + Time::from_us(30);
    usart.advance(on);
    usart.write(offset::CR1, ON, on).expect("modelled");
    assert_eq!(status(&mut usart, on + Time::from_ms(1)) & sr::RXNE, 0);
}

#[test]
fn idle_comes_one_frame_after_the_last_character_and_only_once() {
    let mut usart = receiver(cr1::IDLEIE, 0);
    // An idle line when the receiver is switched on counts too.
    assert_eq!(usart.next_event(), Some(cycles(10 * 625)));
    usart.advance(START);
    assert!(usart.irq());
    status(&mut usart, START);
    data(&mut usart, START);
    assert!(!usart.irq());
    assert_eq!(usart.next_event(), None);
    play(&mut usart, byte(1).at(START));
    let rxne = START + Time::from_us(85);
    usart.advance(rxne);
    // Ten bits of the character, ten of silence.
    let idle = SAMPLED + cycles(6250) + cycles(6250);
    assert_eq!(usart.next_event(), Some(idle));
    usart.advance(idle - Time::from_ps(1));
    assert!(!usart.irq());
    usart.advance(idle);
    assert!(usart.irq());
    status(&mut usart, idle);
    data(&mut usart, idle);
    usart.advance(idle + Time::from_secs(1));
    assert!(!usart.irq());
}

#[test]
fn rxne_is_cleared_by_writing_zero_too() {
    let mut usart = receiver(0, 0);
    play(&mut usart, byte(1).at(START));
    let t = START + Time::from_us(90);
    usart.advance(t);
    usart.write(offset::SR, !sr::RXNE, t).expect("modelled");
    assert_eq!(status(&mut usart, t), sr::RESET);
}

#[test]
fn a_long_run_keeps_few_edges() {
    let mut usart = receiver(0, 0);
    for n in 0..1000_u64 {
        let at = START + Time::from_us(100) * n;
        play(&mut usart, byte(0x55).at(at));
        assert_eq!(data(&mut usart, at + Time::from_us(99)), 0x55);
    }
    assert!(usart.rx_pin.len() < 20, "{}", usart.rx_pin.len());
}

#[test]
fn received_word_requests_a_transfer_and_an_error_an_interrupt() {
    let mut usart = receiver(0, 0);
    usart
        .write(offset::CR3, cr3::DMAR | cr3::EIE, Time::ZERO)
        .unwrap();
    let first = byte(0x55).at(START);
    play(&mut usart, first);
    let end = first.end();
    usart.advance(end);
    assert_eq!((usart.dma_requests(), usart.irq()), ([true, false], false));
    assert_eq!(data(&mut usart, end), 0x55);
    assert_eq!(usart.dma_requests(), [false, false]);
    play(
        &mut usart,
        byte(0).at(end).with_bad_stop(settings(Format::N1)),
    );
    usart.advance(end + end);
    assert!(usart.irq(), "framing error");
}
