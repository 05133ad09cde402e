//! `modio-sim`: the virtual modio-02 on the command line, its RS-485 line on a pseudo-terminal and on TCP,
//! its front panel over HTTP.

use std::process::ExitCode;

use clap::Parser;

mod app;

/// The virtual modio-02: runs the firmware image on an emulated STM32F103 with the board around it
#[derive(Parser)]
#[command(name = "modio-sim")]
struct Cli {
    /// Print the version, and that of the firmware inside, if there is any
    #[arg(short = 'V', long)]
    version: bool,

    #[command(flatten)]
    options: sim::options::Options,
}

fn main() -> ExitCode {
    let options = match Cli::try_parse() {
        Ok(cli) if cli.version => {
            print!("{}", app::version());
            return ExitCode::SUCCESS;
        }
        Ok(cli) => cli.options,
        Err(error) if error.use_stderr() => return refused(&sim::options::one_line(&error)),
        Err(help) => help.exit(),
    };
    if options.missing_files {
        return match options.missing_files() {
            Ok(files) => {
                for (kind, board) in files {
                    println!("{kind} {board}");
                }
                ExitCode::SUCCESS
            }
            Err(what) => refused(&what),
        };
    }
    match app::run(&options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(what) => refused(&what),
    }
}

/// Returns what was asked for cannot be: a line on stderr, exit status 2.
fn refused(what: &str) -> ExitCode {
    eprintln!("modio-sim: {what}");
    ExitCode::from(2)
}
