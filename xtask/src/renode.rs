//! `cargo xtask renode`: the image on Renode, an emulator that nobody here wrote: its own suites, then the
//! conformance suite with every module, in virtual time. With `--interactive`, for a person to try.
//!
//! Renode is not needed for anything else: what can be checked of its files without it is a step of
//! `cargo xtask test` ([`checks`]), and the simulator of `cargo xtask sim` needs none.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use register_map::{Board, Module};

use crate::steps::{Outcome, Steps};
use crate::workspace::Workspace;
use crate::{Failure, Result, build};

pub mod checks;
mod find;
mod live;
#[cfg(test)]
mod platform;
mod processes;
mod report;
mod suites;
#[cfg(all(test, unix))]
mod tests;

pub use find::Renode;

/// The platform, the scripts and the suites, relative to the root.
pub const DIRECTORY: &str = "renode";

/// Where the line is when nothing else is asked for.
const PORT: u16 = 3456;

/// What to run, and where.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    #[command(flatten)]
    build: build::Options,

    /// The program renode, or the directory it is in [default: $RENODE, the PATH, the usual places]
    #[arg(long, value_name = "PATH")]
    renode: Option<PathBuf>,

    /// Run this image instead of building one
    #[arg(long, value_name = "FILE")]
    elf: Option<PathBuf>,

    /// Start the board in Renode, its line on a TCP socket, and leave it to you
    #[arg(long)]
    interactive: bool,

    /// What is in the first slot of --interactive: none, 4di, 4do, 2relay, 4ai, 4ao or 2ai2ao
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
    #[arg(long, value_name = "N", default_value_t = PORT, requires = "interactive", value_parser = clap::value_parser!(u16).range(1..))]
    port: u16,
}

/// `cargo xtask renode`.
///
/// # Errors
///
/// When there is no Renode, or none new enough; when the image does not build; when a test failed.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    // Before the build: without Renode there is nothing to build for.
    let renode = Renode::find(options.renode.as_deref(), &find::Surroundings::of_process())?;
    eprintln!("{renode}");
    let elf = match &options.elf {
        Some(elf) if !elf.is_file() => {
            let what = format!("there is no image {}", elf.display());
            return Err(Failure::asked(what));
        }
        Some(elf) => absolute(elf)?,
        None => build::image(workspace, options.build.board)?.elf,
    };
    let bench = Bench {
        directory: workspace.root().join(DIRECTORY),
        output: workspace
            .target()
            .join("renode")
            .join(options.build.board.name),
        board: options.build.board,
        renode,
        elf,
    };
    if options.interactive {
        return live::interact(&bench, options.module, options.dip, options.port);
    }
    let conformance = live::suite(workspace)?;
    bench.run(&conformance)
}

/// Everything that a run in Renode needs.
struct Bench {
    /// The project's files for Renode.
    directory: PathBuf,
    /// Where results go.
    output: PathBuf,
    board: &'static Board,
    renode: Renode,
    elf: PathBuf,
}

impl Bench {
    /// Runs the suites in Renode and then `conformance`, the program, and sums both up.
    fn run(&self, conformance: &Path) -> Result<()> {
        processes::end_on_signal()?;
        // Results of another run would be taken for this one's.
        let _ = fs::remove_dir_all(&self.output);
        fs::create_dir_all(&self.output).map_err(|error| {
            Failure::new(format!("cannot make {}: {error}", self.output.display()))
        })?;
        let begin = Instant::now();
        let mut steps = Steps::default();
        let mut ended = Vec::new();
        let mut step = |name: String, run: &dyn Fn() -> Result<()>| {
            steps.run(&name, || {
                let begin = Instant::now();
                let outcome = Outcome::from(run());
                say!("{name}: {} s", begin.elapsed().as_secs());
                ended.push((name.clone(), outcome.clone(), begin.elapsed()));
                outcome
            });
        };
        step("suites in Renode".to_owned(), &|| suites::run(self));
        for module in Module::ALL {
            step(format!("conformance in Renode, {module}"), &|| {
                live::conformance(self, module, conformance)
            });
        }
        report::summary(&self.output, &self.renode, &ended)?;
        say!("\nresults: {}", self.output.display());
        say!("the whole run took {} s", begin.elapsed().as_secs());
        steps.finish()
    }
}

fn absolute(path: &Path) -> Result<PathBuf> {
    std::path::absolute(path)
        .map_err(|error| Failure::asked(format!("{}: {error}", path.display())))
}
