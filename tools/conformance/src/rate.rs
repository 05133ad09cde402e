//! Changes a modio and the endpoint to another rate and format, and back.

use std::time::Duration;

use modbus_line::LineFormat;
use register_map::codes::Command;
use register_map::configuration::{BAUD, COMMAND, SAVE_EVERY_S};

use crate::bench::Bench;
use crate::case::{Check, Stop, skip};
use crate::frame::{Reply, hex};
use crate::points::{pdu, write_words};
use crate::target::codes;

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
    bench: &mut Bench<'_>,
    stops: impl IntoIterator<Item = LineFormat>,
    mut visit: impl FnMut(&mut Bench<'_>) -> Check,
) -> Check {
    let home = bench.endpoint.line();
    let patience = bench.patience;
    let stops: Vec<LineFormat> = stops.into_iter().collect();
    takes_all(bench, &stops, home)?;
    let mut result = Ok(());
    // Whether the unit's stored rate is the rate in force.
    let mut settled = true;
    for to in stops {
        let from = bench.endpoint.line();
        if to != from {
            result = move_to(bench, to);
            if result.is_err() {
                settled = false;
                look_for_it(bench, [from, to, home])?;
            }
        }
        if result.is_ok() {
            result = visit(bench);
        }
        if result.is_err() {
            break;
        }
    }
    let mut back = Ok(());
    for _ in 0..ATTEMPTS {
        let from = bench.endpoint.line();
        if settled && from == home {
            break;
        }
        back = move_to(bench, home);
        settled = back.is_ok();
        if !settled {
            look_for_it(bench, [from, home, from])?;
        }
    }
    bench.patience = patience;
    result.and(back)
}

/// Checks that the endpoint supports these rates and formats. An adapter may lack a rate, a pseudo-terminal parity.
fn takes_all(bench: &mut Bench<'_>, lines: &[LineFormat], home: LineFormat) -> Check {
    for line in lines.iter().filter(|line| **line != home) {
        let taken = bench.endpoint.set_line(*line);
        bench.endpoint.set_line(home)?;
        if let Err(why) = taken {
            return skip(why.to_string());
        }
    }
    Ok(())
}

/// Sets the endpoint to the first of these lines at which the unit answers, else to the last.
fn look_for_it(bench: &mut Bench<'_>, lines: [LineFormat; 3]) -> Check {
    for line in lines {
        bench.endpoint.set_line(line)?;
        if bench.alive("a change that failed").is_ok() {
            break;
        }
    }
    Ok(())
}

/// Saves the configuration, whose lock must be open. A unit that refuses, because there were too many saves, accepts
/// another one within a minute.
fn save(bench: &mut Bench<'_>) -> Check {
    let request = pdu(6, COMMAND, Command::Save.code());
    let latest = bench.endpoint.now() + SAVED_AGAIN;
    loop {
        let reply = bench.ask_due(&request)?;
        if reply.exception(6) != Some(6) || bench.endpoint.now() > latest {
            let echoed = reply == Reply::Pdu(request.clone());
            bench.ensure(echoed, format!("the PDU {}", hex(&request)))?;
            bench.rest(STORING)?;
            return Ok(());
        }
        bench.rest(SAVE_INTERVAL)?;
        // The lock would close in this time, because a refused write does not keep it open.
        bench.unlock()?;
    }
}

/// Writes, saves and restarts the unit with another rate and format, and sets the endpoint to them.
fn move_to(bench: &mut Bench<'_>, to: LineFormat) -> Check {
    bench.unlock()?;
    let values = codes(to).map_err(Stop::Skip)?;
    let request = write_words(BAUD, &values);
    bench.reply_is(&request, &request[..5])?;
    // The old rate is in force until the restart.
    bench.alive("a new rate that is in force after the restart")?;
    save(bench)?;
    let request = pdu(6, COMMAND, Command::Restart.code());
    bench.reply_is(&request, &request)?;
    bench.rest(STORING)?;
    bench.endpoint.set_line(to)?;
    bench.patience.quiet = bench.patience.quiet.max(to.t35() + to.characters(2));
    bench.patience.reply = bench.patience.reply.max(to.t35() * 2 + to.characters(4));
    let latest = bench.endpoint.now() + START;
    loop {
        bench.rest(INTERVAL)?;
        let answered = bench.alive(format!("the change to {to}"));
        let silent = matches!(answered, Err(Stop::Fail(_)));
        if !silent || bench.endpoint.now() >= latest {
            return answered;
        }
    }
}
