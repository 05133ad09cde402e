//! `modio-conformance`: runs the suite against a unit and tells what it found.

use std::process::ExitCode;
use std::sync::atomic::Ordering;

use conformance::cli::Cli;
use conformance::probe::{Given, probe};
use conformance::report::{Totals, json, junit, table};
use conformance::run::{self, Options};
use conformance::target::{Support, Target};
use conformance::{interrupt, program};

fn main() -> ExitCode {
    program::run("modio-conformance", test)
}

/// Tests, and gives the exit status.
fn test(cli: &Cli) -> Result<u8, String> {
    let cases = cli.cases()?;
    if cli.list {
        print!("{}", table::list(&cases));
        return Ok(0);
    }
    let profile = cli.read_profile()?;
    let mode = cli.mode(profile.as_ref())?;
    let mut endpoint = cli.open(mode).map_err(|broken| broken.to_string())?;
    let given = Given {
        unit: cli.unit(profile.as_ref()),
        mode,
        patience: cli.waits(endpoint.as_ref()),
        profile: profile.as_ref(),
        allow_config: cli.allow_config,
    };
    let (target, patience) = probe(endpoint.as_mut(), &given)?;
    println!("{}: {}", endpoint.name(), found(&target));
    let options = Options {
        patience,
        allow_config: cli.allow_config,
    };
    let tell = |outcome: &run::Outcome| println!("{}", table::row(outcome));
    let stop = interrupt::catch()?;
    let go_on = || !stop.load(Ordering::Relaxed);
    let outcomes = run::run_while(endpoint.as_mut(), &target, options, &cases, go_on, tell)
        .map_err(|broken| broken.to_string())?;
    println!("{}", table::summary(&outcomes));
    let name = endpoint.name();
    if let Some(path) = &cli.junit {
        program::write(path, &junit::document(&name, &outcomes))?;
    }
    if let Some(path) = &cli.json {
        program::write(path, &format!("{:#}\n", json::value(&name, &outcomes)))?;
    }
    if !go_on() {
        return Ok(interrupt::STATUS);
    }
    Ok(u8::from(Totals::of(&outcomes).failed > 0))
}

/// What the probe has found, in one line.
fn found(target: &Target) -> String {
    let functions: Vec<String> = target
        .functions
        .iter()
        .filter(|(_, support)| **support == Support::Yes)
        .map(|(function, _)| format!("{function:02X}"))
        .collect();
    let what = match target.modio {
        Some(modio) => format!("a modio with {}", modio.module),
        None => "a unit".to_owned(),
    };
    format!(
        "{what} at address {}, functions {}",
        target.unit,
        functions.join(" ")
    )
}
