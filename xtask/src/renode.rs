//! `cargo xtask renode`: loader and image on Renode, an emulator of other authors: its own suites, then the conformance
//! suite with every module, in virtual time. `--interactive` starts the board for a person.
//!
//! Only this command needs Renode. [`checks`], a step of `cargo xtask test`, checks Renode's files without it, and
//! `cargo xtask sim` uses the project's own simulator.

use std::path::{Path, PathBuf};

use anyhow::Result;
use fs_err as fs;
use register_map::board::{MODIO_02, MODIO_08};
use register_map::{Module, Row};
use serde_json::json;

use crate::workspace::Workspace;
use crate::{build, signed, steps};

pub mod checks;
mod find;
mod live;
#[cfg(test)]
mod platform;
mod suites;
#[cfg(all(test, unix))]
mod tests;

use find::Renode;

/// The boards that Renode and the bench have.
pub const MODIO: [&Row; 2] = [&MODIO_02, &MODIO_08];

/// The platform, the scripts and the suites, relative to the root.
const DIRECTORY: &str = "renode";

/// What to run, and where.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    #[command(flatten)]
    given: build::Given,

    /// Run the image that runs without a loader. `--elf` runs such an image, too
    #[arg(long)]
    plain: bool,

    /// The program renode, or its directory [default: the PATH, the usual places]
    #[arg(long, value_name = "PATH", env = "RENODE", hide_env_values = true)]
    renode: Option<PathBuf>,

    /// Start the board in Renode, its line on a TCP socket, with Renode's monitor on the terminal
    #[arg(long)]
    interactive: bool,

    /// The module in the first slot of --interactive
    #[arg(help = format!("The module in the first slot of --interactive: {}", Module::ALL.map(Module::name).join(", ")))]
    #[arg(long, default_value = "4di", requires = "interactive")]
    module: Module,

    /// The DIP switch of --interactive: the unit's address
    #[arg(long, default_value_t = 1, requires = "interactive")]
    dip: u8,

    /// The line's TCP port of --interactive
    #[arg(long, value_name = "N", default_value_t = 3456, requires = "interactive", value_parser = clap::value_parser!(u16).range(1..))]
    port: u16,
}

/// `cargo xtask renode`.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    // Search before the build, which is useless without Renode.
    let renode = Renode::find(options.renode.as_deref())?;
    eprintln!("Renode {} at {}", renode.version, renode.program.display());
    let board = options.given.board();
    let (elf, image) = options.firmware(workspace)?;
    let setup = Setup {
        directory: workspace.root.join(DIRECTORY),
        output: workspace.target.join("renode").join(board.name),
        board,
        renode,
        elf,
        image,
    };
    if options.interactive {
        return live::interact(&setup, options.module, options.dip, options.port);
    }
    let conformance = workspace.program("modio-conformance")?;
    let python = checks::python(workspace)?;
    setup.run(&conformance, &python)
}

impl Options {
    /// Returns the ELF file of the loader and the signed image for slot A, or the ELF file of the image that runs without
    /// a loader. Builds them unless an option names that image.
    fn firmware(&self, workspace: &mut Workspace) -> Result<(PathBuf, Option<PathBuf>)> {
        if self.plain || self.given.is_given() {
            return Ok((self.given.elf(workspace)?, None));
        }
        let board = self.given.board();
        let loader = build::loader(workspace, board)?;
        let image = signed::image(workspace, board)?;
        Ok((loader, Some(image)))
    }
}

/// Everything that a run in Renode needs.
struct Setup {
    /// The project's files for Renode.
    directory: PathBuf,
    /// Directory of the results.
    output: PathBuf,
    board: &'static Row,
    renode: Renode,
    /// The loader, or the image that runs without one.
    elf: PathBuf,
    /// The signed image for slot A, if there is a loader.
    image: Option<PathBuf>,
}

impl Setup {
    /// Runs the suites in Renode and then the program `conformance`, and writes a summary of both.
    fn run(&self, conformance: &Path, python: &Path) -> Result<()> {
        // Results of an earlier run would be mistaken for those of this one.
        let _ = fs::remove_dir_all(&self.output);
        fs::create_dir_all(&self.output)?;
        let suites = || suites::run(self, python);
        let mut done = vec![steps::timed("suites", "suites in Renode", true, suites)];
        for module in Module::ALL {
            let name = format!("conformance-{module}");
            let what = format!("conformance in Renode, {module}");
            let run = || live::conformance(self, module, conformance);
            done.push(steps::timed(&name, &what, true, run));
        }
        let steps = done.iter().map(|done| {
            let (outcome, seconds) = (done.outcome.to_lowercase(), done.took.as_secs_f64());
            json!({ "step": done.name, "outcome": outcome, "why": done.why, "seconds": seconds })
        });
        let steps: Vec<_> = steps.collect();
        let summary = json!({ "renode": self.renode.version.to_string(), "steps": steps });
        fs::write(self.output.join("summary.json"), format!("{summary:#}\n"))?;
        say!("\nresults: {}", self.output.display());
        steps::finish(&done)
    }
}
