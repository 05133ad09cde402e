//! Tests with scripts in place of Renode: which programs are found and run, their order, and how their end is reported.

use super::*;
use crate::script::program;

/// Prints a version, or opens the port of the script in its arguments and waits for `quit`.
const RENODE: &str = r#"
if [ "$1" = --version ]; then echo 'Renode v1.16.1.32541'; exit 0; fi
echo "renode $*" >> "$CALLS"
for script; do :; done
cp "$script" "$CALLS.resc"
export CALLS
python3 -c "
import os, re, socket, sys
line = int(re.search(r'^.port=(\d+)', open(sys.argv[-1]).read(), re.M).group(1))
monitor = socket.create_server(('127.0.0.1', int(sys.argv[sys.argv.index('--port') + 1])))
server = socket.create_server(('127.0.0.1', line))
received = monitor.accept()[0].makefile().read().lstrip()
open(os.environ['CALLS'], 'a').write('monitor ' + received)
" "$@" &
wait $!
"#;

struct Fake(tempfile::TempDir);

impl Fake {
    fn new() -> Self {
        let fake = Self(tempfile::tempdir().unwrap());
        fake.program("renode", RENODE);
        fake.program("renode-test", r#"echo "renode-test $*" >> "$CALLS""#);
        fake
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn program(&self, name: &str, script: &str) {
        let text = format!("CALLS='{}'\n{script}", self.at("calls").display());
        program(self.0.path(), name, &text);
    }

    fn find(&self) -> Result<Renode> {
        Renode::find(Some(&self.at("renode")))
    }

    fn setup(&self) -> Setup {
        let setup = Setup {
            directory: Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../renode")).to_owned(),
            output: self.at("output with a space"),
            board: &register_map::board::MODIO_08,
            renode: self.find().unwrap(),
            elf: self.at("loader"),
            image: Some(self.at("modio-a.image")),
        };
        fs::create_dir_all(&setup.output).unwrap();
        setup
    }

    /// The same with the image that runs without a loader.
    fn plain(&self) -> Setup {
        Setup {
            elf: self.at("modio"),
            image: None,
            ..self.setup()
        }
    }

    fn suites(&self, setup: &Setup, rebot: &str) -> Result<()> {
        self.program("python", rebot);
        suites::run(setup, &self.at("python"))
    }

    fn conformance(&self, setup: &Setup, script: &str) -> Result<()> {
        self.program("conformance", script);
        live::conformance(setup, Module::Do4, &self.at("conformance"))
    }

    fn calls(&self) -> Vec<String> {
        let text = fs::read_to_string(self.at("calls")).unwrap_or_default();
        text.lines().map(str::to_owned).collect()
    }
}

fn message<T: std::fmt::Debug>(result: Result<T>) -> String {
    result.unwrap_err().to_string()
}

#[test]
fn renode_is_found_by_its_file_or_its_directory() {
    let fake = Fake::new();
    for place in [fake.0.path(), &fake.at("renode")] {
        let found = Renode::find(Some(place)).unwrap();
        assert_eq!(found.program, fake.at("renode"));
    }
    let error = Renode::find(Some(Path::new("/no"))).unwrap_err();
    assert!(error.is::<crate::error::Usage>());
    assert_eq!(error.to_string(), "there is no Renode at /no");
}

#[test]
fn old_or_broken_renode_is_refused() {
    let fake = Fake::new();
    for (script, expected) in [
        (
            "echo 'Renode, version 1.17.0.1234 (x-202610011234)'",
            "1.17.0",
        ),
        ("echo '10:20:30.1 [INFO] x'; echo Renode v2.0.0", "2.0.0"),
        ("echo Renode v1.16.0.1525", "is too old"),
        (
            "echo 'error: no .NET' >&2; exit 131",
            "version: error: no .NET",
        ),
    ] {
        fake.program("renode", script);
        let found = fake.find().map(|found| found.version.to_string());
        let text = found.unwrap_or_else(|error| error.to_string());
        assert!(text.contains(expected), "{text}");
    }
}

#[test]
fn suites_run_with_image_and_board_and_their_end_is_reported() {
    let fake = Fake::new();
    let rebot = r#"[ "$3" = robot.rebot ] || exit 252; echo "rebot $*" >> "$CALLS""#;
    fake.suites(&fake.setup(), rebot).unwrap();
    fake.suites(&fake.plain(), rebot).unwrap();
    let calls = fake.calls();
    let at = |name| fake.at(name).display().to_string();
    let (loader, image) = (at("loader"), at("modio-a.image"));
    let loaded = format!(" --variable ELF:{loader} --variable IMAGE:{image} ");
    let plain = format!(" --variable ELF:{} --variable PLAIN:true ", at("modio"));
    let parts = "BOARD_NAME:modio-08 tests/boot.robot modio-08/slots.robot";
    for (call, images) in [(&calls[0], &loaded), (&calls[2], &plain)] {
        for part in parts.split(' ').chain([images.as_str()]) {
            assert!(call.contains(part), "{part}: {call}");
        }
    }
    assert!(calls[1].ends_with("robot_output.xml"), "{}", calls[1]);
    for (test, rebot, expected) in [
        ("exit 1", "exit 3", "tests failed"),
        ("exit 0", "exit 252", "no results"),
        ("exit 2", "exit 0", "Renode crashed"),
        ("exit 5", "exit 0", "status Some(5)"),
    ] {
        fake.program("renode-test", test);
        let text = message(fake.suites(&fake.setup(), rebot));
        assert!(text.contains(expected), "{text}");
    }
    fs::remove_file(fake.at("renode-test")).unwrap();
    let text = message(fake.suites(&fake.setup(), "exit 0"));
    assert!(text.contains("no renode-test beside"), "{text}");
}

#[test]
fn conformance_suite_runs_against_the_board_in_renode() {
    let fake = Fake::new();
    let note = r#"echo "conformance $*" >> "$CALLS""#;
    fake.conformance(&fake.setup(), note).unwrap();
    let calls = fake.calls();
    let [renode, conformance, monitor] = calls.as_slice() else {
        panic!("{calls:?}");
    };
    assert!(renode.starts_with("renode --disable-gui --plain --port "));
    let parts = "--exact-line 127.0.0.1: --allow-config conformance-4do.xml conformance-4do.json";
    for part in parts.split(' ') {
        assert!(conformance.contains(part), "{conformance}");
    }
    assert_eq!(monitor, "monitor quit");
    let script = || fs::read_to_string(fake.at("calls.resc")).unwrap();
    let loaded = script();
    let port = conformance.split([':', ' ']).nth(3).unwrap();
    let at = |name| fake.at(name).display().to_string();
    let (loader, image) = (at("loader"), at("modio-a.image"));
    let expected = format!(
        "$elf=@{loader}\n$image=@{image}\n$dip=1\n$module=\"4do\"\n$port={port}\ninclude @"
    );
    assert!(loaded.starts_with(&expected), "{loaded}");
    assert!(loaded.ends_with("renode/modio-08-exact.resc\n"), "{loaded}");

    fake.conformance(&fake.plain(), note).unwrap();
    let expected = format!("$elf=@{}\n$plain=true\n$dip=1\n", at("modio"));
    assert!(script().starts_with(&expected), "{}", script());
    let text = message(fake.conformance(&fake.setup(), "exit 1"));
    assert_eq!(text, "cases failed");
}

#[test]
fn renode_that_does_not_start_or_dies_is_a_failure_even_if_all_cases_passed() {
    let fake = Fake::new();
    let start = "[ \"$1\" = --version ] || echo $$ > \"$CALLS.pid\"";
    fake.program("renode", &format!("{start}\n{RENODE}"));
    let setup = fake.setup();
    let kill = "kill -KILL $(cat \"$CALLS.pid\"); sleep 0.5";
    let text = message(fake.conformance(&setup, kill));
    assert!(text.starts_with("Renode ended before"), "{text}");
    let no_type = "echo 'Renode v1.16.1'; echo 'Error E25: no such type'; echo bye";
    fake.program("renode", no_type);
    let text = message(fake.conformance(&setup, "echo tried >> \"$CALLS\""));
    let expected = "Renode does not start the board: Error E25: no such type";
    assert_eq!(text, expected);
    assert!(!fake.calls().contains(&"tried".to_owned()));
}
