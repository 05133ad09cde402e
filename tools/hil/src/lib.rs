//! Tests a board on a bench: the whole suite, then the turnaround and the lost frames at each rate, then the wires that
//! connect outputs to inputs. The command `modio-hil`, which `cargo xtask hil` runs, uses this crate.
//!
//! ```text
//! cli, setup  the command                 timing   requests at one rate: turnaround, lost frames
//! bench_file  the hardware of the bench   spread   minimum, percentiles, histogram
//! shell       flash, reset, power         about    unit, adapter, host, date
//! wires       digital wires, pulses       report   JUnit and JSON
//! analog      analog wires                remote   asks any unit on the line
//! ```
//!
//! The rate, the outputs and the configuration of the unit are restored at the end, also when a step fails or the run
//! is interrupted.

#![forbid(unsafe_code)]

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Context as _, Error, Result, bail};
use modbus_line::LineFormat;
use register_map::{Module, state};

use conformance::bench::Bench;
use conformance::case::{Case, Check, Stop, skip};
use conformance::endpoint::Endpoint;
use conformance::frame::Mode;
use conformance::probe::{Given, probe};
use conformance::rate::tour;
use conformance::report::table;
use conformance::run::{Verdict, run_while};
use conformance::target::Patience;

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

/// The unit address of recovery mode, in which the line has a fixed rate.
const RECOVERY: u8 = 255;

/// Bits of the unit's status: settings are not saved, or not in force.
const UNSETTLED: u16 = 1 << 3 | 1 << 4;

/// The tests to run on the bench.
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
    /// The cases to run. If empty, the suite is left out.
    pub cases: Vec<Case>,
    /// Requests at each rate; 0: no timing.
    pub requests: u32,
    /// The rates to measure at, in bit/s; none: the present one.
    pub rates: Vec<u32>,
    /// The longest turnaround that 99 of 100 requests may have; `None`: the turnaround is only reported.
    pub limit: Option<Duration>,
    /// Digital outputs wired to digital inputs.
    pub wires: Vec<Wire>,
    /// Analog outputs wired to analog inputs.
    pub analog: Vec<Analog>,
}

/// Carries out the plan. Calls `print` with each line for people. The report has all results up to an error.
///
/// # Errors
///
/// Why the run cannot continue: no answer, another device or module, an endpoint that no longer works, a unit whose
/// rate could not be restored.
pub fn run(
    endpoint: &mut dyn Endpoint,
    plan: &Plan,
    stop: &AtomicBool,
    report: &mut Report,
    print: &mut dyn FnMut(&str),
) -> Result<()> {
    let given = Given {
        unit: plan.unit,
        mode: Mode::Rtu,
        patience: plan.patience,
        profile: None,
        allow_config: plan.allow_config,
    };
    let target = probe(endpoint, &given)?;
    report.endpoint = endpoint.name();
    let unit = plan.unit;
    let modio = target
        .modio
        .with_context(|| format!("unit {unit} is not a modio"))?;
    let module = modio.module();
    if let Some(wanted) = plan.module.filter(|wanted| *wanted != module) {
        bail!("unit {unit} has the module {module} in force, but the bench has {wanted}");
    }
    let mut bench = Bench::new(endpoint, &target);
    report.about.unit = Some(about::Unit::ask(&mut bench, modio)?);
    print(&report.endpoint);
    for (name, value) in report.about.properties() {
        print(&format!("{name}: {value}"));
    }
    let go_on = || !stop.load(Ordering::Relaxed);

    if !plan.cases.is_empty() {
        print(&format!("\nconformance: {} cases", plan.cases.len()));
        run_while(
            endpoint,
            &target,
            &plan.cases,
            go_on,
            |outcome| print(&table::row(outcome)),
            &mut report.outcomes,
        )?;
        print(&table::summary(&report.outcomes));
    }
    let mut bench = Bench::new(endpoint, &target);
    if plan.requests > 0 && go_on() {
        timing_at_each_rate(&mut bench, plan, stop, report, print)?;
    }
    let wires = plan.wires.len() + plan.analog.len();
    if wires > 0 && go_on() {
        print(&format!("\nwires: {wires}"));
    }
    let mut finding = |finding: Finding| {
        print(&finding.to_string());
        report.findings.push(finding);
    };
    if !plan.wires.is_empty() && go_on() {
        wires::run(&mut bench, &plan.wires, stop, &mut finding)?;
    }
    if !plan.analog.is_empty() && go_on() {
        analog::run(&mut bench, &plan.analog, stop, &mut finding)?;
    }
    report.interrupted = !go_on();
    Ok(())
}

fn timing_at_each_rate(
    bench: &mut Bench<'_>,
    plan: &Plan,
    stop: &AtomicBool,
    report: &mut Report,
    print: &mut dyn FnMut(&str),
) -> Result<()> {
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
            return skip("interrupted");
        }
        let line = bench.endpoint.line();
        let least = timing::least(bench, plan.requests).as_secs();
        print(&format!(
            "\ntiming at {line}: {} requests, {least} s or more",
            plan.requests
        ));
        let begin = bench.endpoint.now();
        let tally = timing::measure(bench, plan.requests, stop)?;
        print(&tally.to_string());
        report.findings.push(Finding {
            name: format!("timing/{line}"),
            about: "every request gets one reply, and the right one".to_owned(),
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
        Err(stop) if here == home => Err(stop.into()),
        Err(stop) => Err(Error::new(stop).context(format!(
            "the unit could not be set back to {home}; it last answered at {here}"
        ))),
    }
}

/// Checks that this unit's rate can be changed and restored without side effects.
fn may_change_rate(bench: &mut Bench<'_>, home: LineFormat) -> Result<()> {
    if !bench.endpoint.abilities().set_line {
        bail!("--rates needs a serial port: a socket has no rate");
    }
    if bench.unit() == RECOVERY {
        bail!("--rates: in recovery mode the unit stays at 9600 8N2");
    }
    let status = bench.read_word(state::STATUS)?;
    if status & UNSETTLED != 0 {
        bail!(
            "--rates: the unit has settings that are not saved, or that wait for a restart (status {status:#06x}): \
             save or drop them, or restart the unit, so that it can be set back to {home}"
        );
    }
    Ok(())
}

/// Returns the verdict about a step. An endpoint that no longer works is an error instead.
fn verdict(result: Check) -> Check<Verdict> {
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
