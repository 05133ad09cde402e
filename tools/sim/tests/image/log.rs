//! The firmware's log: the lines of events, and a debugger that changes the log's mode. The lines of a start are tested
//! in `boot`, `clock` and `dip`.

use sim::soc::map::Block;
use sim::{Module, Time};

use crate::rig::{Rig, symbol};

/// Offset of channel 0's flags in RTT's control block.
const FLAGS: u32 = 44;
/// The mode in which a writer waits for the reader when the buffer is full.
const BLOCK_IF_FULL: u32 = 2;

fn rig() -> Rig {
    let mut rig = Rig::new(Module::Di4, 1);
    rig.tolerant = true;
    rig.board.take_log();
    rig
}

/// Disturbs the line, which the firmware then sets up again, and returns the time in the log's line about it, in
/// milliseconds.
fn event(rig: &mut Rig) -> u32 {
    // Set BRR to another rate.
    rig.board.upset(Block::Usart1, 0x08, 0x0400);
    rig.board.run_for(Time::from_ms(100));
    let log = rig.board.take_log();
    let time = log
        .strip_prefix('[')
        .and_then(|log| log.strip_suffix("] WARN line: set up again\n"))
        .unwrap_or_else(|| panic!("{log:?}"));
    let (seconds, millis) = time.split_once('.').expect("a decimal point");
    assert_eq!(millis.len(), 3, "{time}");
    seconds.parse::<u32>().unwrap() * 1000 + millis.parse::<u32>().unwrap()
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn log_line_of_an_event_has_the_time_in_milliseconds() {
    let mut rig = rig();
    let first = event(&mut rig);
    rig.board.run_for(Time::from_ms(12_005));
    let second = event(&mut rig);
    // A register of the line is compared every 24 ms, and the background, which logs, runs every 10 ms.
    assert!(
        (12_105 - 34..=12_105 + 34).contains(&(second - first)),
        "{first} and {second}"
    );
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn log_never_waits_for_a_reader_although_a_debugger_asks_for_it() {
    let mut rig = rig();
    let block = symbol("_SEGGER_RTT");
    rig.board
        .write_memory(block + FLAGS, &BLOCK_IF_FULL.to_le_bytes())
        .unwrap();
    event(&mut rig);
    assert_eq!(rig.board.word(block + FLAGS), Some(0), "skip if full");
}
