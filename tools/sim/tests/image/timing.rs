//! When the unit sends, and how long its driver is enabled.

use register_map::{codes::Baud, configuration};
use sim::{Module, Time, line::Direction};

use crate::LAYOUT;
use crate::rig::{FIRST, Most, Rig, adu, ascii, corner};

/// From t3.5 to the write of the first byte to the UART's data register. The baud generator adds up to a bit.
const LATE: Most = Most(Time::from_us(25), Time::from_us(45));
/// How much longer the scan may delay it: it holds the points of all ports and terminals at once.
const SCAN: Most = match LAYOUT.board.slots {
    ..=1 => Most(Time::ZERO, Time::ZERO),
    2..=4 => Most(Time::from_us(25), Time::from_us(50)),
    _ => Most(Time::from_us(50), Time::from_us(110)),
};
/// From enabling the driver to the write of the first byte to the UART's data register.
const ON: Most = Most(Time::from_us(1), Time::from_us(1));
/// From the last stop bit to disabling the driver.
const OFF: Most = Most(Time::from_ns(1_400), Time::from_ns(2_350));
/// The same when another interrupt of the line, usually the 1 kHz tick, has just occurred: the longest wait that `cargo
/// xtask bench` allows, 5.0 us, and the handler; at the slow corner the time of [`Rig::ready`] at high rates.
const OFF_BEHIND: Most = Most(Time::from_ns(6_250), Time::from_us(10));
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn reply_starts_at_t35_and_the_driver_is_on_only_for_the_reply() {
    let mut rig = Rig::new(Module::Di4, 1);
    let (bit, sixteenth) = (rig.bit(), rig.sixteenth());
    for _ in 0..10 {
        let now = rig.board.now();
        let end = rig.board.line().send(now, &adu(&[1, 1, 0, FIRST, 0, 4]));
        rig.answer_after(end);

        let line = rig.board.line();
        let frame = line.frames().next_back().expect("a reply").clone();
        assert_eq!(frame.direction, Direction::Response);
        assert!(frame.crc_ok && !frame.damaged);
        let turnaround = frame.start - end;
        assert!(turnaround >= Settings::T35, "{turnaround:?} is before t3.5");
        let late = turnaround - Settings::T35;
        // The receiver may see the end of the request up to a sixteenth of a bit early, which t3.5 allows for.
        let most = bit + sixteenth + LATE.of(corner()) + SCAN.of(corner());
        assert!(late <= most, "{late:?} after t3.5");

        let edges: Vec<_> = line.driver_edges().collect();
        let [.., (on, true), (off, false)] = edges[..] else {
            panic!("the driver does not go on and off: {edges:?}");
        };
        assert!(
            on <= frame.start && frame.start - on <= bit + ON.of(corner()),
            "on {on:?}"
        );
        assert!(
            off >= frame.end && off - frame.end <= bit,
            "off {off:?}, end {:?}",
            frame.end
        );
        assert_eq!(line.collisions().count(), 0);
    }
}

struct Settings;

impl Settings {
    /// t3.5 at 9600 bit/s with 11 bits a character: 38.5 bits.
    const T35: Time = Time::from_ps(38_500_000_000_000 / 9600);
}

/// The driver is off within a bit up to 460800 bit/s, and within two bits at 921600 bit/s. There a bit is 1.085 us, and
/// the time of the interrupt is significant. In a few of a thousand replies, the tick occurs just before the end. Then
/// the driver is off within 10 us.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn driver_is_off_soon_after_the_reply_at_every_rate_and_format() {
    for baud in Baud::ALL {
        for format in 0..7 {
            // Seven data bits need ASCII mode. Three rates are enough for them, because the driver is the same.
            let mode = u16::from(format >= 4);
            if mode == 1 && ![Baud::B9600, Baud::B19200, Baud::B921600].contains(baud) {
                continue;
            }
            let line = [
                (configuration::BAUD, baud.code()),
                (configuration::FORMAT, format),
                (configuration::MODE, mode),
            ];
            let mut rig = Rig::set_up(Module::Di4, &line);
            // At the highest rates the rig would not wait this long. Other work may delay a reply by more than LATE.
            rig.patience = Time::from_us(200);
            let bit = rig.bit();
            let request = match mode {
                0 => adu(&[1, 3, 1, 0, 0, 9]),
                _ => ascii(&[3, 1, 0, 0, 9], "\r\n"),
            };
            let mut least = u64::MAX;
            for _ in 0..2 {
                rig.exchange(&request);
                let clocks = rig.clocks();
                let line = rig.board.line();
                let frame = line.frames().next_back().expect("a reply").clone();
                assert_eq!(
                    frame.direction,
                    Direction::Response,
                    "{baud:?}, format {format}"
                );
                let edges: Vec<_> = line.driver_edges().collect();
                let [.., (on, true), (off, false)] = edges[..] else {
                    panic!("{baud:?}, format {format}: {edges:?}");
                };
                assert!(
                    on <= frame.start && frame.start - on <= bit + ON.of(corner()),
                    "{baud:?}, format {format}: on {on:?}, start {:?}",
                    frame.start
                );
                let held = off.as_ps().checked_sub(frame.end.as_ps());
                let most = OFF_BEHIND.of(corner()) + clocks;
                let held = held.filter(|held| *held <= most.as_ps());
                let held = held.unwrap_or_else(|| {
                    panic!(
                        "{baud:?}, format {format}: off {off:?}, end {:?}",
                        frame.end
                    )
                });
                least = least.min(held.saturating_sub(clocks.as_ps()));
            }
            assert!(least <= OFF.of(corner()).as_ps(), "{baud:?}: {least} ps");
            let bit_or_less = *baud == Baud::B921600 || least <= bit.as_ps();
            assert!(bit_or_less, "{baud:?}: {least} ps of {bit:?}");
        }
    }
}

/// A handler or a lock that delays the UART's interrupt by more than a character must not cut a reply short: the
/// character before the last one then ends while the last one is being given to the UART. Every other request follows
/// the reply as soon as the unit is ready, and the others move on through the millisecond of the scan.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn replies_are_complete_and_the_next_request_is_received_at_every_phase_of_the_scan() {
    for baud in [Baud::B230400, Baud::B460800, Baud::B921600] {
        let mut rig = Rig::set_up(Module::Di4, &[(configuration::BAUD, baud.code())]);
        for phase in 0..1500 {
            let rest = Time::from_ns(667 * phase * (phase % 2));
            let (reply, _) = rig.hurry(rest, &adu(&[1, 3, 2, 0, 0, 2]));
            let expected = adu(&[1, 3, 4, 0x23, 0x83, 0x58, 0x60]);
            assert_eq!(reply, expected, "{baud:?}, phase {phase}");
        }
    }
}
