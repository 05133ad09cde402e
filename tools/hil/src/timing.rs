//! Turnaround and lost frames at one rate.
//!
//! Each request is an echo (08/00) with a unique number, so that a late or repeated reply is not mistaken for the
//! reply to the next request. The *turnaround* is the silence between request and reply; the unit must not answer
//! before t3.5. Where the endpoint's time is exact, the turnaround is measured. Elsewhere it is the time of the whole
//! exchange minus the time of its characters, so it includes the delays of the adapter and the operating system.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use modbus_line::LineFormat;

use crate::spread::Spread;
use conformance::bench::Bench;
use conformance::case::{Check, Failure};
use conformance::cases::timing::silence;
use conformance::endpoint::Piece;
use conformance::frame::Reply;
use conformance::points::pdu;
use conformance::run::Verdict;

/// Number of requests in a row without a reply after which the measurement ends.
const GIVE_UP: u32 = 20;

/// The result of the requests at one rate.
#[derive(Clone, Debug)]
pub struct Tally {
    /// Rate and format.
    pub line: LineFormat,
    /// Requests sent.
    pub sent: u32,
    /// Requests without a reply.
    pub lost: u32,
    /// Wrong replies.
    pub wrong: u32,
    /// Whether the measurement ended early because too many requests in a row were lost.
    pub given_up: bool,
    /// The first exchange that failed.
    pub example: Option<Failure>,
    /// The turnarounds of the exchanges that succeeded.
    pub spread: Option<Spread>,
    /// The shortest turnaround that is allowed: t3.5, or the unit's FRAME_GAP.
    pub least: Duration,
}

/// Resolution of the measured turnarounds.
const TOLERANCE: Duration = Duration::from_micros(1);

/// Returns the shortest time that this number of requests takes at the line's rate.
pub fn least(bench: &Bench<'_>, requests: u32) -> Duration {
    let line = bench.endpoint.line();
    let frame = bench.frame(&echo(0)).len();
    (line.characters(2 * frame) + line.t35() * 2) * requests
}

fn echo(number: u16) -> Vec<u8> {
    pdu(8, 0, number)
}

/// Sends this number of requests, each as soon as the line allows. Ends early when `stop` is set.
pub fn measure(bench: &mut Bench<'_>, requests: u32, stop: &AtomicBool) -> Check<Tally> {
    let line = bench.endpoint.line();
    let mut tally = Tally {
        line,
        sent: 0,
        lost: 0,
        wrong: 0,
        given_up: false,
        example: None,
        spread: None,
        least: silence(bench)?,
    };
    let mut times = Vec::new();
    let mut lost_in_a_row = 0;
    while tally.sent < requests && !stop.load(Ordering::Relaxed) {
        let request = echo(tally.sent as u16);
        let frame = bench.frame(&request);
        let length = frame.len();
        let begin = bench.endpoint.now();
        let reply = bench.exchange_until(&[Piece::Bytes(frame)], length)?;
        tally.sent += 1;
        let lost = reply == Reply::Silence;
        lost_in_a_row = if lost { lost_in_a_row + 1 } else { 0 };
        if reply == Reply::Pdu(request) {
            if let Some(last) = bench.received.last() {
                let whole = begin + line.characters(2 * length);
                times.push(bench.exact(bench.turnaround(), last.end.saturating_sub(whole)));
            }
        } else {
            tally.lost += u32::from(lost);
            tally.wrong += u32::from(!lost);
            if let (None, Err(conformance::case::Stop::Fail(failure))) =
                (&tally.example, bench.fail::<()>("the request, echoed"))
            {
                tally.example = Some(failure);
            }
        }
        if lost_in_a_row == GIVE_UP {
            tally.given_up = true;
            break;
        }
        bench.rest(line.t35())?;
    }
    tally.spread = Spread::of(times);
    Ok(tally)
}

impl Tally {
    /// Passes when every request got its reply, no reply was early, and 99 of 100 turnarounds are within the limit, if
    /// there is a limit.
    pub fn verdict(&self, limit: Option<Duration>) -> Verdict {
        let bad = |came: String, wanted: String| {
            Verdict::Failed(Failure {
                sent: format!("{} requests at {}", self.sent, self.line),
                came,
                wanted,
            })
        };
        if self.lost + self.wrong > 0 {
            let first = self.example.as_ref();
            let first = first.map_or_else(String::new, |first| {
                format!(", the first to {}: {}", first.sent, first.came)
            });
            let came = format!("{} lost, {} wrong{first}", self.lost, self.wrong);
            return bad(came, "a right reply to each".to_owned());
        }
        let shortest = self.spread.as_ref().map(|spread| spread.percentile(0));
        if let Some(shortest) = shortest.filter(|time| *time + TOLERANCE < self.least) {
            let wanted = format!("{:?} at least: t3.5, or FRAME_GAP", self.least);
            return bad(format!("a turnaround of {shortest:?}"), wanted);
        }
        match (&self.spread, limit) {
            (None, _) => Verdict::Skipped("interrupted before the first reply".to_owned()),
            (Some(spread), Some(limit)) if spread.percentile(99) > limit => {
                let time = spread.percentile(99);
                let came = format!("a turnaround of {time:?} at the 99th percentile");
                bad(came, format!("{limit:?} at most"))
            }
            (Some(_), _) => Verdict::Passed,
        }
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
