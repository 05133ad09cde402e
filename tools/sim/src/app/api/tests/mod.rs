//! Tests of the HTTP interface with a board whose firmware does nothing.

mod boards;
mod description;
mod radio;

use serde_json::{Value, json};

use register_map::Module;

use super::*;
use crate::app::Origin;
use crate::app::testing::{bench_of, bench_of_boards, scene};
use sim::{Config, board};

fn get(scene: &mut Scene, target: &str) -> Reply {
    ask(scene, "GET", target, "")
}

fn post(scene: &mut Scene, target: &str, body: &str) -> Reply {
    ask(scene, "POST", target, body)
}

fn ask(scene: &mut Scene, method: &str, target: &str, body: &str) -> Reply {
    let request = Request {
        method: method.to_owned(),
        target: target.to_owned(),
        body: body.as_bytes().to_vec(),
    };
    answer(scene, &request)
}

fn state(scene: &mut Scene) -> Value {
    let reply = get(scene, "/api/state");
    assert_eq!(reply.status, 200);
    reply.body
}

#[test]
fn state_has_every_documented_entry() {
    let mut scene = scene(Module::Di4);
    scene.bus.run_for(sim::Time::from_ms(3));
    let state = state(&mut scene);
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
fn post_to_a_channel_changes_this_channel_only() {
    let mut di = scene(Module::Di4);
    let reply = post(&mut di, "/api/channels/3", r#"{"energised":true}"#);
    assert_eq!(reply.status, 200);
    assert_eq!(reply.body["channels"][2]["energised"], true);
    assert_eq!(state(&mut di)["channels"][1]["energised"], false);

    let mut relay = scene(Module::Relay2);
    post(&mut relay, "/api/channels/2", r#"{"manual":true}"#);
    assert_eq!(state(&mut relay)["channels"][1]["manual"], true);
    assert_eq!(state(&mut relay)["channels"][2], json!({ "kind": "none" }));

    let mut ai = scene(Module::Ai4);
    post(&mut ai, "/api/channels/4", r#"{"millivolts":3300}"#);
    assert_eq!(
        state(&mut ai)["channels"][3],
        json!({ "kind": "ai", "millivolts": 3300 })
    );
}

#[test]
fn change_that_the_channel_does_not_have_returns_409() {
    let mut scene = scene(Module::Di4);
    for body in [r#"{"manual":true}"#, r#"{"millivolts":100}"#] {
        assert_eq!(
            post(&mut scene, "/api/channels/1", body).status,
            409,
            "{body}"
        );
    }
}

#[test]
fn request_to_the_unit_without_a_reply_returns_504_and_without_an_address_409() {
    let mut scene = scene(Module::Di4);
    let mut status = |body: &str| post(&mut scene, "/api/pdu", body).status;
    assert_eq!(
        status(r#"{"pdu":"0300100004"}"#),
        504,
        "no firmware replies"
    );
    let long = format!(r#"{{"pdu":"{}"}}"#, "07".repeat(254));
    for body in [r#"{"pdu":""}"#, r#"{"pdu":"0"}"#, r#"{"pdu":"+7"}"#, &long] {
        assert_eq!(status(body), 400, "{body}");
    }
    assert_eq!(state(&mut scene)["line"]["rx_frames"], 1);
    post(&mut scene, "/api/power", r#"{"on":false}"#);
    let off = post(&mut scene, "/api/pdu", r#"{"pdu":"07"}"#);
    assert_eq!(off.status, 409);
}

#[test]
fn power_dip_and_module_change_and_the_module_only_with_the_power_off() {
    let mut scene = scene(Module::Di4);
    assert_eq!(
        post(&mut scene, "/api/module", r#"{"name":"4do"}"#).status,
        409,
        "power is on"
    );
    let off = post(&mut scene, "/api/power", r#"{"on":false}"#);
    assert_eq!((off.status, &off.body["powered"]), (200, &json!(false)));
    let plugged = post(&mut scene, "/api/module", r#"{"name":"4do"}"#);
    assert_eq!(
        (plugged.status, &plugged.body["module"]),
        (200, &json!("4do"))
    );
    assert_eq!(
        post(&mut scene, "/api/power", r#"{"on":true}"#).body["powered"],
        true
    );
    assert_eq!(state(&mut scene)["channels"][0]["kind"], "do");
    assert_eq!(
        post(&mut scene, "/api/dip", r#"{"value":247}"#).body["dip"],
        247
    );
    let before = scene.now();
    assert_eq!(
        post(&mut scene, "/api/power", r#"{"cycle":true}"#).body["powered"],
        true
    );
    assert!(scene.now() > before);
}

#[test]
fn frames_since_a_number_are_the_later_ones() {
    let mut scene = scene(Module::Di4);
    for _ in 0..2 {
        scene.bus.run_for(sim::Time::from_ms(1));
        scene.send(
            &[0x01, 0x01, 0x00, 0x10, 0x00, 0x04, 0x3C, 0x0C],
            Origin::Pty,
        );
        scene.bus.run_for(sim::Time::from_ms(20));
    }
    let all = get(&mut scene, "/api/frames").body;
    assert_eq!(all["frames"].as_array().unwrap().len(), 2);
    assert_eq!(all["frames"][0]["crc_ok"], true);
    assert_eq!(all["frames"][0]["bytes"], "0101001000043c0c");
    let first = all["frames"][0]["number"].as_u64().unwrap();
    let later = get(&mut scene, &format!("/api/frames?since={first}")).body;
    assert_eq!(later["frames"], json!([all["frames"][1]]));
    assert_eq!(state(&mut scene)["line"]["rx_frames"], 2);
}

#[test]
fn malformed_request_is_refused_and_changes_nothing() {
    let mut scene = scene(Module::Di4);
    let before = state(&mut scene);
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
        ("GET", "/api/frames?since=+1", "", 400),
        ("GET", "/api/frames?since=1.0", "", 400),
        ("GET", "/api/frames?since=18446744073709551616", "", 400),
        (
            "POST",
            "/api/slots/+5/channels/1",
            r#"{"energised":true}"#,
            404,
        ),
        (
            "POST",
            "/api/slots/05/channels/1",
            r#"{"energised":true}"#,
            404,
        ),
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
        let reply = ask(&mut scene, method, target, body);
        assert_eq!(
            reply.status, status,
            "{method} {target} {body}: {}",
            reply.body
        );
        let error = reply.body["error"].as_str().unwrap();
        assert!(!error.is_empty());
    }
    assert_eq!(state(&mut scene), before);
}

/// JSON values that other programs send for `off`, for a number, or by mistake, and text that is not JSON.
const VALUES: [&str; 24] = [
    "true",
    "\"on\"",
    "\"off\"",
    "\"true\"",
    "\"\"",
    "null",
    "[]",
    "[1]",
    "{}",
    "1",
    "0",
    "\"7\"",
    "7.0",
    "7.5",
    "7e0",
    "-7",
    "-0",
    "256",
    "3301",
    "65543",
    "18446744073709551623",
    "1e400",
    "NaN",
    "Infinity",
];

#[test]
fn value_that_is_not_exactly_of_its_type_is_refused_and_changes_nothing() {
    use Module::{Ai4, Di4, Relay2};
    for (module, target, key, accepted) in [
        (Di4, "/api/channels/1", "energised", &["true"][..]),
        (Relay2, "/api/channels/1", "manual", &["true"]),
        (Ai4, "/api/channels/1", "millivolts", &["1", "0", "256"]),
        (Di4, "/api/dip", "value", &["1", "0"]),
        (Di4, "/api/power", "on", &["true"]),
        (Di4, "/api/power", "cycle", &["true"]),
        (Di4, "/api/module", "name", &[]),
        (Di4, "/api/faults", "hse_failed", &["true"]),
        (Di4, "/api/faults", "i2c_absent", &["true"]),
        (Di4, "/api/faults", "drop_rate", &["1", "0", "-0"]),
        (
            Di4,
            "/api/faults",
            "noise_hz",
            &["1", "0", "7.0", "7.5", "7e0", "-0", "256", "3301"],
        ),
    ] {
        let scene = &mut scene(module);
        let before = (state(scene), get(scene, "/api/faults"));
        for value in VALUES.iter().filter(|value| !accepted.contains(value)) {
            // The value alone, beside a correct value, and after a correct value with the same name.
            let good = accepted.first().unwrap_or(&"\"4di\"");
            for body in [
                format!("{{\"{key}\":{value}}}"),
                format!("{{\"lsi_khz\":30,\"{key}\":{value}}}"),
                format!("{{\"{key}\":{good},\"{key}\":{value}}}"),
                format!("{{\"{key}\":{good},\"{key}\":{good}}}"),
                format!("{{\"{key}\":{good}}} {value}"),
            ] {
                let reply = post(scene, target, &body);
                assert_eq!(reply.status, 400, "{target} {body}: {}", reply.body);
            }
            if serde_json::from_str::<Value>(value).is_ok() {
                let reply = post(scene, target, &format!("{{\"{key}\":{value}}}"));
                let error = reply.body["error"].as_str().unwrap();
                assert!(error.starts_with('`'), "{key}: {value}: {error}");
            }
        }
        assert_eq!((state(scene), get(scene, "/api/faults")), before);
    }
}

#[test]
fn reason_of_a_refusal_is_one_short_line() {
    let mut scene = scene(Module::Di4);
    let long = "x\\n\\u001b[31m".repeat(1000);
    for (target, body) in [
        ("/api/dip", format!("{{\"{long}\":1}}")),
        ("/api/module", format!("{{\"name\":\"{long}\"}}")),
        ("/api/faults", format!("{{\"{long}\":1}}")),
        (&format!("/api/{long}"), "{}".to_owned()),
    ] {
        let reply = post(&mut scene, target, &body);
        assert!((400..=404).contains(&reply.status));
        let error = reply.body["error"].as_str().unwrap();
        assert!(!error.contains(char::is_control), "{error:?}");
        assert!(error.len() <= LONGEST_REASON, "{error}");
    }
}

#[test]
fn finding_has_address_time_and_count() {
    use sim::Image;
    // ldr r0, [pc, #4]; ldr r0, [r0]; b .; and the address of GPIOC. Its clock is off.
    let image = [
        0x00, 0x50, 0x00, 0x20, 0x09, 0x00, 0x00, 0x08, 0x01, 0x48, 0x00, 0x68, 0xFE, 0xE7, 0x00,
        0xBF, 0x00, 0x10, 0x01, 0x40,
    ];
    let image = Image::from_bytes(&image).unwrap();
    let board = sim::Board::new(&image, Config::default()).unwrap();
    let unit = crate::app::unit::Unit::new("modio-02".to_owned(), None);
    let mut scene = Scene::new(vec![(board, unit)]);
    scene.bus.run_for(sim::Time::from_ms(10));
    let found = get(&mut scene, "/api/findings").body["findings"][0].take();
    assert_eq!(found["pc"], "0x0800000a", "{found}");
    assert!(
        found["what"].as_str().unwrap().contains("0x40011000"),
        "{found}"
    );
    assert!(found["count"].as_u64() >= Some(1) && found["at_us"].is_u64());
}

#[test]
fn faults_are_caused_reported_and_cleared() {
    let mut scene = scene(Module::Ao4);
    let none = json!({
        "bit_error_rate": 0.0, "drop_rate": 0.0, "noise_hz": 0.0,
        "i2c_absent": false, "hse_failed": false, "hsi_percent": 0.0, "lsi_khz": 40.0,
    });
    assert_eq!(get(&mut scene, "/api/faults").body, none);
    let all = json!({
        "bit_error_rate": 0.001, "drop_rate": 0.5, "noise_hz": 10.0,
        "i2c_absent": true, "hse_failed": true, "hsi_percent": -1.5, "lsi_khz": 30.0,
    });
    let made = post(&mut scene, "/api/faults", &all.to_string());
    assert_eq!((made.status, &made.body), (200, &all));
    // 8 MHz minus 1.5 %, because the core runs from the HSI.
    assert_eq!(scene.first().hclk(), 7_880_000);
    assert!(!scene.first().crystal());
    let one = post(&mut scene, "/api/faults", r#"{"i2c_absent":false}"#).body;
    assert_eq!(
        (&one["i2c_absent"], &one["drop_rate"]),
        (&json!(false), &json!(0.5))
    );
    assert_eq!(
        post(&mut scene, "/api/faults", &none.to_string()).body,
        none
    );

    for body in [
        "{}",
        "[]",
        r#"{"smoke":true}"#,
        r#"{"hse_failed":1}"#,
        r#"{"drop_rate":1.1}"#,
        r#"{"drop_rate":-0.1}"#,
        r#"{"bit_error_rate":0.6}"#,
        r#"{"noise_hz":10001}"#,
        r#"{"hsi_percent":21}"#,
        r#"{"lsi_khz":14}"#,
        r#"{"hse_failed":true,"lsi_khz":900}"#,
    ] {
        assert_eq!(post(&mut scene, "/api/faults", body).status, 400, "{body}");
    }
    assert_eq!(
        get(&mut scene, "/api/faults").body,
        none,
        "a refused request changes nothing"
    );
    assert_eq!(ask(&mut scene, "DELETE", "/api/faults", "").status, 405);
}
