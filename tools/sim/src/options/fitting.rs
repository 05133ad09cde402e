//! The boards on the line with their configurations, from the options or from the file of `--bus`.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use register_map::{Module, Row, board::MODIO_02};
use serde::Deserialize;

use super::{Options, slot};

/// Most boards on a line: the number of unit addresses in Modbus.
const MOST: usize = 247;

/// Configuration of a board before power-on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fitting {
    /// Name of the board in the HTTP interface.
    pub name: String,
    /// Type of the board.
    pub board: &'static Row,
    /// DIP switch SW01: bit 0 = position 1.
    pub dip: u8,
    /// Module in the first slot, unless `slots` names that slot.
    pub module: Module,
    /// Modules in other slots, each with the number of its port.
    pub slots: Vec<(u8, Module)>,
    /// File in which the flash is kept.
    pub flash: Option<PathBuf>,
}

impl Options {
    /// Returns the boards on the line, at least one.
    ///
    /// # Errors
    ///
    /// In one line: there are too many boards, or the first error in the file of `--bus`.
    pub fn fittings(&self) -> Result<Vec<Fitting>, String> {
        if let Some(path) = &self.bus {
            return of_file(path).map_err(|what| format!("{}: {what}", path.display()));
        }
        if self.units.is_empty() {
            return Ok(vec![Fitting {
                name: self.board.name.to_owned(),
                board: self.board,
                dip: self.dip,
                module: self.module,
                slots: self.slots.clone(),
                flash: self.flash.clone(),
            }]);
        }
        if self.units.len() > MOST {
            return Err(format!("a line can have at most {MOST} boards"));
        }
        let mut names = Names::default();
        let unit = |&(dip, module): &(u8, Option<Module>)| Fitting {
            name: names.take(format!("unit-{dip}")),
            board: self.board,
            dip,
            module: module.unwrap_or(self.module),
            slots: Vec::new(),
            flash: None,
        };
        Ok(self.units.iter().map(unit).collect())
    }
}

/// Names already in use.
#[derive(Default)]
struct Names(BTreeSet<String>);

impl Names {
    /// Returns `name`, or `name-2`, `name-3`, ... when it is in use.
    fn take(&mut self, name: String) -> String {
        let numbered = (2..).map(|n| format!("{name}-{n}"));
        let free = std::iter::once(name.clone())
            .chain(numbered)
            .find(|name| self.0.insert(name.clone()));
        // A free number is always found.
        free.unwrap_or(name)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    board: Vec<Table>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    name: Option<String>,
    board: Option<String>,
    dip: u8,
    module: Option<String>,
    #[serde(default)]
    slots: BTreeMap<String, String>,
    flash: Option<PathBuf>,
}

fn of_file(path: &Path) -> Result<Vec<Fitting>, String> {
    let text = fs::read_to_string(path).map_err(|error| error.to_string())?;
    let file: File = toml::from_str(&text).map_err(|error| toml_error(&text, &error))?;
    if file.board.is_empty() || file.board.len() > MOST {
        return Err(format!("the file must have 1 to {MOST} tables [[board]]"));
    }
    let directory = path.parent().unwrap_or(Path::new(""));
    let mut names = Names::default();
    let mut files = BTreeSet::new();
    let mut fittings = Vec::new();
    for (table, number) in file.board.into_iter().zip(1..) {
        let in_table = |what: String| format!("board {number}: {what}");
        let name = match table.name {
            Some(name) => {
                check_name(&name).map_err(in_table)?;
                if !names.0.insert(name.clone()) {
                    return Err(in_table(format!("another board has the name '{name}'")));
                }
                name
            }
            None => names.take(format!("unit-{}", table.dip)),
        };
        let board = match table.board {
            Some(board) => board
                .parse()
                .map_err(|why| in_table(format!("'{board}' is {why}")))?,
            None => &MODIO_02,
        };
        let module = match table.module {
            Some(module) => module
                .parse()
                .map_err(|why| in_table(format!("'{module}' is {why}")))?,
            None => Module::Di4,
        };
        let slots = table.slots.iter();
        let slots: Result<_, _> = slots
            .map(|(port, module)| slot(&format!("{port}={module}")))
            .collect();
        let flash = table.flash.map(|flash| directory.join(flash));
        if let Some(flash) = &flash
            && !files.insert(flash.clone())
        {
            return Err(in_table(format!(
                "another board has the flash file {}",
                flash.display()
            )));
        }
        fittings.push(Fitting {
            name,
            board,
            dip: table.dip,
            module,
            slots: slots.map_err(in_table)?,
            flash,
        });
    }
    Ok(fittings)
}

/// Checks a name, which is part of HTTP paths and of printed lines.
fn check_name(name: &str) -> Result<(), String> {
    let good = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if name.is_empty() || !name.chars().all(good) {
        return Err(format!(
            "the name {name:?} must consist of letters, digits, '-' and '_'"
        ));
    }
    Ok(())
}

/// Describes a TOML error in one line, with its line number in `text`.
#[must_use]
pub fn toml_error(text: &str, error: &toml::de::Error) -> String {
    let what = error.message().replace('\n', ", ");
    match error.span() {
        Some(span) => {
            let line = 1 + text[..span.start].matches('\n').count();
            format!("line {line}: {what}")
        }
        None => what,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use register_map::board::MODIO_08;

    fn read(text: &str) -> Result<Vec<Fitting>, String> {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("bus.toml");
        fs::write(&path, text).unwrap();
        of_file(&path)
    }

    #[test]
    fn each_table_of_the_bus_file_is_a_board() {
        let boards = read(
            r#"
            [[board]]
            name = "pump_house"
            board = "modio-08"
            dip = 3
            module = "4do"
            slots = { 2 = "4ai", 4 = "none" }
            flash = "pump.bin"

            [[board]]
            dip = 7
            [[board]]
            dip = 7
            "#,
        )
        .unwrap();
        let first = &boards[0];
        assert_eq!((first.name.as_str(), first.dip), ("pump_house", 3));
        assert_eq!((first.board, first.module), (&MODIO_08, Module::Do4));
        assert_eq!(first.slots, [(2, Module::Ai4), (4, Module::None)]);
        assert!(
            first.flash.as_ref().unwrap().is_absolute(),
            "the flash file is in the directory of the bus file"
        );
        let names: Vec<_> = boards[1..].iter().map(|board| &board.name).collect();
        assert_eq!(names, ["unit-7", "unit-7-2"]);
        assert_eq!(
            (boards[2].board, boards[2].module),
            (&MODIO_02, Module::Di4)
        );
    }

    #[test]
    fn bus_file_error_is_one_line_that_names_the_line_or_the_board() {
        for (text, part) in [
            ("", "1 to 247 tables [[board]]"),
            ("[[board]]", "line 1: missing field `dip`"),
            ("[[board]]\ndip = 300", "line 2"),
            (
                "[[board]]\ndip = 1\nmodul = '4do'",
                "line 3: unknown field `modul`",
            ),
            (
                "[[board]]\ndip = 1\nboard = 'nucleo'",
                "board 1: 'nucleo' is",
            ),
            ("[[board]]\ndip = 1\nmodule = '8di'", "board 1: '8di' is"),
            ("[[board]]\ndip = 1\nslots = { x = '4do' }", "3=4do"),
            ("[[board]]\ndip = 1\nname = 'a b'", "letters, digits"),
            (
                "[[board]]\ndip = 1\nname = 'a'\n[[board]]\ndip = 2\nname = 'a'",
                "board 2: another board",
            ),
            (
                "[[board]]\ndip = 1\nflash = 'a'\n[[board]]\ndip = 2\nflash = 'a'",
                "board 2: another board has the flash file",
            ),
            ("[board", "line 1"),
        ] {
            let what = read(text).unwrap_err();
            assert!(what.contains(part), "{text:?}: {what}");
            assert!(!what.contains('\n'), "{what:?}");
        }
    }
}
