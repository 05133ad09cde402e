//! Tests with scripts in place of Renode: which programs are found and run, their order, and how their end is reported.

use anyhow::Error;

use super::find::Places;
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
import os, re, socket, sys, threading
line = int(re.search(r'^.port=(\d+)', open(sys.argv[-1]).read(), re.M).group(1))
monitor = socket.create_server(('127.0.0.1', int(sys.argv[sys.argv.index('--port') + 1])))
def serve(server):
    while True:
        client = server.accept()[0]
        for line in client.makefile():
            client.sendall(b'ok 0.000 version=1 line=9600,8N2 abilities= name=fake\\n')
threading.Thread(target=serve, args=[socket.create_server(('127.0.0.1', line))], daemon=True).start()
received = monitor.accept()[0].makefile().read().lstrip()
open(os.environ['CALLS'], 'a').write('monitor ' + received)
" "$@" &
wait $!
"#;

/// Leaves results like the real renode-test.
const RENODE_TEST: &str = r#"
echo "renode-test $*" >> "$CALLS"
echo results > "$2/robot_output.xml"
"#;

/// A Python whose rebot reports no failed test.
const REBOT: &str = r#"[ "$3" = robot.rebot ] || exit 252; echo "rebot $*" >> "$CALLS""#;

/// Records its options.
const CONFORMANCE: &str = r#"
echo "conformance $*" >> "$CALLS"
"#;

struct Fake {
    directory: tempfile::TempDir,
}

impl Fake {
    fn new() -> Self {
        let directory = tempfile::tempdir().unwrap();
        let fake = Self { directory };
        fake.program("renode", RENODE);
        fake.program("renode-test", RENODE_TEST);
        fake.program("python", REBOT);
        fake.program("conformance", CONFORMANCE);
        fake
    }

    fn at(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    fn program(&self, name: &str, script: &str) {
        let text = format!("CALLS='{}'\n{script}", self.at("calls").display());
        program(self.directory.path(), name, &text);
    }

    fn find(&self) -> Result<Renode> {
        Renode::find(Some(&self.at("renode")), &Places::default())
    }

    fn bench(&self) -> Bench {
        let bench = Bench {
            directory: Workspace::open().unwrap().root().join(DIRECTORY),
            output: self.at("output with a space"),
            board: &register_map::board::MODIO_02,
            renode: self.find().unwrap(),
            elf: self.at("modio"),
        };
        fs::create_dir_all(&bench.output).unwrap();
        bench
    }

    fn suites(&self, bench: &Bench) -> Result<()> {
        suites::run(bench, &self.at("python"))
    }

    fn conformance(&self, bench: &Bench) -> Result<()> {
        live::conformance(bench, Module::Do4, &self.at("conformance"))
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
fn renode_is_found_by_option_then_variable_then_path() {
    let [option, variable, path] = [(); 3].map(|()| Fake::new());
    let mut places = Places {
        variable: Some(variable.directory.path().to_owned()),
        path: path.directory.path().into(),
    };
    let found =
        |asked: Option<&Path>, places: &Places| Renode::find(asked, places).unwrap().program;
    assert_eq!(
        found(Some(&option.at("renode")), &places),
        option.at("renode")
    );
    assert_eq!(
        found(Some(option.directory.path()), &places),
        option.at("renode")
    );
    assert_eq!(found(None, &places), variable.at("renode"));
    places.variable = None;
    assert_eq!(found(None, &places), path.at("renode"));
    let text = message(Renode::find(None, &Places::default()));
    for part in ["not installed", "github.com/renode", "cargo xtask sim"] {
        assert!(text.contains(part) && !text.contains('\n'), "{text}");
    }
}

#[test]
fn place_without_renode_is_a_usage_error() {
    let is_usage = |error: &Error| error.is::<crate::error::Usage>();
    let places = Places {
        variable: Some("/nowhere/renode".into()),
        ..Places::default()
    };
    for (asked, text) in [
        (None, "$RENODE: there is no Renode at /nowhere/renode"),
        (
            Some(Path::new("/none")),
            "--renode: there is no Renode at /none",
        ),
    ] {
        let error = Renode::find(asked, &places).unwrap_err();
        assert!(is_usage(&error) && error.to_string() == text, "{error}");
    }
}

#[test]
fn old_or_broken_renode_is_refused() {
    let fake = Fake::new();
    let prints = |version: &str| fake.program("renode", &format!("echo '{version}'"));
    prints("Renode v1.16.0.1525");
    let text = message(fake.find());
    assert!(
        text.contains("too old") && text.contains("1.16.1"),
        "{text}"
    );
    prints("Renode v1.17.0.1 (x)");
    assert!(fake.find().is_ok());
    fake.program("renode", "echo 'error: no .NET' >&2; exit 131");
    let text = message(fake.find());
    assert!(
        text.contains("does not report its version: error: no .NET"),
        "{text}"
    );
}

#[test]
fn suites_run_with_image_and_board() {
    for (board, wanted) in [
        (&register_map::board::MODIO_02, "tests/boot.robot"),
        (&register_map::board::MODIO_08, "modio-08/slots.robot"),
    ] {
        let fake = Fake::new();
        let bench = Bench {
            board,
            ..fake.bench()
        };
        fake.suites(&bench).unwrap();
        let calls = fake.calls();
        let elf = format!("--variable ELF:{}", fake.at("modio").display());
        let name = format!("--variable BOARD_NAME:{board}");
        for part in [
            "renode-test -r ",
            &elf,
            &name,
            wanted,
            "tests/watchdog.robot",
        ] {
            assert!(calls[0].contains(part), "{part}: {}", calls[0]);
        }
        assert!(
            calls[1].contains("--xunit") && calls[1].contains("robot.xml"),
            "{}",
            calls[1]
        );
    }
}

#[test]
fn conformance_suite_runs_against_the_board_in_renode() {
    let fake = Fake::new();
    fake.conformance(&fake.bench()).unwrap();
    let calls = fake.calls();
    let [renode, conformance, monitor] = calls.as_slice() else {
        panic!("{calls:?}");
    };
    assert!(
        renode.starts_with("renode --disable-gui --plain --port "),
        "{renode}"
    );
    let parts = [
        "conformance --exact-line 127.0.0.1:",
        "--allow-config",
        "--unit 1",
    ];
    for part in parts
        .into_iter()
        .chain(["conformance-4do.xml", "conformance-4do.json"])
    {
        assert!(conformance.contains(part), "{conformance}");
    }
    assert_eq!(
        monitor, "monitor quit",
        "Renode was ended by its own command"
    );
    let script = fs::read_to_string(fake.at("calls.resc")).unwrap();
    let port = conformance.split([':', ' ']).nth(3).unwrap();
    let elf = live::token(&fake.at("modio"));
    let expected = format!("$elf={elf}\n$dip=1\n$module=\"4do\"\n$port={port}\ninclude @");
    assert!(script.starts_with(&expected), "{script}");
    assert!(
        script.trim_end().ends_with("renode/modio-02-exact.resc"),
        "{script}"
    );
}

#[test]
fn end_of_the_suites_is_reported() {
    let fake = Fake::new();
    for (script, failed, expected) in [
        (format!("{RENODE_TEST}exit 1"), 3, "3 tests failed"),
        (RENODE_TEST.to_owned(), 3, "hidden a failure"),
        (RENODE_TEST.to_owned(), 252, "robot_output.xml"),
        (format!("{RENODE_TEST}exit 2"), 0, "Renode crashed"),
        ("exit 0".to_owned(), 0, "left no"),
        ("exit 5".to_owned(), 0, "status 5"),
        ("kill -KILL $$".to_owned(), 0, "was ended"),
    ] {
        let _ = fs::remove_dir_all(fake.at("output with a space"));
        fake.program("renode-test", &script);
        fake.program("python", &format!("exit {failed}"));
        let text = message(fake.suites(&fake.bench()));
        assert!(text.contains(expected), "{text}");
    }
    fs::remove_file(fake.at("renode-test")).unwrap();
    let text = message(fake.bench().renode.tester(&Places::default()));
    assert!(text.contains("no renode-test beside"), "{text}");
}

#[test]
fn end_of_the_conformance_suite_is_reported() {
    let fake = Fake::new();
    for (script, expected) in [
        ("exit 1", "cases failed"),
        ("exit 2", "nothing could be tested"),
        ("exit 3", "was ended"),
    ] {
        fake.program("conformance", script);
        let text = message(fake.conformance(&fake.bench()));
        assert!(text.contains(expected), "{script}: {text}");
    }
}

#[test]
fn renode_that_does_not_start_is_reported_with_its_error() {
    let fake = Fake::new();
    let bench = fake.bench();
    fake.program("renode", "echo 'Error E25: no such type'; echo bye; exit 0");
    let text = message(fake.conformance(&bench));
    assert_eq!(
        text,
        "Renode does not start the board: Error E25: no such type"
    );
    assert!(fake.calls().is_empty(), "conformance was not tried");
}

#[test]
fn renode_that_dies_during_the_run_is_a_failure_even_if_all_cases_passed() {
    let fake = Fake::new();
    let pid = format!("{}.pid", fake.at("calls").display());
    fake.program(
        "renode",
        &format!("[ \"$1\" = --version ] || echo $$ > \"$CALLS.pid\"\n{RENODE}"),
    );
    let killer = format!("sleep 0.2; kill -KILL $(cat '{pid}'); sleep 0.5; exit 0");
    fake.program("conformance", &killer);
    let text = message(fake.conformance(&fake.bench()));
    assert!(
        text.starts_with("Renode ended before the conformance suite did"),
        "{text}"
    );
}

#[test]
fn spaces_in_paths_are_escaped_for_the_monitor() {
    let written = live::token(Path::new("/home/a b/modio"));
    assert_eq!(written, "@/home/a\\ b/modio");
}
