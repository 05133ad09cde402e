//! Registers of the line's UART and timers that change on their own, as in a disturbance of the part: the driver goes
//! off in time, and the unit serves the line again.

use register_map::{codes::Baud, configuration, fault};
use sim::soc::map::Block;
use sim::{Module, Time};

use crate::bench::{Bench, FIRST, adu};

/// Registers that are disturbed: block, offset, bits, and the name for messages. RM0008 27.6 (USART), 14.4 (TIM1),
/// 15.4 (TIM2).
const REGISTERS: [(Block, u32, u16, &str); 17] = [
    // An inverted bit of SR can clear TC.
    (Block::Usart1, 0x00, 1 << 6, "USART1 SR.TC"),
    (Block::Usart1, 0x08, 0xFFFF, "USART1 BRR"),
    (Block::Usart1, 0x0C, 0x3FFF, "USART1 CR1"),
    (Block::Usart1, 0x10, 0x7F6F, "USART1 CR2"),
    (Block::Usart1, 0x14, 0x07FF, "USART1 CR3"),
    (Block::Tim2, 0x00, 0x03FF, "TIM2 CR1"),
    (Block::Tim2, 0x08, 0x0077, "TIM2 SMCR"),
    (Block::Tim2, 0x0C, 0x5F5F, "TIM2 DIER"),
    (Block::Tim2, 0x24, 0xFFFF, "TIM2 CNT"),
    (Block::Tim2, 0x28, 0xFFFF, "TIM2 PSC"),
    (Block::Tim2, 0x2C, 0xFFFF, "TIM2 ARR"),
    (Block::Tim2, 0x34, 0xFFFF, "TIM2 CCR1"),
    (Block::Tim2, 0x38, 0xFFFF, "TIM2 CCR2"),
    (Block::Tim2, 0x3C, 0xFFFF, "TIM2 CCR3"),
    (Block::Tim1, 0x00, 0x03FF, "TIM1 CR1"),
    (Block::Tim1, 0x1C, 0x00FF, "TIM1 CCMR2"),
    (Block::Tim1, 0x20, 0x0FFF, "TIM1 CCER"),
];

/// A read of 9 registers: the reply has 23 characters.
const LONG: [u8; 6] = [1, 3, 1, 0, 0, 9];

/// Returns the instants after the start of a request at which bits change: while the line is idle, in the request, in
/// t3.5, at the beginning, in the middle and at the end of the reply.
fn instants(bench: &Bench) -> [Time; 7] {
    let request = bench.characters(8);
    let reply = request + bench.t35();
    let half = |characters: u64| Time::from_ps(bench.characters(characters).as_ps() / 2);
    [
        Time::ZERO,
        half(9),
        request + half(5),
        reply + half(1),
        reply + half(11),
        reply + half(43),
        reply + half(46),
    ]
}

/// Returns the duration of the longest reply at the bench's rate, plus the millisecond that the server may add, plus a
/// tenth.
fn bound(bench: &Bench) -> Time {
    let longest = bench.characters(256) + Time::from_ms(1);
    Time::from_ps(longest.as_ps() * 11 / 10)
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn any_bit_of_the_lines_registers_may_change_at_any_instant() {
    let mut failures = Vec::new();
    for baud in [Baud::B9600, Baud::B115200, Baud::B921600] {
        let mut bench = Bench::set_up(Module::Di4, &[(configuration::BAUD, baud.code())]);
        bench.tolerant = true;
        bench.board.run_for(Time::from_ms(40));
        for (block, offset, bits, name) in REGISTERS {
            for bit in (0..16).filter(|bit| bits >> bit & 1 != 0) {
                for (n, after) in instants(&bench).into_iter().enumerate() {
                    if !survives(&mut bench, after, block, offset, 1 << bit) {
                        failures.push(format!("{baud:?} {name} bit {bit}, instant {n}"));
                        // Start the next case on a new board.
                        bench = Bench::set_up(Module::Di4, &[(configuration::BAUD, baud.code())]);
                        bench.tolerant = true;
                        bench.board.run_for(Time::from_ms(40));
                    }
                }
            }
        }
    }
    assert!(
        failures.is_empty(),
        "{} failed: {failures:#?}",
        failures.len()
    );
}

/// Returns whether the driver is off in time and a request is answered 100 ms later, without a reset.
fn survives(bench: &mut Bench, after: Time, block: Block, offset: u32, mask: u32) -> bool {
    let resets = bench.board.resets();
    let begin = bench.board.now();
    bench.board.line().send(begin, &adu(&LONG));
    bench.board.run_until(begin + after);
    bench.board.upset(block, offset, mask);
    let upset = bench.board.now();
    let most = bound(bench);
    while bench.board.now() < upset + most.max(Time::from_ms(100)) {
        bench.board.run_for(Time::from_us(250));
        let now = bench.board.now();
        let last = bench.board.line().driver_edges().next_back();
        if last.is_some_and(|(at, on)| on && now > at + most) {
            return false;
        }
    }
    bench.board.line().take_received();
    let reply = bench.exchange(&adu(&[1, 2, 0, FIRST, 0, 4]));
    bench.board.resets() == resets && reply == adu(&[1, 2, 1, 0])
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn line_that_is_set_up_again_is_counted_and_logged() {
    let mut bench = Bench::new(Module::Di4, 1);
    bench.tolerant = true;
    let repairs = |bench: &mut Bench| {
        let [high, low] = fault::LINE_REPAIRS.to_be_bytes();
        bench.ask(1, &[3, high, low, 0, 1])
    };
    assert_eq!(repairs(&mut bench), Some(vec![3, 2, 0, 0]));
    bench.board.take_log();
    // Set BRR to another rate.
    bench.board.upset(Block::Usart1, 0x08, 0x0400);
    bench.board.run_for(Time::from_ms(100));
    assert_eq!(repairs(&mut bench), Some(vec![3, 2, 0, 1]));
    let log = bench.board.take_log();
    assert!(log.contains("line: set up again"), "{log}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_reply_whose_end_is_never_reported_is_cut_off() {
    for baud in [Baud::B9600, Baud::B115200, Baud::B921600] {
        let mut bench = Bench::set_up(Module::Di4, &[(configuration::BAUD, baud.code())]);
        stays_within_the_bound(&mut bench, |_| {});
        bench.assert_answers(1);
    }
}

/// The timer that limits a reply has stopped as well.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_reply_whose_end_is_never_reported_is_cut_off_by_the_second_clock_too() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    stays_within_the_bound(&mut bench, |bench| {
        bench.board.upset(Block::Tim2, 0x00, 1);
    });
    bench.assert_answers(1);
}

/// Stops the transmitter in a reply, so that TC is never set. The driver must go off in time.
fn stays_within_the_bound(bench: &mut Bench, more: impl FnOnce(&mut Bench)) {
    bench.tolerant = true;
    let now = bench.board.now();
    bench.board.line().send(now, &adu(&[1, 2, 0, FIRST, 0, 4]));
    while !bench.board.driver_enable() {
        bench.board.run_for(Time::from_us(1));
    }
    let begin = bench.board.now();
    let limit = begin + bound(bench);
    bench.board.run_for(Time::from_us(5));
    // Clear TE.
    bench.board.upset(Block::Usart1, 0x0C, 1 << 3);
    more(bench);
    bench.board.run_until(limit);
    assert!(!bench.board.driver_enable(), "the driver is off");
    bench.board.run_for(Time::from_ms(10));
    bench.board.line().take_received();
}
