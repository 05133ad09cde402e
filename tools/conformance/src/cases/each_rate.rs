//! Turnaround and lost frames at one rate.
//!
//! Each request is an echo (08/00) with a unique number, so that a late or repeated reply is not mistaken for the
//! reply to the next request. The *turnaround* is the silence between request and reply; the unit must not answer
//! before t3.5. Where the endpoint's time is exact, the turnaround is measured. Elsewhere it is the time of the whole
//! exchange minus the time of its characters, so it includes the delays of the adapter and the operating system.

use std::fmt;
use std::time::Duration;

use modbus_line::LineFormat;
use register_map::state;
use serde_json::{Value, json};

use super::timing::silence;
use crate::case::{Case, Check, Failure, Need, Part, Stop, parts, skip};
use crate::endpoint::{Broken, Piece};
use crate::frame::Reply;
use crate::hil::spread::Spread;
use crate::points::pdu;
use crate::rate::tour;
use crate::tester::Tester;

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    parts("timing/each-rate", "V1.02 2.5.1.1", "every request gets one reply, the right one, and not before t3.5",
        &[Need::Modio, Need::Rtu, Need::Requests], each_rate),
];

/// The unit address of recovery mode, in which the line has a fixed rate.
const RECOVERY: u8 = 255;

/// Bits of the unit's status: settings are not saved, or not in force.
const UNSETTLED: u16 = state::status::UNSAVED | state::status::RESTART_NEEDED;

/// Number of requests in a row without a reply after which the measurement ends.
const GIVE_UP: u32 = 20;

/// Measures at each rate, and restores the rate.
fn each_rate(tester: &mut Tester<'_>, done: &mut dyn FnMut(Part)) -> Check {
    let home = tester.endpoint.line();
    let stops = lines(tester);
    if stops.iter().any(|line| *line != home) {
        may_change_rate(tester, home)?;
    }
    let toured = tour(tester, stops, |tester| {
        tester.go_on()?;
        let name = tester.endpoint.line().to_string();
        done(tester.part(name, |tester, part| {
            let tally = measure(tester)?;
            part.note = tally.to_string();
            part.measured = tally.json();
            tally.judge(tester.target.hil.limit)
        })?);
        Ok(())
    });
    let here = tester.endpoint.line();
    match toured {
        Err(why) if here != home => Err(Stop::Broken(Broken(format!(
            "the unit could not be set back to {home}; it last answered at {here}: {why}"
        )))),
        // The port does not have a rate that the user asks for.
        Err(Stop::Skip(why)) if tester.go_on().is_ok() => Err(Stop::Broken(Broken(why))),
        toured => toured,
    }
}

/// Returns the rates to measure at.
fn lines(tester: &Tester<'_>) -> Vec<LineFormat> {
    let home = tester.endpoint.line();
    let rates = tester.target.hil.rates.iter();
    match rates
        .map(|baud| LineFormat {
            baud: *baud,
            ..home
        })
        .collect()
    {
        none if Vec::is_empty(&none) => vec![home],
        lines => lines,
    }
}

/// Returns the shortest time that the requests take, all rates together.
pub fn least(tester: &Tester<'_>) -> Duration {
    let frame = tester.frame(&echo(0)).len();
    let once = |line: &LineFormat| line.characters(2 * frame) + line.t35() * 2;
    let each: Duration = lines(tester).iter().map(once).sum();
    each * tester.target.hil.requests
}

/// Checks that this unit's rate can be changed and restored without side effects.
fn may_change_rate(tester: &mut Tester<'_>, home: LineFormat) -> Check {
    let refused = |why: String| Err(Stop::Broken(Broken(format!("--rates: {why}"))));
    if !tester.endpoint.abilities().set_line {
        return refused("the line must be a serial port: a socket has no rate".to_owned());
    }
    if tester.unit() == RECOVERY {
        return refused("in recovery mode the unit stays at 9600 8N2".to_owned());
    }
    let status = tester.read_word(state::STATUS)?;
    if status & UNSETTLED != 0 {
        return refused(format!(
            "the unit has settings that are not saved, or that wait for a restart (status {status:#06x}): \
             save or drop them, or restart the unit, so that it can be set back to {home}"
        ));
    }
    Ok(())
}

/// The result of the requests at one rate.
#[derive(Clone, Debug)]
struct Tally {
    /// Rate and format.
    line: LineFormat,
    /// Requests sent.
    sent: u32,
    /// Requests without a reply.
    lost: u32,
    /// Wrong replies.
    wrong: u32,
    /// Whether the measurement ended early because too many requests in a row were lost.
    given_up: bool,
    /// The first exchange that failed.
    example: Option<Failure>,
    /// The turnarounds of the exchanges that succeeded.
    spread: Option<Spread>,
    /// The shortest turnaround that is allowed: t3.5, or the unit's FRAME_GAP.
    least: Duration,
}

/// Resolution of the measured turnarounds.
const TOLERANCE: Duration = Duration::from_micros(1);

fn echo(number: u16) -> Vec<u8> {
    pdu(8, 0, number)
}

/// Sends the requests, each as soon as the line allows. Ends early when the user ends the run.
fn measure(tester: &mut Tester<'_>) -> Check<Tally> {
    let requests = tester.target.hil.requests;
    let line = tester.endpoint.line();
    let mut tally = Tally {
        line,
        sent: 0,
        lost: 0,
        wrong: 0,
        given_up: false,
        example: None,
        spread: None,
        least: silence(tester)?,
    };
    let mut times = Vec::new();
    let mut lost_in_a_row = 0;
    while tally.sent < requests && tester.go_on().is_ok() {
        let request = echo(tally.sent as u16);
        let frame = tester.frame(&request);
        let length = frame.len();
        let begin = tester.endpoint.now();
        let reply = tester.exchange_until(&[Piece::Bytes(frame)], length)?;
        tally.sent += 1;
        let lost = reply == Reply::Silence;
        lost_in_a_row = if lost { lost_in_a_row + 1 } else { 0 };
        if reply == Reply::Pdu(request) {
            if let Some(last) = tester.received.last() {
                let whole = begin + line.characters(2 * length);
                times.push(tester.exact(tester.turnaround(), last.end.saturating_sub(whole)));
            }
        } else {
            tally.lost += u32::from(lost);
            tally.wrong += u32::from(!lost);
            if let (None, Err(Stop::Fail(failure))) =
                (&tally.example, tester.fail::<()>("the request, echoed"))
            {
                tally.example = Some(failure);
            }
        }
        if lost_in_a_row == GIVE_UP {
            tally.given_up = true;
            break;
        }
        tester.rest(line.t35())?;
    }
    tally.spread = Spread::of(times);
    Ok(tally)
}

impl Tally {
    /// Fails unless every request got its reply, no reply was early, and 99 of 100 turnarounds are within the limit, if
    /// there is a limit.
    fn judge(&self, limit: Option<Duration>) -> Check {
        let bad = |came: String, wanted: String| {
            Err(Stop::Fail(Failure {
                sent: format!("{} requests at {}", self.sent, self.line),
                came,
                wanted,
            }))
        };
        if self.lost + self.wrong > 0 {
            let first = self.example.as_ref();
            let first = first.map_or_else(String::new, |first| {
                format!(", the first to {}: {}", first.sent, first.came)
            });
            let came = format!("{} lost, {} wrong{first}", self.lost, self.wrong);
            return bad(came, "a right reply to each".to_owned());
        }
        let Some(spread) = &self.spread else {
            return skip("interrupted before the first reply");
        };
        let [shortest, most] = [0, 99].map(|percent| spread.percentile(percent));
        if shortest + TOLERANCE < self.least {
            let wanted = format!("{:?} at least: t3.5, or FRAME_GAP", self.least);
            return bad(format!("a turnaround of {shortest:?}"), wanted);
        }
        match limit.filter(|limit| most > *limit) {
            Some(limit) => bad(
                format!("a turnaround of {most:?} at the 99th percentile"),
                format!("{limit:?} at most"),
            ),
            None => Ok(()),
        }
    }

    fn json(&self) -> Value {
        let turnaround = self.spread.as_ref().map(|spread| {
            let us = |percent| spread.percentile(percent).as_micros() as u64;
            json!({
                "min": us(0), "median": us(50), "p95": us(95), "p99": us(99), "max": us(100),
            })
        });
        json!({
            "line": self.line.to_string(),
            "baud": self.line.baud,
            "sent": self.sent,
            "lost": self.lost,
            "wrong": self.wrong,
            "turnaround_us": turnaround,
            "t35_us": self.line.t35().as_micros() as u64,
        })
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            sent, lost, wrong, ..
        } = self;
        write!(f, "{sent} sent, {lost} lost, {wrong} wrong")?;
        if self.given_up {
            write!(f, "; given up after {GIVE_UP} in a row without a reply")?;
        }
        let Some(spread) = &self.spread else {
            return Ok(());
        };
        let at = |percent| spread.percentile(percent).as_secs_f64() * 1000.0;
        writeln!(
            f,
            "\nturnaround in ms: min {:.3}, median {:.3}, p95 {:.3}, p99 {:.3}, max {:.3} (t3.5 is {:.3})",
            at(0),
            at(50),
            at(95),
            at(99),
            at(100),
            self.line.t35().as_secs_f64() * 1000.0
        )?;
        f.write_str(spread.histogram().trim_end())
    }
}
