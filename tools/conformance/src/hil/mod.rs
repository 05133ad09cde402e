//! A board on a bench: the whole suite, then how soon and how surely it answers at each rate, then the
//! wires that lead from outputs to inputs. Behind the command `modio-hil`, which `cargo xtask hil` runs.
//!
//! ```text
//! cli, setup  the command                 timing   requests at one rate: turnaround, lost frames
//! bench_file  the hardware of the bench   spread   minimum, percentiles, histogram
//! shell       flash, reset, power         about    unit, adapter, host, date
//! wires       digital wires, pulses       report   JUnit and JSON
//! analog      analog wires                remote   asks any unit on the line
//! ```
//!
//! The unit is left as it was found: rate, outputs, configuration; also when a step fails and when the run
//! is interrupted.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use register_map::{Module, state};

use crate::bench::{Bench, Patience};
use crate::case::{Case, Check, Failure, Stop};
use crate::endpoint::Endpoint;
use crate::frame::Mode;
use crate::line::LineFormat;
use crate::probe::{Given, probe};
use crate::rate::tour;
use crate::report::table;
use crate::run::{Options, Verdict, run_while};

pub mod about;
pub mod analog;
pub mod bench_file;
pub mod cli;
#[cfg(test)]
mod fake;
mod remote;
pub mod report;
pub mod setup;
pub mod shell;
pub mod spread;
pub mod timing;
pub mod wires;

use bench_file::{Analog, Wire};
use report::{Finding, Report};

/// The unit address of loader mode, in which the line has its own rate, whatever is stored.
const LOADER: u8 = 255;

/// The bits of the unit's status that say that its settings are not those stored, or not in force.
const UNSETTLED: u16 = 1 << 3 | 1 << 4;

/// What to do on the bench.
#[derive(Clone)]
pub struct Plan {
    /// The unit's address.
    pub unit: u8,
    /// The module that must be in its first slot; `None`: any.
    pub module: Option<Module>,
    /// How long to wait.
    pub patience: Patience,
    /// Whether cases may write the unit's configuration.
    pub allow_config: bool,
    /// The cases to run; none: no suite.
    pub cases: Vec<Case>,
    /// Requests at each rate; 0: no timing.
    pub requests: u32,
    /// The rates to measure at, in bit/s; none: the present one.
    pub rates: Vec<u32>,
    /// The longest turnaround that 99 of 100 requests may have; `None`: it is only told.
    pub limit: Option<Duration>,
    /// Digital outputs wired to digital inputs.
    pub wires: Vec<Wire>,
    /// Analog outputs wired to analog inputs.
    pub analog: Vec<Analog>,
}

/// Does it; `tell` hears each line for people as it comes. What has been found up to an error stands in
/// the report.
///
/// # Errors
///
/// Why it cannot go on, in one line: no answer, another device or module, an endpoint that is gone, a unit that
/// could not be brought back.
pub fn run(
    endpoint: &mut dyn Endpoint,
    plan: &Plan,
    stop: &AtomicBool,
    report: &mut Report,
    tell: &mut dyn FnMut(&str),
) -> Result<(), String> {
    let given = Given {
        unit: plan.unit,
        mode: Mode::Rtu,
        patience: plan.patience,
        profile: None,
        allow_config: plan.allow_config,
    };
    let (target, patience) = probe(endpoint, &given)?;
    report.endpoint = endpoint.name();
    let modio = target
        .modio
        .ok_or_else(|| format!("unit {} is no modio", plan.unit))?;
    let module = modio.module();
    if let Some(wanted) = plan.module.filter(|wanted| *wanted != module) {
        return Err(format!(
            "unit {} has the module {module} in force, but the bench has {wanted}",
            plan.unit
        ));
    }
    let mut bench = Bench::new(endpoint, &target, patience, plan.allow_config);
    report.about.unit = Some(about::Unit::ask(&mut bench, modio).map_err(told)?);
    tell(&report.endpoint);
    for (name, value) in report.about.properties() {
        tell(&format!("{name}: {value}"));
    }
    let go_on = || !stop.load(Ordering::Relaxed);

    if !plan.cases.is_empty() {
        tell(&format!("\nconformance: {} cases", plan.cases.len()));
        let options = Options {
            patience,
            allow_config: plan.allow_config,
        };
        run_while(
            endpoint,
            &target,
            options,
            &plan.cases,
            go_on,
            |outcome| tell(&table::row(outcome)),
            &mut report.outcomes,
        )
        .map_err(|broken| broken.to_string())?;
        tell(&table::summary(&report.outcomes));
    }
    let mut bench = Bench::new(endpoint, &target, patience, plan.allow_config);
    if plan.requests > 0 && go_on() {
        timing_at_each_rate(&mut bench, plan, stop, report, tell)?;
    }
    let wires = plan.wires.len() + plan.analog.len();
    if wires > 0 && go_on() {
        tell(&format!("\nwires: {wires}"));
    }
    let mut finding = |finding: Finding| {
        tell(&finding.to_string());
        report.findings.push(finding);
    };
    if !plan.wires.is_empty() && go_on() {
        wires::run(&mut bench, &plan.wires, stop, &mut finding).map_err(told)?;
    }
    if !plan.analog.is_empty() && go_on() {
        analog::run(&mut bench, &plan.analog, stop, &mut finding).map_err(told)?;
    }
    report.interrupted = !go_on();
    Ok(())
}

fn timing_at_each_rate(
    bench: &mut Bench<'_>,
    plan: &Plan,
    stop: &AtomicBool,
    report: &mut Report,
    tell: &mut dyn FnMut(&str),
) -> Result<(), String> {
    let home = bench.endpoint.line();
    let at = |baud: &u32| LineFormat {
        baud: *baud,
        ..home
    };
    let stops: Vec<LineFormat> = match plan.rates.as_slice() {
        [] => vec![home],
        rates => rates.iter().map(at).collect(),
    };
    if stops.iter().any(|line| *line != home) {
        may_change_rate(bench, home)?;
    }
    let mut interrupted = false;
    let toured = tour(bench, stops, |bench| {
        if stop.load(Ordering::Relaxed) {
            interrupted = true;
            return Err(Stop::Skip("interrupted".to_owned()));
        }
        let line = bench.endpoint.line();
        let least = timing::least(bench, plan.requests).as_secs();
        tell(&format!(
            "\ntiming at {line}: {} requests, {least} s or more",
            plan.requests
        ));
        let begin = bench.endpoint.now();
        let tally = timing::measure(bench, plan.requests, stop)?;
        tell(&tally.to_string());
        report.findings.push(Finding {
            name: format!("timing/{line}"),
            about: "every request is answered, once and rightly".to_owned(),
            note: String::new(),
            verdict: tally.verdict(plan.limit),
            time: bench.endpoint.now().saturating_sub(begin),
        });
        report.timing.push(tally);
        Ok(())
    });
    let here = bench.endpoint.line();
    match toured {
        Err(Stop::Skip(_)) if interrupted && here == home => Ok(()),
        Ok(()) => Ok(()),
        Err(stop) if here == home => Err(told(stop)),
        Err(stop) => Err(format!(
            "the unit could not be brought back to {home}, it was heard last at {here}: {}",
            told(stop)
        )),
    }
}

/// Whether this unit's rate can be changed and put back without harm.
fn may_change_rate(bench: &mut Bench<'_>, home: LineFormat) -> Result<(), String> {
    if !bench.endpoint.abilities().set_line {
        return Err("--rates needs a serial port: a socket has no rate".to_owned());
    }
    if bench.unit() == LOADER {
        return Err("--rates: in loader mode the unit stays at 9600 8N2".to_owned());
    }
    let status = bench.read_word(state::STATUS).map_err(told)?;
    if status & UNSETTLED != 0 {
        return Err(format!(
            "--rates: the unit has settings that are not saved, or wait for a restart (status {status:#06x}): \
             save or drop them, or restart it, so that it can be brought back to {home} as it is"
        ));
    }
    Ok(())
}

/// What stopped a step, in one line.
fn told(stop: Stop) -> String {
    match stop {
        Stop::Broken(broken) => broken.to_string(),
        Stop::Skip(why) => why,
        Stop::Fail(failure) => failed(&failure),
    }
}

fn failed(failure: &Failure) -> String {
    format!(
        "to {} came {}; wanted: {}",
        failure.sent, failure.came, failure.wanted
    )
}

/// A failure of a step becomes a verdict; an endpoint that is gone does not.
fn verdict(result: Check) -> Result<Verdict, Stop> {
    match result {
        Ok(()) => Ok(Verdict::Passed),
        Err(Stop::Fail(failure)) => Ok(Verdict::Failed(failure)),
        Err(Stop::Skip(why)) => Ok(Verdict::Skipped(why)),
        Err(broken @ Stop::Broken(_)) => Err(broken),
    }
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod wire_tests;
