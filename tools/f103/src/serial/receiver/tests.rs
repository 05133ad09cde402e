//! Tests of the receiver with undamaged and damaged characters.

use super::*;
use crate::serial::Character;
use crate::serial::Format;

fn settings(baud: u32, format: Format) -> Settings {
    Settings { baud, format }
}

fn play(wave: &mut Wave, c: Character) {
    wave.push_character(&c);
    wave.push(c.end(), true);
}

fn receive(wave: &Wave, settings: Settings) -> Vec<Word> {
    let mut receiver = Receiver::listening_from(Time::ZERO);
    let framing = Framing::of(settings);
    std::iter::from_fn(|| receiver.next_word(wave, &framing, Time::from_secs(1))).collect()
}

#[test]
fn byte_in_each_format_is_received_at_its_instant() {
    for (format, sixteenths) in [
        (Format::N1, 16 * 9 + 10),
        (Format::N2, 16 * 10),
        (Format::E1, 16 * 10 + 10),
        (Format::O1, 16 * 10 + 10),
        (Format::SevenE1, 16 * 9 + 10),
        (Format::SevenO1, 16 * 9 + 10),
        (Format::SevenN2, 16 * 9),
    ] {
        let s = settings(115_200, format);
        let start = Time::from_us(7);
        let mut wave = Wave::default();
        play(&mut wave, Character::new(s, 0xA7).at(start));
        let words = receive(&wave, s);
        assert_eq!(words.len(), 1, "{format:?}");
        let word = words[0];
        let sent = if format.data_bits() == 7 { 0x27 } else { 0xA7 };
        assert_eq!(Framing::of(s).payload(word.data), sent);
        assert_eq!(word.start, start);
        assert_eq!(word.at, start + s.rate().sixteenths(sixteenths));
        assert!(!word.parity_error && !word.framing_error && !word.noise);
    }
}

#[test]
fn characters_without_gaps_from_a_fast_sender_are_received() {
    // The sender is 2 % fast and has one stop bit. The receiver is set to two.
    let sender = settings(9792, Format::N1);
    let mut wave = Wave::default();
    for n in 0..200_u8 {
        let at = Time::from_ms(1) + sender.characters(u64::from(n));
        play(&mut wave, Character::new(sender, n).at(at));
    }
    let words = receive(&wave, settings(9600, Format::N2));
    assert_eq!(words.len(), 200);
    assert!(
        words
            .iter()
            .zip(0..)
            .all(|(w, n)| w.data == n && !w.framing_error)
    );
}

#[test]
fn each_kind_of_damage_sets_its_flag() {
    let s = settings(9600, Format::E1);
    let mut wave = Wave::default();
    let c = Character::new(s, 0x31).at(Time::from_ms(1));
    play(&mut wave, c.with_wrong_parity());
    play(&mut wave, c.with_bad_stop(s).at(Time::from_ms(5)));
    play(
        &mut wave,
        Character::line_break(s.rate(), 14).at(Time::from_ms(9)),
    );
    let words = receive(&wave, s);
    assert_eq!(words.len(), 3);
    assert!(words[0].parity_error && !words[0].framing_error);
    assert!(!words[1].parity_error && words[1].framing_error);
    assert!(words[2].framing_error && words[2].data == 0);
}

#[test]
fn short_glitch_is_no_start_bit_and_the_next_start_bit_is_found() {
    let s = settings(9600, Format::N2);
    let sixteenth = s.rate().sixteenths(1);
    let mut wave = Wave::default();
    wave.push(Time::from_ms(1), false);
    wave.push(Time::from_ms(1) + sixteenth * 4, true);
    // The true start bit begins just after the receiver has detected the glitch.
    let start = Time::from_ms(1) + sixteenth * 12;
    play(&mut wave, Character::new(s, 0x5A).at(start));
    let words = receive(&wave, s);
    assert_eq!(words.len(), 1);
    assert_eq!((words[0].data, words[0].start), (0x5A, start));
}

#[test]
fn glitch_on_one_of_three_samples_sets_the_noise_flag() {
    let s = settings(9600, Format::N2);
    let sixteenth = s.rate().sixteenths(1);
    let start = Time::from_ms(1);
    let mut wave = Wave::default();
    let c = Character::new(s, 0xFF).at(start);
    wave.push(start, false);
    wave.push(start + c.bit, true);
    let glitch = start + c.bit * 3 + s.rate().sixteenths(8);
    wave.push(glitch + Time::from_ns(100), false);
    wave.push(glitch + sixteenth + Time::from_ns(100), true);
    let words = receive(&wave, s);
    assert_eq!(words.len(), 1);
    assert_eq!(words[0].data, 0xFF);
    assert!(words[0].noise);
}
