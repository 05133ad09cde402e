//! `modio-conformance`: runs the suite against a unit and reports the results.

use std::fmt::Display;
use std::io::{self, Write as _};
use std::process::ExitCode;
use std::sync::atomic::Ordering;

use anyhow::{anyhow, ensure};
use clap::{CommandFactory as _, FromArgMatches as _};

use conformance::about::{About, Unit};
use conformance::case::Case;
use conformance::cases::each_rate;
use conformance::cli::Cli;
use conformance::endpoint::trace::Trace;
use conformance::hil::shell;
use conformance::interrupt;
use conformance::probe::{Given, probe};
use conformance::report::{Report, Totals, json, junit, table};
use conformance::run::{Verdict, run_until};
use conformance::target::{Support, Target};
use conformance::tester::Tester;

fn main() -> ExitCode {
    let arguments = Cli::command()
        .version(register_map::version!())
        .try_get_matches();
    let tested = match arguments.and_then(|found| Cli::from_arg_matches(&found)) {
        Ok(cli) => test(cli),
        Err(error) if error.use_stderr() => Err(anyhow!(one_line(&error))),
        Err(help) => help.exit(),
    };
    match tested {
        Ok(status) => ExitCode::from(status),
        Err(error) => {
            eprintln!("modio-conformance: {error:#}");
            ExitCode::from(2)
        }
    }
}

/// Prints one or more lines. A reader that has closed the pipe, as `head` does, is no error: the unit must still be
/// restored, and the reports written.
fn say(text: impl Display) {
    let _ = writeln!(io::stdout(), "{text}");
}

fn one_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let lines: Vec<&str> = text
        .lines()
        .map_while(|line| (!line.is_empty()).then(|| line.trim()))
        .collect();
    lines.join(" ").trim_start_matches("error: ").to_owned()
}

/// Tests the unit. Returns the exit status, or why nothing could be tested.
fn test(cli: Cli) -> anyhow::Result<u8> {
    let cases = cli.cases()?;
    if cli.list {
        say(table::list(&cases).trim_end());
        return Ok(0);
    }
    let cli = cli.with_bench_file()?;
    cli.reports.check()?;
    let mut report = Report {
        about: About::here(cli.serial.as_deref(), register_map::commit!()),
        ..Report::default()
    };
    let ended = run(&cli, &cases, &mut report);
    // The results up to an error are reported, too, so that no report of an earlier run stays.
    let written = cli
        .reports
        .write(&junit::document(&report), &json::value(&report));
    let is_modio = ended?;
    written?;
    if report.interrupted {
        return Ok(interrupt::STATUS);
    }
    // The documents of the modio promise what the interpretations demand.
    let strict = cli.strict || is_modio;
    Ok(u8::from(Totals::of(&report.outcomes).counted(strict) > 0))
}

/// Runs these cases, and adds to the report what is known. Returns whether the unit is a modio.
fn run(cli: &Cli, cases: &[Case], report: &mut Report) -> anyhow::Result<bool> {
    let profile = cli.read_profile()?;
    let mode = cli.mode(profile.as_ref());
    let mut endpoint = cli.open(mode)?;
    report.endpoint = endpoint.name();
    let update = cli.on_bench.update.as_ref();
    let update = update.map(|file| anyhow::Ok((cli.reached()?, file)));
    let update = update.transpose()?;
    // Wrong arguments have been reported by now, before anything is done to the board.
    cli.on_bench.prepare()?;
    if let Some((reached, file)) = update {
        // The other program needs the port.
        drop(endpoint);
        shell::update(&reached, file)?;
        endpoint = cli.open(mode)?;
    }
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
    let mut target = probe(endpoint.as_mut(), &given)?;
    target.hil = cli.of_bench();
    is_wanted(cli, &target)?;
    let mut tester = Tester::new(endpoint.as_mut(), &target);
    let unit = target.modio.map(|modio| Unit::ask(&mut tester, modio));
    report.about.unit = unit.transpose()?;
    say(format_args!("{}: {}", report.endpoint, found(&target)));
    for (name, value) in report.about.properties() {
        say(format_args!("{name}: {value}"));
    }
    let least = each_rate::least(&tester).as_secs();
    if least > 0 {
        let requests = target.hil.requests;
        say(format_args!(
            "{requests} requests at each rate take {least} s or more"
        ));
    }
    let stop = interrupt::catch()?;
    let ended = run_until(
        endpoint.as_mut(),
        &target,
        cases,
        stop,
        |outcome| say(table::row(outcome)),
        &mut report.outcomes,
    );
    report.interrupted = stop.load(Ordering::Relaxed);
    say(table::summary(&report.outcomes));
    for outcome in &report.outcomes {
        if matches!(outcome.verdict, Verdict::Failed(_)) {
            say(format_args!("failed: {}", outcome.name));
        }
    }
    ended?;
    Ok(target.modio.is_some())
}

/// Checks that the unit is a modio with the module that the user expects, if the user does.
fn is_wanted(cli: &Cli, target: &Target) -> anyhow::Result<()> {
    let (unit, module) = (target.unit, target.modio.map(|modio| modio.module()));
    ensure!(
        module.is_some() || cli.hil.is_none() && cli.module.is_none(),
        "unit {unit} is not a modio"
    );
    if let Some((module, wanted)) = module.zip(cli.module) {
        ensure!(
            module == wanted,
            "unit {unit} has the module {module} in force, but the bench has {wanted}"
        );
    }
    Ok(())
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
