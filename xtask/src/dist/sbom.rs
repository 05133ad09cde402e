//! The bills of materials: the crates that are linked into an image or a program, and their dependencies, in CycloneDX
//! 1.5 (JSON).
//!
//! The build itself reports which packages it compiled for the target, `cargo metadata` has their origin, and
//! Cargo.lock their check sums. Procedural macros and build scripts run on the host and are not in a bill. A bill has
//! neither time nor serial number, so the same sources give the same bill.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context as _, Result};
use cargo_metadata::{DependencyKind, Metadata, MetadataCommand, Package, PackageId, Resolve};
use serde_json::{Value, json};

use super::notices::{self, Notices};
use crate::workspace::{Workspace, locked};

/// The file that a bill is for.
pub struct Subject<'a> {
    pub name: &'a str,
    /// Its kind in CycloneDX.
    pub kind: &'a str,
    /// The package that it is built from.
    pub package: &'a str,
    /// The target and the features that it is built for.
    pub target: &'a str,
    pub features: String,
    /// The packages that were compiled for the target, for this file and for others.
    pub compiled: &'a [PackageId],
    /// The version of the rustc that has compiled it.
    pub compiler: &'a str,
    pub sha256: String,
}

/// Check sums of packages, by name and version.
type Sums = BTreeMap<(String, String), String>;

impl Subject<'_> {
    /// Returns the bill, as the text of a file, and notes its packages.
    pub fn bill(&self, workspace: &Workspace, notices: &mut Notices) -> Result<String> {
        let mut metadata = MetadataCommand::new();
        metadata.current_dir(&workspace.root);
        metadata.other_options([
            "--locked".to_owned(),
            format!("--filter-platform={}", self.target),
            format!("--features={}", self.features),
        ]);
        let sums = locked(&workspace.root.join("Cargo.lock"), "checksum")?;
        let bill = self.of(&metadata.exec()?, &sums, notices)?;
        Ok(format!("{bill:#}\n"))
    }

    fn of(&self, metadata: &Metadata, sums: &Sums, notices: &mut Notices) -> Result<Value> {
        let resolve = metadata.resolve.as_ref().context("no dependencies")?;
        let mut packages = metadata.workspace_packages().into_iter();
        let root = packages.find(|package| *package.name == self.package);
        let root = root.with_context(|| format!("there is no package {}", self.package))?;
        // The package and those of its dependencies, direct or not, that were compiled for the target.
        let mut linked = BTreeSet::new();
        let mut open = vec![&root.id];
        while let Some(id) = open.pop() {
            if self.compiled.contains(id) && linked.insert(id) {
                open.extend(normal_dependencies(resolve, id));
            }
        }
        let (mut components, mut dependencies) = (BTreeMap::new(), BTreeMap::new());
        for id in &linked {
            let package = &metadata[id];
            notices.note(package);
            components.insert(reference(package), component(package, sums)?);
            let on = normal_dependencies(resolve, id).filter(|on| linked.contains(on));
            let on: BTreeSet<_> = on.map(|on| reference(&metadata[on])).collect();
            dependencies.insert(reference(package), on);
        }
        let mut main = components
            .remove(&reference(root))
            .with_context(|| format!("the build has not compiled {}", self.package))?;
        main["type"] = json!(self.kind);
        main["name"] = json!(self.name);
        main["hashes"] = json!([{ "alg": "SHA-256", "content": self.sha256 }]);
        let dependencies = dependencies
            .into_iter()
            .map(|(of, on)| json!({ "ref": of, "dependsOn": on }));
        Ok(json!({
            "$schema": "http://cyclonedx.org/schema/bom-1.5.schema.json",
            "bomFormat": "CycloneDX",
            "specVersion": "1.5",
            "version": 1,
            "metadata": {
                "component": main,
                "tools": {
                    "components": [{ "type": "application", "name": "rustc", "version": self.compiler }],
                },
            },
            "components": components.into_values().collect::<Vec<_>>(),
            "dependencies": dependencies.collect::<Vec<_>>(),
        }))
    }
}

/// Returns the dependencies of a package, without those of its tests and its build script.
fn normal_dependencies<'a>(
    resolve: &'a Resolve,
    of: &PackageId,
) -> impl Iterator<Item = &'a PackageId> {
    let normal = resolve[of].deps.iter().filter(|dependency| {
        let mut kinds = dependency.dep_kinds.iter();
        kinds.any(|kind| kind.kind == DependencyKind::Normal)
    });
    normal.map(|dependency| &dependency.pkg)
}

/// Returns the name of a package in the bill.
pub fn reference(package: &Package) -> String {
    format!("{}@{}", package.name, package.version)
}

fn component(package: &Package, sums: &Sums) -> Result<Value> {
    let mut component = json!({
        "type": "library",
        "bom-ref": reference(package),
        "name": package.name,
        "version": package.version,
    });
    // A package URL of type cargo without a qualifier is a package on crates.io, so other packages have none. A `+` of
    // the version is escaped.
    let source = package.source.as_ref();
    if source.is_some_and(|source| source.is_crates_io()) {
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

    /// The metadata of four packages: `firmware` depends on `crc` and on a macro, `crc` on `firmware` for its tests,
    /// and `other` on nothing.
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
        let compiled = ["f", "c", "o"].map(|id| PackageId { repr: id.into() });
        let subject = Subject {
            name: "modio-02",
            kind: "firmware",
            package: "firmware",
            target: "",
            features: String::new(),
            compiled: &compiled,
            compiler: "1.95.0",
            sha256: "ef".to_owned(),
        };
        let bill = subject.of(&metadata(), &sums, &mut Notices::default());
        let bill = bill.unwrap();
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
