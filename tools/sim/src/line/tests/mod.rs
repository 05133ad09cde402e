//! Tests of the bus with a USART on it: which characters each side receives, and when.

mod faults;
mod several;

use super::*;
use f103::periph::timer::{Kind, Timer};
use f103::periph::usart::{Usart, Wire};
use f103::peripheral::Peripheral;

const HZ: u32 = 72_000_000;
/// 115200 bit/s at 72 MHz.
const BRR: u32 = 0x271;
const SR: u32 = 0x00;
const DR: u32 = 0x04;
const CR1: u32 = 0x0C;
/// UE, TE, RE.
const ON: u32 = 1 << 13 | 1 << 3 | 1 << 2;
const RXNE: u32 = 1 << 5;

/// A tick of the baud generator after the idle frame that the transmitter sends first.
const TICK: Time = Time::cycles(116 * 625, HZ);

struct Rig {
    line: Line,
    usart: Usart,
    now: Time,
}

impl Rig {
    /// Returns both ends at 115200 8N2, after the first idle frame of the USART.
    fn new() -> Self {
        let mut rig = Self {
            line: Line::default(),
            usart: Usart::default(),
            now: Time::ZERO,
        };
        rig.line.set_settings(Settings {
            baud: 115_200,
            format: Format::N2,
        });
        rig.usart.set_clock(HZ, Time::ZERO);
        rig.line.set_tx_pin(TxPin::Usart, Time::ZERO);
        for (offset, value) in [(0x08, BRR), (0x10, 2 << 12), (CR1, ON)] {
            rig.write(offset, value);
        }
        rig.run_to(TICK);
        rig
    }

    fn run_to(&mut self, at: Time) {
        self.now = at;
        self.usart.exchange(&mut self.line, at);
    }

    fn write(&mut self, offset: u32, value: u32) {
        self.usart.exchange(&mut self.line, self.now);
        assert_eq!(self.usart.write(offset, value, self.now), Ok(()));
    }

    fn read(&mut self, offset: u32) -> u32 {
        self.usart.exchange(&mut self.line, self.now);
        self.usart.read(offset, self.now).expect("modelled")
    }

    fn driver(&mut self, on: bool) {
        self.usart.exchange(&mut self.line, self.now);
        self.line.set_driver(on, self.now);
    }

    /// Returns the bytes that the USART receives up to `end`. Reads each at the event of its reception.
    fn receive(&mut self, end: Time) -> Vec<u8> {
        let mut bytes = Vec::new();
        while let Some(at) = self.usart.next_exchange(&self.line).filter(|&at| at <= end) {
            self.run_to(at);
            if self.read(SR) & RXNE != 0 {
                bytes.push(self.read(DR) as u8);
            }
        }
        self.run_to(end);
        bytes
    }

    /// Sends `bytes` from the unit without gaps, and switches the driver off at the end of the last stop bit.
    fn answer(&mut self, bytes: &[u8]) -> Time {
        // Start at a tick of the baud generator, so that the first byte begins immediately.
        let (_, tick) = Rate::from_clock(625, HZ).ticks(1, self.now);
        self.run_to(tick);
        self.driver(true);
        let begin = self.now;
        for &byte in bytes {
            while self.read(SR) & 1 << 7 == 0 {
                self.run_to(self.usart.next_event().expect("sending"));
            }
            self.write(DR, u32::from(byte));
        }
        let end = begin + Time::cycles(bytes.len() as u64 * 11 * 625, HZ);
        self.run_to(end);
        assert_ne!(self.read(SR) & 1 << 6, 0, "TC");
        self.driver(false);
        end
    }
}

#[test]
fn request_and_answer_are_received_and_recorded() {
    let mut rig = Rig::new();
    let request = [0x11, 0x01, 0x00, 0x13, 0x00, 0x25, 0x0E, 0x84];
    let sent = Time::from_ms(2);
    let end = rig.line.send(sent, &request);
    assert_eq!(end, sent + Time::cycles(88, 115_200));
    assert_eq!(rig.receive(end + Time::from_us(1750)), request);
    let done = rig.answer(&request[..4]);
    let began = done - Time::cycles(4 * 11 * 625, HZ);
    rig.run_to(done + Time::from_us(1751));
    let frames: Vec<_> = rig.line.frames().cloned().collect();
    assert_eq!(frames.len(), 2);
    assert_eq!(
        (frames[0].start, frames[0].direction),
        (sent, Direction::Request)
    );
    assert!(frames[0].end.as_ps().abs_diff(end.as_ps()) < 100);
    assert!(frames[0].crc_ok && !frames[0].damaged);
    assert_eq!(
        (frames[1].start, frames[1].direction),
        (began, Direction::Response)
    );
    assert_eq!(frames[1].bytes, request[..4]);
    assert!(!frames[1].damaged);
    let received: Vec<_> = rig.line.received().map(|r| r.byte).collect();
    assert_eq!(received, request[..4]);
    assert!(rig.line.received().all(Received::is_good));
    assert_eq!(
        rig.line.driver_edges().collect::<Vec<_>>(),
        [(began, true), (done, false)]
    );
    assert_eq!(rig.line.collisions().count(), 0);
    assert_eq!(rig.line.take_findings(), []);
}

#[test]
fn one_large_step_has_the_same_result_as_many_small_steps() {
    let run = |steps: u64| {
        let mut rig = Rig::new();
        let end = rig.line.send(Time::from_ms(2), &[1, 2, 3]);
        for n in 1..=steps {
            let at = Time::from_ms(2) + (end - Time::from_ms(2)) * n;
            rig.run_to(Time::from_ps(at.as_ps() / steps).max(rig.now));
        }
        rig.run_to(Time::from_ms(9));
        (
            rig.read(SR),
            rig.read(DR),
            rig.line.frames().cloned().collect::<Vec<_>>(),
        )
    };
    let (sr, dr, frames) = run(0);
    // DR was not read in between: it has the first byte, and the others are lost.
    assert_eq!((sr & 0x28, dr), (0x28, 1));
    assert_eq!(frames[0].bytes, [1, 2, 3]);
    assert_eq!(run(1000), (sr, dr, frames));
}

#[test]
fn unit_receives_its_echo_only_with_set_echo() {
    for echo in [false, true] {
        let mut rig = Rig::new();
        rig.line.set_echo(echo);
        rig.answer(&[0xA5]);
        assert_eq!(rig.read(SR) & RXNE != 0, echo);
        if echo {
            assert_eq!(rig.read(DR), 0xA5);
        }
    }
}

#[test]
fn tim1_captures_falling_edges_of_received_characters() {
    let mut rig = Rig::new();
    let mut tim1 = Timer::new(Kind::Advanced);
    tim1.set_clock(HZ, Time::ZERO);
    let ok = Ok(());
    assert_eq!(tim1.write(0x1C, 1, Time::ZERO), ok);
    assert_eq!(tim1.write(0x20, 3 << 8, Time::ZERO), ok);
    assert_eq!(tim1.write(0x00, 1, Time::ZERO), ok);
    let mut flags = |rig: &mut Rig, clear: bool| {
        rig.usart.exchange(&mut rig.line, rig.now);
        for (at, rising) in rig.usart.take_edges() {
            tim1.capture_edge(3, at, rising);
        }
        tim1.advance(rig.now);
        let sr = tim1.read(0x10, rig.now).expect("modelled") & 0x808;
        if clear {
            assert_eq!(tim1.write(0x10, 0, rig.now), Ok(()));
        }
        sr
    };
    flags(&mut rig, true);
    let end = rig.line.send(Time::from_ms(2), &[0xFF, 0x55]);
    rig.run_to(Time::from_ms(2) - Time::from_ps(1));
    assert_eq!(flags(&mut rig, true), 0);
    rig.run_to(Time::from_ms(2));
    assert_eq!(flags(&mut rig, true), 1 << 3);
    // The second start bit and four more falling edges: capture and overcapture.
    rig.run_to(end);
    assert_eq!(flags(&mut rig, true), 1 << 3 | 1 << 11);
    rig.run_to(end + Time::from_ms(1));
    assert_eq!(flags(&mut rig, true), 0);
    // Characters of the unit itself are not on its RX pin.
    rig.answer(&[0x00]);
    assert_eq!(flags(&mut rig, true), 0);
}

#[test]
fn following_master_takes_over_the_units_settings() {
    let mut rig = Rig::new();
    rig.line.set_settings(Settings::default());
    rig.run_to(Time::from_ms(2));
    assert_eq!(rig.line.settings(), Settings::default());
    rig.line.set_follow(true);
    let end = rig.line.send(rig.now, &[0x55]);
    // The master keeps its settings until it has sent its queue.
    rig.run_to(end - Time::from_ps(1));
    assert_eq!(rig.line.settings(), Settings::default());
    rig.run_to(end);
    let settings = Settings {
        baud: 115_200,
        format: Format::N2,
    };
    assert_eq!(rig.line.settings(), settings);
    // 921600 bit/s from 72 MHz: 78 cycles are 923077 bit/s. With even parity.
    rig.write(0x10, 0);
    rig.write(0x08, 78);
    rig.write(CR1, ON | 1 << 12 | 1 << 10);
    rig.run_to(Time::from_ms(9));
    let settings = Settings {
        baud: 921_600,
        format: Format::E1,
    };
    assert_eq!(rig.line.settings(), settings);
    // An unusual rate is taken over as it is. A format that no Modbus line has changes nothing.
    rig.write(0x08, 1000);
    rig.run_to(Time::from_ms(10));
    assert_eq!(rig.line.settings().baud, 72_000);
    // Nine data bits, no parity.
    rig.write(CR1, ON | 1 << 12);
    rig.run_to(Time::from_ms(11));
    assert_eq!(rig.line.settings().format, Format::E1);
    // A parity bit in words of eight bits: seven data bits.
    for (parity, format) in [(0, Format::SevenE1), (1 << 9, Format::SevenO1)] {
        rig.write(CR1, ON | 1 << 10 | parity);
        let now = rig.line.now;
        rig.run_to(now + Time::from_ms(1));
        assert_eq!(rig.line.settings().format, format);
    }
}

#[test]
fn memory_is_bounded_in_a_long_run() {
    let mut rig = Rig::new();
    for n in 0..20_000_u64 {
        let at = Time::from_ms(2 + 3 * n);
        let end = rig.line.send(at, &[0x55, 0xAA, n as u8]);
        rig.run_to(end);
        rig.write(DR, 0x55);
    }
    assert_eq!(rig.line.frames().count(), KEPT);
    let (from_master, from_unit) = rig.line.frame_counts();
    assert_eq!((from_master, from_unit), (19_999, 0));
    let waves = [
        &rig.line.bus,
        &rig.line.usart,
        &rig.line.master.wave,
        &rig.line.unit,
    ];
    assert!(
        waves.iter().all(|wave| wave.len() < 2500),
        "a wave keeps more than 100 ms"
    );
    assert!(rig.line.master.sending.len() < 3);
}
