//! The commands.

mod config;
mod describe;
mod export;
mod fast;
mod info;
mod links;
mod module;
mod note;
mod ports;
mod raw;
mod read;
mod scan;
mod sniff;
mod stage;
mod update;
mod watch;
mod write;

use std::path::Path;
use std::process::ExitCode;

use clap::CommandFactory;

use crate::bus::Endpoint;
use crate::cli::{Cli, Command};
use crate::device::Device;
use crate::failure::Failure;
use crate::{monitor, output, trace};
use note::Note;

/// Exit status of a program that Ctrl-C has ended, as shells define it.
const INTERRUPTED: u8 = 130;

/// Runs the command of the command line, until it is done or Ctrl-C is pressed.
pub async fn run(mut cli: Cli) -> Result<ExitCode, Failure> {
    let until_stopped = matches!(
        cli.command,
        Command::Watch(_) | Command::Events(_) | Command::Monitor(_) | Command::Sniff(_)
    );
    if let Command::Scan(options) = &cli.command {
        let options = options.clone();
        let endpoint = endpoint(&mut cli)?;
        let observer = cli.trace.then(trace::to_stderr);
        let complete = if options.fast {
            fast::scan::run(endpoint, observer, &options, cli.json).await?
        } else {
            scan::run(endpoint, observer, &options, cli.json).await?
        };
        return Ok(if complete {
            ExitCode::SUCCESS
        } else {
            stopped("")
        });
    }
    let note = Note::default();
    tokio::select! {
        // Ctrl-C is handled before the command begins.
        biased;
        _ = tokio::signal::ctrl_c() => Ok(if until_stopped {
            ExitCode::SUCCESS
        } else {
            stopped(&note.text())
        }),
        result = dispatch(cli, &note) => match result {
            Ok(()) => Ok(ExitCode::SUCCESS),
            Err(failure) => Err(failure.after(&note.text())),
        },
    }
}

/// Reports that Ctrl-C has ended the command, and what it had done. Returns the exit status.
fn stopped(note: &str) -> ExitCode {
    match note {
        "" => eprintln!("modioctl: stopped"),
        note => eprintln!("modioctl: stopped: {note}"),
    }
    ExitCode::from(INTERRUPTED)
}

async fn dispatch(mut cli: Cli, note: &Note) -> Result<(), Failure> {
    let json = cli.json;
    // These commands need no unit.
    match cli.command {
        Command::Ports => return ports::run(json),
        Command::Update(options) if options.show => return update::show(&options, json),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "modioctl", &mut script);
            return output::line(String::from_utf8_lossy(&script));
        }
        Command::Man => {
            let mut page = Vec::new();
            clap_mangen::Man::new(Cli::command())
                .render(&mut page)
                .map_err(Failure::usage)?;
            return output::line(String::from_utf8_lossy(&page));
        }
        _ => {}
    }
    let endpoint = endpoint(&mut cli)?;
    if let Command::Monitor(options) = cli.command {
        return monitor::run(endpoint, &options, cli.trace, cli.refresh).await;
    }
    if let Command::Sniff(options) = cli.command {
        return sniff::run(&endpoint, &options, json).await;
    }
    let observer = cli.trace.then(trace::to_stderr);
    if let Command::Update(options) = cli.command {
        return update::run(endpoint, observer, &options, json, note).await;
    }
    let mut device = Device::open(endpoint, observer).await?;
    device.refresh = cli.refresh;
    match cli.command {
        Command::Info => info::run(&mut device, json).await,
        Command::Read(options) => read::run(&mut device, &options, json).await,
        Command::Write(options) => write::run(&mut device, &options, json, note).await,
        Command::Module(options) => module::run(device, options, note).await,
        Command::Config(options) => config::run(device, options, json, note).await,
        Command::Links => links::list(&mut device, json).await,
        Command::Link { words } => links::link(&mut device, &words.join(" "), note).await,
        Command::Watch(options) => watch::run(device, &options, cli.trace).await,
        Command::Events(options) => fast::events::run(device, &options, json).await,
        Command::Address(options) => fast::address::run(device.master, &options, note).await,
        Command::Raw(options) => raw::run(&mut device, &options).await,
        Command::Describe => describe::run(&mut device, json).await,
        Command::Export(options) => export::run(&mut device, &options).await,
        Command::Reboot => module::reboot(device).await,
        Command::Identify => module::identify(&mut device).await,
        Command::Scan(_)
        | Command::Update(_)
        | Command::Monitor(_)
        | Command::Sniff(_)
        | Command::Ports
        | Command::Completions { .. }
        | Command::Man => Ok(()),
    }
}

fn endpoint(cli: &mut Cli) -> Result<Endpoint, Failure> {
    let options = std::mem::take(&mut cli.endpoint);
    options.endpoint(cli.at.as_deref(), cli.endpoints.as_deref().map(Path::new))
}
