//! ASCII mode on the release image.

use register_map::configuration::{BAUD, COMM_TIMEOUT, FORMAT, FRAME_GAP, MODE};
use sim::line::{Character, Format, Settings};
use sim::{Channel, Module, Time};

use crate::bench::{Bench, FIRST};

/// PDU that reads the four inputs.
const READ: [u8; 5] = [0x01, 0, FIRST, 0, 4];

/// Returns an ASCII frame of unit 1.
pub fn ascii(pdu: &[u8], end: &str) -> Vec<u8> {
    let sum = pdu.iter().fold(1u8, |sum, byte| sum.wrapping_add(*byte));
    let mut text = String::from(":01");
    for byte in pdu.iter().chain(&[sum.wrapping_neg()]) {
        text += &format!("{byte:02X}");
    }
    (text + end).into_bytes()
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn ascii_requests_get_ascii_replies_in_ascii_mode() {
    let mut bench = Bench::new(Module::Di4, 1);
    bench.unlock();
    bench.write(0x0103, &[1]).unwrap();
    bench.save();
    bench.power_cycle();
    assert_eq!(bench.ask(1, &[0x07]), None, "RTU requests get no reply");
    bench.board.set_energised(2, true).unwrap();
    bench.board.run_for(Time::from_ms(50));

    let start = bench.board.now();
    let end = bench.board.line().send(start, &ascii(&READ, "\r\n"));
    bench.board.run_until(end + bench.t35());
    assert!(
        !bench.board.driver_enable(),
        "the unit waits t3.5 before it replies"
    );
    assert_eq!(bench.answer_after(end), ascii(&[0x01, 1, 0b0010], "\r\n"));

    // The end mark changes after the reply, which still has the old one. A restart restores the default.
    let change = [0x08, 0, 3, b'#', 0];
    assert_eq!(
        bench.exchange(&ascii(&change, "\r\n")),
        ascii(&change, "\r\n")
    );
    assert_eq!(
        bench.exchange(&ascii(&READ, "\r#")),
        ascii(&[0x01, 1, 0b0010], "\r#")
    );
    let restart = [0x08, 0, 1, 0, 0];
    assert_eq!(
        bench.exchange(&ascii(&restart, "\r#")),
        ascii(&restart, "\r#")
    );

    // A pause of less than a second is allowed; a longer one invalidates the frame.
    let whole = ascii(&READ, "\r\n");
    for (ms, answered) in [(900, true), (1100, false)] {
        let now = bench.board.now();
        bench.board.line().send(now, &whole[..7]);
        bench.board.run_for(Time::from_ms(ms));
        let reply = bench.exchange(&whole[7..]);
        assert_eq!(!reply.is_empty(), answered, "{ms} ms");
        bench.board.run_for(Time::from_ms(10));
    }
    assert_eq!(bench.exchange(&whole), ascii(&[0x01, 1, 0b0010], "\r\n"));
    let errors = bench.exchange(&ascii(&[0x08, 0, 0x0C, 0, 0], "\r\n"));
    assert_eq!(errors, ascii(&[0x08, 0, 0x0C, 0, 1], "\r\n"));
    bench.assert_sound();
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn complete_frame_is_answered_despite_a_glitch_after_it() {
    let mut bench = Bench::set_up(Module::Di4, &[(MODE, 1)]);
    for glitch in [0x00, 0xFF, b'\r'] {
        let start = bench.board.now();
        let end = bench.board.line().send(start, &ascii(&READ, "\r\n"));
        let end = bench.board.line().send(end, &[glitch]);
        let reply = bench.answer_after(end);
        assert_eq!(reply, ascii(&[0x01, 1, 0], "\r\n"), "{glitch:02X}");
    }
    // The unit does not reply when a frame for another unit has begun.
    let start = bench.board.now();
    let end = bench.board.line().send(start, &ascii(&READ, "\r\n"));
    let end = bench.board.line().send(end, b":02");
    assert_eq!(bench.answer_after(end), []);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn valid_frame_followed_by_a_colon_is_counted_as_unanswered() {
    let mut bench = Bench::set_up(Module::Di4, &[(MODE, 1)]);
    let start = bench.board.now();
    let cut = ascii(&READ, "\r\n");
    let end = bench.board.line().send(start, &cut);
    let end = bench.board.line().send(end, &cut);
    assert_eq!(bench.answer_after(end), ascii(&[0x01, 1, 0], "\r\n"));
    // The counters include both frames and the requests that read the counters.
    for (counter, expected) in [(0x0B, 3), (0x0C, 0), (0x0E, 5), (0x0F, 1), (0x11, 0)] {
        let reply = bench.exchange(&ascii(&[0x08, 0, counter, 0, 0], "\r\n"));
        let expected = ascii(&[0x08, 0, counter, 0, expected], "\r\n");
        assert_eq!(reply, expected, "{counter:02X}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn communication_watchdog_counts_from_the_end_of_the_request() {
    let settings = [(MODE, 1), (FRAME_GAP, 500), (COMM_TIMEOUT, 2)];
    let mut bench = Bench::set_up(Module::Do4, &settings);
    bench.patience = Time::from_ms(60);
    let on = [0x05, 0, FIRST, 0xFF, 0];
    assert_eq!(
        bench.exchange(&ascii(&on, "\r\n")),
        ascii(&on, "\r\n"),
        "after 50 ms"
    );
    for (ms, is_on) in [(197, true), (203, false)] {
        bench.board.run_until(bench.sent + Time::from_ms(ms));
        assert_eq!(bench.board.channel(1), Channel::Do { on: is_on }, "{ms} ms");
    }
}

/// Reads a counter of function 08 with the settings of the master.
fn counter(bench: &mut Bench, which: u8) -> u8 {
    let reply = bench.exchange(&ascii(&[0x08, 0, which, 0, 0], "\r\n"));
    let known = |count: &u8| ascii(&[0x08, 0, which, 0, *count], "\r\n") == reply;
    (0..=255).find(known).expect("the counter is below 256")
}

/// Checks a format of seven data bits at the lowest rate, the default rate and the highest rate: the unit answers, and
/// a character with a wrong parity bit or a low first stop bit invalidates only its own frame.
fn assert_works(format: Format) {
    for baud in [12, 96, 9216] {
        let code = Format::ALL.iter().position(|known| *known == format);
        let code = code.expect("a code of FORMAT") as u16;
        let stored = [(MODE, 1), (BAUD, baud), (FORMAT, code)];
        let mut bench = Bench::set_up(Module::Di4, &stored);
        bench.board.set_energised(2, true).unwrap();
        bench.board.run_for(Time::from_ms(50));
        let good = ascii(&READ, "\r\n");
        let reply = ascii(&[0x01, 1, 0b0010], "\r\n");
        assert_eq!(bench.exchange(&good), reply, "{baud}00");

        let settings = bench.board.line().settings();
        assert_eq!(settings.format, format);
        let damage = |byte: u8| match settings.format.parity() {
            Some(_) => Character::new(settings, byte).with_wrong_parity(),
            None => Character::new(settings, byte).with_bad_stop(settings),
        };
        for (index, byte) in good.iter().enumerate() {
            let start = bench.board.now();
            let line = bench.board.line();
            let at = line.send(start, &good[..index]);
            let at = line.send_character(at, damage(*byte));
            let end = line.send(at, &good[index + 1..]);
            assert_eq!(bench.answer_after(end), [], "{baud}00, character {index}");
            assert_eq!(bench.exchange(&good), reply, "{baud}00, after {index}");
        }
        assert_eq!(usize::from(counter(&mut bench, 0x0C)), good.len());
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn seven_data_bits_with_even_parity_work() {
    assert_works(Format::SevenE1);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn seven_data_bits_with_odd_parity_work() {
    assert_works(Format::SevenO1);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn seven_data_bits_with_two_stop_bits_work() {
    assert_works(Format::SevenN2);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn characters_of_eight_data_bits_are_framing_errors_with_7n2() {
    let mut bench = Bench::set_up(Module::Di4, &[(MODE, 1), (FORMAT, 6)]);
    let seven = bench.board.line().settings();
    let good = ascii(&READ, "\r\n");
    let format = Format::N1;
    bench.settings(Settings { format, ..seven });
    assert_eq!(bench.exchange(&good), [], "bit 7 is the first stop bit");
    bench.settings(seven);
    bench.board.run_for(Time::from_ms(1100));
    assert_eq!(bench.exchange(&good), ascii(&[0x01, 1, 0], "\r\n"));
    assert_eq!(counter(&mut bench, 0x0C), 1);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn rtu_with_seven_data_bits_is_refused_with_exception_03() {
    let mut bench = Bench::new(Module::Di4, 1);
    bench.unlock();
    for format in 4..=6 {
        assert_eq!(bench.write(FORMAT, &[format]), Err(3), "{format}");
        assert_eq!(bench.write(FORMAT, &[format, 0]), Err(3), "{format}");
    }
    bench.write(FORMAT, &[6, 1]).unwrap();
    assert_eq!(bench.write(MODE, &[0]), Err(3));
    bench.save();
    bench.power_cycle();
    bench.settings(Settings {
        baud: 9600,
        format: Format::SevenN2,
    });
    let reply = ascii(&[0x01, 1, 0], "\r\n");
    assert_eq!(bench.exchange(&ascii(&READ, "\r\n")), reply);
}
