//! Compares the OpenAPI description with the code.

use sim::radio::Parameters;

use super::*;

#[test]
fn description_has_every_path_and_no_other() {
    let mut bench = bench(Module::Di4);
    let described = get(&mut bench, "/api/openapi.json");
    assert_eq!(described.status, 200);
    let paths = described.body["paths"].as_object().unwrap();
    // The paths are in the table at the start of api.rs, except `/api/events`, which the HTTP server handles itself.
    let mut known: Vec<_> = include_str!("../api.rs")
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
        radio: Some(Parameters::FACTORY),
        ..Config::default()
    });
    let schemas = get(&mut bench, "/api/openapi.json").body["components"]["schemas"].take();
    bench.send(
        &[0x01, 0x01, 0x00, 0x10, 0x00, 0x04, 0x3C, 0x0C],
        Origin::Pty,
    );
    bench.bus.run_for(sim::Time::from_ms(20));
    let frame = get(&mut bench, "/api/frames").body["frames"][0].take();
    assert_eq!(schemas["Module"]["enum"][1], "4di");
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
