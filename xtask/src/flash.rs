//! `cargo xtask flash`: writes the image into a board through probe-rs, verifies it and starts it.

use std::path::PathBuf;
use std::process::Command;

use crate::board::{Hardware, Memory};
use crate::workspace::Workspace;
use crate::{Failure, Result, build, command, image};

/// What to write, and through which probe.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    #[command(flatten)]
    build: build::Options,

    /// The debug probe, when there are several: VID:PID or VID:PID:SERIAL, as `probe-rs list` shows it
    #[arg(long, value_name = "SELECTOR")]
    probe: Option<String>,

    /// Write this image instead of building one
    #[arg(long, value_name = "FILE")]
    elf: Option<PathBuf>,
}

/// `cargo xtask flash`.
///
/// # Errors
///
/// When probe-rs or a probe is missing, the image does not build or is broken, or writing fails.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let part = Hardware::of(options.build.board).part;
    let probe_rs = ProbeRs {
        program: "probe-rs".into(),
        part,
        probe: options.probe.clone(),
    };
    // Before the build: without a probe there is nothing to build for.
    probe_rs.check()?;
    let elf = match &options.elf {
        Some(elf) => {
            let broken = |why| Failure::asked(format!("{}: {why}", elf.display()));
            image::flat(&image::read(elf)?, part.flash).map_err(broken)?;
            elf.clone()
        }
        None => build::image(workspace, options.build.board)?.elf,
    };
    probe_rs.write(&elf)?;
    say!("written, verified and started: {}", elf.display());
    Ok(())
}

/// The program probe-rs with the options that each of its commands gets.
struct ProbeRs {
    program: PathBuf,
    /// The part on the board.
    part: Memory,
    probe: Option<String>,
}

impl ProbeRs {
    fn command(&self, subcommand: &str) -> Command {
        let mut command = Command::new(&self.program);
        command.args([subcommand, "--chip", self.part.name]);
        if let Some(probe) = &self.probe {
            command.args(["--probe", probe]);
        }
        command
    }

    /// Whether there is probe-rs, and a probe it sees.
    fn check(&self) -> Result<()> {
        let list = Command::new(&self.program)
            .arg("list")
            .output()
            .map_err(|_| {
                Failure::new(
                    "probe-rs is not installed: `cargo install probe-rs-tools --locked`, \
                 or see https://probe.rs/docs/getting-started/installation",
                )
            })?;
        let text = [list.stdout, list.stderr].concat();
        let text = String::from_utf8_lossy(&text).to_lowercase();
        if text.contains("no debug probes were found") {
            return Err(Failure::new(
                "no debug probe found: connect one (ST-Link, CMSIS-DAP, J-Link) to USB; \
                 on Linux it may need the udev rules of https://probe.rs/docs/getting-started/probe-setup",
            ));
        }
        Ok(())
    }

    fn write(&self, elf: &std::path::Path) -> Result<()> {
        command::run(self.command("download").arg("--verify").arg(elf))?;
        command::run(&mut self.command("reset"))
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::*;
    use crate::script::program;

    /// A program in probe-rs's place that writes its arguments down, a line for each call.
    fn fake(directory: &Path, script: &str) -> ProbeRs {
        let log = directory.join("log");
        let text = format!("echo \"$@\" >> '{}'\n{script}", log.display());
        ProbeRs {
            program: program(directory, "probe-rs", &text),
            part: Hardware::of(&register_map::board::MODIO_02).part,
            probe: None,
        }
    }

    fn calls(directory: &Path) -> Vec<String> {
        let log = fs::read_to_string(directory.join("log")).unwrap();
        log.lines().map(str::to_owned).collect()
    }

    #[test]
    fn the_image_is_written_verified_and_started() {
        let directory = tempfile::tempdir().unwrap();
        let probe_rs = fake(directory.path(), "exit 0");
        probe_rs.check().unwrap();
        probe_rs.write(Path::new("/x/modio")).unwrap();
        assert_eq!(
            calls(directory.path()),
            [
                "list",
                "download --chip STM32F103CB --verify /x/modio",
                "reset --chip STM32F103CB"
            ]
        );
    }

    #[test]
    fn the_probe_asked_for_is_passed_on_to_both() {
        let directory = tempfile::tempdir().unwrap();
        let mut probe_rs = fake(directory.path(), "exit 0");
        probe_rs.probe = Some("0483:3748:0667".to_owned());
        probe_rs.write(Path::new("/x/modio")).unwrap();
        for call in calls(directory.path()) {
            assert!(call.contains("--probe 0483:3748:0667"), "{call}");
        }
    }

    #[test]
    fn a_failed_write_does_not_start_the_board() {
        let directory = tempfile::tempdir().unwrap();
        let probe_rs = fake(directory.path(), "[ $1 = reset ]");
        let text = probe_rs
            .write(Path::new("/x/modio"))
            .unwrap_err()
            .to_string();
        assert!(
            text.contains("download") && text.contains("failed"),
            "{text}"
        );
        assert_eq!(calls(directory.path()).len(), 1);
    }

    #[test]
    fn no_probe_is_told_with_what_to_do() {
        let directory = tempfile::tempdir().unwrap();
        let probe_rs = fake(directory.path(), "echo 'No debug probes were found.'");
        let text = probe_rs.check().unwrap_err().to_string();
        assert!(text.starts_with("no debug probe found: connect"), "{text}");
    }

    #[test]
    fn no_probe_rs_is_told_with_how_to_install_it() {
        let probe_rs = ProbeRs {
            program: "/nowhere/probe-rs".into(),
            part: Hardware::of(&register_map::board::MODIO_02).part,
            probe: None,
        };
        let text = probe_rs.check().unwrap_err().to_string();
        assert!(text.contains("cargo install probe-rs-tools"), "{text}");
    }
}
