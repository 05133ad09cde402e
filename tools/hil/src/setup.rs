//! The command line and the bench file, merged: the line, the commands for the board, and the tests.

use std::path::Path;
use std::time::Duration;

use anyhow::{Context as _, Result, anyhow, bail};
use modbus_line::LineFormat;

use crate::Plan;
use crate::bench_file::BenchFile;
use crate::cli::Cli;
use crate::shell::{Flash, Powered};
use conformance::case::Case;
use conformance::cli::{chosen, waits};
use conformance::endpoint::stream::Stream;
use conformance::endpoint::{Broken, Endpoint};

/// The command line and the bench file, merged.
#[derive(Clone, Debug)]
pub struct Setup {
    cli: Cli,
    file: BenchFile,
}

impl Cli {
    /// Reads the bench file, if one is named.
    pub fn setup(&self) -> Result<Setup> {
        let file = match &self.bench {
            None => BenchFile::default(),
            Some(path) => {
                let shown = path.display();
                let text =
                    std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
                BenchFile::parse(&text, self.unit).map_err(|wrong| anyhow!("{shown}:{wrong}"))?
            }
        };
        let setup = Setup {
            cli: self.clone(),
            file,
        };
        if setup.port().is_none() && self.tcp.is_none() {
            bail!("no serial port: name it with --port, or in the bench file");
        }
        let format = setup.line().format.to_string();
        if !["8N2", "8E1", "8O1", "8N1"].contains(&format.as_str()) {
            bail!("a modio has no format {format}: use 8N2, 8E1, 8O1 or 8N1");
        }
        let wires = setup.file.wires().len() + setup.file.analog().len();
        if self.no_suite && self.requests == 0 && wires == 0 {
            bail!("nothing to test: no suite, no requests, and no wires in a bench file");
        }
        Ok(setup)
    }
}

impl Setup {
    /// Returns the serial port, if the line is on one.
    pub fn port(&self) -> Option<&Path> {
        let port = self.cli.port.as_deref().or(self.file.port.as_deref());
        port.filter(|_| self.cli.tcp.is_none())
    }

    fn unit(&self) -> u8 {
        self.cli.unit.or(self.file.unit).unwrap_or(1)
    }

    fn line(&self) -> LineFormat {
        let usual = LineFormat::default();
        let format = self.cli.format.or(self.file.format);
        LineFormat::new(
            self.cli.baud.or(self.file.baud).unwrap_or(usual.baud),
            format.unwrap_or(usual.format),
        )
    }

    /// Opens the line.
    pub fn open(&self) -> Result<Box<dyn Endpoint>, Broken> {
        let line: Box<dyn Endpoint> = match (self.port(), &self.cli.tcp) {
            (Some(port), _) => Box::new(Stream::serial(port, self.line())?),
            (None, Some(address)) => Box::new(Stream::tcp(address, self.line())?),
            (None, None) => return Err(Broken("no --port".to_owned())),
        };
        let power = self.cli.power_cmd.as_ref().or(self.file.power_cmd.as_ref());
        Ok(match power {
            Some(command) => Box::new(Powered::new(line, command.clone())),
            None => line,
        })
    }

    /// Returns how to write the image, if the image is written.
    pub fn flash(&self) -> Option<Flash> {
        let probe = self.cli.probe.as_ref().or(self.file.probe.as_ref());
        self.cli.flash.then(|| Flash {
            probe: probe.cloned(),
            elf: self.cli.elf.clone(),
        })
    }

    /// Returns the options with which modioctl reaches the unit.
    pub fn reached(&self) -> Vec<String> {
        let (option, place) = match self.port() {
            Some(port) => ("--port", port.display().to_string()),
            None => ("--tcp", self.cli.tcp.clone().unwrap_or_default()),
        };
        let (line, unit) = (self.line(), self.unit().to_string());
        let (baud, format) = (line.baud.to_string(), line.format.to_string());
        let options = [option, &place, "--baud", &baud, "--format", &format];
        let options = options.into_iter().chain(["--unit", &unit]);
        options.map(str::to_owned).collect()
    }

    /// Returns the command that resets the board, if there is one.
    pub fn reset(&self) -> Option<&str> {
        let command = self.cli.reset_cmd.as_deref();
        command.or(self.file.reset_cmd.as_deref())
    }

    /// Returns the tests to run on this line.
    pub fn plan(&self, endpoint: &dyn Endpoint) -> Result<Plan> {
        let (cli, file) = (&self.cli, &self.file);
        Ok(Plan {
            unit: self.unit(),
            module: cli.module.or(file.module),
            patience: waits(endpoint, cli.patience.map(Duration::from_millis)),
            allow_config: cli.allow_config,
            cases: self.cases()?,
            requests: cli.requests,
            rates: cli.rates.clone().unwrap_or_default(),
            limit: cli.limit.map(Duration::from_millis),
            wires: file.wires(),
            analog: file.analog(),
        })
    }

    fn cases(&self) -> Result<Vec<Case>> {
        if self.cli.no_suite {
            return Ok(Vec::new());
        }
        chosen(&self.cli.only)
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;
    use register_map::Module;

    use super::*;
    use crate::fake::Line;

    fn parse(arguments: &[&str]) -> Result<Cli, clap::Error> {
        Cli::try_parse_from([&["x"], arguments].concat())
    }

    fn setup(file: &str, arguments: &[&str]) -> Result<Setup, String> {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("bench.toml");
        std::fs::write(&path, file).unwrap();
        let path = path.to_string_lossy();
        parse(&[&["--bench", &path], arguments].concat())
            .unwrap()
            .setup()
            .map_err(|error| format!("{error:#}"))
    }

    const FILE: &str = "port = \"/dev/a\"\nprobe = \"1:2\"\nunit = 7\nbaud = 19200\nformat = \"8E1\"\n\
                        module = \"4ao\"\nreset_cmd = \"r\"\n";

    #[test]
    fn bench_file_is_used_where_the_command_line_says_nothing() {
        let setup = setup(FILE, &["--flash"]).unwrap();
        assert_eq!(setup.port(), Some(Path::new("/dev/a")));
        assert_eq!(setup.line().to_string(), "19200 8E1");
        assert_eq!(setup.flash().unwrap().probe.as_deref(), Some("1:2"));
        assert_eq!(setup.reset(), Some("r"));
        let plan = setup.plan(&Line::new(&[1])).unwrap();
        assert_eq!((plan.unit, plan.module), (7, Some(Module::Ao4)));
    }

    #[test]
    fn command_line_takes_precedence_over_the_bench_file() {
        let arguments = "--port /dev/b --flash --probe 3:4 --unit 9 --baud 9600 --format 8N1 --module 4di --reset-cmd s";
        let merged = setup(FILE, &arguments.split(' ').collect::<Vec<_>>()).unwrap();
        assert_eq!(merged.port(), Some(Path::new("/dev/b")));
        assert_eq!(merged.line().to_string(), "9600 8N1");
        assert_eq!(merged.flash().unwrap().probe.as_deref(), Some("3:4"));
        assert_eq!(merged.reset(), Some("s"));
        let plan = merged.plan(&Line::new(&[1])).unwrap();
        assert_eq!((plan.unit, plan.module), (9, Some(Module::Di4)));
        assert_eq!(setup(FILE, &["--tcp", "b:1"]).unwrap().port(), None);
        assert_eq!(setup(FILE, &[]).unwrap().flash(), None);
    }

    #[test]
    fn modioctl_gets_port_line_and_unit() {
        let reached = |arguments: &str| {
            let arguments: Vec<_> = arguments.split(' ').collect();
            setup("", &arguments).unwrap().reached().join(" ")
        };
        let serial = "--port /dev/b --baud 19200 --format 8E1 --unit 9";
        assert_eq!(reached(serial), serial);
        let tcp = "--tcp a:1 --baud 9600 --format 8N2 --unit 1";
        assert_eq!(reached("--tcp a:1"), tcp);
    }

    #[test]
    fn mistake_is_one_line_that_names_the_file_and_the_line() {
        let error = setup("unit = 1\nprot = \"x\"", &[]).unwrap_err();
        assert!(
            error.contains("bench.toml:2: unknown field `prot`"),
            "{error}"
        );
        assert!(!error.contains('\n'), "{error}");
        let error = setup("unit = 1", &[]).unwrap_err();
        assert!(error.contains("--port"), "{error}");
        let error = setup(FILE, &["--no-suite", "--requests", "0"]).unwrap_err();
        assert!(error.starts_with("nothing to test"), "{error}");
        let error = setup(FILE, &["--format", "7E1"]).unwrap_err();
        assert!(error.starts_with("a modio has no format 7E1"), "{error}");
        let cli = parse(&["--bench", "/nowhere/b.toml"]).unwrap();
        let error = format!("{:#}", cli.setup().unwrap_err());
        assert!(error.starts_with("/nowhere/b.toml: "), "{error}");
    }
}
