//! Tests of requests to one of several boards, and to one of several slots.

use super::*;

#[test]
fn slots_of_the_modio_08_are_addressed_by_their_ports() {
    let mut scene = bench_of(Config {
        layout: &board::MODIO_08,
        slots: vec![(3, Module::Relay2)],
        ..Config::default()
    });
    let first = state(&mut scene);
    let slots = first["slots"].as_array().expect("a list");
    let ports: Vec<_> = slots.iter().map(|slot| &slot["port"]).collect();
    assert_eq!(ports, [1, 2, 3, 4]);
    let modules: Vec<_> = slots.iter().map(|slot| &slot["module"]).collect();
    assert_eq!(modules, ["4di", "none", "2relay", "none"]);
    assert_eq!(first["module"], "4di");
    assert_eq!(first["channels"], slots[0]["channels"]);

    let reply = post(&mut scene, "/api/slots/3/channels/2", r#"{"manual":true}"#);
    assert_eq!(reply.status, 200);
    assert_eq!(reply.body["slots"][2]["channels"][1]["manual"], true);
    let reply = post(&mut scene, "/api/channels/4", r#"{"energised":true}"#);
    assert_eq!(reply.body["slots"][0]["channels"][3]["energised"], true);

    let plug = |scene: &mut Scene| post(scene, "/api/slots/4/module", r#"{"name":"4ai"}"#);
    assert_eq!(plug(&mut scene).status, 409);
    post(&mut scene, "/api/power", r#"{"on":false}"#);
    assert_eq!(plug(&mut scene).body["slots"][3]["module"], "4ai");
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
        assert_eq!(post(&mut scene, path, body).status, status, "{path}");
    }
}

#[test]
fn board_with_one_slot_has_no_list_of_slots_but_accepts_its_port() {
    let mut scene = scene(Module::Di4);
    assert_eq!(state(&mut scene).get("slots"), None);
    let reply = post(
        &mut scene,
        "/api/slots/5/channels/1",
        r#"{"energised":true}"#,
    );
    assert_eq!(reply.body["channels"][0]["energised"], true);
}

#[test]
fn single_board_is_also_addressed_by_its_name() {
    let mut scene = scene(Module::Di4);
    let boards = get(&mut scene, "/api/boards").body;
    assert_eq!(
        boards,
        json!([{
            "name": "modio-02",
            "board": "modio-02",
            "dip": 1,
            "address": 1,
            "powered": true,
            "fault": false,
            "modules": ["4di"],
        }])
    );
    let reply = post(
        &mut scene,
        "/api/boards/modio-02/channels/2",
        r#"{"energised":true}"#,
    );
    assert_eq!(reply.body["channels"][1]["energised"], true);
    let same = get(&mut scene, "/api/boards/modio-02/state").body;
    assert_eq!(same, state(&mut scene));
    for path in [
        "/api/boards/modio-08/state",
        "/api/boards/modio-02",
        "/api/boards/modio-02/",
        "/api/boards/modio-02state",
        "/api/boards/",
    ] {
        assert_eq!(get(&mut scene, path).status, 404, "{path}");
    }
}

#[test]
fn boards_are_addressed_by_name_and_a_path_without_name_means_the_first() {
    let config = |module| Config {
        module,
        ..Config::default()
    };
    let mut scene = bench_of_boards([("pump", config(Module::Di4)), ("fan", config(Module::Ai4))]);
    let boards = get(&mut scene, "/api/boards").body;
    let named = [0, 1].map(|n| [&boards[n]["name"], &boards[n]["modules"][0]]);
    assert_eq!(named, [["pump", "4di"], ["fan", "4ai"]]);
    assert_eq!(state(&mut scene)["module"], "4di");
    let fan = get(&mut scene, "/api/boards/fan/state").body;
    assert_eq!(fan["module"], "4ai");

    let millivolts = r#"{"millivolts":500}"#;
    let changed = post(&mut scene, "/api/boards/fan/channels/2", millivolts);
    assert_eq!(changed.body["channels"][1]["millivolts"], 500);
    assert_eq!(post(&mut scene, "/api/channels/2", millivolts).status, 409);

    post(&mut scene, "/api/boards/fan/dip", r#"{"value":7}"#);
    assert_eq!(state(&mut scene)["dip"], 1);
    post(&mut scene, "/api/boards/fan/power", r#"{"cycle":true}"#);
    let both = ["pump", "fan"].map(|name| {
        let state = get(&mut scene, &format!("/api/boards/{name}/state")).body;
        (state["dip"].clone(), state["virtual_ms"].clone())
    });
    assert_eq!(both, [(json!(1), json!(100)), (json!(7), json!(100))]);
}

#[test]
fn address_in_force_is_the_switch_at_power_on() {
    let mut scene = scene(Module::Di4);
    let set = |scene: &mut Scene, path: &str, body: &str| {
        let state = post(scene, path, body).body;
        let boards = get(scene, "/api/boards").body;
        assert_eq!(boards[0]["address"], state["address"]);
        (state["dip"].clone(), state["address"].clone())
    };
    let dip = |value| format!(r#"{{"value":{value}}}"#);
    for (value, address) in [
        (7, json!(7)),
        (255, json!(255)),
        (248, json!(null)),
        (0, json!(null)),
    ] {
        let before = state(&mut scene)["address"].clone();
        let moved = set(&mut scene, "/api/dip", &dip(value));
        assert_eq!(moved, (json!(value), before));
        let cycled = set(&mut scene, "/api/power", r#"{"cycle":true}"#);
        assert_eq!(cycled, (json!(value), address));
    }
    set(&mut scene, "/api/dip", &dip(3));
    let off = set(&mut scene, "/api/power", r#"{"on":false}"#);
    assert_eq!(off, (json!(3), json!(null)));
}

#[test]
fn configured_module_is_the_stored_one() {
    let stored = [(register_map::configuration::module_of(5), 2)];
    let mut config = Config {
        module: Module::Relay2,
        ..Config::default()
    };
    config.chip.flash = board::MODIO_02.flash_with(&stored);
    let mut scene = bench_of(config);
    let state = state(&mut scene);
    assert_eq!(
        (&state["module"], &state["configured"]),
        (&json!("2relay"), &json!("4do"))
    );
}

#[test]
fn announced_endpoints_are_listed_by_name() {
    let mut scene = scene(Module::Di4);
    assert_eq!(get(&mut scene, "/api/endpoints").body, json!({}));
    let tcp = ("tcp", "127.0.0.1:5020".to_owned());
    scene.endpoints.push(tcp);
    let listed = get(&mut scene, "/api/endpoints").body;
    assert_eq!(listed, json!({ "tcp": "127.0.0.1:5020" }));
}

#[test]
fn terminals_of_the_fx3u_are_addressed_by_their_names() {
    let mut scene = bench_of(Config {
        layout: &board::FX3U_24,
        ..Config::default()
    });
    let first = state(&mut scene);
    assert_eq!(first.get("slots"), None);
    assert_eq!(
        (&first["module"], &first["address"]),
        (&json!("none"), &json!(1))
    );
    let terminals = first["terminals"].as_array().expect("a list");
    assert_eq!(terminals.len(), 36);
    assert_eq!(
        terminals[0],
        json!({"name": "X0", "point": 0, "kind": "input", "energised": false})
    );
    for (at, point) in [(34, json!(14)), (30, Value::Null)] {
        assert_eq!(terminals[at]["point"], point, "{}", terminals[at]);
    }
    for (at, path, body) in [
        (0, "X0", json!({"energised": true})),
        (24, "AD0", json!({"millivolts": 10_000})),
        (27, "AD3", json!({"microamperes": 4000})),
        (30, "POT0", json!({"permille": 1000})),
        (34, "RUN", json!({"high": true})),
        (35, "24V", json!({"present": false})),
    ] {
        let path = format!("/api/terminals/{path}");
        let reply = post(&mut scene, &path, &body.to_string());
        assert_eq!(reply.status, 200, "{path}");
        let (key, value) = body.as_object().unwrap().iter().next().unwrap();
        assert_eq!(reply.body["terminals"][at][key], *value, "{path}");
    }
    for (path, body, status) in [
        ("/api/terminals/X8", r#"{"energised":true}"#, 404),
        ("/api/terminals/X0", r#"{"millivolts":1}"#, 409),
        ("/api/terminals/Y0", r#"{"energised":true}"#, 409),
        ("/api/terminals/AD0", r#"{"millivolts":12001}"#, 400),
        ("/api/terminals/X0", r#"{"on":true}"#, 400),
        ("/api/channels/1", r#"{"energised":true}"#, 404),
        ("/api/module", r#"{"name":"4do"}"#, 409),
    ] {
        assert_eq!(post(&mut scene, path, body).status, status, "{path} {body}");
    }
}
