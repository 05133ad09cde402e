//! Compares the OpenAPI description with the paths that are answered.

use super::*;

#[test]
fn every_described_path_is_answered() {
    let mut scene = scene(Module::Di4);
    let described = get(&mut scene, "/api/openapi.json");
    let paths = described.body["paths"].as_object().unwrap();
    assert!(paths.len() > 12, "{}", paths.len());
    for (path, methods) in paths {
        // The HTTP server answers this path itself.
        if path == "/api/events" {
            continue;
        }
        for method in methods.as_object().unwrap().keys() {
            let target = path.replace("{port}", "5").replace("{channel}", "1");
            let status = ask(&mut scene, &method.to_uppercase(), &target, "{}").status;
            let expected = if method == "get" { 200 } else { 400 };
            assert_eq!(status, expected, "{method} {path}");
        }
    }
}
