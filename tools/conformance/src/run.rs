//! Runs cases one after another, skips those that do not apply, and leaves the unit as it was.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use modbus_line::Parity;
use register_map::codes::Command;
use register_map::configuration::COMMAND;
use serde_json::Value;

use crate::case::{Case, Failure, Need, Part, Run, Stop};
use crate::endpoint::{Broken, Endpoint};
use crate::frame::Mode;
use crate::points::pdu;
use crate::target::{Support, Target};
use crate::tester::Tester;

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

/// The result of a case, or of a part of it.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The case.
    pub case: Case,
    /// The name: that of the case, in which that of a part replaces what is behind the slash.
    pub name: String,
    /// How it ended.
    pub verdict: Verdict,
    /// What was measured, for people; it may have several lines.
    pub note: String,
    /// What was measured, for programs.
    pub measured: Value,
    /// How long it took by the endpoint's clock.
    pub time: Duration,
    /// Number of due replies that were missing, so that the request was repeated.
    pub asked_again: u32,
}

impl Outcome {
    /// Returns the result of a case that has no parts.
    pub fn of(case: Case, verdict: Verdict, time: Duration, asked_again: u32) -> Self {
        Self {
            case,
            name: case.name.to_owned(),
            verdict,
            note: String::new(),
            measured: Value::Null,
            time,
            asked_again,
        }
    }

    fn of_part(case: Case, part: Part) -> Self {
        let (group, _) = case.name.split_once('/').unwrap_or_default();
        let verdict = part
            .result
            .map_or_else(Verdict::Failed, |()| Verdict::Passed);
        Self {
            name: format!("{group}/{}", part.name),
            note: part.note,
            measured: part.measured,
            ..Self::of(case, verdict, part.time, 0)
        }
    }
}

/// Runs these cases.
pub fn run(
    endpoint: &mut dyn Endpoint,
    target: &Target,
    cases: &[Case],
) -> Result<Vec<Outcome>, Broken> {
    let mut outcomes = Vec::new();
    let never = AtomicBool::new(false);
    run_until(endpoint, target, cases, &never, |_| {}, &mut outcomes)?;
    Ok(outcomes)
}

/// Runs these cases until `stop` is set. A case that has begun then also ends and restores the unit. Adds each outcome to
/// `outcomes`, and calls `report` with it. When the endpoint no longer works, `outcomes` has the outcomes up to then.
pub fn run_until(
    endpoint: &mut dyn Endpoint,
    target: &Target,
    cases: &[Case],
    stop: &AtomicBool,
    mut report: impl FnMut(&Outcome),
    outcomes: &mut Vec<Outcome>,
) -> Result<(), Broken> {
    let mut done = |outcome: Outcome| {
        report(&outcome);
        outcomes.push(outcome);
    };
    let mut edits = false;
    for case in cases {
        if stop.load(Ordering::Relaxed) {
            break;
        }
        let lacking = case
            .needs
            .iter()
            .find_map(|need| lacking(*need, endpoint, target));
        match lacking {
            Some(why) => done(Outcome::of(*case, Verdict::Skipped(why), Duration::ZERO, 0)),
            None => {
                let mut needs = case.needs.iter();
                edits |= needs.any(|need| matches!(need, Need::Config | Need::Words));
                let mut tester = Tester::new(endpoint, target);
                tester.stop = stop;
                one(tester, case, &mut done)?;
            }
        }
    }
    if edits && target.allow_config && target.modio.is_some() {
        // Settings that cases have changed and restored still count as unsaved changes. Drop these changes.
        let mut tester = Tester::new(endpoint, target);
        if tester.unlock().is_ok() {
            let drop_changes = pdu(6, COMMAND, Command::DropChanges.code());
            // A failure is harmless: every case has restored what it changed.
            let _ = tester.ask(&drop_changes);
        }
    }
    Ok(())
}

/// Runs a case, and calls `done` with its outcome, or with those of its parts. A case that has parts gets a further outcome
/// when it did not come to its end.
fn one(mut tester: Tester<'_>, case: &Case, done: &mut dyn FnMut(Outcome)) -> Result<(), Broken> {
    let begin = tester.endpoint.now();
    let writes = case
        .needs
        .iter()
        .any(|need| matches!(need, Need::Bits | Need::Words));
    let locked = case.needs.contains(&Need::Words) && tester.target.words.is_some_and(|w| w.locked);
    let mut before = None;
    let result = (|| {
        if case.needs.contains(&Need::LockClosed) {
            tester.wait_for_lock()?;
        }
        if locked {
            tester.unlock()?;
        }
        if writes {
            before = Some(tester.snapshot()?);
        }
        match case.run {
            Run::Whole(run) => run(&mut tester),
            Run::Parts(run) => run(&mut tester, &mut |part| done(Outcome::of_part(*case, part))),
        }
    })();
    let restored = match &before {
        Some(before) => tester.restore(before),
        None => Ok(()),
    };
    let complaints = tester.endpoint.take_complaints()?;
    let verdict = match result.and(restored) {
        Ok(()) if !complaints.is_empty() => Verdict::Failed(Failure {
            sent: case.about.to_owned(),
            came: complaints.join("; "),
            wanted: "no action of the firmware that a real part does not allow".to_owned(),
        }),
        Ok(()) if matches!(case.run, Run::Parts(_)) => return Ok(()),
        Ok(()) => Verdict::Passed,
        Err(Stop::Skip(why)) => Verdict::Skipped(why),
        Err(Stop::Fail(failure)) => Verdict::Failed(failure),
        Err(Stop::Broken(broken)) => return Err(broken),
    };
    let time = tester.endpoint.now().saturating_sub(begin);
    done(Outcome::of(*case, verdict, time, tester.asked_again));
    Ok(())
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
        Need::Requests | Need::Wires | Need::Pulses | Need::AnalogWires => {
            return need.unmet(&target.hil).map(str::to_owned);
        }
    };
    (!met).then(|| why.to_owned())
}
