//! The command: its exit status, its output and its files. It tests the reference server over a socket.

use std::fs;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::thread;
use std::time::{Duration, Instant};

use conformance::about::Unit as About;
use conformance::frame::Mode;
use conformance::points::pdu;
use conformance::tester::Tester;
use modbus_line::LineFormat;
use register_map::state;
use tempfile::TempDir;

use super::endpoint::Reference;
use super::fault::Fault;
use super::modio::UNIT;
use super::probed;
use super::unit::{Character, Unit};

const PROFILE: &str = r#"
unit = 9
functions = [1, 2, 3, 4, 5, 6, 7, 8, 11, 12, 15, 16, 17, 22, 23, 43]

[coils]
read = ["100-2199"]
write = ["100-107"]

[holding_registers]
read = ["1000-1199"]
write = ["1000-1003"]
values = [1, 4000]
refused = 5000
"#;

/// Runs the command with these arguments, which spaces separate.
fn command(arguments: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_modio-conformance"))
        .args(arguments.split_whitespace())
        .output()
        .expect("the command runs")
}

/// Runs the command against a server with this fault, with the profile in a file of a new directory.
fn tested(fault: Option<Fault>, arguments: &str) -> (Output, TempDir) {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().display();
    std::fs::write(directory.path().join("profile.toml"), PROFILE).expect("written");
    let address = server(fault);
    let arguments = arguments.replace("DIR", &path.to_string());
    let endpoint = format!("--tcp {address} --profile {path}/profile.toml --patience 60");
    (command(&format!("{endpoint} {arguments}")), directory)
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Serves one master on a socket until it disconnects. A silence of 8 ms ends a frame. A file with `on` or `off` switches
/// the unit's power, and is removed then.
fn serve(mut stream: TcpStream, mut unit: Unit, power: &Path) {
    let begin = Instant::now();
    let mut powered = true;
    stream
        .set_read_timeout(Some(Duration::from_millis(8)))
        .expect("a socket takes a time-out");
    let mut buffer = [0; 1024];
    loop {
        if let Ok(state) = fs::read_to_string(power) {
            powered = state.trim() == "on";
            unit.start(begin.elapsed());
            fs::remove_file(power).expect("the file can be removed");
        }
        match stream.read(&mut buffer) {
            Ok(0) => return,
            Ok(length) => {
                for byte in buffer[..length].iter().filter(|_| powered) {
                    let at = begin.elapsed();
                    unit.receive(Character {
                        byte: *byte,
                        start: at,
                        end: at,
                        parity_error: false,
                        stop_error: false,
                    });
                }
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                unit.close(begin.elapsed());
                let reply: Vec<u8> = unit.sent.drain(..).map(|received| received.byte).collect();
                if stream.write_all(&reply).is_err() {
                    return;
                }
            }
            Err(_) => return,
        }
    }
}

/// Starts a server of such units. Returns its address.
fn served(unit: impl Fn() -> Unit + Send + 'static, power: PathBuf) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = listener.local_addr().expect("bound").to_string();
    thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            let (unit, power) = (unit(), power.clone());
            thread::spawn(move || serve(stream, unit, &power));
        }
    });
    address
}

/// Starts a server with this fault. Returns its address.
fn server(fault: Option<Fault>) -> String {
    served(
        move || Unit::new(fault, Mode::Rtu, LineFormat::default()),
        PathBuf::new(),
    )
}

#[test]
fn good_server_passes_and_the_reports_are_written() {
    let arguments = "--only fc05/ --only timing/ --exclude fc05/length --trace \
        --junit DIR/junit.xml --json DIR/result.json";
    let (output, directory) = tested(None, arguments);
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(0), "{out}{err}");
    assert!(
        out.contains("fc05/value") && out.contains("0 failed"),
        "{out}"
    );
    assert!(out.contains("the endpoint's time is not exact"), "{out}");
    assert!(!out.contains("fc05/length"), "{out}");
    let traced = |what: &str| err.lines().any(|line| line.contains(what));
    assert!(
        traced(" s sent     09 05 ") && traced(" s received 09 05 "),
        "{err}"
    );
    let read = |name: &str| std::fs::read_to_string(directory.path().join(name)).expect("there");
    let xml = read("junit.xml");
    assert!(xml.contains("failures=\"0\"") && xml.contains("classname=\"fc05\""));
    let json: serde_json::Value = serde_json::from_str(&read("result.json")).expect("JSON");
    assert_eq!(json["failed"], 0);
    assert!(json["passed"].as_u64() > Some(3));
}

#[test]
fn faulty_server_gives_status_1_and_its_failure_is_printed() {
    let (output, _) = tested(Some(Fault::Answers126), "--only fc03/quantity-above-most");
    let out = text(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{out}");
    for part in [
        "FAILED",
        "09 03 03 E8 00 7E",
        "exception 03 to function 03",
        "1 failed",
        "failed: fc03/quantity-above-most",
    ] {
        assert!(out.contains(part), "{part}: {out}");
    }
}

#[test]
fn run_that_cannot_test_gives_status_2_and_one_line() {
    let nobody = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let nowhere = nobody.local_addr().expect("bound").to_string();
    drop(nobody);
    let silent = server(Some(Fault::SilentToUnknown));
    for (arguments, part) in [
        ("", "--serial PORT"),
        ("--tcp NOWHERE", "cannot connect"),
        ("--serial /dev/no-such-port", "there is no port"),
        ("--tcp SILENT --unit 77 --patience 50", "does not answer"),
        ("--tcp SILENT --unit 9 --patience 50", "--profile"),
        ("--tcp SILENT --profile /no/profile", "/no/profile"),
        ("--tcp NOWHERE --json /no/report", "cannot write /no/report"),
        ("--tcp NOWHERE --json x --junit x", "the same file"),
        ("--only no-such-case", "--list"),
        ("--format 9N1", "8N2"),
        ("--no-such-option", "unexpected argument"),
    ] {
        let arguments = arguments.replace("NOWHERE", &nowhere);
        let arguments = arguments.replace("SILENT", &silent);
        let output = command(&arguments);
        let err = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {err}");
        assert!(err.contains(part), "{arguments:?}: {err}");
        assert_eq!(err.trim_end().lines().count(), 1, "{err}");
    }
}

#[test]
fn run_that_ends_before_its_first_case_leaves_no_reports_of_an_earlier_run() {
    let directory = tempfile::tempdir().expect("a directory");
    let at = |name: &str| directory.path().join(name);
    let (json, junit) = (at("result.json"), at("junit.xml"));
    fs::write(&json, "old").expect("written");
    fs::write(&junit, "old").expect("written");
    let (json_shown, junit_shown) = (json.display(), junit.display());
    let silent = server(None);
    let output = command(&format!(
        "--tcp {silent} --unit 77 --patience 50 --json {json_shown} --junit {junit_shown}"
    ));
    assert_eq!(output.status.code(), Some(2));
    let json = fs::read_to_string(json).expect("there");
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(json["cases"], serde_json::json!([]));
    let junit = fs::read_to_string(junit).expect("there");
    assert!(junit.contains("tests=\"0\""), "{junit}");
}

#[test]
fn unit_that_is_silent_to_identity_or_version_is_described_without_them() {
    let line = LineFormat::default();
    let described = |hidden: Option<Vec<u8>>| {
        let mut endpoint = Reference::modio(None, Mode::Rtu, line);
        let target = probed(&mut endpoint, Mode::Rtu, None);
        endpoint.way = Box::new(move |bytes, _| match &hidden {
            Some(frame) if bytes == frame => Vec::new(),
            _ => bytes.to_vec(),
        });
        let mut tester = Tester::new(&mut endpoint, &target);
        let modio = target.modio.expect("a modio");
        let unit = About::ask(&mut tester, modio).expect("the line works");
        serde_json::to_value(unit).expect("JSON")
    };
    let all = described(None);
    for (register, count, keys) in [
        (state::UNIQUE_ID, 6, &["identity"][..]),
        (state::FIRMWARE_VERSION, 3, &["firmware", "commit"]),
    ] {
        let mut wanted = all.clone();
        for key in keys {
            assert!(wanted[key].is_string(), "{wanted}");
            wanted[key] = serde_json::Value::Null;
        }
        let request = Mode::Rtu.frame(UNIT, &pdu(3, register, count));
        assert_eq!(described(Some(request)), wanted);
    }
}

#[test]
fn failed_interpretation_gives_status_1_only_with_strict() {
    for (arguments, status) in [
        ("--only fc05/length", 0),
        ("--only fc05/length --strict", 1),
    ] {
        let (output, _) = tested(Some(Fault::IgnoresSpareBytes), arguments);
        let out = text(&output.stdout);
        assert_eq!(output.status.code(), Some(status), "{arguments}: {out}");
        assert!(out.contains("failed interpretations: 1"), "{out}");
    }
}

#[test]
fn list_names_every_case() {
    let output = command("--list");
    assert_eq!(output.status.code(), Some(0));
    let list = text(&output.stdout);
    for case in conformance::cases::all() {
        assert!(list.contains(&format!("`{}`", case.name)), "{}", case.name);
    }
}

/// Tests a modio with these arguments and this bench file, in which a command switches the power as POWER says. Returns the
/// status, the report in JSON, and the output.
#[cfg(unix)]
fn hil(bench: &str, arguments: &str) -> (Option<i32>, serde_json::Value, String) {
    let directory = tempfile::tempdir().expect("a directory");
    let at = |name: &str| directory.path().join(name);
    let power = at("power").display().to_string();
    let script = format!(
        "echo $1 > '{power}.new'; mv '{power}.new' '{power}'; while [ -e '{power}' ]; do sleep 0.02; done"
    );
    fs::write(at("switch"), script).expect("written");
    let address = served(
        || Unit::modio(None, Mode::Rtu, LineFormat::default()),
        at("power"),
    );
    let bench = bench.replace("POWER", &format!("sh {}", at("switch").display()));
    fs::write(at("bench.toml"), bench).expect("written");
    let output = command(&format!(
        "hil --tcp {address} --patience 60 --bench {} --json {} {arguments}",
        at("bench.toml").display(),
        at("report.json").display()
    ));
    let report = fs::read_to_string(at("report.json")).unwrap_or_default();
    (
        output.status.code(),
        serde_json::from_str(&report).unwrap_or_default(),
        text(&output.stdout) + &text(&output.stderr),
    )
}

#[cfg(unix)]
#[test]
fn power_is_switched_by_the_command_of_the_bench_file() {
    let case = "--only outputs/start-value";
    for (bench, status, wanted) in [
        ("", 0, "skipped"),
        ("power_cmd = 'POWER'", 0, "passed"),
        ("power_cmd = 'false'", 2, ""),
    ] {
        let (ended, report, text) = hil(bench, case);
        let result = report["cases"][0]["result"].as_str();
        assert_eq!(
            (ended, result.unwrap_or_default()),
            (Some(status), wanted),
            "{text}"
        );
    }
}

#[cfg(unix)]
#[test]
fn report_of_a_bench_has_the_unit_and_what_was_measured() {
    // The socket carries bytes in no time, so the turnarounds may be too short.
    let (_, report, text) = hil("module = '2relay'", "--only each-rate --requests 3");
    assert!(text.contains("3 sent, 0 lost, 0 wrong"), "{text}");
    assert_eq!(report["cases"][0]["name"], "timing/9600 8N2");
    assert_eq!(report["cases"][0]["measured"]["sent"], 3);
    let about = &report["about"];
    assert!(about["adapter"].is_null(), "{report}");
    let unit = &about["unit"];
    assert_eq!(unit["module"], "2relay");
    assert_eq!(unit["commit"], "1234abcd");
    assert_eq!(unit["firmware"], "0.1.0");
}

#[cfg(unix)]
#[test]
fn unit_with_another_module_than_the_bench_is_not_tested() {
    let (status, report, text) = hil("module = '4ao'", "");
    assert_eq!(status, Some(2), "{text}");
    assert_eq!(report["cases"].as_array().map(Vec::len), Some(0));
    let error = "unit 1 has the module 2relay in force, but the bench has 4ao";
    assert!(text.contains(error), "{text}");
}
