//! Runs cases one after another, skips those that do not apply, and leaves the unit as it was.

use std::time::Duration;

use modbus_line::Parity;
use register_map::codes::Command;
use register_map::configuration::COMMAND;

use crate::bench::Bench;
use crate::case::{Case, Failure, Need, Stop};
use crate::endpoint::{Broken, Endpoint};
use crate::frame::Mode;
use crate::points::pdu;
use crate::target::{Support, Target};

/// How a case ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The unit did what the case demands.
    Passed,
    /// The case does not apply here: the reason.
    Skipped(String),
    /// The unit made a mistake.
    Failed(Failure),
}

/// The result of a case.
#[derive(Clone)]
pub struct Outcome {
    /// The case.
    pub case: Case,
    /// How it ended.
    pub verdict: Verdict,
    /// How long it took by the endpoint's clock.
    pub time: Duration,
    /// Number of due replies that were missing, so that the request was repeated.
    pub asked_again: u32,
}

/// Runs these cases.
pub fn run(
    endpoint: &mut dyn Endpoint,
    target: &Target,
    cases: &[Case],
) -> Result<Vec<Outcome>, Broken> {
    let mut outcomes = Vec::new();
    run_while(endpoint, target, cases, || true, |_| {}, &mut outcomes)?;
    Ok(outcomes)
}

/// Runs these cases until `go_on` returns false. `go_on` is called before each case, so a case that has begun also ends
/// and restores the unit. Adds each outcome to `outcomes`, and calls `report` with it. When the endpoint no longer
/// works, `outcomes` has the outcomes up to then.
pub fn run_while(
    endpoint: &mut dyn Endpoint,
    target: &Target,
    cases: &[Case],
    mut go_on: impl FnMut() -> bool,
    mut report: impl FnMut(&Outcome),
    outcomes: &mut Vec<Outcome>,
) -> Result<(), Broken> {
    for case in cases {
        if !go_on() {
            break;
        }
        let begin = endpoint.now();
        let lacking = case
            .needs
            .iter()
            .find_map(|need| lacking(*need, endpoint, target));
        let (verdict, asked_again) = match lacking {
            Some(why) => (Verdict::Skipped(why), 0),
            None => one(endpoint, target, case)?,
        };
        let outcome = Outcome {
            case: *case,
            verdict,
            time: endpoint.now().saturating_sub(begin),
            asked_again,
        };
        report(&outcome);
        outcomes.push(outcome);
    }
    if target.allow_config && target.modio.is_some() {
        // Settings that cases have changed and restored still count as unsaved changes. Drop these changes.
        let mut bench = Bench::new(endpoint, target);
        if bench.unlock().is_ok() {
            let drop_changes = pdu(6, COMMAND, Command::DropChanges.code());
            // A failure is harmless: every case has restored what it changed.
            let _ = bench.ask(&drop_changes);
        }
    }
    Ok(())
}

fn one(
    endpoint: &mut dyn Endpoint,
    target: &Target,
    case: &Case,
) -> Result<(Verdict, u32), Broken> {
    let mut bench = Bench::new(endpoint, target);
    let writes = case
        .needs
        .iter()
        .any(|need| matches!(need, Need::Bits | Need::Words));
    let locked = case.needs.contains(&Need::Words) && target.words.is_some_and(|w| w.locked);
    let mut before = None;
    let result = (|| {
        if case.needs.contains(&Need::LockClosed) {
            bench.wait_for_lock()?;
        }
        if locked {
            bench.unlock()?;
        }
        if writes {
            before = Some(bench.snapshot()?);
        }
        (case.run)(&mut bench)
    })();
    let restored = match &before {
        Some(before) => bench.restore(before),
        None => Ok(()),
    };
    let complaints = bench.endpoint.take_complaints()?;
    let verdict = match result.and(restored) {
        Ok(()) if complaints.is_empty() => Verdict::Passed,
        Ok(()) => Verdict::Failed(Failure {
            sent: case.about.to_owned(),
            came: complaints.join("; "),
            wanted: "no action of the firmware that a real part does not allow".to_owned(),
        }),
        Err(Stop::Skip(why)) => Verdict::Skipped(why),
        Err(Stop::Fail(failure)) => Verdict::Failed(failure),
        Err(Stop::Broken(broken)) => return Err(broken),
    };
    Ok((verdict, bench.asked_again))
}

/// Returns the reason why a need is not met, if it is not met.
fn lacking(need: Need, endpoint: &dyn Endpoint, target: &Target) -> Option<String> {
    let able = endpoint.abilities();
    let (met, why) = match need {
        Need::Function(function) => {
            let how = match target.functions.get(&function) {
                Some(Support::Yes) => return None,
                Some(Support::Silent) => "is silent to",
                _ => "answers 01 to",
            };
            return Some(format!("the unit {how} function {function:02X}"));
        }
        Need::Readable(function) => {
            if target.longest(function).is_some() {
                return None;
            }
            return Some(format!("nothing to read by function {function:02X}"));
        }
        Need::Bits => (target.bits.is_some(), "no coil to write to"),
        Need::Words => (
            target.words.is_some(),
            "no register to write to (on a modio, --allow-config gives some)",
        ),
        Need::Exact => (
            able.exact,
            "the endpoint's time is not exact: its silences last 100 ms or more",
        ),
        Need::Faults => (able.faults, "the endpoint cannot send damaged characters"),
        Need::Parity => (
            endpoint.line().format.parity != Parity::None,
            "the line has no parity",
        ),
        Need::Power => (able.power, "the endpoint cannot switch the power"),
        Need::Driver => (able.driver, "the endpoint does not record the driver"),
        Need::CharacterTime => (
            able.character_time,
            "characters have no duration on the endpoint's line",
        ),
        Need::StartBit => (
            able.start_bit,
            "the unit detects a character here at its end, not at its start bit",
        ),
        Need::Echo => (able.echo, "the endpoint has no echo to switch"),
        Need::SetLine => (able.set_line, "the endpoint cannot change rate and format"),
        Need::Config => (
            target.allow_config,
            "writes the configuration: --allow-config",
        ),
        // The run waits for it.
        Need::LockClosed => return None,
        Need::Modio => (target.modio.is_some(), "about the modio only"),
        Need::Rtu => (target.mode == Mode::Rtu, "about RTU framing"),
        Need::Ascii => (target.mode == Mode::Ascii, "about ASCII framing: --ascii"),
    };
    (!met).then(|| why.to_owned())
}
