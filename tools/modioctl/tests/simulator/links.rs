//! Tests of `links` and `link`.

use register_map::Module;
use register_map::board::MODIO_08;

use crate::program::{At, has};
use crate::served::{Answers, Modio, other, serve_requests, serve_unit};
use crate::unit::Unit;

#[test]
fn unit_without_links_is_reported() {
    let at = At::tcp(serve_unit(Modio::modio_02(Module::Do4)));
    for words in ["links", "link p5.1 toggles p5.2", "link none p5.1"] {
        has(&at.run(words).failed(2), &["the unit has no links"]);
    }
}

/// A modio-08 with 0-10 V inputs in raw codes in port 1, and outputs in port 2.
#[test]
fn settings_that_make_a_link_surprising_are_warned_of_by_each_command() {
    let unit = Modio::of(&MODIO_08, |port| match port {
        1 => Module::Ai4,
        2 => Module::Do4,
        _ => Module::None,
    });
    let at = At::tcp(serve_unit(unit));
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("unit.toml");
    std::fs::write(&file, "p2.1.link1 = \"p1.1, 257, 900, 800\"\n").unwrap();
    for words in [
        "link p1.1 switches p2.1 on above 900 off below 800 if alone".to_owned(),
        "links".to_owned(),
        "write COMM_TIMEOUT=0".to_owned(),
        "config set p2.1.link1=p1.1,257,900,800".to_owned(),
        format!("config import {}", file.display()),
    ] {
        let ran = at.run(&words);
        let warnings = ran.err.matches("modioctl: warning: ").count();
        assert_eq!((ran.status, warnings), (0, 3), "{words}: {ran:?}");
    }
    let ran = at.run("export csv");
    has(
        &ran.err,
        &["modioctl: warning: unit 1, p1.1, p1.2, p1.3, p1.4: SCALE is 0"],
    );
}

/// Register 0x0104 is COMM_TIMEOUT of a modio.
#[test]
fn write_that_succeeded_does_not_fail_because_of_a_warning() {
    let at = At::tcp(serve_unit(other()));
    let ran = at.run("write 0x0104=5");
    assert_eq!(ran.err, "");
    ran.fine();
    // A unit that is switched off after the write.
    let mut unit = Modio::modio_02(Module::Do4);
    let mut is_off = false;
    let at = At::tcp(serve_requests(move |address, pdu| {
        if is_off {
            return Some(Vec::new());
        }
        is_off = pdu[..3] == [6, 0x01, 0x04];
        Some(unit.response(address, pdu))
    }));
    at.run("--timeout 100ms --retries 0 write COMM_TIMEOUT=5")
        .fine();
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn link_is_written_acts_and_is_listed_until_it_is_deleted() {
    let unit = Unit::bus(
        r#"
        board = [
            { board = "modio-08", dip = 1, slots = { 1 = "4di", 2 = "4do", 3 = "4ai" } },
        ]"#,
    );
    let at = At::tcp(unit.tcp);
    assert_eq!(at.run("links").fine(), "no links\n");
    let text = at.run("link p1.1 toggles p2.1").fine();
    let lines = "p2.1.link1: p1.1 toggles p2.1\nnot saved: save with `modioctl config save`\n";
    assert_eq!(text, lines);
    // A link acts a second after it was written.
    unit.wait(1100);
    unit.post("/api/slots/1/channels/1", r#"{"energised": true}"#);
    unit.wait(50);
    assert_eq!(at.run("read p2.1").fine(), "p2.1  on\n");

    // The same input replaces its link, another one gets the second link, a third one none.
    let ran = at.run("link p1.1 sets p2.1 if alone");
    has(&ran.err, &["warning: COMM_TIMEOUT is 0"]);
    at.run("write p3.1.range=NTC p3.1.scale=1 COMM_TIMEOUT=3600")
        .fine();
    let ran = at.run("link p3.1 switches p2.1 on below -5.5 off above 18");
    has(&ran.err, &["note: while the sensor of p3.1 is cut"]);
    assert!(!ran.fine().contains("note"));
    let links = "p2.1.link1  p1.1 sets p2.1 if alone\n\
                 p2.1.link2  p3.1 switches p2.1 on below -5.5 °C off above 18.0 °C\n";
    let ran = at.run("links");
    assert_eq!((&*ran.out, &*ran.err), (links, ""));
    let text = at.run("link p1.2 toggles p2.1").failed(2);
    has(&text, &["all links of p2.1 are in use", "link none p2.1"]);

    let json: serde_json::Value = serde_json::from_str(&at.run("--json links").fine()).unwrap();
    assert_eq!(json[1]["source"], "p3.1", "{json}");
    assert_eq!(json[1]["action"], "invert", "{json}");
    assert_eq!(json[0]["if_alone"], true, "{json}");
    at.run("link none p2.1").fine();
    assert_eq!(at.run("links").fine(), "no links\n");

    // A module that is set has links before it is in force.
    at.run("write p4.module=4do").fine();
    at.run("link p1.1 toggles p4.1").fine();
    assert_eq!(at.run("links").fine(), "p4.1.link1  p1.1 toggles p4.1\n");
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn output_that_a_link_holds_is_reported_and_is_no_switch_in_an_export() {
    let unit = Unit::bus(
        r#"
        board = [
            { board = "modio-08", dip = 1, slots = { 1 = "4di", 2 = "4do" } },
        ]"#,
    );
    let at = At::tcp(unit.tcp);
    assert!(!at.run("info").fine().contains("held"));
    at.run("link p2.1 follows p1.1").fine();
    at.run("link p2.1 inverts p1.2 if alone").fine();
    at.run("link p1.3 toggles p2.2").fine();
    unit.wait(1100);
    let held = "p2.1: held by link p1.1; a write to a held output has no effect\n";
    let text = at.run("write p2.1=on p2.2=on").fine();
    assert_eq!(text, format!("{held}p2.2 = on\n"));
    assert_eq!(at.run("read p2.1 p2.2").fine(), "p2.1  off\np2.2  on\n");
    let json = at.run("--json write p2.1=on p2.2=on p1.1.filter=5");
    has(&json.err, &["not saved"]);
    let json: serde_json::Value = serde_json::from_str(&json.fine()).unwrap();
    let by = [0, 1, 2].map(|n| json[n]["held_by"].to_string());
    assert_eq!(by, [r#"["p1.1"]"#, "[]", "[]"]);
    assert_eq!(json[0]["value"], true, "{json}");

    let text = at.run("info").fine();
    let row = text
        .lines()
        .find_map(|line| line.trim().strip_prefix("outputs held by links"));
    assert_eq!(row.map(str::trim), Some("p2.1 by p1.1"), "{text}");
    let json: serde_json::Value = serde_json::from_str(&at.run("--json info").fine()).unwrap();
    let held = &json["outputs held by links"];
    assert_eq!(held.to_string(), r#"{"p2.1":["p1.1"]}"#);
    let yaml = at.run("export home-assistant").fine();
    let (sensors, switches) = yaml.split_once("switches:").unwrap();
    assert!(sensors.contains("1 p2.1") && !switches.contains("1 p2.1"));

    // The links of another module that waits for a restart are not those in force.
    at.run("write p2.module=4di").fine();
    assert!(!at.run("info").fine().contains("held"));
}
