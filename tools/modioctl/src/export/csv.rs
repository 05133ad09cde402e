//! A table for spreadsheets and for the import functions of other programs (RFC 4180, with LF at the end of a line).

use modio_description::Table;

use super::{Line, Scaling, plain};
use crate::failure::Failure;
use crate::listing::values;
use crate::names::Item;
use crate::output::csv_field;
use crate::value::{table_name, unit_name};

const HEAD: &str = "name,address,table,function,words,type,scale,offset,unit,access,values,about,line,unit_address";

/// Returns one row for each point and register of each unit.
pub fn text(line: Line<'_>) -> Result<String, Failure> {
    let mut text = format!("{HEAD}\n");
    let name = plain(line.name.unwrap_or_default());
    for source in line.units {
        source.book.of_modio()?;
        for item in source.book.items() {
            let row = row(item).join(",");
            text.push_str(&format!("{row},{},{}\n", csv_field(&name), source.unit));
        }
    }
    Ok(text)
}

fn row(item: &Item) -> [String; 12] {
    let scaling = Scaling::of(item);
    let function = match (item.table, item.writable, item.words) {
        (Table::Bit, false, _) => "01 02",
        (Table::Bit, true, _) => "01 02 05 0F",
        (Table::Word, false, _) => "03 04",
        (Table::Word, true, 1) => "03 04 06 10",
        (Table::Word, true, _) => "03 04 10",
    };
    let data_type = match (item.table, item.words) {
        (Table::Bit, _) => "bool",
        (Table::Word, 1) if scaling.signed => "int16",
        (Table::Word, 1) => "uint16",
        (Table::Word, 2) => "uint32",
        (Table::Word, _) => "bytes",
    };
    let access = match (item.writable, item.restart) {
        (false, _) => "read",
        (true, false) => "read write",
        (true, true) => "read write restart",
    };
    [
        csv_field(&plain(&item.name)),
        item.address.to_string(),
        table_name(item.table).to_owned(),
        function.to_owned(),
        item.words.to_string(),
        data_type.to_owned(),
        scaling.factor().to_string(),
        scaling.unit.offset.to_string(),
        csv_field(unit_name(&scaling.unit.code)),
        access.to_owned(),
        csv_field(values(item).trim_start_matches("it takes ")),
        csv_field(&item.about),
    ]
}
