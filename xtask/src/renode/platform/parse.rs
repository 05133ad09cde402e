//! Reading the platform, the scripts, and the simulator's map, as far as the tests look.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use register_map::Board;

use crate::renode::DIRECTORY;
use crate::workspace::Workspace;

/// An entry: its type, where it is registered, and the lines below it.
#[derive(Debug, Default)]
pub(super) struct Entry {
    pub(super) kind: Option<String>,
    pub(super) place: String,
    pub(super) lines: Vec<String>,
}

impl Entry {
    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        let start = format!("{name}: ");
        self.lines.iter().find_map(|line| line.strip_prefix(&start))
    }
}

pub(super) fn root() -> PathBuf {
    Workspace::open().unwrap().root().to_owned()
}

pub(super) fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The entries of a board's platform, by name: its own, and those of the file for all boards. Of an entry that is in
/// both, the lines of both.
pub(super) fn entries(board: &Board) -> BTreeMap<String, Entry> {
    let mut entries = of_file("modio.repl");
    for (name, entry) in of_file(&format!("{board}.repl")) {
        let of_both = entries.entry(name.clone()).or_default();
        assert!(of_both.kind.is_none() || entry.kind.is_none(), "{name}");
        of_both.kind = of_both.kind.take().or(entry.kind);
        of_both.place += &entry.place;
        of_both.lines.extend(entry.lines);
    }
    entries
}

/// The entries of a file, by name.
fn of_file(file: &str) -> BTreeMap<String, Entry> {
    let text = read(&root().join(DIRECTORY).join(file));
    let mut entries: BTreeMap<String, Entry> = BTreeMap::new();
    let mut current = String::new();
    let mut open = false;
    for line in text.lines() {
        let line = line.split("//").next().unwrap_or_default();
        if line.trim().is_empty() || line.starts_with("using ") {
            continue;
        }
        assert!(!line.contains('\t'), "Renode takes no tabs: {line}");
        let entry = if open || line.starts_with(' ') {
            let indent = line.len() - line.trim_start().len();
            assert!(indent.is_multiple_of(4), "indented by fours: {line}");
            entries.get_mut(&current).unwrap()
        } else {
            let (name, rest) = line.split_once(':').unwrap();
            current = name.to_owned();
            assert!(!entries.contains_key(name), "{name} is there twice");
            let entry = entries.entry(current.clone()).or_default();
            let (kind, place) = rest.split_once('@').unwrap_or((rest, ""));
            entry.kind = Some(kind.trim().to_owned()).filter(|kind| !kind.is_empty());
            entry.place = place.trim().to_owned();
            open = place.contains('{');
            continue;
        };
        if open {
            entry.place += line.trim();
            open = !line.contains('}');
        } else {
            entry.lines.push(line.trim().to_owned());
        }
    }
    entries
}

pub(super) fn number(text: &str) -> u32 {
    let text = text.trim_matches(|c: char| !c.is_ascii_alphanumeric());
    match text.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16),
        None => text.parse(),
    }
    .unwrap_or_else(|_| panic!("not a number: {text}"))
}

/// The models that board.resc adds: their file, address, size and name.
pub(super) fn models() -> Vec<(String, u32, u32, String)> {
    let text = read(&root().join(DIRECTORY).join("board.resc"));
    let models = text.lines().filter_map(|line| {
        let rest = line.strip_prefix("machine PyDevFromFile $ORIGIN/")?;
        let [file, address, size, init, name] = rest.split(' ').collect::<Vec<_>>()[..] else {
            panic!("{line}");
        };
        assert_eq!(init, "True", "models have a state to start from: {line}");
        let name = name
            .strip_prefix('"')
            .and_then(|name| name.strip_suffix('"'));
        let name = name.expect("Renode takes the name as a string only");
        Some((
            file.to_owned(),
            number(address),
            number(size),
            name.to_owned(),
        ))
    });
    models.collect()
}

/// The simulator's blocks: what it calls what stands at an address.
pub(super) fn simulator() -> BTreeMap<u32, String> {
    let text = read(&root().join("tools/sim/src/soc/map.rs"));
    let blocks = text.lines().filter_map(|line| {
        let (address, place) = line.trim().strip_prefix('(')?.split_once(", ")?;
        let address = address.strip_prefix("0x")?.replace('_', "");
        let name = place
            .strip_prefix("Place::Block(B::")
            .or_else(|| place.strip_prefix("Absent(\""))?;
        let end = name.find(|c: char| !c.is_ascii_alphanumeric())?;
        let address = u32::from_str_radix(&address, 16).ok()?;
        Some((address, name[..end].to_lowercase()))
    });
    blocks.collect()
}
