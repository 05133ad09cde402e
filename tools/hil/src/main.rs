//! `modio-hil`: tests a modio on a bench and reports the results.

use std::process::ExitCode;

use conformance::{interrupt, program};
use hil::about::About;
use hil::cli::Cli;
use hil::report::Report;
use hil::shell;

fn main() -> ExitCode {
    program::run("modio-hil", register_map::version!(), test)
}

/// Prepares the board and tests it. Returns the exit status.
fn test(cli: &Cli) -> anyhow::Result<u8> {
    let setup = cli.setup()?;
    cli.reports.check()?;
    let mut endpoint = setup.open()?;
    let plan = setup.plan(endpoint.as_ref())?;
    // Wrong arguments have been reported by now, before anything is done to the board.
    if let Some(flash) = setup.flash() {
        flash.write()?;
    }
    if let Some(reset) = setup.reset() {
        shell::run(reset)?;
    }
    if let Some(file) = &cli.update {
        // The other program needs the port.
        drop(endpoint);
        shell::update(&setup.reached(), file)?;
        endpoint = setup.open()?;
    }
    let stop = interrupt::catch()?;
    let mut report = Report {
        about: About::here(setup.port(), register_map::commit!()),
        ..Report::default()
    };
    let mut print = |line: &str| program::say(line);
    let ended = hil::run(endpoint.as_mut(), &plan, stop, &mut report, &mut print);
    // The results up to an error are reported, too.
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
