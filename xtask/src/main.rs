//! `cargo xtask`: the commands this project is built, tested and tried with.

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let cli = match xtask::Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) if error.use_stderr() && !xtask::Cli::wants_usage(&error) => {
            eprintln!("xtask: {}", sim_options::one_line(&error));
            return ExitCode::from(2);
        }
        Err(usage) => usage.exit(),
    };
    match xtask::run(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("xtask: {failure}");
            ExitCode::from(failure.code)
        }
    }
}
