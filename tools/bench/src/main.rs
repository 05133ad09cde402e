//! `modio-bench`: measures images and prints the figures as JSON. Started by `cargo xtask bench`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use register_map::Row;
use sim::Image;

/// Measures the release image on the virtual board and prints the figures as JSON
#[derive(Parser)]
#[command(name = "modio-bench", version = register_map::version!())]
struct Cli {
    /// The image
    elf: PathBuf,
    /// The board that it is for: modio-02 or modio-08
    #[arg(long, value_name = "NAME")]
    board: &'static Row,
    /// The loader
    #[arg(long, value_name = "ELF")]
    loader: PathBuf,
    /// The signed image for slot A
    #[arg(long, value_name = "FILE")]
    signed: PathBuf,
    /// Minimal servers on other crates, named after their files
    #[arg(long, value_name = "ELF", num_args = 1..)]
    rivals: Vec<PathBuf>,
}

fn main() -> ExitCode {
    match run(&Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("modio-bench: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(cli: &Cli) -> Result<(), String> {
    let read = |path: &PathBuf| {
        Image::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()))
    };
    let image = read(&cli.elf)?;
    let rivals = cli
        .rivals
        .iter()
        .map(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            Ok((name.into_owned(), read(path)?))
        })
        .collect::<Result<Vec<_>, String>>()?;
    let loader = read(&cli.loader)?;
    let signed = std::fs::read(&cli.signed)
        .map_err(|error| format!("cannot read {}: {error}", cli.signed.display()))?;
    let report = bench::measure(&image, (&loader, &signed), cli.board, &rivals)?;
    let json = serde_json::to_string_pretty(&report).map_err(|error| error.to_string())?;
    println!("{json}");
    Ok(())
}
