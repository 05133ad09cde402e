//! Tests of the dependencies between the crates of this repository: docs/architecture.md lists them.

use std::collections::BTreeSet;
use std::path::Path;

use cargo_metadata::{DependencyKind, MetadataCommand, Package};

/// The manifests of the workspaces.
const WORKSPACES: [&str; 3] = ["Cargo.toml", "fuzz/Cargo.toml", "tools/peers/Cargo.toml"];

fn root() -> &'static Path {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.parent().expect("xtask is in the root")
}

/// Returns the packages of all workspaces.
fn packages() -> Vec<Package> {
    let packages = WORKSPACES.map(|manifest| {
        let mut metadata = MetadataCommand::new();
        metadata.manifest_path(root().join(manifest));
        metadata.no_deps().other_options(["--offline".to_owned()]);
        metadata.exec().expect(manifest).packages
    });
    packages.into_iter().flatten().collect()
}

/// Returns the crates of this repository that a package depends on in this way.
fn dependencies(package: &Package, kind: DependencyKind) -> BTreeSet<&str> {
    let mut dependencies = BTreeSet::new();
    for dependency in &package.dependencies {
        if dependency.path.is_some() && dependency.kind == kind {
            dependencies.insert(dependency.name.as_str());
        }
    }
    dependencies
}

/// Returns the arrows of a package as the table has them: a crate that the package depends on anyway is not listed again
/// for its build script or its tests.
fn arrows(package: &Package) -> Vec<String> {
    let normal = dependencies(package, DependencyKind::Normal);
    let build = &dependencies(package, DependencyKind::Build) - &normal;
    let tests = &dependencies(package, DependencyKind::Development) - &normal;
    arrows_to(&package.name, [normal, build, tests])
}

/// Returns the arrows from a crate to those that it depends on, and those for its build script and its tests.
fn arrows_to<'a>(from: &str, to: [impl IntoIterator<Item = &'a str>; 3]) -> Vec<String> {
    let mut arrows = vec![from.to_owned()];
    for (to, kind) in to.into_iter().zip(["", " (build script)", " (tests)"]) {
        arrows.extend(to.into_iter().map(|to| format!("{from} -> {to}{kind}")));
    }
    arrows
}

/// Returns the arrows of a row of the table.
fn row(line: &str) -> Vec<String> {
    let mut cells = line.split('|').skip(1);
    // Every second piece is between backticks.
    let mut names = || {
        let cell = cells.next().expect(line);
        cell.split('`').skip(1).step_by(2).collect::<Vec<_>>()
    };
    let from = names()[0];
    arrows_to(from, [names(), names(), names()])
}

#[test]
fn table_of_crates_has_every_dependency_and_no_other() {
    let page = include_str!("../../docs/architecture.md");
    let mut lines = page.lines();
    let heads = lines.any(|line| line.starts_with("| crate | depends on |"));
    assert!(heads, "docs/architecture.md has no table of crates");
    let rows = lines.skip(1).take_while(|line| line.starts_with('|'));
    let listed: BTreeSet<_> = rows.flat_map(row).collect();
    let packages = packages();
    let real: BTreeSet<_> = packages.iter().flat_map(arrows).collect();
    let (missing, extra) = (&real - &listed, &listed - &real);
    assert!(
        missing.is_empty() && extra.is_empty(),
        "the table of crates in docs/architecture.md differs from the manifests; add to it {missing:?}, remove from it \
         {extra:?}"
    );
}

#[test]
fn products_depend_on_no_test_tool_and_tools_on_no_code_of_the_device() {
    let packages = packages();
    let is_in = |package: &Package, directories: &[&str]| {
        let manifest = package.manifest_path.strip_prefix(root()).unwrap();
        directories.iter().any(|part| manifest.starts_with(part))
    };
    let is_tool = |package: &Package| is_in(package, &["tools", "xtask"]);
    let is_product = |package: &Package| {
        is_in(package, &["tools/modioctl", "tools/modbus-line"])
            || !is_tool(package) && !is_in(package, &["fuzz"])
    };
    let test_tools = packages.iter().filter(|package| !is_product(package));
    let test_tools: BTreeSet<_> = test_tools.map(|tool| tool.name.as_str()).collect();
    assert!(test_tools.contains("sim"));
    let of_device = BTreeSet::from(["firmware", "board-support"]);
    for package in &packages {
        let normal = dependencies(package, DependencyKind::Normal);
        let used = &normal | &dependencies(package, DependencyKind::Build);
        let name = &package.name;
        if is_product(package) {
            let broken = &used & &test_tools;
            assert!(broken.is_empty(), "{name} -> {broken:?}: not for products");
        }
        if is_tool(package) {
            let broken = &used & &of_device;
            assert!(broken.is_empty(), "{name} -> {broken:?}: not for tools");
        }
    }
}
