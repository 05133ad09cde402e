//! `modio-hil`: tests a modio on a bench and reports what it found.

use std::process::ExitCode;

use conformance::hil::about::About;
use conformance::hil::cli::Cli;
use conformance::hil::report::Report;
use conformance::hil::shell;
use conformance::{hil, interrupt, program};

fn main() -> ExitCode {
    program::run("modio-hil", test)
}

/// Gets the board ready and tests it; returns the exit status.
fn test(cli: &Cli) -> Result<u8, String> {
    let setup = cli.setup()?;
    cli.reports.check()?;
    let mut endpoint = setup.open().map_err(|broken| broken.to_string())?;
    let plan = setup.plan(endpoint.as_ref())?;
    // A mistake has been reported by now: nothing was done to the board yet.
    if let Some(flash) = setup.flash() {
        flash.write()?;
    }
    if let Some(reset) = setup.reset() {
        shell::run(reset)?;
    }
    let stop = interrupt::catch()?;
    let mut report = Report {
        about: About::here(setup.port()),
        ..Report::default()
    };
    let mut tell = |line: &str| program::say(line);
    let ended = hil::run(endpoint.as_mut(), &plan, stop, &mut report, &mut tell);
    // What was found before it could not go on is worth having, too.
    let written = cli.reports.write(&report.junit(), &report.json());
    let totals = report.totals();
    let early = if report.interrupted {
        ", interrupted"
    } else {
        ""
    };
    program::say(format_args!(
        "\nin all: {} passed, {} failed, {} skipped{early}",
        totals.passed, totals.failed, totals.skipped
    ));
    for name in report.failed() {
        program::say(format_args!("failed: {name}"));
    }
    ended?;
    written?;
    Ok(if report.interrupted {
        interrupt::STATUS
    } else {
        u8::from(totals.failed > 0)
    })
}
