//! How large a crate's structures are, as the debug information has them.

use std::collections::BTreeMap;

use addr2line::gimli::{self, constants};

use super::source::{self, Reader};
use crate::image::Elf;

/// The structures of a crate by name, in bytes. Of several with one name, the largest.
///
/// # Errors
///
/// When the debug information is broken.
pub fn of<'data>(
    elf: &Elf<'data>,
    bytes: &'data [u8],
    krate: &str,
) -> Result<BTreeMap<String, u64>, String> {
    find(elf, bytes, krate).map_err(|error| format!("broken debug information: {error}"))
}

fn find<'data>(
    elf: &Elf<'data>,
    bytes: &'data [u8],
    krate: &str,
) -> gimli::Result<BTreeMap<String, u64>> {
    let dwarf = source::dwarf(elf, bytes)?;
    let mut found = BTreeMap::new();
    let mut headers = dwarf.units();
    while let Some(header) = headers.next()? {
        let unit = dwarf.unit(header)?;
        let unit = unit.unit_ref(&dwarf);
        // The depth of the crate's namespace while the cursor is in it.
        let mut within = None;
        let mut entries = unit.entries();
        while let Some(entry) = entries.next_dfs()? {
            within = within.filter(|depth| entry.depth() > *depth);
            let Some(name) = entry.attr_value(constants::DW_AT_name) else {
                continue;
            };
            let name: Reader<'_> = unit.attr_string(name)?;
            match entry.tag() {
                constants::DW_TAG_namespace
                    if within.is_none() && name.slice() == krate.as_bytes() =>
                {
                    within = Some(entry.depth());
                }
                constants::DW_TAG_structure_type if within.is_some() => {
                    let size = entry.attr_value(constants::DW_AT_byte_size);
                    let size = size.and_then(|size| size.udata_value()).unwrap_or_default();
                    let name = name.to_string_lossy().into_owned();
                    let largest: &mut u64 = found.entry(name).or_default();
                    *largest = size.max(*largest);
                }
                _ => {}
            }
        }
    }
    Ok(found)
}
