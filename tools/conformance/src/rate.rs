//! Changes a modio and the endpoint to another rate and format, and back.

use std::time::Duration;

use modbus_line::LineFormat;
use register_map::codes::Command;
use register_map::configuration::{BAUD, COMMAND, SAVE_EVERY_S};

use crate::case::{Check, Stop, skip};
use crate::frame::{Reply, hex};
use crate::points::{pdu, write_words};
use crate::target::codes;
use crate::tester::Tester;

/// Time for the unit to store its configuration.
const STORING: Duration = Duration::from_millis(200);
/// Time after which a unit accepts another save, with a margin, and the interval at which it is asked to save.
const SAVED_AGAIN: Duration = Duration::from_secs(SAVE_EVERY_S as u64 + 5);
const SAVE_INTERVAL: Duration = Duration::from_secs(5);
/// Longest time that a restart may take, and the interval at which the unit is asked whether it has restarted.
const START: Duration = Duration::from_millis(1500);
const INTERVAL: Duration = Duration::from_millis(250);

/// Number of attempts to restore the rate. One frame lost on a poor line must not leave the unit at another rate.
const ATTEMPTS: u32 = 3;

/// Sets each of these rates and formats, calls `visit` there, and restores the first rate and format, also after a
/// failure. If the unit does not answer after a change, the endpoint tries the rates where the unit may be. The tour
/// ends when `visit` fails.
///
/// # Errors
///
/// [`Stop::Skip`] when the endpoint does not support one of the rates and formats; then the unit is not changed.
/// Otherwise the error of the first change or visit that failed, or of restoring the rate. In the last case the unit
/// may be at another rate than before, and the endpoint is at the rate at which the unit last answered.
pub fn tour(
    tester: &mut Tester<'_>,
    stops: impl IntoIterator<Item = LineFormat>,
    mut visit: impl FnMut(&mut Tester<'_>) -> Check,
) -> Check {
    let home = tester.endpoint.line();
    let patience = tester.patience;
    let stops: Vec<LineFormat> = stops.into_iter().collect();
    takes_all(tester, &stops, home)?;
    let mut result = Ok(());
    // Whether the unit's stored rate is the rate in force.
    let mut settled = true;
    for to in stops {
        let from = tester.endpoint.line();
        if to != from {
            result = move_to(tester, to);
            if result.is_err() {
                settled = false;
                look_for_it(tester, [from, to, home])?;
            }
        }
        if result.is_ok() {
            result = visit(tester);
        }
        if result.is_err() {
            break;
        }
    }
    let mut back = Ok(());
    for _ in 0..ATTEMPTS {
        let from = tester.endpoint.line();
        if settled && from == home {
            break;
        }
        back = move_to(tester, home);
        settled = back.is_ok();
        if !settled {
            look_for_it(tester, [from, home, from])?;
        }
    }
    tester.patience = patience;
    result.and(back)
}

/// Checks that the endpoint supports these rates and formats. An adapter may lack a rate, a pseudo-terminal parity.
fn takes_all(tester: &mut Tester<'_>, lines: &[LineFormat], home: LineFormat) -> Check {
    for line in lines.iter().filter(|line| **line != home) {
        let taken = tester.endpoint.set_line(*line);
        tester.endpoint.set_line(home)?;
        if let Err(why) = taken {
            return skip(why.to_string());
        }
    }
    Ok(())
}

/// Sets the endpoint to the first of these lines at which the unit answers, else to the last.
fn look_for_it(tester: &mut Tester<'_>, lines: [LineFormat; 3]) -> Check {
    for line in lines {
        tester.endpoint.set_line(line)?;
        if tester.alive("a change that failed").is_ok() {
            break;
        }
    }
    Ok(())
}

/// Saves the configuration, whose lock must be open. A unit that refuses, because there were too many saves, accepts
/// another one within a minute.
fn save(tester: &mut Tester<'_>) -> Check {
    let request = pdu(6, COMMAND, Command::Save.code());
    let latest = tester.endpoint.now() + SAVED_AGAIN;
    loop {
        let reply = tester.ask_due(&request)?;
        if reply.exception(6) != Some(6) || tester.endpoint.now() > latest {
            let echoed = reply == Reply::Pdu(request.clone());
            tester.ensure(echoed, format!("the PDU {}", hex(&request)))?;
            tester.rest(STORING)?;
            return Ok(());
        }
        tester.rest(SAVE_INTERVAL)?;
        // The lock would close in this time, because a refused write does not keep it open.
        tester.unlock()?;
    }
}

/// Writes, saves and restarts the unit with another rate and format, and sets the endpoint to them.
fn move_to(tester: &mut Tester<'_>, to: LineFormat) -> Check {
    tester.unlock()?;
    let values = codes(to).map_err(Stop::Skip)?;
    let request = write_words(BAUD, &values);
    tester.reply_is(&request, &request[..5])?;
    // The old rate is in force until the restart.
    tester.alive("a new rate that is in force after the restart")?;
    save(tester)?;
    let request = pdu(6, COMMAND, Command::Restart.code());
    tester.reply_is(&request, &request)?;
    tester.rest(STORING)?;
    tester.endpoint.set_line(to)?;
    tester.patience.quiet = tester.patience.quiet.max(to.t35() + to.characters(2));
    tester.patience.reply = tester.patience.reply.max(to.t35() * 2 + to.characters(4));
    let latest = tester.endpoint.now() + START;
    loop {
        tester.rest(INTERVAL)?;
        let answered = tester.alive(format!("the change to {to}"));
        let silent = matches!(answered, Err(Stop::Fail(_)));
        if !silent || tester.endpoint.now() >= latest {
            return answered;
        }
    }
}
