//! `modio-conformance`: runs the suite against a unit and reports the results.

use std::io;
use std::process::ExitCode;
use std::sync::atomic::Ordering;

use conformance::cli::Cli;
use conformance::endpoint::trace::Trace;
use conformance::probe::{Given, probe};
use conformance::report::{Totals, json, junit, table};
use conformance::run;
use conformance::target::{Support, Target};
use conformance::{interrupt, program};

fn main() -> ExitCode {
    program::run("modio-conformance", register_map::version!(), test)
}

/// Tests the unit, and returns the exit status.
fn test(cli: &Cli) -> anyhow::Result<u8> {
    let cases = cli.cases()?;
    if cli.list {
        program::say(table::list(&cases).trim_end());
        return Ok(0);
    }
    cli.reports.check()?;
    let profile = cli.read_profile()?;
    let mode = cli.mode(profile.as_ref())?;
    let mut endpoint = cli.open(mode)?;
    if cli.trace {
        endpoint = Box::new(Trace::new(endpoint, io::stderr()));
    }
    let given = Given {
        unit: cli.unit(profile.as_ref()),
        mode,
        patience: cli.waits(endpoint.as_ref()),
        profile: profile.as_ref(),
        allow_config: cli.allow_config,
    };
    let target = probe(endpoint.as_mut(), &given)?;
    let name = endpoint.name();
    program::say(format_args!("{name}: {}", found(&target)));
    let mut outcomes = Vec::new();
    let report = |outcome: &run::Outcome| program::say(table::row(outcome));
    let stop = interrupt::catch()?;
    let go_on = || !stop.load(Ordering::Relaxed);
    let ended = run::run_while(
        endpoint.as_mut(),
        &target,
        &cases,
        go_on,
        report,
        &mut outcomes,
    );
    // The results up to an error are reported, too.
    program::say(table::summary(&outcomes));
    let json = json::value(&name, &outcomes);
    let written = cli.reports.write(&junit::document(&name, &outcomes), &json);
    ended?;
    written?;
    if !go_on() {
        return Ok(interrupt::STATUS);
    }
    // The documents of the modio promise what the interpretations demand.
    let strict = cli.strict || target.modio.is_some();
    Ok(u8::from(Totals::of(&outcomes).counted(strict) > 0))
}

/// Returns the results of the probe, in one line.
fn found(target: &Target) -> String {
    let functions: Vec<String> = target
        .functions
        .iter()
        .filter(|(_, support)| **support == Support::Yes)
        .map(|(function, _)| format!("{function:02X}"))
        .collect();
    let what = match target.modio {
        Some(modio) => {
            let board = modio.board.map_or("modio", |board| board.name);
            format!("a {board} with {modio}")
        }
        None => "a unit".to_owned(),
    };
    format!(
        "{what} at address {}, functions {}",
        target.unit,
        functions.join(" ")
    )
}
