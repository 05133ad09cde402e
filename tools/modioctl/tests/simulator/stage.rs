//! What commands report about the times of digital outputs, of units that these tests serve.

use std::sync::{Arc, Mutex};

use register_map::Module;
use register_map::board::MODIO_08;
use register_map::codes::ChannelStatus;
use register_map::configuration::MODULE;
use register_map::stage::DEAD_TIME;
use register_map::state::CHANNEL_STATUS;

use crate::program::{At, has};
use crate::served::{Answers, Modio, serve_requests, serve_unit};

/// Returns a modio-08 with a 4do in port 2.
fn unit() -> Modio {
    Modio::of(&MODIO_08, |port| match port {
        2 => Module::Do4,
        _ => Module::None,
    })
}

#[test]
fn output_that_stays_off_is_reported_with_the_reason() {
    let mut unit = unit().with([(CHANNEL_STATUS + 4, ChannelStatus::Ended.code())]);
    // The outputs p2.1 to p2.3 take no 1.
    let at = At::tcp(serve_requests(move |address, pdu| {
        let is_ignored = pdu[0] == 5 && pdu[3] != 0 && (4..7).contains(&pdu[2]);
        let answer = unit.response(address, pdu);
        if is_ignored {
            unit.response(address, &[5, 0, pdu[2], 0, 0]);
        }
        Some(answer)
    }));
    at.run("write p2.3.dead_time=0.5").fine();
    let on = "write p2.1=on p2.2=on p2.3=on p2.4=on";
    let text = at.run(on).fine();
    let lines = "p2.1: off, because MAX_ON has ended it: a repeated 1 is no new order\n\
                 p2.2: off again\n\
                 p2.3: off, because p2.4 of its pair is on\n\
                 p2.4 = on\n";
    assert_eq!(text, lines);
    let json = at.run(&format!("--json {on}")).fine();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let each = [0, 1, 2, 3].map(|n| format!("{} {}", json[n]["value"], json[n]["off_by"]));
    assert_eq!(
        each,
        [
            r#"false "MAX_ON""#,
            "false null",
            r#"false "p2.4""#,
            "true null"
        ]
    );
    assert_eq!(
        at.run("write p2.1=off p2.4=off").fine(),
        "p2.1 = off\np2.4 = off\n"
    );
}

#[test]
fn each_command_that_ends_a_pair_warns_after_it() {
    let unit = Arc::new(Mutex::new(unit()));
    let served = Arc::clone(&unit);
    // A change of a module sets DEAD_TIME to 0.
    let at = At::tcp(serve_requests(move |address, pdu| {
        let mut unit = served.lock().unwrap();
        if pdu[..3] == [6, (MODULE >> 8) as u8, MODULE as u8 + 1]
            && pdu[4] != Module::Do4.code() as u8
        {
            unit.modio.edited.insert(DEAD_TIME + 6, 0);
        }
        Some(unit.response(address, pdu))
    }));
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("unit.toml");
    std::fs::write(&file, "p2.3.dead_time = 0\n").unwrap();
    let lost = "warning: p2.3 and p2.4 are no pair any more: their DEAD_TIME is 0";
    for (words, warns) in [
        ("write COMMAND=3".to_owned(), true),
        ("write COMMAND=4".to_owned(), true),
        ("write COMMAND=1".to_owned(), false),
        ("write p2.module=4di".to_owned(), true),
        ("write p2.3.dead_time=0.1".to_owned(), false),
        ("config set p2.module=4di".to_owned(), true),
        ("module set 2 4di".to_owned(), true),
        ("module set 2 4do".to_owned(), false),
        ("config reset".to_owned(), true),
        (format!("config import {}", file.display()), true),
    ] {
        {
            let mut unit = unit.lock().unwrap();
            unit.modio.edited.insert(MODULE + 1, Module::Do4.code());
            unit.modio.edited.insert(DEAD_TIME + 6, 50);
        }
        let ran = at.run(&words);
        assert_eq!(ran.status, 0, "{words}: {ran:?}");
        assert_eq!(ran.err.contains(lost), warns, "{words}: {ran:?}");
    }
}

#[test]
fn warnings_about_the_times_are_those_of_the_outputs_that_were_written() {
    let at = At::tcp(serve_unit(unit()));
    let ran = at.run("write p2.2.dead_time=1 p2.4.dead_time=1");
    has(
        &ran.err,
        &[
            "p2.2.dead_time has no effect",
            "p2.4.dead_time has no effect",
        ],
    );
    for words in ["write p2.4.safe=0", "link none p2.4"] {
        let ran = at.run(words);
        let warnings = ran
            .err
            .matches("warning: p2.4.dead_time has no effect")
            .count();
        assert_eq!(
            (ran.err.lines().count(), warnings),
            (1, 1),
            "{words}: {ran:?}"
        );
    }
}

#[test]
fn longest_time_on_is_in_seconds_for_programs() {
    let at = At::tcp(serve_unit(unit()));
    at.run("write p2.1.max_on=10min").fine();
    for (words, value) in [("read", 600), ("read --raw", 0x800A)] {
        let json = at.run(&format!("--json {words} p2.1.max_on")).fine();
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(json[0]["value"], value, "{json}");
        assert_eq!(json[0]["unit"] == "s", words == "read", "{json}");
    }
}
