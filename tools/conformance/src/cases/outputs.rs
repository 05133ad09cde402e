//! The outputs of a modio when the master stops sending, and at power-on.

use std::time::Duration;

use register_map::codes::CommSource;
use register_map::configuration::{self, AS_IT_WAS};
use register_map::points::Kind;
use register_map::state;

use crate::case::{Case, Check, Need, Stop, case, skip};
use crate::points::{pdu, words_of, write_bits, write_words};
use crate::target::{Modio, Span};
use crate::tester::Tester;

const N: &[Need] = &[Need::Modio, Need::Config, Need::Function(6)];

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("outputs/safe-when-the-line-dies", "map, communication watchdog",
        "without requests for COMM_TIMEOUT every output goes to SAFE, also when requests to another unit and bad frames \
        come; the flag stays until it is cleared", N, line_dies),
    case("outputs/stay-while-the-line-lives", "map, communication watchdog",
        "requests and broadcasts within COMM_TIMEOUT keep outputs as they are", N, line_lives),
    case("outputs/stay-while-heartbeats-come", "map, 0x010C",
        "with COMM_SOURCE 1 HEARTBEAT within COMM_TIMEOUT, also as a broadcast, keeps outputs as they are", N,
        heartbeats_come),
    case("outputs/inputs-take-no-writes", "map, points",
        "writing an input point is exception 02, by every function that writes", &[Need::Modio], inputs),
    case("outputs/start-value", "map, 0x01E0", "at power-on outputs are at START", &[Need::Modio, Need::Power],
        start_value),
];

/// Returns the first output of a module: the function that reads it, its address, and a value other than 0.
fn output(tester: &Tester<'_>) -> Check<(u8, u16, u16)> {
    if let Some(span) = tester.target.bits {
        return Ok((1, span.first, 1));
    }
    match tester.target.words.filter(|words| !words.locked) {
        Some(words) => Ok((3, words.span.first, words.high)),
        None => skip("the module has no outputs"),
    }
}

fn inputs(tester: &mut Tester<'_>) -> Check {
    let modio = tester.target.modio;
    let mut requests = Vec::new();
    for (address, kind) in modio.iter().flat_map(Modio::points) {
        match kind {
            Kind::BitInput => requests.extend([
                pdu(5, address, 0),
                pdu(5, address, 0xFF00),
                write_bits(address, &[true], false),
            ]),
            Kind::WordInput => requests.extend([
                pdu(6, address, 1),
                write_words(address, &[1]),
                [pdu(0x16, address, 0), vec![0, 1]].concat(),
            ]),
            Kind::None | Kind::BitOutput | Kind::WordOutput => {}
        }
    }
    if requests.is_empty() {
        return skip("the module has no inputs");
    }
    for request in requests {
        tester.exception(&request, 2)?;
    }
    Ok(())
}

fn read(tester: &mut Tester<'_>, function: u8, address: u16) -> Check<u16> {
    Ok(read_all(tester, function, Span::one(address))?[0])
}

fn write(tester: &mut Tester<'_>, function: u8, address: u16, value: u16) -> Check {
    write_all(tester, function, address, &[value])
}

fn set(tester: &mut Tester<'_>, register: u16, value: u16) -> Check {
    tester.unlock()?;
    let request = pdu(6, register, value);
    tester.reply_is(&request, &request)
}

/// Returns a value for COMM_TIMEOUT in tenths of a second: `exact` in virtual time. In real time it is four times as long,
/// so that the pauses of a busy host are not longer than the time-out.
fn tenths(tester: &Tester<'_>, exact: u16) -> u16 {
    tester.exact(exact, exact * 4)
}

/// Calls `done` with COMM_TIMEOUT set and SAFE of the output at 0, and restores both.
fn with_timeout(
    tester: &mut Tester<'_>,
    tenths: u16,
    address: u16,
    done: fn(&mut Tester<'_>, Duration) -> Check,
) -> Check {
    let safe = configuration::SAFE + address;
    let before = tester.read_word(configuration::COMM_TIMEOUT)?;
    let safe_before = tester.read_word(safe)?;
    set(tester, safe, 0)?;
    set(tester, configuration::COMM_TIMEOUT, tenths)?;
    let result = done(tester, Duration::from_millis(100) * u32::from(tenths));
    set(tester, configuration::COMM_TIMEOUT, before)?;
    set(tester, safe, safe_before)?;
    set(tester, configuration::COMMAND, 5)?;
    result
}

fn has_tripped(tester: &mut Tester<'_>) -> Check<bool> {
    Ok(tester.read_word(state::STATUS)? & state::status::COMM_WATCHDOG != 0)
}

fn line_dies(tester: &mut Tester<'_>) -> Check {
    let (function, address, high) = output(tester)?;
    let before = read(tester, function, address)?;
    let tenths = tenths(tester, 5);
    let result = with_timeout(tester, tenths, address, |tester, timeout| {
        let (function, address, high) = output(tester)?;
        let is = |tester: &mut Tester<'_>, value, wanted: &str| {
            let now = read(tester, function, address)?;
            tester.ensure(now == value, wanted)
        };
        write(tester, function, address, high)?;
        is(tester, high, "the output as written")?;
        let other = tester.other();
        let mut bad = tester.ping();
        // In RTU a byte of the address, in ASCII a digit of the function.
        bad[3] ^= 1;
        let end = tester.endpoint.now() + timeout * 2;
        while tester.endpoint.now() < end {
            tester.rest(timeout / 4)?;
            tester.silent_ping(other, "a request to another unit")?;
            tester.silence_to(&bad, "a wrong checksum")?;
        }
        is(tester, 0, "the output at SAFE, 0")?;
        let tripped = has_tripped(tester)?;
        tester.ensure(tripped, "status bit 0 set: the watchdog has tripped")?;
        // Requests end the timeout, but do not restore the outputs.
        is(tester, 0, "the output at SAFE until it is written")?;
        write(tester, function, address, high)?;
        is(tester, high, "the output as written again")?;
        set(tester, configuration::COMMAND, 5)?;
        let tripped = has_tripped(tester)?;
        tester.ensure(!tripped, "status bit 0 clear after COMMAND 5")
    });
    write(tester, function, address, before.min(high))?;
    result
}

fn line_lives(tester: &mut Tester<'_>) -> Check {
    let (function, address, high) = output(tester)?;
    let before = read(tester, function, address)?;
    let tenths = tenths(tester, 10);
    let result = with_timeout(tester, tenths, address, |tester, timeout| {
        let (function, address, high) = output(tester)?;
        write(tester, function, address, high)?;
        for _ in 0..10 {
            tester.rest(timeout / 4)?;
            let now = read(tester, function, address)?;
            tester.ensure(now == high, "the output as written")?;
        }
        // Every unit ignores a broadcast read, but it is a valid message and restarts the timeout.
        for _ in 0..8 {
            tester.rest(timeout / 4)?;
            tester.silent_ping(0, "a broadcast")?;
        }
        let tripped = has_tripped(tester)?;
        tester.ensure(!tripped, "status bit 0 clear: broadcasts count")?;
        let now = read(tester, function, address)?;
        tester.ensure(now == high, "the output as written")
    });
    write(tester, function, address, before.min(high))?;
    result
}

fn heartbeats_come(tester: &mut Tester<'_>) -> Check {
    let (function, address, high) = output(tester)?;
    let before = read(tester, function, address)?;
    let source = tester.read_word(configuration::COMM_SOURCE)?;
    let tenths = tenths(tester, 10);
    set(
        tester,
        configuration::COMM_SOURCE,
        CommSource::Writes.code(),
    )?;
    let result = with_timeout(tester, tenths, address, |tester, timeout| {
        let (function, address, high) = output(tester)?;
        write(tester, function, address, high)?;
        for value in 0..8 {
            tester.rest(timeout / 4)?;
            let request = pdu(6, configuration::HEARTBEAT, value);
            tester.reply_is(&request, &request)?;
        }
        for value in 0..8 {
            tester.rest(timeout / 4)?;
            let request = pdu(6, configuration::HEARTBEAT, value);
            tester.silence_of(0, &request, "a broadcast")?;
        }
        let tripped = has_tripped(tester)?;
        tester.ensure(!tripped, "status bit 0 clear: HEARTBEAT is a write")?;
        let now = read(tester, function, address)?;
        tester.ensure(now == high, "the output as written")
    });
    set(tester, configuration::COMM_SOURCE, source)?;
    write(tester, function, address, before.min(high))?;
    result
}

fn read_all(tester: &mut Tester<'_>, function: u8, span: Span) -> Check<Vec<u16>> {
    if function == 3 {
        return tester.read_words(span);
    }
    let bits = tester.read_bits(span)?;
    Ok(bits.into_iter().map(u16::from).collect())
}

/// Sets the outputs of one kind to these values.
fn write_all(tester: &mut Tester<'_>, function: u8, first: u16, values: &[u16]) -> Check {
    if function == 3 {
        return tester.set_words(first, values);
    }
    let bits: Vec<bool> = values.iter().map(|value| *value != 0).collect();
    tester.set_bits(first, &bits)
}

/// The first read is this long before the end of COMM_TIMEOUT, and the last read this long after it.
const BEFORE: Duration = Duration::from_millis(2);
const AFTER: Duration = Duration::from_millis(3);
/// A unit whose replies are waited for no longer than this gets a COMM_TIMEOUT of 200 ms, others one of 500 ms.
const FAST: Duration = Duration::from_millis(30);
/// Number of reads around the end of COMM_TIMEOUT.
const READS: u32 = 40;

/// Returns the outputs of a module, of one kind.
fn outputs(tester: &Tester<'_>) -> Check<Span> {
    let words = tester.target.words.filter(|words| !words.locked);
    let span = tester.target.bits.or(words.map(|words| words.span));
    span.ok_or_else(|| Stop::Skip("the module has no outputs".to_owned()))
}

pub(super) fn torn(tester: &mut Tester<'_>) -> Check {
    let (function, ..) = output(tester)?;
    let span = outputs(tester)?;
    let before = read_all(tester, function, span)?;
    let safe = configuration::SAFE + span.first;
    let count = span.len() as usize;
    let safe_before = tester.reply(&pdu(3, safe, count as u16))?;
    tester.unlock()?;
    tester.set_words(safe, &vec![0; count])?;
    // The write of all outputs, its reply and the read have to fit into the timeout.
    let tenths = if tester.patience.reply < FAST { 2 } else { 5 };
    let result = with_timeout(tester, tenths, span.first, reads_around_the_end);
    tester.unlock()?;
    tester.set_words(safe, &words_of(&safe_before))?;
    write_all(tester, function, span.first, &before)?;
    result
}

/// Writes all outputs and reads them near the end of the timeout, with another offset each time.
fn reads_around_the_end(tester: &mut Tester<'_>, timeout: Duration) -> Check {
    let (function, _, high) = output(tester)?;
    let span = outputs(tester)?;
    let count = span.len() as usize;
    let (high, low) = (vec![high; count], vec![0; count]);
    let line = tester.endpoint.line();
    let request = tester.frame(&pdu(function, span.first, count as u16));
    // The unit reads its outputs when the request has ended and the silence after it has passed. The timeout may
    // begin with the end of the write or when the silence after it has passed.
    let ahead = line.characters(request.len()) + line.t35() + BEFORE;
    let step = (BEFORE + line.t35() + AFTER) / READS;
    let (mut held, mut safe) = (0, 0);
    for n in 0..READS {
        write_all(tester, function, span.first, &high)?;
        let until = tester.sent_end + timeout + step * n;
        let now = tester.endpoint.now();
        tester.rest(until.saturating_sub(now).saturating_sub(ahead))?;
        let values = read_all(tester, function, span)?;
        held += u32::from(values == high);
        safe += u32::from(values == low);
        let wanted = "every output as written, or every output at SAFE";
        tester.ensure(values == high || values == low, wanted)?;
    }
    // If the watchdog trips in none or in all of the reads, no read was near the end of the timeout.
    tester.ensure(
        held > 0 && safe > 0,
        format!("some reads before and some after the end of the timeout, not {held} and {safe}"),
    )
}

fn start_value(tester: &mut Tester<'_>) -> Check {
    let (function, address, high) = output(tester)?;
    let start = tester.read_word(configuration::START + address)?;
    if start == AS_IT_WAS || tester.read_word(configuration::SCALE + address)? != 0 {
        return skip("START is not in the output's own units");
    }
    let before = read(tester, function, address)?;
    write(tester, function, address, if start == 0 { high } else { 0 })?;
    super::power::cycle(tester)?;
    tester.rest(super::power::START)?;
    let now = read(tester, function, address)?;
    tester.ensure(now == start, format!("the output at START, {start}"))?;
    write(tester, function, address, before)
}
