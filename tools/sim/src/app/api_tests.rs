//! The HTTP interface against a real board whose firmware does nothing.

use serde_json::{Value, json};

use super::*;
use crate::app::testing::{bench, bench_of};
use sim::{Config, board};

fn get(bench: &mut Bench, target: &str) -> Reply {
    ask(bench, "GET", target, "")
}

fn post(bench: &mut Bench, target: &str, body: &str) -> Reply {
    ask(bench, "POST", target, body)
}

fn ask(bench: &mut Bench, method: &str, target: &str, body: &str) -> Reply {
    let request = Request {
        method: method.to_owned(),
        target: target.to_owned(),
        body: body.as_bytes().to_vec(),
    };
    answer(bench, &request)
}

fn state(bench: &mut Bench) -> Value {
    let reply = get(bench, "/api/state");
    assert_eq!(reply.status, 200);
    reply.body
}

#[test]
fn the_state_has_everything_of_the_contract() {
    let mut bench = bench(Module::Di4);
    bench.board.run_for(sim::Time::from_ms(3));
    let state = state(&mut bench);
    assert_eq!(state["virtual_ms"], 3);
    assert_eq!(state["dip"], 1);
    assert_eq!(state["module"], "4di");
    for led in ["activity", "fault", "run"] {
        assert!(state["leds"][led].is_boolean(), "{led}");
    }
    assert_eq!(state["driver_enable"], false);
    let line = json!({ "baud": 9600, "format": "8N2", "rx_frames": 0, "tx_frames": 0 });
    assert_eq!(state["line"], line);
    let off = json!({ "kind": "di", "energised": false });
    assert_eq!(state["channels"], json!([off, off, off, off]));
    assert_eq!(state["log_tail"], json!([]));
}

#[test]
fn inputs_follow_the_world_outside() {
    let mut di = bench(Module::Di4);
    let reply = post(&mut di, "/api/channels/3", r#"{"energised":true}"#);
    assert_eq!(reply.status, 200);
    assert_eq!(reply.body["channels"][2]["energised"], true);
    assert_eq!(state(&mut di)["channels"][1]["energised"], false);

    let mut relay = bench(Module::Relay2);
    post(&mut relay, "/api/channels/2", r#"{"manual":true}"#);
    assert_eq!(state(&mut relay)["channels"][1]["manual"], true);
    assert_eq!(state(&mut relay)["channels"][2], json!({ "kind": "none" }));

    let mut ai = bench(Module::Ai4);
    post(&mut ai, "/api/channels/4", r#"{"millivolts":3300}"#);
    assert_eq!(
        state(&mut ai)["channels"][3],
        json!({ "kind": "ai", "millivolts": 3300 })
    );
}

#[test]
fn what_a_channel_does_not_have_is_refused() {
    let mut bench = bench(Module::Di4);
    for body in [r#"{"manual":true}"#, r#"{"millivolts":100}"#] {
        assert_eq!(
            post(&mut bench, "/api/channels/1", body).status,
            409,
            "{body}"
        );
    }
}

#[test]
fn power_and_switch_and_module() {
    let mut bench = bench(Module::Di4);
    assert_eq!(
        post(&mut bench, "/api/module", r#"{"name":"4do"}"#).status,
        409,
        "power is on"
    );
    let off = post(&mut bench, "/api/power", r#"{"on":false}"#);
    assert_eq!((off.status, &off.body["powered"]), (200, &json!(false)));
    let plugged = post(&mut bench, "/api/module", r#"{"name":"4do"}"#);
    assert_eq!(
        (plugged.status, &plugged.body["module"]),
        (200, &json!("4do"))
    );
    assert_eq!(
        post(&mut bench, "/api/power", r#"{"on":true}"#).body["powered"],
        true
    );
    assert_eq!(state(&mut bench)["channels"][0]["kind"], "do");
    assert_eq!(
        post(&mut bench, "/api/dip", r#"{"value":247}"#).body["dip"],
        247
    );
    let before = bench.board.now();
    assert_eq!(
        post(&mut bench, "/api/power", r#"{"cycle":true}"#).body["powered"],
        true
    );
    assert!(bench.board.now() > before);
}

#[test]
fn frames_are_told_from_a_number_on() {
    let mut bench = bench(Module::Di4);
    for _ in 0..2 {
        bench.board.run_for(sim::Time::from_ms(1));
        bench.send(&[0x01, 0x01, 0x00, 0x10, 0x00, 0x04, 0x3C, 0x0C]);
        bench.board.run_for(sim::Time::from_ms(20));
    }
    let all = get(&mut bench, "/api/frames").body;
    assert_eq!(all["frames"].as_array().unwrap().len(), 2);
    assert_eq!(all["frames"][0]["crc_ok"], true);
    assert_eq!(all["frames"][0]["bytes"], "0101001000043c0c");
    let first = all["frames"][0]["number"].as_u64().unwrap();
    let later = get(&mut bench, &format!("/api/frames?since={first}")).body;
    assert_eq!(later["frames"], json!([all["frames"][1]]));
    assert_eq!(state(&mut bench)["line"]["rx_frames"], 2);
}

#[test]
fn anything_ill_formed_is_refused_and_changes_nothing() {
    let mut bench = bench(Module::Di4);
    let before = state(&mut bench);
    for (method, target, body, status) in [
        ("GET", "/api", "", 404),
        ("GET", "/api/", "", 404),
        ("GET", "/api/states", "", 404),
        ("GET", "/api/channels", "", 404),
        ("GET", "/api/channels/1", "", 405),
        ("GET", "/api/dip", "", 405),
        ("DELETE", "/api/state", "", 405),
        ("POST", "/api/state", "{}", 405),
        ("POST", "/api/frames", "{}", 405),
        ("GET", "/api/frames?since=-1", "", 400),
        ("GET", "/api/frames?since=", "", 400),
        ("GET", "/api/frames?after=1", "", 400),
        ("POST", "/api/channels/0", r#"{"energised":true}"#, 404),
        ("POST", "/api/channels/5", r#"{"energised":true}"#, 404),
        ("POST", "/api/channels/01", r#"{"energised":true}"#, 404),
        ("POST", "/api/channels/one", r#"{"energised":true}"#, 404),
        ("POST", "/api/channels/1/", r#"{"energised":true}"#, 404),
        ("POST", "/api/channels/1", "", 400),
        ("POST", "/api/channels/1", "{", 400),
        ("POST", "/api/channels/1", "[]", 400),
        ("POST", "/api/channels/1", "{}", 400),
        ("POST", "/api/channels/1", r#"{"energised":1}"#, 400),
        ("POST", "/api/channels/1", r#"{"energised":null}"#, 400),
        ("POST", "/api/channels/1", r#"{"energized":true}"#, 400),
        (
            "POST",
            "/api/channels/1",
            r#"{"energised":true,"manual":true}"#,
            400,
        ),
        ("POST", "/api/channels/1", r#"{"millivolts":3301}"#, 400),
        ("POST", "/api/channels/1", r#"{"millivolts":-1}"#, 400),
        ("POST", "/api/channels/1", r#"{"millivolts":1.5}"#, 400),
        ("POST", "/api/channels/1", "\u{0}\u{1}", 400),
        ("POST", "/api/dip", r#"{"value":256}"#, 400),
        ("POST", "/api/dip", r#"{"value":"1"}"#, 400),
        ("POST", "/api/dip", r#"{"dip":1}"#, 400),
        ("POST", "/api/power", r#"{"on":"yes"}"#, 400),
        ("POST", "/api/power", r#"{"cycle":false}"#, 400),
        ("POST", "/api/power", r#"{"off":true}"#, 400),
        ("POST", "/api/module", r#"{"name":"8di"}"#, 400),
        ("POST", "/api/module", r#"{"name":4}"#, 400),
    ] {
        let reply = ask(&mut bench, method, target, body);
        assert_eq!(
            reply.status, status,
            "{method} {target} {body}: {}",
            reply.body
        );
        let error = reply.body["error"].as_str().unwrap();
        assert!(!error.is_empty());
    }
    assert_eq!(state(&mut bench), before);
}

#[test]
fn slots_of_a_larger_board_are_addressed_by_their_ports() {
    let mut bench = bench_of(Config {
        layout: &board::MODIO_08,
        slots: vec![(3, Module::Relay2)],
        ..Config::default()
    });
    let first = state(&mut bench);
    let slots = first["slots"].as_array().expect("a list");
    let ports: Vec<_> = slots.iter().map(|slot| &slot["port"]).collect();
    assert_eq!(ports, [1, 2, 3, 4]);
    let modules: Vec<_> = slots.iter().map(|slot| &slot["module"]).collect();
    assert_eq!(modules, ["4di", "none", "2relay", "none"]);
    assert_eq!(first["module"], "4di");
    assert_eq!(first["channels"], slots[0]["channels"]);

    let reply = post(&mut bench, "/api/slots/3/channels/2", r#"{"manual":true}"#);
    assert_eq!(reply.status, 200);
    assert_eq!(reply.body["slots"][2]["channels"][1]["manual"], true);
    let reply = post(&mut bench, "/api/channels/4", r#"{"energised":true}"#);
    assert_eq!(reply.body["slots"][0]["channels"][3]["energised"], true);

    let plug = |bench: &mut Bench| post(bench, "/api/slots/4/module", r#"{"name":"4ai"}"#);
    assert_eq!(plug(&mut bench).status, 409);
    post(&mut bench, "/api/power", r#"{"on":false}"#);
    assert_eq!(plug(&mut bench).body["slots"][3]["module"], "4ai");
    for (path, status) in [
        ("/api/slots/5/module", 404),
        ("/api/slots/5/channels/1", 404),
        ("/api/slots/x/module", 404),
        ("/api/slots/3/channels/5", 404),
        ("/api/slots/3", 404),
        ("/api/slots/3/dip", 404),
    ] {
        let body = if path.ends_with("module") {
            r#"{"name":"4do"}"#
        } else {
            r#"{"manual":true}"#
        };
        assert_eq!(post(&mut bench, path, body).status, status, "{path}");
    }
}

#[test]
fn a_board_with_one_slot_has_no_list_of_slots_but_a_port() {
    let mut bench = bench(Module::Di4);
    assert_eq!(state(&mut bench).get("slots"), None);
    let reply = post(
        &mut bench,
        "/api/slots/5/channels/1",
        r#"{"energised":true}"#,
    );
    assert_eq!(reply.body["channels"][0]["energised"], true);
}

#[test]
fn the_description_names_every_path_and_no_other() {
    let mut bench = bench(Module::Di4);
    let described = get(&mut bench, "/api/openapi.json");
    assert_eq!(described.status, 200);
    let paths = described.body["paths"].as_object().unwrap();
    // The table of this module's documentation; `/api/events` is the server's own.
    let mut known: Vec<_> = include_str!("api.rs")
        .lines()
        .filter_map(|line| line.strip_prefix("//! | `"))
        .filter_map(|row| row.split(['`', '?']).next())
        .map(|row| row.replace("/N", "/{channel}"))
        .collect();
    known.push("GET /api/events".to_owned());
    for (path, methods) in paths {
        for method in methods.as_object().unwrap().keys() {
            if method == "parameters" {
                continue;
            }
            let method = method.to_uppercase();
            let plain = path.replace("/slots/{port}", "");
            let known = known.iter().any(|row| *row == format!("{method} {plain}"));
            assert!(known, "{method} {path}");
            let target = path.replace("{port}", "5").replace("{channel}", "1");
            let status = ask(&mut bench, &method, &target, "{}").status;
            let expected = if method == "GET" { 200 } else { 400 };
            assert!(
                status == expected || path == "/api/events",
                "{path}: {status}"
            );
        }
    }
    for row in &known {
        let (method, path) = row.split_once(' ').unwrap();
        let there = paths
            .get(path)
            .is_some_and(|methods| methods.get(method.to_lowercase()).is_some());
        assert!(there || path == "/api/slots/PORT/...", "{row}");
    }
}

#[test]
fn replies_have_the_described_entries() {
    let mut bench = bench_of(Config {
        layout: &board::MODIO_08,
        ..Config::default()
    });
    let schemas = get(&mut bench, "/api/openapi.json").body["components"]["schemas"].take();
    bench.send(&[0x01, 0x01, 0x00, 0x10, 0x00, 0x04, 0x3C, 0x0C]);
    bench.board.run_for(sim::Time::from_ms(20));
    let frame = get(&mut bench, "/api/frames").body["frames"][0].take();
    for (name, reply) in [("State", state(&mut bench)), ("Frame", frame)] {
        let mut described: Vec<_> = schemas[name]["properties"]
            .as_object()
            .unwrap()
            .keys()
            .collect();
        described.sort();
        let mut there: Vec<_> = reply.as_object().unwrap().keys().collect();
        there.sort();
        assert_eq!(described, there, "{name}");
    }
}

#[test]
fn findings_have_an_address_and_a_time() {
    use sim::Image;
    // ldr r0, [pc, #4]; ldr r0, [r0]; b .; and the address of GPIOC, whose clock is off.
    let image = [
        0x00, 0x50, 0x00, 0x20, 0x09, 0x00, 0x00, 0x08, 0x01, 0x48, 0x00, 0x68, 0xFE, 0xE7, 0x00,
        0xBF, 0x00, 0x10, 0x01, 0x40,
    ];
    let image = Image::from_bytes(&image).unwrap();
    let board = sim::Board::new(&image, Config::default()).unwrap();
    let mut bench = Bench::new(board);
    bench.board.run_for(sim::Time::from_ms(10));
    let found = get(&mut bench, "/api/findings").body["findings"][0].take();
    assert_eq!(found["pc"], "0x0800000a", "{found}");
    assert!(
        found["what"].as_str().unwrap().contains("0x40011000"),
        "{found}"
    );
    assert!(found["count"].as_u64() >= Some(1) && found["at_us"].is_u64());
}

#[test]
fn a_board_is_also_addressed_by_its_name() {
    let mut bench = bench(Module::Di4);
    let boards = get(&mut bench, "/api/boards").body;
    assert_eq!(
        boards,
        json!([{ "name": "modio-02", "board": "modio-02", "dip": 1 }])
    );
    let reply = post(
        &mut bench,
        "/api/boards/modio-02/channels/2",
        r#"{"energised":true}"#,
    );
    assert_eq!(reply.body["channels"][1]["energised"], true);
    let same = get(&mut bench, "/api/boards/modio-02/state").body;
    assert_eq!(same, state(&mut bench));
    for path in [
        "/api/boards/modio-08/state",
        "/api/boards/modio-02",
        "/api/boards/modio-02/",
        "/api/boards/modio-02state",
        "/api/boards/",
    ] {
        assert_eq!(get(&mut bench, path).status, 404, "{path}");
    }
}
