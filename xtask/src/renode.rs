//! `cargo xtask renode`: the image on Renode, an emulator of other authors: its own suites, then the conformance suite
//! with every module, in virtual time. `--interactive` starts the board for a person.
//!
//! Only this command needs Renode. [`checks`], a step of `cargo xtask test`, checks Renode's files without it, and
//! `cargo xtask sim` uses the project's own simulator.

use std::path::{Path, PathBuf};

use anyhow::Result;
use fs_err as fs;
use register_map::{Board, Module};
use serde_json::{Value, json};

use crate::error::usage;
use crate::workspace::Workspace;
use crate::{build, group, steps};

pub mod checks;
mod find;
mod live;
#[cfg(test)]
mod platform;
mod suites;
#[cfg(all(test, unix))]
mod tests;

use find::Renode;

/// The platform, the scripts and the suites, relative to the root.
const DIRECTORY: &str = "renode";

/// What to run, and where.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    #[command(flatten)]
    build: build::Options,

    /// The program renode, or its directory [default: $RENODE, the PATH, the usual places]
    #[arg(long, value_name = "PATH")]
    renode: Option<PathBuf>,

    /// Run this image instead of building one
    #[arg(long, value_name = "FILE")]
    elf: Option<PathBuf>,

    /// Start the board in Renode, its line on a TCP socket, with Renode's monitor on the terminal
    #[arg(long)]
    interactive: bool,

    /// The module in the first slot of --interactive: none, 4di, 4do, 2relay, 4ai, 4ao or 2ai2ao
    #[arg(
        long,
        value_name = "NAME",
        default_value = "4di",
        requires = "interactive"
    )]
    module: Module,

    /// The DIP switch of --interactive: the unit's address
    #[arg(long, value_name = "N", default_value_t = 1, requires = "interactive")]
    dip: u8,

    /// The line's TCP port of --interactive
    #[arg(long, value_name = "N", default_value_t = 3456, requires = "interactive", value_parser = clap::value_parser!(u16).range(1..))]
    port: u16,
}

/// `cargo xtask renode`.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    // Search before the build, which is useless without Renode.
    let renode = Renode::find(options.renode.as_deref(), &find::Places::of_process()?)?;
    eprintln!("{renode}");
    let board = options.build.board;
    let elf = match &options.elf {
        Some(elf) if !elf.is_file() => {
            return Err(usage(format!("there is no image {}", elf.display())));
        }
        Some(elf) => std::path::absolute(elf)?,
        None => build::image(workspace, board)?.elf,
    };
    let bench = Bench {
        directory: workspace.root().join(DIRECTORY),
        output: workspace.target().join("renode").join(board.name),
        board,
        renode,
        elf,
    };
    if options.interactive {
        return live::interact(&bench, options.module, options.dip, options.port);
    }
    let conformance = workspace.program("modio-conformance")?;
    let rebot = checks::python(workspace)?;
    bench.run(&conformance, &rebot)
}

/// Everything that a run in Renode needs.
struct Bench {
    /// The project's files for Renode.
    directory: PathBuf,
    /// Directory of the results.
    output: PathBuf,
    board: &'static Board,
    renode: Renode,
    elf: PathBuf,
}

impl Bench {
    /// Runs the suites in Renode and then the program `conformance`, and writes a summary of both.
    fn run(&self, conformance: &Path, python: &Path) -> Result<()> {
        group::end_on_signal()?;
        // Results of an earlier run would be mistaken for those of this one.
        let _ = fs::remove_dir_all(&self.output);
        fs::create_dir_all(&self.output)?;
        let mut done = vec![steps::timed("suites", "suites in Renode", true, || {
            suites::run(self, python)
        })];
        for module in Module::ALL {
            let name = format!("conformance-{module}");
            let what = format!("conformance in Renode, {module}");
            done.push(steps::timed(&name, &what, true, || {
                live::conformance(self, module, conformance)
            }));
        }
        let summary = self.summary(&done);
        fs::write(self.output.join("summary.json"), format!("{summary:#}\n"))?;
        say!("\nresults: {}", self.output.display());
        steps::finish(&done)
    }

    /// Returns the version of Renode, and the outcome and duration of every step.
    fn summary(&self, done: &[steps::Done]) -> Value {
        let steps = done.iter().map(|(name, outcome, took)| {
            let (word, why) = outcome.words();
            json!({ "step": name, "outcome": word.to_lowercase(), "why": why, "seconds": took.as_secs_f64() })
        });
        json!({ "renode": self.renode.version.to_string(), "steps": steps.collect::<Vec<_>>() })
    }
}
