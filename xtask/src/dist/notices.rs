//! The licences of the crates of others that are in the files of a release.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context as _, Result};
use cargo_metadata::Package;
use fs_err as fs;
use spdx::{AdditionItem, Expression, ParseMode};

use super::sbom::reference;

/// Starts of the names of files with licences, in small letters.
const FILES: &str = "copying copyright licence license notice unlicense";

/// The licence of musl's libc, which programs for Linux contain.
const MUSL: &str = include_str!("musl.txt");

/// Packages of others by name and version, each with a line about it and with its licence texts.
#[derive(Debug, Default)]
pub struct Notices(BTreeMap<String, Package>);

impl Notices {
    /// Adds a package, unless it is one of this project.
    pub fn note(&mut self, package: &Package) {
        if package.source.is_some() {
            self.0.insert(reference(package), package.clone());
        }
    }

    /// Writes the licences of these packages, and of the C library that programs for a musl target contain too.
    pub fn write(&self, target: &str, out: &Path) -> Result<()> {
        let mut text = self.text()?;
        if target.ends_with("-musl") {
            text += MUSL;
        }
        fs::write(out.join(format!("THIRD-PARTY-{target}.txt")), text)?;
        Ok(())
    }

    /// Returns the list of packages, and each distinct text once, with the packages that it is for.
    fn text(&self) -> Result<String> {
        let mut list = String::new();
        let mut texts = BTreeMap::<String, BTreeSet<&str>>::new();
        for (name, package) in &self.0 {
            let from = package.repository.as_deref().unwrap_or("crates.io");
            list += &format!("{name}  {}  {from}\n", expression(package)?);
            for text in texts_of(package)? {
                texts.entry(text).or_default().insert(name);
            }
        }
        let sections = texts
            .into_iter()
            .map(|(text, names)| (Vec::from_iter(names), text));
        let rule = "-".repeat(80);
        let mut all = format!(
            "Software of others in the files of this release, with its licences. Its sources are on crates.io.\n\
             The licences of Rust's standard library are in THIRD-PARTY-rust-std.html.\n\n{list}"
        );
        for (names, text) in sections.collect::<BTreeSet<_>>() {
            all += &format!("\n{rule}\n{}\n{rule}\n\n{text}\n", names.join(", "));
        }
        Ok(all)
    }
}

/// Returns the licence of a package.
pub fn expression(package: &Package) -> Result<Expression> {
    let name = reference(package);
    let license = package.license.as_deref();
    let license = license.with_context(|| format!("{name} names no licence"))?;
    let canonical = Expression::canonicalize(license)
        .with_context(|| format!("the licence {license:?} of {name} is not in SPDX's form"))?;
    let canonical = canonical.as_deref().unwrap_or(license);
    Ok(Expression::parse_mode(canonical, ParseMode::LAX)?)
}

/// Returns the licence texts in a package, or those of SPDX when the package has none.
fn texts_of(package: &Package) -> Result<Vec<String>> {
    let directory = package.manifest_path.parent();
    let mut found = Vec::new();
    for file in fs::read_dir(directory.context("a package has a directory")?)? {
        let file = file?;
        let name = file.file_name().to_string_lossy().to_lowercase();
        let named = FILES.split(' ').any(|start| name.starts_with(start));
        if named && file.file_type()?.is_file() {
            let text = fs::read_to_string(file.path())?;
            found.push(text.replace("\r\n", "\n").trim().to_owned());
        }
    }
    if found.is_empty() {
        for required in expression(package)?.requirements() {
            let license = &required.req.license;
            let unknown = || format!("SPDX has no text for {license}");
            let license = license.id().with_context(unknown)?;
            let mut text = license.text().trim().to_owned();
            if let Some(AdditionItem::Spdx(exception)) = &required.req.addition {
                text += &format!("\n\n{}", exception.text().trim());
            }
            found.push(text);
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn package(name: &str, license: &str, files: &[(&str, &str)]) -> (tempfile::TempDir, Package) {
        let directory = tempfile::tempdir().unwrap();
        for (name, text) in files {
            fs::write(directory.path().join(name), text).unwrap();
        }
        let package = serde_json::json!({
            "id": name, "name": name, "version": "1.0.0", "license": license, "dependencies": [], "targets": [],
            "features": {}, "manifest_path": directory.path().join("Cargo.toml"),
            "source": "registry+https://github.com/rust-lang/crates.io-index",
        });
        (directory, serde_json::from_value(package).unwrap())
    }

    #[test]
    fn text_has_the_licences_of_others_once_and_names_their_packages() {
        let files = [("LICENSE-MIT", "the text\r\n"), ("README", "not this")];
        let (_a, a) = package("a", "MIT/Apache-2.0", &files);
        let (_b, b) = package("b", "MIT", &[("licence.txt", "the text")]);
        let (_c, c) = package("c", "Apache-2.0 WITH LLVM-exception", &[]);
        let (_own, mut own) = package("own", "MIT", &[]);
        own.source = None;
        let mut notices = Notices::default();
        for package in [&b, &a, &c, &own] {
            notices.note(package);
        }
        let text = notices.text().unwrap();
        let rule = "-".repeat(80);
        for part in [
            "\na@1.0.0  MIT OR Apache-2.0  crates.io\nb@1.0.0",
            &format!("\n{rule}\na@1.0.0, b@1.0.0\n{rule}\n\nthe text\n"),
            &format!("\n{rule}\nc@1.0.0\n{rule}\n\nApache License"),
            "LLVM Exceptions",
        ] {
            assert!(text.contains(part), "{part}\nis not in\n{text}");
        }
        assert!(
            !text.contains("own@") && !text.contains("not this"),
            "{text}"
        );
    }

    #[test]
    fn package_without_a_known_licence_is_refused() {
        let (_a, a) = package("a", "Foo", &[]);
        let error = expression(&a).unwrap_err().to_string();
        assert!(error.contains("\"Foo\" of a@1.0.0"), "{error}");
    }
}
