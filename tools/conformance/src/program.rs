//! What the commands of this package have in common: arguments in, one line and exit status 2 when nothing
//! could be tested, reports into files.

use std::fs;
use std::path::Path;
use std::process::ExitCode;

use clap::Parser;

/// Runs a command of this name by its arguments. `test` gives the exit status, or says in a line why it could
/// not test.
pub fn run<Cli: Parser>(name: &str, test: impl FnOnce(&Cli) -> Result<u8, String>) -> ExitCode {
    let tested = match Cli::try_parse() {
        Ok(cli) => test(&cli),
        Err(error) if error.use_stderr() => Err(one_line(&error)),
        Err(help) => help.exit(),
    };
    match tested {
        Ok(status) => ExitCode::from(status),
        Err(what) => {
            eprintln!("{name}: {what}");
            ExitCode::from(2)
        }
    }
}

/// Writes a report.
///
/// # Errors
///
/// When it cannot be written: where and why.
pub fn write(path: &Path, text: &str) -> Result<(), String> {
    fs::write(path, text).map_err(|error| format!("cannot write {}: {error}", path.display()))
}

/// What is wrong with a command line, in one line.
fn one_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let lines: Vec<&str> = text
        .lines()
        .map_while(|line| (!line.is_empty()).then(|| line.trim()))
        .collect();
    lines.join(" ").trim_start_matches("error: ").to_owned()
}
