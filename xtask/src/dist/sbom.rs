//! The bill of materials: the crates that are linked into the image, and their dependencies, in CycloneDX 1.5 (JSON).
//!
//! The build itself reports which packages it compiled for the target, `cargo metadata` has their origin, and
//! Cargo.lock their check sums. Procedural macros and build scripts run on the host and are not in the bill. The bill
//! has neither time nor serial number, so the same sources give the same bill.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context as _, Result, ensure};
use cargo_metadata::{DependencyKind, Metadata, MetadataCommand, Package, PackageId};
use object::{Object as _, ObjectSection as _};
use register_map::Board;
use serde_json::{Value, json};

use crate::build::Image;
use crate::image;
use crate::toolchain::TARGET;
use crate::workspace::{Workspace, locked};

/// Returns the bill of an image. `flash` is the SHA-256 of its .bin.
pub fn of_image(workspace: &Workspace, board: &Board, built: &Image, flash: &str) -> Result<Value> {
    let mut metadata = MetadataCommand::new();
    metadata.current_dir(workspace.root());
    metadata.other_options([
        format!("--filter-platform={TARGET}"),
        format!("--features=firmware/{board}"),
    ]);
    let sums = locked(&workspace.root().join("Cargo.lock"), "checksum")?;
    let elf = image::read(&built.elf)?;
    bill(
        board,
        &built.packages,
        &metadata.exec()?,
        &sums,
        &compiler(&elf)?,
        flash,
    )
}

/// Returns the version of the rustc that has compiled the image, from a comment in the image.
fn compiler(elf: &[u8]) -> Result<String> {
    let elf = image::parse(elf)?;
    let comment = elf.section_by_name(".comment");
    let comment = comment
        .and_then(|section| section.data().ok())
        .unwrap_or_default();
    let comment = String::from_utf8_lossy(comment);
    let mut texts = comment.split('\0');
    let version = texts.find_map(|text| text.strip_prefix("rustc version "));
    Ok(version
        .context("the image has no comment with its compiler")?
        .to_owned())
}

fn bill(
    board: &Board,
    linked: &[PackageId],
    metadata: &Metadata,
    sums: &BTreeMap<(String, String), String>,
    compiler: &str,
    flash: &str,
) -> Result<Value> {
    let linked: BTreeMap<&PackageId, &Package> = metadata
        .packages
        .iter()
        .filter(|package| linked.contains(&package.id))
        .map(|package| (&package.id, package))
        .collect();
    let (root, mut libraries): (Vec<&Package>, Vec<&Package>) = linked
        .values()
        .partition(|package| *package.name == "firmware");
    ensure!(root.len() == 1, "the image has not one package firmware");
    libraries.sort_by_key(|package| reference(package));
    let mut main = component(root[0], sums);
    main["type"] = json!("firmware");
    main["name"] = json!(board.name);
    main["hashes"] = json!([{ "alg": "SHA-256", "content": flash }]);

    let resolve = metadata
        .resolve
        .as_ref()
        .context("cargo reports no dependencies")?;
    let dependencies: BTreeMap<String, BTreeSet<String>> = resolve
        .nodes
        .iter()
        .filter_map(|node| {
            let normal = node.deps.iter().filter(|dependency| {
                let mut kinds = dependency.dep_kinds.iter();
                kinds.any(|kind| kind.kind == DependencyKind::Normal)
            });
            let on = normal.filter_map(|dependency| Some(reference(linked.get(&dependency.pkg)?)));
            Some((reference(linked.get(&node.id)?), on.collect()))
        })
        .collect();
    let dependencies = dependencies
        .into_iter()
        .map(|(of, on)| json!({ "ref": of, "dependsOn": on }));
    let libraries = libraries
        .into_iter()
        .map(|package| component(package, sums));
    Ok(json!({
        "$schema": "http://cyclonedx.org/schema/bom-1.5.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {
            "component": main,
            "tools": { "components": [{ "type": "application", "name": "rustc", "version": compiler }] },
        },
        "components": libraries.collect::<Vec<_>>(),
        "dependencies": dependencies.collect::<Vec<_>>(),
    }))
}

/// Returns the name of a package in the bill.
fn reference(package: &Package) -> String {
    format!("{}@{}", package.name, package.version)
}

fn component(package: &Package, sums: &BTreeMap<(String, String), String>) -> Value {
    let mut component = json!({
        "type": "library",
        "bom-ref": reference(package),
        "name": package.name,
        "version": package.version,
    });
    // A package URL of type cargo without a qualifier is a package on crates.io, so other packages have none. A `+` of
    // the version is escaped.
    if package
        .source
        .as_ref()
        .is_some_and(|source| source.is_crates_io())
    {
        let version = package.version.to_string().replace('+', "%2B");
        component["purl"] = json!(format!("pkg:cargo/{}@{version}", package.name));
    }
    if let Some(license) = &package.license {
        // Older packages have a slash instead of the OR of SPDX.
        let license = license.replace(" / ", " OR ").replace('/', " OR ");
        component["licenses"] = json!([{ "expression": license }]);
    }
    if let Some(sum) = sums.get(&(package.name.to_string(), package.version.to_string())) {
        component["hashes"] = json!([{ "alg": "SHA-256", "content": sum }]);
    }
    if let Some(url) = &package.repository {
        component["externalReferences"] = json!([{ "type": "vcs", "url": url }]);
    }
    component
}

#[cfg(test)]
mod tests {
    use register_map::board::MODIO_02;

    use super::*;

    /// The metadata of three packages: `firmware` depends on `crc` and on a macro, and `crc` on `firmware` for its
    /// tests.
    fn metadata() -> Metadata {
        let registry = "registry+https://github.com/rust-lang/crates.io-index";
        let package = |id: &str, name: &str, version: &str, source: Option<&str>| {
            json!({
                "id": id, "name": name, "version": version, "source": source, "license": "MIT/Apache-2.0",
                "repository": "https://example.com/x", "dependencies": [], "targets": [], "features": {},
                "manifest_path": "/x/Cargo.toml",
            })
        };
        let dependency = |on: &str, kind: Value| json!({ "name": on, "pkg": on, "dep_kinds": [{ "kind": kind, "target": null }] });
        let node = |id: &str, deps: Vec<Value>| json!({ "id": id, "deps": deps, "dependencies": [], "features": [] });
        let metadata = json!({
            "packages": [
                package("f", "firmware", "0.1.0", None),
                package("c", "crc", "3.4.0+1", Some(registry)),
                package("m", "a-macro", "1.0.0", Some(registry)),
            ],
            "resolve": { "root": null, "nodes": [
                node("f", vec![dependency("c", Value::Null), dependency("m", Value::Null)]),
                node("c", vec![dependency("f", json!("dev"))]),
                node("m", vec![]),
            ] },
            "workspace_members": ["f"], "workspace_root": "/x", "target_directory": "/x/target", "version": 1,
        });
        serde_json::from_value(metadata).unwrap()
    }

    #[test]
    fn bill_has_the_linked_packages_with_their_origin_and_dependencies() {
        let sums = BTreeMap::from([(("crc".to_owned(), "3.4.0+1".to_owned()), "abcd".to_owned())]);
        let linked = ["f", "c"].map(|id| PackageId {
            repr: id.to_owned(),
        });
        let bill = bill(&MODIO_02, &linked, &metadata(), &sums, "1.95.0", "ef").unwrap();
        let [crc] = bill["components"].as_array().unwrap().as_slice() else {
            panic!("{bill:#}");
        };
        assert_eq!(crc["purl"], "pkg:cargo/crc@3.4.0%2B1");
        assert_eq!(crc["hashes"][0]["content"], "abcd");
        assert_eq!(crc["licenses"][0]["expression"], "MIT OR Apache-2.0");
        let main = &bill["metadata"]["component"];
        assert_eq!(
            (&main["name"], &main["purl"]),
            (&json!("modio-02"), &Value::Null)
        );
        assert_eq!(main["hashes"][0]["content"], "ef");
        assert_eq!(
            bill["dependencies"],
            json!([
                { "ref": "crc@3.4.0+1", "dependsOn": [] },
                { "ref": "firmware@0.1.0", "dependsOn": ["crc@3.4.0+1"] },
            ])
        );
    }
}
