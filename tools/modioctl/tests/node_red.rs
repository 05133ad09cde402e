//! Runs the functions of the Node-RED export with node, in which Node-RED runs them, too.
//!
//! Without node these tests fail. `cargo test` leaves them out, and `cargo xtask test modioctl` runs them.

use std::io::Write;
use std::process::{Command, Stdio};

use modio_description::{Unit, describe};
use modioctl::bus::adu::Framing;
use modioctl::bus::{Endpoint, Place};
use modioctl::export::ExportFormat;
use modioctl::export::{Line, Source, text};
use modioctl::names::Book;
use register_map::board::MODIO_02;
use register_map::{Module, Row};
use serde_json::{Value as Json, json};

/// Calls each function with its payload, as Node-RED does. Prints the payloads of the results; for a message that the
/// function does not send, the error.
const CALLS: &str = r#"
const calls = JSON.parse(require("fs").readFileSync(0));
console.log(JSON.stringify(calls.map(([code, payload]) => {
  const errors = [];
  const node = { error: (text) => errors.push(text) };
  const msg = { payload: Function("return " + payload)() };
  const result = Function("msg", "node", code)(msg, node);
  return result === null ? errors.join() : result.payload;
})));
"#;

fn flow(book: Book) -> Vec<Json> {
    let endpoint = Endpoint::new(Place::Serial("/dev/ttyUSB0".to_owned()), Framing::Rtu);
    let line = Line {
        name: None,
        endpoint: &endpoint,
        units: &[Source {
            unit: 1,
            book,
            source: String::new(),
            held: Default::default(),
        }],
    };
    serde_json::from_str(&text(ExportFormat::NodeRed, line).unwrap()).unwrap()
}

fn book(board: &Row, module: Module, range: u16, unit: Option<Unit>) -> Book {
    let mut description = describe(board, "0.1.0", |_| module);
    if let Some(unit) = unit {
        for reading in &mut description.kinds[4].readings {
            (reading.min, reading.max) = (-400, 1250);
            reading.unit = unit.clone();
        }
    }
    Book::new(description, vec![(range, 1); 32])
}

/// Returns the results of a function node for payloads in JavaScript.
fn results(flow: &[Json], name: &str, payloads: &[&str]) -> Vec<Json> {
    let node = |node: &&Json| node["type"] == "function" && node["name"] == name;
    let code = &flow.iter().find(node).unwrap()["func"];
    let calls: Vec<_> = payloads
        .iter()
        .map(|payload| json!([code, payload]))
        .collect();
    let mut program = Command::new("node");
    program.args(["-e", CALLS]).stdin(Stdio::piped());
    let mut child = program.stdout(Stdio::piped()).spawn().expect("node");
    let mut input = child.stdin.take().unwrap();
    input
        .write_all(json!(calls).to_string().as_bytes())
        .unwrap();
    drop(input);
    let output = child.wait_with_output().unwrap();
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Values that no output has.
const WRONG: [&str; 12] = [
    "''",
    "' '",
    "'o'",
    "'on off'",
    "'constructor'",
    "null",
    "undefined",
    "NaN",
    "Infinity",
    "[1]",
    "({})",
    "'0x10'",
];

#[test]
#[ignore = "needs node"]
fn a_bit_output_takes_the_values_of_modioctl_and_refuses_others() {
    let flow = flow(book(&MODIO_02, Module::Do4, 0, None));
    let results = |payloads: &[&str]| results(&flow, "set p5.1", payloads);
    for (state, payloads) in [
        (true, ["'on'", "'ON '", "'true'", "'1'", "true", "1"]),
        (false, ["'off'", "'Off'", "'false'", "'0'", "false", "0"]),
    ] {
        assert_eq!(results(&payloads), [state; 6], "{payloads:?}");
    }
    for (payload, result) in WRONG.iter().zip(results(&WRONG)) {
        let error = result.as_str().expect(payload);
        assert!(
            error.ends_with("is not on, true, 1, off, false or 0"),
            "{error}"
        );
    }
    let others = results(&["2", "-1", "0.5", "'yes'"]);
    assert!(others.iter().all(Json::is_string), "{others:?}");
}

#[test]
#[ignore = "needs node"]
fn a_word_output_takes_quantities_of_its_range_and_refuses_others() {
    let flow = flow(book(&MODIO_02, Module::Ao4, 1, None));
    let results = |payloads: &[&str]| results(&flow, "set p5.1", payloads);
    let right = results(&["4000", "20000", "'12000'", "' 12000.0 '", "1.2e4"]);
    assert_eq!(right, [4000, 20000, 12000, 12000, 12000]);
    let wrong = [
        "3999",
        "20001",
        "0",
        "-4000",
        "1e9",
        "12000.5",
        "true",
        "false",
        "'on'",
        "'12000 V'",
    ];
    for (payload, result) in wrong
        .iter()
        .chain(&WRONG)
        .zip(results(&[&wrong[..], &WRONG].concat()))
    {
        let error = result.as_str().expect(payload);
        assert!(
            error.ends_with("is not 4000 to 20000 µA in steps of 1"),
            "{error}"
        );
    }
}

#[test]
#[ignore = "needs node"]
fn a_word_output_with_scale_and_offset_gets_its_number_in_twos_complement() {
    let unit = Unit {
        code: "Cel".to_owned(),
        exponent: -1,
        offset: 100,
    };
    let flow = flow(book(&MODIO_02, Module::Ai2Ao2, 0, Some(unit)));
    let results = |name, payloads: &[&str]| results(&flow, name, payloads);
    let set = results("set p5.3", &["0", "10.1", "-30", "135", "0.05", "-30.1"]);
    assert_eq!(set[..4], [65436, 1, 65136, 1250]);
    assert_eq!(
        set[4],
        "p5.3: \"0.05\" is not -30.0 to 135.0 °C in steps of 0.1"
    );
    assert!(set[5].is_string());
    let read = results("p5.3 to p5.4", &["[65436, 1]"]);
    assert_eq!(read, [json!({ "p5.3": 0, "p5.4": 10.1 })]);
}
