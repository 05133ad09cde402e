//! The bills of materials: the crates that are linked into an image or a program, and their dependencies, in CycloneDX
//! 1.5 (JSON).
//!
//! The build itself reports which packages it compiled for the target, `cargo metadata` has their origin, and
//! Cargo.lock their check sums. Procedural macros and build scripts run on the host and are not in a bill. A bill has
//! neither time nor serial number, so the same sources give the same bill.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use anyhow::{Context as _, Result};
use cargo_metadata::{DependencyKind, Metadata, MetadataCommand, Package, PackageId};
use object::{Object as _, ObjectSection as _};
use register_map::Board;
use serde_json::{Value, json};

use super::notices::{self, Notices};
use crate::build::Image;
use crate::toolchain::TARGET;
use crate::workspace::{Workspace, locked};
use crate::{command, image};

/// The file that a bill is for.
struct Subject<'a> {
    name: &'a str,
    /// Its kind in CycloneDX.
    kind: &'a str,
    /// The package that it is built from.
    package: &'a str,
    /// The version of the rustc that has compiled it.
    compiler: &'a str,
    sha256: &'a str,
}

/// Returns the bill of an image, and notes its packages. `flash` is the SHA-256 of its .bin.
pub fn of_image(
    workspace: &Workspace,
    board: &Board,
    built: &Image,
    flash: &str,
    notices: &mut Notices,
) -> Result<Value> {
    let elf = image::read(&built.elf)?;
    let subject = Subject {
        name: board.name,
        kind: "firmware",
        package: "firmware",
        compiler: &compiler(&elf)?,
        sha256: flash,
    };
    let metadata = metadata(workspace, TARGET, &format!("firmware/{board}"))?;
    of(workspace, &subject, &metadata, &built.packages, notices)
}

/// Returns the bill of a program, and notes its packages.
pub fn of_program(
    workspace: &Workspace,
    target: &str,
    (package, program): (&str, &str),
    compiled: &[PackageId],
    sha256: &str,
    notices: &mut Notices,
) -> Result<Value> {
    let version = command::read(Command::new("rustc").arg("--version"))?;
    let subject = Subject {
        name: program,
        kind: "application",
        package,
        compiler: version.trim().trim_start_matches("rustc "),
        sha256,
    };
    let metadata = metadata(workspace, target, "")?;
    of(workspace, &subject, &metadata, compiled, notices)
}

fn of(
    workspace: &Workspace,
    subject: &Subject,
    metadata: &Metadata,
    compiled: &[PackageId],
    notices: &mut Notices,
) -> Result<Value> {
    let linked = linked(metadata, subject.package, compiled)?;
    notices.note(linked.values().copied());
    let sums = locked(&workspace.root().join("Cargo.lock"), "checksum")?;
    bill(subject, &linked, metadata, &sums)
}

fn metadata(workspace: &Workspace, target: &str, features: &str) -> Result<Metadata> {
    let mut metadata = MetadataCommand::new();
    metadata.current_dir(workspace.root());
    metadata.other_options([
        "--locked".to_owned(),
        format!("--filter-platform={target}"),
        format!("--features={features}"),
    ]);
    Ok(metadata.exec()?)
}

/// Returns a package and those of its dependencies, direct or not, that were compiled for the target.
fn linked<'a>(
    metadata: &'a Metadata,
    root: &str,
    compiled: &[PackageId],
) -> Result<BTreeMap<&'a PackageId, &'a Package>> {
    let packages: BTreeMap<&PackageId, &Package> = metadata
        .packages
        .iter()
        .filter(|package| compiled.contains(&package.id))
        .map(|package| (&package.id, package))
        .collect();
    let root = packages.values().find(|package| *package.name == root);
    let root = root.with_context(|| format!("the build has not compiled {root:?}"))?;
    let mut found = BTreeMap::new();
    let mut open = vec![&root.id];
    while let Some(id) = open.pop() {
        let Some((id, package)) = packages.get_key_value(id) else {
            continue;
        };
        if found.insert(*id, *package).is_none() {
            open.extend(normal_dependencies(metadata, id));
        }
    }
    Ok(found)
}

/// Returns the dependencies of a package, without those of its tests and its build script.
fn normal_dependencies<'a>(
    metadata: &'a Metadata,
    of: &PackageId,
) -> impl Iterator<Item = &'a PackageId> {
    let nodes = metadata.resolve.iter().flat_map(|resolve| &resolve.nodes);
    let node = nodes.into_iter().find(|node| node.id == *of);
    let dependencies = node.into_iter().flat_map(|node| &node.deps);
    let normal = dependencies.filter(|dependency| {
        let mut kinds = dependency.dep_kinds.iter();
        kinds.any(|kind| kind.kind == DependencyKind::Normal)
    });
    normal.map(|dependency| &dependency.pkg)
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
    subject: &Subject,
    linked: &BTreeMap<&PackageId, &Package>,
    metadata: &Metadata,
    sums: &BTreeMap<(String, String), String>,
) -> Result<Value> {
    let (root, mut libraries): (Vec<&Package>, Vec<&Package>) = linked
        .values()
        .partition(|package| *package.name == subject.package);
    let root = root.first().context("the subject is not linked")?;
    libraries.sort_by_key(|package| reference(package));
    let mut main = component(root, sums)?;
    main["type"] = json!(subject.kind);
    main["name"] = json!(subject.name);
    main["hashes"] = json!([{ "alg": "SHA-256", "content": subject.sha256 }]);

    let dependencies: BTreeMap<String, BTreeSet<String>> = linked
        .iter()
        .map(|(id, package)| {
            let on = normal_dependencies(metadata, id)
                .filter_map(|dependency| Some(reference(linked.get(dependency)?)));
            (reference(package), on.collect())
        })
        .collect();
    let dependencies = dependencies
        .into_iter()
        .map(|(of, on)| json!({ "ref": of, "dependsOn": on }));
    let libraries: Result<Vec<_>> = libraries
        .into_iter()
        .map(|package| component(package, sums))
        .collect();
    Ok(json!({
        "$schema": "http://cyclonedx.org/schema/bom-1.5.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {
            "component": main,
            "tools": {
                "components": [{ "type": "application", "name": "rustc", "version": subject.compiler }],
            },
        },
        "components": libraries?,
        "dependencies": dependencies.collect::<Vec<_>>(),
    }))
}

/// Returns the name of a package in the bill.
pub fn reference(package: &Package) -> String {
    format!("{}@{}", package.name, package.version)
}

fn component(package: &Package, sums: &BTreeMap<(String, String), String>) -> Result<Value> {
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
    let license = notices::expression(package)?.to_string();
    component["licenses"] = json!([{ "expression": license }]);
    if let Some(sum) = sums.get(&(package.name.to_string(), package.version.to_string())) {
        component["hashes"] = json!([{ "alg": "SHA-256", "content": sum }]);
    }
    if let Some(url) = &package.repository {
        component["externalReferences"] = json!([{ "type": "vcs", "url": url }]);
    }
    Ok(component)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The metadata of four packages: `firmware` depends on `crc` and on a macro, `crc` on `firmware` for its tests, and
    /// `other` on nothing.
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
                package("o", "other", "0.1.0", None),
            ],
            "resolve": { "root": null, "nodes": [
                node("f", vec![dependency("c", Value::Null), dependency("m", Value::Null)]),
                node("c", vec![dependency("f", json!("dev"))]),
                node("m", vec![]),
                node("o", vec![]),
            ] },
            "workspace_members": ["f"], "workspace_root": "/x", "target_directory": "/x/target", "version": 1,
        });
        serde_json::from_value(metadata).unwrap()
    }

    #[test]
    fn bill_has_the_linked_packages_with_their_origin_and_dependencies() {
        let sums = BTreeMap::from([(("crc".to_owned(), "3.4.0+1".to_owned()), "abcd".to_owned())]);
        // The other program's package was compiled in the same build.
        let compiled = ["f", "c", "o"].map(|id| PackageId {
            repr: id.to_owned(),
        });
        let subject = Subject {
            name: "modio-02",
            kind: "firmware",
            package: "firmware",
            compiler: "1.95.0",
            sha256: "ef",
        };
        let metadata = metadata();
        let linked = linked(&metadata, "firmware", &compiled).unwrap();
        let bill = bill(&subject, &linked, &metadata, &sums).unwrap();
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
