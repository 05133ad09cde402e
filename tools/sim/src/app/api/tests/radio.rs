//! The LoRa module in the state, and the loss of its packets.

use sim::Time;
use sim::radio::{Fault, Parameters};

use super::*;

fn fitted() -> Scene {
    bench_of(Config {
        radio: Some(Parameters::from_bytes([0x01, 0x02, 0x1C, 0x0A, 0x45])),
        ..Config::default()
    })
}

#[test]
fn state_has_the_radio_only_if_it_is_fitted() {
    let mut scene = scene(Module::Di4);
    assert!(state(&mut scene).get("radio").is_none());
    let mut scene = fitted();
    let mut expected = json!({
        "mode": null, "aux": false, "address": 0x0102, "channel_mhz": 420, "air_rate": 9600,
        "power_dbm": 17, "packets_sent": 0, "packets_received": 0,
    });
    assert_eq!(state(&mut scene)["radio"], expected);
    scene.run_until(Time::from_ms(600));
    expected["mode"] = "sleep".into();
    expected["aux"] = true.into();
    assert_eq!(state(&mut scene)["radio"], expected);
    scene.first().set_radio_fault(Fault::Hung);
    expected["mode"] = json!(null);
    expected["aux"] = false.into();
    assert_eq!(state(&mut scene)["radio"], expected);
}

#[test]
fn radio_loss_is_a_fault_of_the_whole_air() {
    let config = || Config {
        radio: Some(Parameters::FACTORY),
        ..Config::default()
    };
    let mut scene = bench_of_boards([("one", config()), ("two", config())]);
    assert_eq!(get(&mut scene, "/api/faults").body["radio_loss"], 0.0);
    let path = "/api/boards/two/faults";
    let reply = post(&mut scene, path, r#"{"radio_loss":0.25}"#);
    assert_eq!(
        (reply.status, &reply.body["radio_loss"]),
        (200, &json!(0.25))
    );
    assert_eq!(get(&mut scene, "/api/faults").body["radio_loss"], 0.25);
    for wrong in ["1.5", "-0.1", "true"] {
        let body = format!(r#"{{"radio_loss":{wrong}}}"#);
        assert_eq!(post(&mut scene, path, &body).status, 400, "{body}");
    }
}

#[test]
fn radio_loss_without_a_radio_returns_409_and_changes_nothing() {
    let mut scene = scene(Module::Di4);
    let before = get(&mut scene, "/api/faults").body;
    assert!(before.get("radio_loss").is_none());
    let body = r#"{"radio_loss":0.5,"drop_rate":0.5}"#;
    let reply = post(&mut scene, "/api/faults", body);
    assert_eq!(reply.status, 409);
    assert_eq!(reply.body["error"], "the board has no LoRa module");
    assert_eq!(get(&mut scene, "/api/faults").body, before);
}
