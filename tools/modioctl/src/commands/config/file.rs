//! The file of settings: TOML with register names.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::ops::Range;
use std::path::Path;

use modio_description::{Description, Unit, Value};
use register_map::codes::{Format, Mode};
use register_map::configuration::{FORMAT, MODE, module_of};
use toml::de::{DeTable, DeValue};

use super::{Setting, of_modules};
use crate::failure::Failure;
use crate::input;
use crate::names::{Book, Item, Meaning, is_module, port_of, slots};
use crate::value::{parse, show, takes};

/// Returns the text of a file.
pub fn text(book: &Book, items: &[Item], values: &[Vec<u16>]) -> Result<String, Failure> {
    let about = book.of_modio()?;
    let mut text = format!(
        "# Settings of a {} with firmware {}, written by `modioctl config export`.\n",
        about.board, about.firmware
    );
    for (item, words) in items.iter().zip(values) {
        let shown = show(item, words, false);
        let value = match &shown.json {
            serde_json::Value::String(name) => toml::Value::String(name.clone()).to_string(),
            // Some of these values are in minutes.
            _ if item.meaning == Meaning::LongestOn => {
                toml::Value::String(shown.to_string()).to_string()
            }
            _ => shown.text.clone(),
        };
        let comment = comment(item, &shown.unit);
        let _ = writeln!(text, "{} = {value}  # {comment}", item.name);
    }
    Ok(text)
}

fn comment(item: &Item, unit: &str) -> String {
    let about = item
        .about
        .trim_start_matches("By point. ")
        .trim_start_matches("By port. ");
    let takes = match (&item.meaning, &item.values) {
        (Meaning::Value(Value::Number(of)), Some(values)) => takes(values, of),
        (Meaning::Value(Value::Codes(_)), _) => String::new(),
        (Meaning::Value(Value::Fields { .. }) | Meaning::LongestOn, _) => {
            crate::listing::values(item)
        }
        (_, Some(values)) if unit.is_empty() => takes(values, &Unit::default()),
        _ => String::new(),
    };
    let takes = takes.trim_start_matches("it takes ");
    match takes {
        "" => about.to_owned(),
        takes => format!("{takes}. {about}"),
    }
}

#[derive(Debug, PartialEq, Eq)]
struct Line {
    number: usize,
    name: String,
    value: String,
}

/// Reads the settings in a file and checks all of them, with the modules in the file. The error has all lines that are
/// wrong.
pub fn read(book: &Book, path: &Path) -> Result<Vec<Setting>, Failure> {
    let shown = path.display().to_string();
    let bytes =
        input::read(path).map_err(|what| Failure::usage(format!("cannot read {shown}: {what}")))?;
    check(book, &shown, text_of(&shown, &bytes)?)
}

/// Returns the text in the bytes of a file.
fn text_of<'a>(file: &str, bytes: &'a [u8]) -> Result<&'a str, Failure> {
    input::text(bytes).map_err(|what| {
        Failure::usage(format!(
            "{file} {what}: `modioctl config export FILE` writes such a file; nothing is written"
        ))
    })
}

fn check(book: &Book, file: &str, text: &str) -> Result<Vec<Setting>, Failure> {
    let (lines, mut wrong) = parsed(text);
    check_board(book.of_modio()?, file, &lines)?;
    let (book, unknown) = with_modules(book, &lines)?;
    let mut settings = Vec::new();
    // A file has these lines for every point, and one message is enough.
    let mut lacking = lines.iter().filter(|line| book.lacks_stage(&line.name));
    let (first, more) = (lacking.next(), lacking.count());
    for line in &lines {
        match setting(&book, &line.name, &line.value) {
            Ok(setting) => settings.push(setting),
            // Without the module it is not known which settings its points have.
            Err(_) if unknown.contains(&port_of(&line.name)) && !line.name.ends_with("module") => {}
            Err(_) if book.lacks_stage(&line.name) && first != Some(line) => {}
            Err(failure) => {
                let mut text = failure.to_string();
                if more > 0 && first == Some(line) {
                    let _ = write!(text, " ({more} more lines have such settings)");
                }
                wrong.entry(line.number).or_insert(text);
            }
        }
    }
    if !is_consistent(&settings) {
        let format = |line: &&Line| line.name.eq_ignore_ascii_case("FORMAT");
        let number = lines.iter().find(format).map_or(1, |line| line.number);
        let text = "FORMAT with 7 data bits needs MODE = \"ASCII\"".to_owned();
        wrong.entry(number).or_insert(text);
    }
    if lines.is_empty() && wrong.is_empty() {
        return Err(Failure::usage(format!(
            "{file} has no setting; nothing is written"
        )));
    }
    if wrong.is_empty() {
        return Ok(settings);
    }
    let each: Vec<_> = wrong
        .iter()
        .map(|(line, text)| format!("line {line}: {text}"))
        .collect();
    Err(Failure::usage(match &each[..] {
        [only] => format!("{file}, {only}"),
        each => format!(
            "{file} has {} wrong lines; nothing is written\n  {}",
            each.len(),
            each.join("\n  ")
        ),
    }))
}

/// Returns the lines of a TOML text that have the form of a setting, and what is wrong with others.
fn parsed(text: &str) -> (Vec<Line>, BTreeMap<usize, String>) {
    let (table, errors) = DeTable::parse_recoverable(text);
    let number = |at: usize| {
        let before = text.get(..at).unwrap_or_default();
        before.matches('\n').count() + 1
    };
    let mut wrong = BTreeMap::new();
    for error in errors {
        let at = error.span().map_or(0, |span| span.start);
        let text = error.message().to_owned();
        wrong.entry(number(at)).or_insert(text);
    }
    let mut lines = Vec::new();
    flatten("", table.get_ref(), &mut |at, name, value| {
        let number = number(at.start);
        // The parser continues after an error with a default value.
        if !wrong.contains_key(&number) {
            lines.push(Line {
                number,
                name,
                value: value.unwrap_or_else(|| text.get(at).unwrap_or_default().to_owned()),
            });
        }
    });
    lines.sort_by_key(|line| line.number);
    (lines, wrong)
}

/// Passes the place, the name and the value of each setting in a table to `add`; the value `None` is the text at the
/// place. `p5.1.filter = 4` is a table within tables.
fn flatten(
    prefix: &str,
    table: &DeTable<'_>,
    add: &mut impl FnMut(Range<usize>, String, Option<String>),
) {
    for (key, value) in table {
        let name = format!("{prefix}{}", key.get_ref());
        match value.get_ref() {
            DeValue::Table(inner) => flatten(&format!("{name}."), inner, add),
            DeValue::String(text) => add(value.span(), name, Some(text.to_string())),
            DeValue::Integer(number) => add(value.span(), name, Some(number.to_string())),
            DeValue::Float(number) => add(value.span(), name, Some(number.to_string())),
            _ => add(value.span(), name, None),
        }
    }
}

/// Checks that the file belongs to this board: a port in the file has a slot.
fn check_board(unit: &Description, file: &str, lines: &[Line]) -> Result<(), Failure> {
    let ports: BTreeSet<_> = lines
        .iter()
        .filter_map(|line| port_of(&line.name))
        .collect();
    let has_slot = |port: &u8| unit.ports.iter().any(|known| known.number == *port);
    if ports.is_empty() || ports.iter().any(has_slot) {
        return Ok(());
    }
    let ports: Vec<_> = ports.iter().map(u8::to_string).collect();
    Err(Failure::usage(format!(
        "{file} is a file of another board: it has settings of port {}, and {} has slots at {}; nothing is written",
        ports.join(", "),
        unit.board,
        slots(unit)
    )))
}

/// Returns the names of the unit with the modules in the file, and the ports whose module is wrong.
fn with_modules(book: &Book, lines: &[Line]) -> Result<(Book, Vec<Option<u8>>), Failure> {
    let (mut modules, mut unknown) = (Vec::new(), Vec::new());
    for line in lines {
        match book.find(&line.name) {
            Ok(item) if is_module(&item) => match parse(&item, &line.value, false) {
                Ok(words) => modules.push((item.address, words)),
                Err(_) => unknown.push(port_of(&item.name)),
            },
            _ => {}
        }
    }
    let book = of_modules(book, |port| {
        let wanted = modules
            .iter()
            .find(|(module, _)| *module == module_of(port.into()));
        wanted.and_then(|(_, words)| words.first().copied())
    })?;
    Ok((book, unknown))
}

/// Checks a name and a value.
pub fn setting(book: &Book, name: &str, value: &str) -> Result<Setting, Failure> {
    let item = book.find(name)?;
    if !item.setting {
        return Err(Failure::usage(format!("{name} is not a setting")));
    }
    let words = parse(&item, value, false)?;
    Ok((item, words))
}

/// Returns whether FORMAT and MODE are compatible, as the unit checks it.
fn is_consistent(settings: &[Setting]) -> bool {
    let word = |address: u16| {
        let found = settings.iter().find(|(item, _)| item.address == address);
        found.and_then(|(_, words)| words.first().copied())
    };
    let format = word(FORMAT).and_then(Format::from_code);
    let mode = word(MODE).and_then(Mode::from_code);
    format
        .zip(mode)
        .is_none_or(|(format, mode)| format.suits(mode))
}

#[cfg(test)]
mod tests {
    use register_map::Module;
    use register_map::board::{MODIO_02, MODIO_08};

    use super::*;
    use crate::names::{Book, book};

    fn checked(text: &str) -> Result<Vec<String>, String> {
        checked_for(&book(&MODIO_02, Module::None, (0, 0)), text)
    }

    fn checked_for(unit: &Book, text: &str) -> Result<Vec<String>, String> {
        let settings = check(unit, "unit.toml", text);
        let shown = |(item, words): Setting| format!("{}={}", item.name, words[0]);
        settings
            .map(|settings| settings.into_iter().map(shown).collect())
            .map_err(|failure| failure.to_string())
    }

    #[test]
    fn settings_have_the_meaning_of_the_modules_in_the_file() {
        let text = "BAUD = 19_200 # rate\np5.module = '4ao'\n5.1.safe = 0xFFFF\np5.2.range = \"4-20 mA\"\n";
        let settings = ["BAUD=192", "p5.module=5", "p5.1.safe=65535", "p5.2.range=1"];
        assert_eq!(checked(text).unwrap(), settings);
    }

    #[test]
    fn exported_longest_time_on_is_the_same_register_when_it_is_imported() {
        let unit = book(&MODIO_08, Module::Do4, (0, 0));
        let items =
            ["p1.1.max_on", "p1.2.max_on", "p1.3.max_on"].map(|name| unit.find(name).unwrap());
        let words = [0, 900, 0x800A].map(|word| vec![word]);
        let text = text(&unit, &items, &words).unwrap();
        let settings = ["p1.1.max_on=0", "p1.2.max_on=900", "p1.3.max_on=32778"];
        assert_eq!(checked_for(&unit, &text).unwrap(), settings, "{text}");
    }

    #[test]
    fn links_are_those_of_the_modules_in_the_file() {
        let unit = book(&MODIO_08, Module::None, (0, 0));
        let text = "p1.module = '2relay'\np1.3.link1 = 'p1.1, toggle'\np1.4.link2 = 'none'\n";
        let settings = ["p1.module=3", "p1.3.link1=0", "p1.4.link2=65535"];
        assert_eq!(checked_for(&unit, text).unwrap(), settings);
        let text = "p1.module = '4di'\np1.3.link1 = 'none'";
        let wrong = checked_for(&unit, text).unwrap_err();
        assert!(
            wrong.contains("line 2: p1.3.link1: no such point"),
            "{wrong}"
        );
    }

    #[test]
    fn every_wrong_line_is_reported() {
        let text = "BAUD = 1\nMODE = \nCOMM_TIMEOUT = 2.5\nBUAD = 96\nuptime = 0\np5.module = '4di'\np5.1.filter = [5]\nMODE 3\n";
        let wrong = checked(text).unwrap_err();
        let lines: Vec<_> = wrong.lines().collect();
        assert_eq!(lines[0], "unit.toml has 6 wrong lines; nothing is written");
        for (line, (number, part)) in lines[1..].iter().zip([
            (1, "BAUD does not allow \"1\": it takes 1200"),
            (2, "string values must be quoted"),
            (4, "BUAD: no such point or register; similar names: BAUD"),
            (5, "uptime is not a setting"),
            (
                7,
                "p5.1.filter does not allow \"[5]\": it takes 0 to 1000 ms",
            ),
            (8, "key with no value, expected `=`"),
        ]) {
            let start = format!("  line {number}: {part}");
            assert!(line.starts_with(&start), "{line:?}, not {start:?}");
        }
    }

    #[test]
    fn times_of_outputs_for_a_unit_without_them_are_reported_in_one_line() {
        let wrong =
            checked("p5.module = '4do'\np5.1.dead_time = 0.5\np5.2.max_on = 0\np5.3.min_off = 0\n");
        let wrong = wrong.unwrap_err();
        let start =
            "unit.toml, line 2: p5.1.dead_time: this unit has no DEAD_TIME, MAX_ON and MIN_OFF";
        assert!(wrong.starts_with(start), "{wrong}");
        assert!(
            wrong.ends_with("(2 more lines have such settings)"),
            "{wrong}"
        );
    }

    #[test]
    fn one_wrong_line_is_reported_in_one_line() {
        let wrong = checked("BAUD = 9600\nFORMAT = '7E1'\nMODE = 'rtu'").unwrap_err();
        let text = "unit.toml, line 2: FORMAT with 7 data bits needs MODE = \"ASCII\"";
        assert_eq!(wrong, text);
        // What settings the points have depends on the module.
        let wrong = checked("p5.1.filter = 4\np5.module = '5di'\np5.1.safe = 0").unwrap_err();
        assert!(wrong.starts_with("unit.toml, line 2: p5.module does not allow"));
    }

    #[test]
    fn a_file_without_settings_is_refused() {
        for text in ["", "# BAUD = 9600\n", "[p5]\n"] {
            assert_eq!(
                checked(text).unwrap_err(),
                "unit.toml has no setting; nothing is written"
            );
        }
    }

    #[test]
    fn a_file_in_utf_16_is_called_that_and_a_byte_order_mark_is_skipped() {
        let of = |bytes: &[u8]| text_of("a", bytes).map(str::to_owned);
        let text = "BAUD = 9600\n";
        let units: Vec<u16> = std::iter::once(0xFEFF).chain(text.encode_utf16()).collect();
        for bytes in [u16::to_be_bytes, u16::to_le_bytes] {
            let bytes: Vec<u8> = units.iter().flat_map(|unit| bytes(*unit)).collect();
            let text = of(&bytes).unwrap_err().to_string();
            let why = "a is UTF-16, as `>` of PowerShell writes it";
            assert!(text.starts_with(why), "{text}");
        }
        let text_of_latin_1 = of(b"NAME = \xE4").unwrap_err().to_string();
        assert_eq!(
            text_of_latin_1,
            "a is not a text in UTF-8: `modioctl config export FILE` writes such a file; nothing is written"
        );
        assert_eq!(of(b"\xEF\xBB\xBFBAUD = 9600\n").unwrap(), text);
    }

    #[test]
    fn file_of_another_board_is_called_that() {
        let wrong = checked("BAUD = 9600\np1.module = '4di'\np2.module = 'none'").unwrap_err();
        let text = "unit.toml is a file of another board: it has settings of port 1, 2, and ";
        assert!(
            wrong.starts_with(text) && wrong.contains("has slots at 5"),
            "{wrong}"
        );
    }
}
