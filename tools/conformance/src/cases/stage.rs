//! The output stage of a modio: what DEAD_TIME, MAX_ON and MIN_OFF do, as far as a master can see it.

use std::time::Duration;

use register_map::board::Row;
use register_map::codes::{ChannelStatus, LinkAction};
use register_map::links;
use register_map::points::Kind;
use register_map::stage::{DEAD_TIME, MAX_ON, MIN_OFF};
use register_map::state::CHANNEL_STATUS;

use crate::case::{Case, Check, Need, case, skip};
use crate::points::{pdu, write_bits};
use crate::target::Span;
use crate::tester::Tester;

const N: &[Need] = &[
    Need::Modio,
    Need::Config,
    // The outputs are restored.
    Need::Bits,
    Need::Function(1),
    Need::Function(5),
    Need::Function(0xF),
    Need::Function(0x10),
];

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("stage/both-in-one-request", "map, 0x0520",
        "a request that switches both outputs of a pair on is answered, and neither is on", N, both),
    case("stage/other-direction", "map, 0x0520",
        "of two orders for the outputs of a pair the newer one wins, and waits for DEAD_TIME", N, other),
    case("stage/master-repeats", "map, 0x0540",
        "after MAX_ON an output stays off although its master repeats himself, until he has written 0", N, repeats),
    case("stage/shortest-time-off", "map, 0x0560", "an output that is switched on within MIN_OFF waits for its end", N,
        waits),
];

/// DEAD_TIME, MAX_ON and MIN_OFF as registers have them, the last two of the first output of a pair.
#[derive(Default)]
struct Times {
    dead: u16,
    max_on: u16,
    min_off: u16,
}

/// Returns the first of two digital outputs that can be a pair and that no link holds.
fn pair(tester: &mut Tester<'_>) -> Check<u16> {
    let Some(modio) = &tester.target.modio else {
        return skip("the unit is no modio");
    };
    let has_links = modio.board.is_none_or(Row::has_links);
    if modio.board.is_some_and(|board| !board.stage) {
        return skip("the board has no output stage");
    }
    let outputs = modio.points().filter(|(_, kind)| *kind == Kind::BitOutput);
    let outputs: Vec<_> = outputs.map(|(address, _)| address).collect();
    let is_pair = |first: &&u16| first.is_multiple_of(2) && outputs.contains(&(*first + 1));
    let Some(first) = outputs.iter().find(is_pair).copied() else {
        return skip("no module has digital outputs");
    };
    let reads = tester.ask(&pdu(3, DEAD_TIME, 1))?;
    if reads.exception(3) == Some(2) {
        return skip("the firmware has no output stage");
    }
    let holds = [LinkAction::Follow, LinkAction::Invert].map(LinkAction::code);
    for output in [first, first + 1] {
        for second in [false, true] {
            let action = links::of_point(output, second) + 1;
            if has_links && holds.contains(&(tester.read_word(action)? & 0xFF)) {
                return skip("a link holds the outputs");
            }
        }
    }
    Ok(first)
}

/// Sets the times of both outputs of a pair, which also switches both off, calls `done`, and restores the times.
fn with_times(
    tester: &mut Tester<'_>,
    times: &Times,
    done: impl FnOnce(&mut Tester<'_>, u16) -> Check,
) -> Check {
    let first = pair(tester)?;
    let all = Span {
        first: DEAD_TIME + first,
        last: MIN_OFF + first + 1,
    };
    let before = tester.read_words(all)?;
    let with = |times: &Times| {
        let mut words = before.clone();
        let wanted = [
            (DEAD_TIME, [times.dead, 0]),
            (MAX_ON, [times.max_on, 0]),
            (MIN_OFF, [times.min_off, 0]),
        ];
        for (block, words_of) in wanted {
            let at = usize::from(block - DEAD_TIME);
            words[at..at + 2].copy_from_slice(&words_of);
        }
        words
    };
    tester.unlock()?;
    // A change begins the times, and the same value again is no change.
    let other = with(&Times {
        dead: 1000,
        max_on: 1,
        min_off: 1,
    });
    let result = (|| {
        tester.set_words(all.first, &other)?;
        tester.set_words(all.first, &with(times))?;
        done(tester, first)
    })();
    let restored = tester
        .unlock()
        .and_then(|()| tester.set_words(all.first, &before));
    result.and(restored)
}

/// Returns a time in virtual time, or four times as long in real time: the host may be busy.
fn longer(tester: &Tester<'_>, count: u16) -> u16 {
    tester.exact(count, 4 * count)
}

/// Tenths of a second.
fn tenths(count: u16) -> Duration {
    Duration::from_millis(100) * u32::from(count)
}

fn write(tester: &mut Tester<'_>, output: u16, on: bool) -> Check {
    let request = pdu(5, output, if on { 0xFF00 } else { 0 });
    tester.reply_is(&request, &request)
}

fn coils_are(tester: &mut Tester<'_>, first: u16, wanted: u8) -> Check {
    tester.reply_is(&pdu(1, first, 2), &[1, 1, wanted])
}

fn status_is(tester: &mut Tester<'_>, output: u16, wanted: ChannelStatus) -> Check {
    tester.word_is(CHANNEL_STATUS + output, wanted.code())
}

fn both(tester: &mut Tester<'_>) -> Check {
    let times = Times {
        dead: 2,
        ..Times::default()
    };
    with_times(tester, &times, |tester, first| {
        let request = write_bits(first, &[true, true], false);
        for _ in 0..2 {
            tester.reply_is(&request, &pdu(0xF, first, 2))?;
            coils_are(tester, first, 0)?;
            write(tester, first, true)?;
            coils_are(tester, first, 1)?;
        }
        Ok(())
    })
}

fn other(tester: &mut Tester<'_>) -> Check {
    let tens = longer(tester, 5);
    let times = Times {
        dead: 10 * tens,
        ..Times::default()
    };
    with_times(tester, &times, |tester, first| {
        for (output, coils) in [(first, 1), (first + 1, 2), (first, 1)] {
            write(tester, output, true)?;
            coils_are(tester, first, coils)?;
            status_is(tester, output, ChannelStatus::Waits)?;
            tester.rest(tenths(tens + 1))?;
            status_is(tester, output, ChannelStatus::Good)?;
        }
        Ok(())
    })
}

fn repeats(tester: &mut Tester<'_>) -> Check {
    let max_on = longer(tester, 5);
    let times = Times {
        max_on,
        ..Times::default()
    };
    with_times(tester, &times, |tester, first| {
        for _ in 0..8 {
            write(tester, first, true)?;
            tester.rest(tenths(max_on) / 4)?;
        }
        write(tester, first, true)?;
        status_is(tester, first, ChannelStatus::Ended)?;
        tester.reply_is(&pdu(1, first, 1), &[1, 1, 0])?;
        write(tester, first, false)?;
        write(tester, first, true)?;
        tester.reply_is(&pdu(1, first, 1), &[1, 1, 1])?;
        status_is(tester, first, ChannelStatus::Good)
    })
}

fn waits(tester: &mut Tester<'_>) -> Check {
    let min_off = longer(tester, 5);
    let times = Times {
        min_off,
        ..Times::default()
    };
    with_times(tester, &times, |tester, first| {
        for _ in 0..2 {
            write(tester, first, true)?;
            tester.reply_is(&pdu(1, first, 1), &[1, 1, 1])?;
            status_is(tester, first, ChannelStatus::Waits)?;
            tester.rest(tenths(min_off + 1))?;
            status_is(tester, first, ChannelStatus::Good)?;
            write(tester, first, false)?;
        }
        Ok(())
    })
}
