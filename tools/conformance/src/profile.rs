//! A profile describes a device other than a modio in TOML, so that any Modbus server can be tested. docs/conformance.md
//! has an example.
//!
//! One request can span a whole run. The addresses before and after a run do not exist.

use anyhow::{Context as _, Result, anyhow, bail, ensure};
use serde::Deserialize;

use crate::frame::Mode;
use crate::target::{Span, Words};

/// The contents of a profile's file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// The unit's address.
    pub unit: Option<u8>,
    /// The form of its frames.
    pub mode: Option<Mode>,
    /// The functions that it has.
    pub functions: Option<Vec<u8>>,
    /// Whether the unit drops a frame with a gap above t1.5.
    pub strict_t15: Option<bool>,
    #[serde(default)]
    coils: Table,
    #[serde(default)]
    discrete_inputs: Table,
    #[serde(default)]
    holding_registers: Table,
    #[serde(default)]
    input_registers: Table,
}

#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    #[serde(default)]
    read: Vec<String>,
    #[serde(default)]
    write: Vec<String>,
    values: Option<[u16; 2]>,
    refused: Option<u16>,
}

/// The points that a profile describes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Known {
    /// What can be read, by function 1 to 4.
    pub readable: [Vec<Span>; 4],
    /// Coils to write to.
    pub bits: Option<Span>,
    /// Registers to write to.
    pub words: Option<Words>,
}

impl Profile {
    /// Reads a profile. The error is one line.
    pub fn parse(text: &str) -> Result<Self> {
        toml::from_str(text).map_err(|error| anyhow!(error.to_string().trim().replace('\n', " ")))
    }

    /// Returns the unit's points. The error is one line.
    pub fn known(&self) -> Result<Known> {
        ensure!(
            self.unit != Some(0),
            "unit 0 is the broadcast address: a unit has an address from 1"
        );
        for (table, name, can_be_written) in [
            (&self.coils, "coils", true),
            (&self.discrete_inputs, "discrete_inputs", false),
            (&self.input_registers, "input_registers", false),
        ] {
            let right = can_be_written || table.write.is_empty();
            ensure!(right, "{name} cannot be written");
            ensure!(
                table.values.is_none() && table.refused.is_none(),
                "{name} take no `values` and no `refused`"
            );
        }
        let bits = self.coils.one_to_write("coils")?;
        let holding = &self.holding_registers;
        let to_write = holding.one_to_write("holding_registers")?;
        let words = match (to_write, holding.values) {
            (None, _) => None,
            (Some(_), None) => bail!(
                "holding_registers need `values`: two values that the registers in `write` accept"
            ),
            (Some(_), Some([low, high])) if low == high => {
                bail!("the two `values` of holding_registers must differ");
            }
            (Some(span), Some([low, high])) => Some(Words {
                span: span.up_to(123),
                low,
                high,
                refused: holding.refused,
                locked: false,
            }),
        };
        Ok(Known {
            readable: [
                spans(&self.coils.read)?,
                spans(&self.discrete_inputs.read)?,
                spans(&holding.read)?,
                spans(&self.input_registers.read)?,
            ],
            bits: bits.map(|span| span.up_to(1968)),
            words,
        })
    }
}

impl Table {
    /// Returns the run to write to, if there is one. It must be readable, because its values are restored.
    fn one_to_write(&self, name: &str) -> Result<Option<Span>> {
        let run = match spans(&self.write)?[..] {
            [] => return Ok(None),
            [run] => run,
            _ => bail!("{name} take one run to `write`, not several"),
        };
        let readable = spans(&self.read)?;
        let has_run = |span: &Span| span.has(run.first) && span.has(run.last);
        ensure!(
            readable.iter().any(has_run),
            "{name}: the run in `write` must be part of one run in `read`, so that it can be restored"
        );
        Ok(Some(run))
    }
}

fn spans(texts: &[String]) -> Result<Vec<Span>> {
    texts.iter().map(|text| span(text)).collect()
}

/// Parses `0x0010` or `16`.
pub(crate) fn number(text: &str) -> Option<u16> {
    let text = text.trim();
    match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(digits) => u16::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    }
}

/// `0x0010-0x0013`, `16-19` or `16`.
fn span(text: &str) -> Result<Span> {
    let wrong = || format!("{text:?} is not a run of addresses such as \"0x0010-0x0013\"");
    let number = |text| number(text).with_context(wrong);
    let (first, last) = match text.split_once('-') {
        Some((first, last)) => (number(first)?, number(last)?),
        None => (number(text)?, number(text)?),
    };
    ensure!(first <= last, wrong());
    Ok(Span { first, last })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn example_in_the_manual_is_a_profile() {
        let manual = include_str!("../../../docs/conformance.md");
        let (_, example) = manual.split_once("```toml\n").unwrap();
        let profile = Profile::parse(example.split("```").next().unwrap()).unwrap();
        let known = profile.known().unwrap();
        assert_eq!((profile.unit, profile.mode), (Some(17), None));
        let ascii = Profile::parse("mode = \"ascii\"").unwrap();
        assert_eq!(ascii.mode, Some(Mode::Ascii));
        assert_eq!(known.readable[2], [Span::of(0, 256)]);
        assert_eq!(known.bits, Some(Span::of(0, 16)));
        let words = known.words.unwrap();
        assert_eq!((words.span.first, words.high), (16, 4000));
        assert_eq!(words.refused, Some(5000));
    }

    #[test]
    fn wrong_profile_is_an_error_in_one_line() {
        for (text, part) in [
            ("unit = 300", "unit"),
            ("colour = 1", "colour"),
            ("mode = \"tcp\"", "`rtu` or `ascii`"),
            ("[coils]\nread = ['5-3']", "5-3"),
            ("[coils]\nread = ['0-70000']", "70000"),
            ("[holding_registers]\nread = ['1']\nwrite = ['1']", "values"),
            ("unit = 0", "unit 0"),
            ("[coils]\nrefused = 3", "no `refused`"),
            ("[coils]\nread = ['0-9']\nwrite = ['5-10']", "restored"),
            ("[coils]\nread = ['0-9']\nwrite = ['1', '3']", "not several"),
            (
                "[holding_registers]\nread = [\"1\"]\nwrite = [\"1\"]\nvalues = [3, 3]",
                "differ",
            ),
            ("[input_registers]\nwrite = [\"1\"]", "cannot be written"),
        ] {
            let error = Profile::parse(text).and_then(|p| p.known()).unwrap_err();
            let error = format!("{error:#}");
            assert!(error.contains(part) && !error.contains('\n'), "{error}");
        }
    }
}
