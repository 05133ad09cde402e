//! The characters that the transmitter sends, their times, and its flags.
#![expect(
    clippy::unusual_byte_groupings,
    reason = "grouped as stop bits, parity, data, start bit"
)]

use super::*;

const HZ: u32 = 72_000_000;
const BRR: u32 = 0x271;
const ON: u32 = cr1::UE | cr1::TE;
/// A tick of the baud generator after the preamble.
const TICK: Time = Time::cycles(116 * 625, HZ);
/// TE costs a bit of delay and an idle frame of ten.
const PREAMBLE: u64 = 11 * 625;

fn cycles(n: u64) -> Time {
    Time::cycles(n, HZ)
}

fn transmitter(cr1: u32, cr2: u32) -> Usart {
    let mut usart = Usart::default();
    usart.set_clock(HZ, Time::ZERO);
    write(&mut usart, offset::BRR, BRR, Time::ZERO);
    write(&mut usart, offset::CR2, cr2, Time::ZERO);
    write(&mut usart, offset::CR1, ON | cr1, Time::ZERO);
    usart
}

fn write(usart: &mut Usart, offset: u32, value: u32, at: Time) {
    usart.advance(at);
    assert_eq!(usart.write(offset, value, at), Ok(()));
}

fn status(usart: &mut Usart, at: Time) -> u32 {
    usart.advance(at);
    usart.read(offset::SR, at).expect("modelled")
}

fn starts(usart: &mut Usart) -> Vec<(Time, u16, u8)> {
    usart
        .take_sent()
        .into_iter()
        .map(|sent| match sent {
            Sent::Character(c) => (c.start, c.levels, c.bits),
            Sent::Cut(at) => panic!("cut at {at}"),
        })
        .collect()
}

#[test]
fn the_first_character_follows_the_idle_frame() {
    let mut usart = transmitter(0, 0);
    write(&mut usart, offset::DR, 0x55, cycles(100));
    assert_eq!(status(&mut usart, cycles(100)) & sr::TXE, 0);
    assert_eq!(usart.next_event(), Some(cycles(PREAMBLE)));
    assert_eq!(status(&mut usart, cycles(PREAMBLE)) & sr::TXE, sr::TXE);
    assert_eq!(
        starts(&mut usart),
        [(cycles(PREAMBLE), 0b1_0101_0101_0, 10)]
    );
}

#[test]
fn clone_leaves_an_idle_bit_between_two_characters_and_none_in_front_of_the_first() {
    let mut usart = transmitter(0, 0);
    usart.set_idle_bits(1);
    write(&mut usart, offset::DR, 0x55, cycles(100));
    write(&mut usart, offset::DR, 0x55, cycles(PREAMBLE));
    let (first, second) = (cycles(PREAMBLE), cycles(PREAMBLE + 6250 + 625));
    status(&mut usart, second);
    let begun = starts(&mut usart).into_iter().map(|(start, ..)| start);
    assert!(begun.eq([first, second]));
}

#[test]
fn two_bytes_deep_without_a_gap_and_tc_at_the_end_of_the_last_stop_bit() {
    let mut usart = transmitter(cr1::TCIE, 0);
    let t = TICK;
    // TC is set after the preamble; SR read, DR write clears it.
    assert_eq!(status(&mut usart, t), sr::TXE | sr::TC);
    assert!(usart.irq());
    write(&mut usart, offset::DR, 0xAA, t);
    assert!(!usart.irq());
    assert_eq!(
        status(&mut usart, t),
        sr::TXE,
        "straight into the shift register"
    );
    write(&mut usart, offset::DR, 0x01, t);
    assert_eq!(status(&mut usart, t), 0);
    let second = t + cycles(6250);
    assert_eq!(usart.next_event(), Some(second));
    assert_eq!(status(&mut usart, second - Time::from_ps(1)), 0);
    assert_eq!(status(&mut usart, second), sr::TXE);
    let end = t + cycles(12_500);
    assert_eq!(status(&mut usart, end - Time::from_ps(1)), sr::TXE);
    assert!(!usart.irq());
    assert_eq!(status(&mut usart, end), sr::TXE | sr::TC);
    assert!(usart.irq());
    let sent: Vec<_> = starts(&mut usart).into_iter().map(|(at, ..)| at).collect();
    assert_eq!(sent, [t, second]);
    write(&mut usart, offset::SR, !sr::TC, end);
    assert_eq!(status(&mut usart, end), sr::TXE);
}

#[test]
fn a_character_begins_at_the_next_tick_of_the_baud_generator() {
    for late in [1, 300, 624, 625] {
        let mut usart = transmitter(0, 0);
        let written = TICK + cycles(late);
        usart.advance(written);
        // The generator runs from BRR on, not from TE or DR.
        write(&mut usart, offset::DR, 0x55, written);
        assert_eq!(status(&mut usart, written) & sr::TXE, sr::TXE);
        let (start, ..) = starts(&mut usart)[0];
        assert_eq!(start, Time::cycles(117 * 625, HZ), "{late}");
        let end = Time::cycles(127 * 625, HZ);
        assert_eq!(usart.next_event(), Some(end));
    }
}

#[test]
fn a_thousand_characters_do_not_drift() {
    let mut usart = transmitter(0, 0);
    let t = TICK;
    write(&mut usart, offset::DR, 0, t);
    let mut last = Time::ZERO;
    for n in 0..1000 {
        let begins = t + cycles(6250 * n);
        write(&mut usart, offset::DR, 0, begins);
        last = starts(&mut usart)[0].0;
        assert_eq!(last, begins);
    }
    assert_eq!(last, t + cycles(6250 * 999));
}

#[test]
fn formats_on_the_wire() {
    let even = cr1::M | cr1::PCE;
    for (cr1, cr2, levels, bits) in [
        (0, cr2::STOP_TWO, 0b11_0000_0111_0, 11),
        (even, 0, 0b1_1_0000_0111_0, 11),
        (even | cr1::PS, 0, 0b1_0_0000_0111_0, 11),
        // Seven data bits and parity when M = 0.
        (cr1::PCE, 0, 0b1_1000_0111_0, 10),
        (cr1::M, 0, 0b1_1_0000_0111_0, 11),
    ] {
        let mut usart = transmitter(cr1, cr2);
        let t = TICK;
        // Bit 8 is data only in nine bits without parity; bit 7 gives way to parity in eight.
        write(&mut usart, offset::DR, 0x107, t);
        assert_eq!(starts(&mut usart), [(t, levels, bits)], "{cr1:#x}");
    }
}

#[test]
fn a_write_without_txe_is_reported_and_takes_the_place() {
    let mut usart = transmitter(0, 0);
    let t = TICK;
    write(&mut usart, offset::DR, 1, t);
    write(&mut usart, offset::DR, 2, t);
    assert!(usart.write(offset::DR, 3, t).is_err());
    usart.advance(Time::from_ms(2));
    let sent: Vec<_> = starts(&mut usart).iter().map(|s| s.1 >> 1 & 0xFF).collect();
    assert_eq!(sent, [1, 3]);
}

#[test]
fn clearing_te_cuts_the_character_clearing_ue_does_not() {
    let mut usart = transmitter(0, 0);
    let t = TICK;
    write(&mut usart, offset::DR, 0, t);
    let cut = t + cycles(1000);
    usart.advance(cut);
    assert!(usart.write(offset::CR1, cr1::UE, cut).is_err());
    assert_eq!(usart.take_sent()[1..], [Sent::Cut(cut)]);
    assert_eq!(usart.next_event(), None);

    let mut usart = transmitter(0, 0);
    write(&mut usart, offset::DR, 0, t);
    write(&mut usart, offset::DR, 0, t);
    write(&mut usart, offset::CR1, cr1::TE, cut);
    usart.advance(Time::from_ms(5));
    assert_eq!(starts(&mut usart).len(), 1);
}

#[test]
fn a_break_is_low_for_a_frame_and_clears_its_bit() {
    let mut usart = transmitter(0, 0);
    let t = TICK;
    write(&mut usart, offset::DR, 0xFF, t);
    write(&mut usart, offset::CR1, ON | cr1::SBK, t);
    let end = t + cycles(6250 + 11 * 625);
    usart.advance(end - Time::from_ps(1));
    assert_eq!(usart.cr1 & cr1::SBK, cr1::SBK);
    usart.advance(end);
    assert_eq!(usart.cr1 & cr1::SBK, 0);
    assert_eq!(
        starts(&mut usart)[1],
        (t + cycles(6250), 0b100_0000_0000, 11)
    );
    assert_eq!(usart.next_event(), None);
}

#[test]
fn interrupts_follow_their_enables() {
    let mut usart = transmitter(0, 0);
    assert!(!usart.irq());
    let t = TICK;
    write(&mut usart, offset::CR1, ON | cr1::TXEIE, t);
    assert!(usart.irq());
    write(&mut usart, offset::DR, 0, t);
    write(&mut usart, offset::DR, 0, t);
    assert!(!usart.irq());
}

#[test]
fn empty_data_register_requests_a_transfer_while_the_transmitter_is_on() {
    let mut usart = transmitter(0, 0);
    assert_eq!(usart.dma_requests(), [false, false]);
    write(&mut usart, offset::CR3, cr3::DMAT, Time::ZERO);
    assert_eq!(usart.dma_requests(), [false, true]);
    // The preamble is in the shift register.
    write(&mut usart, offset::DR, 0x55, Time::ZERO);
    assert_eq!(usart.dma_requests(), [false, false]);
    write(&mut usart, offset::CR1, cr1::UE, Time::ZERO);
    usart.advance(Time::from_ms(1));
    assert_eq!(usart.dma_requests(), [false, false]);
}

#[test]
fn features_not_modelled_are_reported() {
    let mut usart = transmitter(0, 0);
    for (offset, value) in [
        (offset::CR1, ON | cr1::RWU),
        (offset::CR2, cr2::LINEN),
        (offset::CR2, 1 << 12),
        (offset::CR3, 1 << 8),
        (offset::GTPR, 1),
        (0x1C, 0),
    ] {
        assert!(
            usart.write(offset, value, Time::ZERO).is_err(),
            "{offset:#x}"
        );
    }
    assert!(usart.read(0x1C, Time::ZERO).is_err());
    let mut unset = Usart::default();
    unset.set_clock(HZ, Time::ZERO);
    assert!(unset.write(offset::CR1, ON, Time::ZERO).is_err(), "BRR = 0");
}
