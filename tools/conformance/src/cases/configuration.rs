//! The configuration of a modio: its lock, its checks, and when a setting is in force.

use std::time::Duration;

use register_map::{Module, codes::Command, configuration, points, state};

use crate::case::{Case, Check, Need, case};
use crate::points::{pdu, write_words};
use crate::tester::Tester;

const L: &[Need] = &[Need::Modio, Need::LockClosed, Need::Function(6)];

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("config/locked", "map, 0x0100",
        "while the lock is closed a configuration write is exception 06 and changes nothing",
        L, locked),
    case("config/wrong-key", "map, 0x0100", "KEY takes 5A17 only, anything else is exception 03", L,
        wrong_key),
    case("config/value-before-lock", "map, access rules",
        "a value out of range is exception 03 even while the lock is closed", L, value_first),
    case("config/read-only", "map, access rules", "writing identity and state is exception 02, by 06 and 10",
        &[Need::Modio, Need::Function(6), Need::Function(0x10)], read_only),
    case("config/command-reads-0", "map, 0x0108", "COMMAND reads 0, and takes no command that does not exist",
        &[Need::Modio, Need::Function(6)], command),
    case("config/all-or-nothing", "map, access rules",
        "a write of several registers with one bad value changes none of them",
        &[Need::Modio, Need::Config, Need::Function(0x10)], all_or_nothing),
    case("config/response-delay", "map, 0x0105", "RESPONSE_DELAY is in force at once: replies come that much later",
        &[Need::Modio, Need::Config, Need::Exact, Need::Function(6)], response_delay),
];

fn locked(tester: &mut Tester<'_>) -> Check {
    let before = tester.read_word(configuration::RESPONSE_DELAY)?;
    for value in [before, before ^ 1] {
        tester.exception(&pdu(6, configuration::RESPONSE_DELAY, value), 6)?;
        tester.exception(&write_words(configuration::RESPONSE_DELAY, &[value]), 6)?;
    }
    tester.word_is(configuration::RESPONSE_DELAY, before)
}

fn wrong_key(tester: &mut Tester<'_>) -> Check {
    for key in [0, 1, 0x5A16, 0x175A, 0xFFFF] {
        tester.exception(&pdu(6, configuration::KEY, key), 3)?;
    }
    let now = tester.read_word(configuration::KEY)?;
    tester.ensure(now == 0, "KEY reads 0: the lock is still closed")
}

fn value_first(tester: &mut Tester<'_>) -> Check {
    let mut wrong = vec![
        (configuration::RESPONSE_DELAY, 1001),
        (configuration::FRAME_GAP, 1),
        (configuration::COMM_TIMEOUT, 36_001),
        (configuration::BETA, 1999),
    ];
    if let Some(board) = tester.target.modio.and_then(|modio| modio.board) {
        let ports = (1..=points::PORTS).filter(|port| board.chooses(*port));
        wrong.extend(ports.map(|port| {
            let known = board.has_slot(port);
            let code = if known { Module::LAST + 1 } else { 1 };
            (configuration::module_of(port), code)
        }));
    }
    for (register, value) in wrong {
        let before = tester.read_word(register)?;
        tester.exception(&pdu(6, register, value), 3)?;
        tester.word_is(register, before)?;
    }
    Ok(())
}

fn read_only(tester: &mut Tester<'_>) -> Check {
    for register in [
        state::PRODUCT_CODE,
        state::UNIT_ADDRESS,
        state::UPTIME,
        state::STATUS,
        state::MODULE_IN_FORCE,
        state::BUS_MESSAGES,
    ] {
        tester.exception(&pdu(6, register, 0), 2)?;
        tester.exception(&write_words(register, &[0]), 2)?;
    }
    Ok(())
}

fn command(tester: &mut Tester<'_>) -> Check {
    let now = tester.read_word(configuration::COMMAND)?;
    tester.ensure(now == 0, "COMMAND reads 0")?;
    for value in [0, 7, 0xB006, 0xFFFF] {
        tester.exception(&pdu(6, configuration::COMMAND, value), 3)?;
    }
    if tester.target.allow_config {
        tester.unlock()?;
        let clear_flag = Command::ClearWatchdogFlag.code();
        let request = pdu(6, configuration::COMMAND, clear_flag);
        tester.reply_is(&request, &request)?;
    }
    let now = tester.read_word(configuration::COMMAND)?;
    tester.ensure(now == 0, "COMMAND reads 0 after a command")
}

fn all_or_nothing(tester: &mut Tester<'_>) -> Check {
    tester.unlock()?;
    let at = configuration::COMM_TIMEOUT;
    let before = tester.reply(&pdu(3, at, 4))?;
    tester.exception(&write_words(at, &[700, 1, 1, 0]), 3)?;
    tester.exception(&write_words(at, &[700, 1, 0, 2]), 3)?;
    let now = tester.reply(&pdu(3, at, 4))?;
    tester.ensure(now == before, "the four registers are unchanged")
}

fn response_delay(tester: &mut Tester<'_>) -> Check {
    tester.unlock()?;
    let before = tester.read_word(configuration::RESPONSE_DELAY)?;
    let patience = tester.patience;
    tester.patience.reply += Duration::from_millis(200);
    let mut result = Ok(());
    for ms in [1, 20, 100] {
        let request = pdu(6, configuration::RESPONSE_DELAY, ms);
        result = result.and_then(|()| tester.reply_is(&request, &request));
        result = result.and_then(|()| tester.alive("a new RESPONSE_DELAY"));
        let least =
            tester.endpoint.line().t35_limits().least + Duration::from_millis(u64::from(ms));
        let took = tester.turnaround();
        let right = took >= least && took < least + Duration::from_millis(3);
        let wanted = format!("a reply {least:?} after the request, not {took:?}");
        result = result.and_then(|()| tester.ensure(right, wanted));
    }
    tester.reply(&pdu(6, configuration::RESPONSE_DELAY, before))?;
    tester.patience = patience;
    result
}
