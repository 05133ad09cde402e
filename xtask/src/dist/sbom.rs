//! The bill of materials: the crates that are linked into the image, and what each stands on, in
//! CycloneDX 1.5 (JSON).
//!
//! Written from what cargo itself tells: `cargo tree` knows which crates this build has with these features
//! on this target, `cargo metadata` where they come from, `Cargo.lock` their check sums. Procedural macros
//! and build scripts run on the host and are not in it. No time and no serial number: the same sources
//! give the same bill.

use std::collections::{BTreeMap, BTreeSet};

use object::read::{Object as _, ObjectSection as _};
use register_map::Board;
use serde_json::{Value, json};

use crate::toolchain::TARGET;
use crate::workspace::Workspace;
use crate::{Failure, Result, command, image};

/// Name and version of a crate.
type Crate = (String, String);

/// The bill of this image for a board; `flash` is the SHA-256 of its .bin.
///
/// # Errors
///
/// When cargo cannot be asked, or what it says does not fit together.
pub(super) fn of_image(
    workspace: &Workspace,
    board: &Board,
    elf: &[u8],
    flash: &str,
) -> Result<Value> {
    let mut cargo = workspace.cargo("tree");
    cargo.args([
        "--package",
        "firmware",
        "--features",
        board.name,
        "--target",
        TARGET,
    ]);
    cargo.args(["--edges", "normal,no-proc-macro", "--prefix", "none"]);
    let tree = command::read(cargo.args(["--format", "{p}"]))?;
    let mut cargo = workspace.cargo("metadata");
    cargo.args(["--format-version", "1", "--filter-platform", TARGET]);
    let metadata = command::read(cargo.args(["--features", &format!("firmware/{board}")]))?;
    let metadata = serde_json::from_str(&metadata)
        .map_err(|error| Failure::new(format!("`cargo metadata` gives no JSON: {error}")))?;
    let lock = std::fs::read_to_string(workspace.root().join("Cargo.lock"))
        .map_err(|error| Failure::new(format!("cannot read Cargo.lock: {error}")))?;
    let compiler = compiler(elf).map_err(Failure::new)?;
    bill(
        board,
        &linked(&tree),
        &metadata,
        &checksums(&lock),
        &compiler,
        flash,
    )
    .map_err(Failure::new)
}

/// The crates of `cargo tree`: `name vVERSION`, and more that does not matter here.
fn linked(tree: &str) -> BTreeSet<Crate> {
    let of_line = |line: &str| {
        let mut words = line.split_whitespace();
        let (name, version) = (words.next()?, words.next()?.strip_prefix('v')?);
        Some((name.to_owned(), version.to_owned()))
    };
    tree.lines().filter_map(of_line).collect()
}

/// The check sums of a Cargo.lock, which packages of this workspace do not have.
fn checksums(lock: &str) -> BTreeMap<Crate, String> {
    let mut sums = BTreeMap::new();
    for package in lock.split("[[package]]").skip(1) {
        let field = |name: &str| {
            let prefix = format!("{name} = \"");
            let line = package
                .lines()
                .find_map(|line| line.strip_prefix(&prefix))?;
            Some(line.trim_end_matches('"').to_owned())
        };
        if let (Some(name), Some(version), Some(sum)) =
            (field("name"), field("version"), field("checksum"))
        {
            sums.insert((name, version), sum);
        }
    }
    sums
}

/// Which rustc has compiled the image, as it says itself.
fn compiler(elf: &[u8]) -> std::result::Result<String, String> {
    let elf = image::parse(elf)?;
    let comment = elf
        .section_by_name(".comment")
        .and_then(|section| section.data().ok());
    comment
        .unwrap_or_default()
        .split(|byte| *byte == 0)
        .find_map(|text| {
            std::str::from_utf8(text)
                .ok()?
                .strip_prefix("rustc version ")
        })
        .map(str::to_owned)
        .ok_or_else(|| "the image does not tell its compiler".to_owned())
}

fn bill(
    board: &Board,
    linked: &BTreeSet<Crate>,
    metadata: &Value,
    sums: &BTreeMap<Crate, String>,
    compiler: &str,
    flash: &str,
) -> std::result::Result<Value, String> {
    let text = |value: &Value, field: &str| value[field].as_str().unwrap_or_default().to_owned();
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    // Cargo's identifier of each crate that is linked.
    let mut packages: BTreeMap<String, (Crate, Value)> = BTreeMap::new();
    for package in list(&metadata["packages"]) {
        let name = (text(&package, "name"), text(&package, "version"));
        if linked.contains(&name) {
            packages.insert(text(&package, "id"), (name, package));
        }
    }
    if let Some(missing) = linked
        .iter()
        .find(|name| !packages.values().any(|(other, _)| other == *name))
    {
        return Err(format!(
            "`cargo metadata` knows no {} {}",
            missing.0, missing.1
        ));
    }
    let (root, rest): (Vec<_>, Vec<_>) = packages
        .values()
        .partition(|((name, _), _)| name == "firmware");
    let [(root, package)] = root.as_slice() else {
        return Err("there is not one package firmware".to_owned());
    };
    let mut main = component(root, package, sums);
    main["type"] = json!("firmware");
    main["name"] = json!(board.name);
    main["hashes"] = json!([{ "alg": "SHA-256", "content": flash }]);
    let mut components: Vec<Value> = rest
        .iter()
        .map(|(name, package)| component(name, package, sums))
        .collect();
    components.sort_by_key(|component| text(component, "bom-ref"));

    let mut dependencies = Vec::new();
    for node in list(&metadata["resolve"]["nodes"]) {
        let Some((name, _)) = packages.get(&text(&node, "id")) else {
            continue;
        };
        let on: BTreeSet<String> = list(&node["deps"])
            .iter()
            .filter(|dep| {
                list(&dep["dep_kinds"])
                    .iter()
                    .any(|kind| kind["kind"].is_null())
            })
            .filter_map(|dep| packages.get(&text(dep, "pkg")))
            .map(|(name, _)| purl(name))
            .collect();
        dependencies.push(json!({ "ref": purl(name), "dependsOn": on }));
    }
    dependencies.sort_by_key(|dependency| text(dependency, "ref"));
    Ok(json!({
        "$schema": "http://cyclonedx.org/schema/bom-1.5.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {
            "component": main,
            "tools": { "components": [{ "type": "application", "name": "rustc", "version": compiler }] },
        },
        "components": components,
        "dependencies": dependencies,
    }))
}

fn component(name: &Crate, package: &Value, sums: &BTreeMap<Crate, String>) -> Value {
    let mut component = json!({
        "type": "library",
        "bom-ref": purl(name),
        "name": name.0,
        "version": name.1,
        "purl": purl(name),
    });
    if let Some(license) = package["license"].as_str() {
        // Some still write a slash where SPDX has OR.
        let license = license.replace(" / ", " OR ").replace('/', " OR ");
        component["licenses"] = json!([{ "expression": license }]);
    }
    if let Some(sum) = sums.get(name) {
        component["hashes"] = json!([{ "alg": "SHA-256", "content": sum }]);
    }
    if let Some(url) = package["repository"].as_str() {
        component["externalReferences"] = json!([{ "type": "vcs", "url": url }]);
    }
    component
}

fn purl((name, version): &Crate) -> String {
    format!("pkg:cargo/{name}@{version}")
}

#[cfg(test)]
mod tests {
    use register_map::board::MODIO_02;

    use super::*;

    const TREE: &str = "firmware v0.1.0 (/x/firmware)\ncrc v3.4.0\ncrc v3.4.0 (*)\n\n";

    fn metadata() -> Value {
        json!({
            "packages": [
                { "id": "f", "name": "firmware", "version": "0.1.0", "license": "MIT" },
                { "id": "c3", "name": "crc", "version": "3.4.0", "license": "MIT/Apache-2.0",
                  "repository": "https://example.com/crc" },
                { "id": "c2", "name": "crc", "version": "2.0.0" },
                { "id": "m", "name": "a-macro", "version": "1.0.0" },
            ],
            "resolve": { "nodes": [
                { "id": "f", "deps": [
                    { "pkg": "c3", "dep_kinds": [{ "kind": null }] },
                    { "pkg": "m", "dep_kinds": [{ "kind": null }] },
                ] },
                { "id": "c3", "deps": [{ "pkg": "f", "dep_kinds": [{ "kind": "dev" }] }] },
                { "id": "m", "deps": [] },
            ] },
        })
    }

    #[test]
    fn only_what_is_linked_is_in_it_with_what_it_stands_on() {
        let lock = "[[package]]\nname = \"crc\"\nversion = \"3.4.0\"\nsource = \"r\"\n\
                    checksum = \"abcd\"\n\n[[package]]\nname = \"firmware\"\nversion = \"0.1.0\"\n";
        let sums = checksums(lock);
        assert_eq!(sums.len(), 1);
        let bill = bill(&MODIO_02, &linked(TREE), &metadata(), &sums, "1.95.0", "ef").unwrap();
        let [crc] = bill["components"].as_array().unwrap().as_slice() else {
            panic!("{bill:#}");
        };
        assert_eq!(crc["purl"], "pkg:cargo/crc@3.4.0");
        assert_eq!(crc["hashes"][0]["content"], "abcd");
        assert_eq!(crc["licenses"][0]["expression"], "MIT OR Apache-2.0");
        assert_eq!(bill["metadata"]["component"]["name"], "modio-02");
        assert_eq!(bill["metadata"]["component"]["hashes"][0]["content"], "ef");
        assert_eq!(
            bill["dependencies"],
            json!([
                { "ref": "pkg:cargo/crc@3.4.0", "dependsOn": [] },
                { "ref": "pkg:cargo/firmware@0.1.0", "dependsOn": ["pkg:cargo/crc@3.4.0"] },
            ])
        );
    }

    #[test]
    fn a_crate_that_is_linked_but_not_known_is_told() {
        let tree = format!("{TREE}stranger v9.0.0\n");
        let (tree, sums) = (linked(&tree), BTreeMap::new());
        let text = bill(&MODIO_02, &tree, &metadata(), &sums, "", "").unwrap_err();
        assert_eq!(text, "`cargo metadata` knows no stranger 9.0.0");
    }
}
