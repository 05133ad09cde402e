//! `modio-hil`: tests a modio on a bench and tells what it found.

use std::process::ExitCode;

use conformance::hil::cli::Cli;
use conformance::hil::report::Report;
use conformance::{hil, interrupt, program};

fn main() -> ExitCode {
    program::run("modio-hil", test)
}

/// Tests, and gives the exit status.
fn test(cli: &Cli) -> Result<u8, String> {
    cli.reports.check()?;
    let mut endpoint = cli.open().map_err(|broken| broken.to_string())?;
    let plan = cli.plan(endpoint.as_ref())?;
    if cli.check {
        return Ok(0);
    }
    let stop = interrupt::catch()?;
    let mut report = Report::default();
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
