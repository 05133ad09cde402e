//! Tests of `links` and `link`.

use register_map::Module;

use crate::program::{At, has};
use crate::served::{modio_02, response, serve_requests, server};
use crate::unit::Unit;

#[test]
fn unit_without_links_is_reported() {
    let mut unit = server(modio_02(Module::Do4));
    let at = At::tcp(serve_requests(move |address, pdu| {
        Some(response(&mut unit, address, pdu))
    }));
    for words in ["links", "link p5.1 toggles p5.2", "link none p5.1"] {
        has(&at.run(words).failed(2), &["the unit has no links"]);
    }
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
    unit.post("/api/slots/1/channels/1", r#"{"energised": true}"#);
    unit.wait(50);
    assert_eq!(at.run("read p2.1").fine(), "p2.1  on\n");

    // The same input replaces its link, another one gets the second link, a third one none.
    at.run("link p1.1 sets p2.1 if alone").fine();
    at.run("write p3.1.range=NTC p3.1.scale=1").fine();
    at.run("link p3.1 switches p2.1 on below -5.5 off above 18")
        .fine();
    let links = "p2.1.link1  p1.1 sets p2.1 if alone\n\
                 p2.1.link2  p3.1 switches p2.1 on below -5.5 °C off above 18.0 °C\n";
    assert_eq!(at.run("links").fine(), links);
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
