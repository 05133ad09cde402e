//! Renode played by scripts: what is found and run, in which order, and what becomes of it.

use std::fs;
use std::path::{Path, PathBuf};

use super::find::Surroundings;
use super::*;
use crate::script::program;

/// Prints a version, or opens the port of the script it is given and waits for `quit`.
const RENODE: &str = r#"
if [ "$1" = --version ]; then echo 'Renode v1.16.1.32541'; exit 0; fi
echo "renode $*" >> "$CALLS"
for script; do :; done
cp "$script" "$CALLS.resc"
export CALLS
python3 -c "
import os, re, socket, sys, threading
line = int(re.search(r'^.port=(\d+)', open(sys.argv[-1]).read(), re.M).group(1))
monitor = socket.create_server(('127.0.0.1', int(sys.argv[sys.argv.index('--port') + 1])))
def serve(server):
    while True:
        client = server.accept()[0]
        for line in client.makefile():
            client.sendall(b'ok 0.000 version=1 line=9600,8N2 abilities= name=fake\\n')
threading.Thread(target=serve, args=[socket.create_server(('127.0.0.1', line))], daemon=True).start()
told = monitor.accept()[0].makefile().read().lstrip()
open(os.environ['CALLS'], 'a').write('told ' + told)
" "$@" &
wait $!
"#;

/// Leaves results as the real one does.
const RENODE_TEST: &str = r#"
echo "renode-test $*" >> "$CALLS"
echo '<suite name="S"><test name="T"><status status="PASS"/></test></suite>' > "$2/robot_output.xml"
"#;

/// Writes down its options.
const CONFORMANCE: &str = r#"
echo "conformance $*" >> "$CALLS"
"#;

struct Fake {
    directory: tempfile::TempDir,
}

impl Fake {
    fn new() -> Self {
        let fake = Self {
            directory: tempfile::tempdir().unwrap(),
        };
        fake.program("renode", RENODE);
        fake.program("renode-test", RENODE_TEST);
        fake.program("conformance", CONFORMANCE);
        fake
    }

    fn at(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    fn program(&self, name: &str, script: &str) -> PathBuf {
        let calls = self.at("calls");
        let text = format!("CALLS='{}'\n{script}", calls.display());
        program(self.directory.path(), name, &text)
    }

    fn version(&self, version: &str) -> PathBuf {
        self.program("renode", &format!("echo '{version}'"))
    }

    fn find(&self) -> Result<Renode> {
        Renode::find(Some(&self.at("renode")), &Surroundings::default())
    }

    fn bench(&self) -> Bench {
        Bench {
            directory: Workspace::open().unwrap().root().join(DIRECTORY),
            output: self.at("output with a space"),
            board: &register_map::board::MODIO_02,
            renode: self.find().unwrap(),
            elf: self.at("modio"),
        }
    }

    /// Both steps, one after the other, as `Bench::run` has them.
    fn run(&self) -> (Result<()>, Result<()>) {
        let bench = self.bench();
        fs::create_dir_all(&bench.output).unwrap();
        let suites = suites::run(&bench);
        let conformance = self.at("conformance");
        let conformance = live::conformance(&bench, Module::Do4, &conformance);
        (suites, conformance)
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
fn it_is_found_by_option_then_variable_then_path_then_usual_places() {
    let [option, variable, path, usual] = [(); 4].map(|()| Fake::new());
    let directory = |fake: &Fake| fake.directory.path().to_owned();
    let mut machine = Surroundings {
        variable: Some(directory(&variable).into()),
        path: vec!["/nowhere".into(), directory(&path)],
        usual: vec![directory(&usual)],
    };
    let found = |asked: Option<&Path>, machine: &Surroundings| {
        let text = Renode::find(asked, machine).unwrap().to_string();
        let place = text.strip_prefix("Renode 1.16.1 at ").unwrap().to_owned();
        PathBuf::from(place)
    };
    assert_eq!(
        found(Some(&option.at("renode")), &machine),
        option.at("renode")
    );
    assert_eq!(
        found(Some(option.directory.path()), &machine),
        option.at("renode")
    );
    assert_eq!(found(None, &machine), variable.at("renode"));
    machine.variable = None;
    assert_eq!(found(None, &machine), path.at("renode"));
    machine.path.pop();
    assert_eq!(found(None, &machine), usual.at("renode"));
    machine.usual.clear();
    let failure = Renode::find(None, &machine).unwrap_err();
    let text = failure.to_string();
    assert!(
        text.contains("not installed") && text.contains("github.com/renode"),
        "{text}"
    );
    assert!(text.contains("cargo xtask sim"), "{text}");
    assert!(!text.contains('\n'));
    assert_eq!(failure.code, 1);
}

#[test]
fn a_place_that_was_named_and_has_none_is_a_mistake() {
    let machine = Surroundings {
        variable: Some("/nowhere/renode".into()),
        ..Surroundings::default()
    };
    let failure = Renode::find(None, &machine).unwrap_err();
    assert_eq!(
        failure.to_string(),
        "$RENODE: there is no Renode at /nowhere/renode"
    );
    assert_eq!(failure.code, 2);
    let failure = Renode::find(Some(Path::new("/none")), &machine).unwrap_err();
    assert_eq!(failure.to_string(), "--renode: there is no Renode at /none");
}

#[test]
fn one_that_is_too_old_or_none_is_told() {
    let fake = Fake::new();
    for old in ["Renode v1.16.0.1525", "Renode, version 1.15.3.2"] {
        fake.version(old);
        let text = message(fake.find());
        assert!(
            text.contains("too old") && text.contains("1.16.1"),
            "{text}"
        );
    }
    for new in ["Renode v1.16.1.1", "Renode v1.17.0.1 (x)", "Renode v2.0.0"] {
        fake.version(new);
        assert!(fake.find().is_ok(), "{new}");
    }
    fake.program("renode", "echo 'error: no .NET' >&2; exit 131");
    let text = message(fake.find());
    assert!(
        text.contains("does not tell its version: error: no .NET"),
        "{text}"
    );
}

#[test]
fn suites_run_first_and_then_conformance_against_the_board() {
    let fake = Fake::new();
    assert_eq!(fake.run(), (Ok(()), Ok(())));
    let calls = fake.calls();
    let [suites, renode, conformance, told] = calls.as_slice() else {
        panic!("{calls:?}");
    };
    assert!(suites.starts_with("renode-test -r "), "{suites}");
    assert!(suites.contains(&format!("--variable ELF:{}", fake.at("modio").display())));
    assert!(
        suites.contains("boot.robot") && suites.contains("watchdog.robot"),
        "{suites}"
    );
    assert!(
        renode.starts_with("renode --disable-gui --plain --port "),
        "{renode}"
    );
    assert!(
        conformance.starts_with("conformance --exact-line 127.0.0.1:"),
        "{conformance}"
    );
    for option in [
        "--allow-config",
        "--unit 1",
        "conformance-4do.xml",
        "conformance-4do.json",
    ] {
        assert!(conformance.contains(option), "{option}");
    }
    assert_eq!(told, "told quit", "Renode was ended by its own command");

    let script = fs::read_to_string(fake.at("calls.resc")).unwrap();
    let port = conformance.split(['=', ':', ' ']).nth(3).unwrap();
    assert!(script.contains(&format!("$port={port}\n")), "{script}");
    assert!(script.contains("$module=\"4do\"\n$"), "{script}");
    assert!(script.contains(&format!("$elf={}\n", live::token(&fake.at("modio")))));
    assert!(
        script.trim_end().ends_with("renode/modio-02-exact.resc"),
        "{script}"
    );
    assert!(fake.at("output with a space/robot.xml").is_file());
}

#[test]
fn another_board_has_scripts_and_suites_of_its_own() {
    let fake = Fake::new();
    let bench = Bench {
        board: &register_map::board::MODIO_08,
        ..fake.bench()
    };
    fs::create_dir_all(&bench.output).unwrap();
    assert_eq!(suites::run(&bench), Ok(()));
    let conformance = fake.at("conformance");
    let ran = live::conformance(&bench, Module::Do4, &conformance);
    assert_eq!(ran, Ok(()));
    let suites = &fake.calls()[0];
    assert!(suites.contains("modio-08/slots.robot"), "{suites}");
    assert!(suites.contains("tests/watchdog.robot"), "{suites}");
    assert!(suites.contains("BOARD_NAME:modio-08"), "{suites}");
    let script = fs::read_to_string(fake.at("calls.resc")).unwrap();
    let script = script.trim_end();
    assert!(script.ends_with("renode/modio-08-exact.resc"), "{script}");
}

#[test]
fn how_the_suites_end_is_told() {
    let fake = Fake::new();
    let failing = RENODE_TEST.replace("PASS", "FAIL");
    for (script, expected) in [
        (format!("{failing}exit 1"), "1 of 1 tests failed"),
        (format!("{failing}exit 0"), "hid a failure"),
        (format!("{RENODE_TEST}exit 2"), "Renode crashed"),
        ("exit 0".to_owned(), "left no"),
        ("exit 5".to_owned(), "status 5"),
        ("kill -KILL $$".to_owned(), "was ended"),
    ] {
        let _ = fs::remove_dir_all(fake.at("output with a space"));
        fake.program("renode-test", &script);
        let (suites, conformance) = fake.run();
        let text = message(suites);
        assert!(text.contains(expected), "{text}");
        assert_eq!(conformance, Ok(()), "it runs whatever the suites do");
    }
    fs::remove_file(fake.at("renode-test")).unwrap();
    let text = message(fake.bench().renode.tester(&Surroundings::default()));
    assert!(text.contains("no renode-test beside"), "{text}");
}

#[test]
fn how_conformance_ends_is_told() {
    let fake = Fake::new();
    for (script, expected) in [
        ("exit 1", "cases failed"),
        ("exit 2", "nothing could be tested"),
        ("exit 3", "was ended"),
    ] {
        fake.program("conformance", script);
        assert!(message(fake.run().1).contains(expected), "{script}");
    }
}

#[test]
fn a_renode_that_does_not_come_up_is_told_with_what_it_said() {
    let fake = Fake::new();
    let bench = fake.bench();
    fs::create_dir_all(&bench.output).unwrap();
    fake.program("renode", "echo 'Error E25: no such type'; echo bye; exit 0");
    let text = message(live::conformance(
        &bench,
        Module::Do4,
        &fake.at("conformance"),
    ));
    assert_eq!(
        text,
        "Renode does not start the board: Error E25: no such type"
    );
    assert_eq!(
        fake.calls(),
        Vec::<String>::new(),
        "conformance was not tried"
    );
}

#[test]
fn renode_that_dies_during_the_run_is_a_failure_even_if_all_cases_passed() {
    let fake = Fake::new();
    let calls = fake.at("calls");
    let killer = format!(
        "sleep 0.2; kill -KILL $(cat '{}.pid'); sleep 0.5; exit 0",
        calls.display()
    );
    fake.program(
        "renode",
        &format!("[ \"$1\" = --version ] || echo $$ > \"$CALLS.pid\"\n{RENODE}"),
    );
    fake.program("conformance", &killer);
    let text = message(fake.run().1);
    assert!(
        text.starts_with("Renode ended before the conformance suite did"),
        "{text}"
    );
}

#[test]
fn paths_are_written_as_the_monitor_takes_them() {
    let written = live::token(Path::new("/home/a b/modio"));
    assert_eq!(written, "@/home/a\\ b/modio");
}
