//! `cargo xtask docs`: `docs/register-map.md`, written from the registers' own data so that it cannot say anything
//! else, and the list of modules in `renode/commands.py`.

use std::fmt::{Result, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

use register_map::points::Kind;
use register_map::{
    BLOCKS, Block, Field, InForce, Module, Row, Rule, Scope, Text, Unit, Value, Values, codes,
    configuration, counters, deadband, edges, fault, links, points, second, stage,
};

const INTRODUCTION: &str = "\
# Register map, version 2

<!-- Written by `cargo xtask docs` from crate register-map. Change it there. -->

Addresses are the numbers in the frame and count from 0. Many masters count from 1, or put a digit for the table in
front: 0x0010 is then 17, 00017 or 10017 as a bit, and 40017 or 30017 as a word.

## Rules

- Functions 01 and 02 read the same bits, and functions 03 and 04 the same words.
- A request must lie within one of the blocks below and within its defined registers: gaps are exception 02.
- A write to a register that does not exist, or that can only be read, is exception 02 and writes nothing.
- A write to several registers is checked completely, and then done completely or not at all.
- The first failing check decides the exception: function (01), then quantity, byte count and form of the value (03),
  then the address (02), then the value (03), then the state (04: a module does not answer, 06: the configuration is
  locked, its store is busy, there were too many saves, or the radio does not serve this).
- A value of two registers has its high word first. A request that reads both registers gets one consistent value.
";

const CONFIGURATION_NOTES: &str = "
- Every write to this block except to KEY or HEARTBEAT alone needs the open lock, COMMAND included. Otherwise it is
  exception 06. The state of the lock when the request arrives counts: a request with KEY and a setting needs an open
  lock already. A refused write does not open the lock and does not keep it open. A value of KEY other than 0x5A17 is
  exception 03.
- HEARTBEAT takes any value, which has no effect and is not stored. Its write counts for COMM_SOURCE as every write does
  ([safety.md](safety.md#a-heartbeat)). Alone in its request it is accepted over every line, with LORA 2 too, and as a
  broadcast. It does not keep the lock open.
- A written value reads back immediately. \"now\" is in force immediately. \"restart\" is in force after the next start, if
  the value was saved before it.
- The response to COMMAND is sent before the command is executed. While a save runs, another save is exception 06 and a
  restart waits for the save. A change that is made during a save is not part of it. Status bit 3 clears when the save is
  complete. A save of values that are already stored writes nothing to the flash.
- The lock closes 60 s after the last configuration write. It belongs to the line that opened it: writes over the other
  line are exception 06, and KEY and status bit 5 read 1 over the owner's line only. KEY over the other line takes the
  lock.
- Twenty saves are possible one after another, and then one a minute; between them a save is exception 06. A save that
  writes nothing is always possible and does not count. COMMAND 0xB001 and 0xB004 cost one each, and 0xB002 without a new
  transfer. The number of saves left survives every reset but a power-on.
- START = 0xFFFE, *as it was*, exists on boards with more than 128 KiB of flash: not on the modio-02 and the eth-io5r,
  where it is exception 03. [safety.md](safety.md#outputs-as-they-were) says which value an output then has.
- A broadcast over the air writes nothing here but HEARTBEAT: it is exception 06, which is not sent. With LORA 2 no other
  write over the air is accepted here at all, and neither the clearing of pulse counters nor function 08 except 00, 02
  and 0B-12.
- FRAME_GAP counts as 1.5 characters when it is shorter than that at the rate in force.
- Identify (6): all LEDs blink together for 10 s, and then show the state of the device again. Another identify starts
  the 10 s again.
- Load defaults (3) and drop (4) change the settings as writes do: save to make them permanent.
- The allowed values of a setting by point depend on the kind of the point, which the last written MODULE defines. If
  the point does not use the setting, every value of the register is allowed. A change of MODULE from one module to
  another sets the settings of its points to their defaults. A change from none to a module keeps the settings that suit.
- Until the restart a \"now\" setting that does not suit the module in force counts as its default.
";

const SECOND_NOTES: &str = "
The second line is a radio on a modio-02 and modio-08, and the RS-232 socket on an fx3u. Other boards have none: exception 02.
Over a radio the gaps are always 0. On RS-232 those shorter than 3 ms may be missed.
";

const COUNTER_NOTES: &str = "
A counter wraps. A write of 0 to both registers of a point in one request clears the counter. Any other write is exception 03.
";

const EDGE_NOTES: &str = "
The uptime is that of 0x0226. File 3 (function 14) is the log of the last 64 edges of all digital inputs:
[time-and-links.md](time-and-links.md).
";

const DEADBAND_NOTES: &str = "
Only boards with [function 70](fast-modbus.md) have it. It is a setting as those of the configuration, in the unit of the
point. A change of MODULE sets it to 0.
";

const STAGE_NOTES: &str = "
Settings as those of the configuration, on boards that have them; at points that are no digital outputs they are stored,
without effect. MAX_ON 0x8000 is exception 03. A change of one begins the times of its output anew, with the output off; a
change of MODULE sets them to 0: [outputs.md](outputs.md).
";

const LINK_NOTES: &str = "
n is the point of a digital output of the module written last; other addresses are exception 02, and on a board with one
slot all are. Links are settings: KEY protects them, COMMAND 1 saves them, and they are in force immediately. A link is
checked as a whole: [time-and-links.md](time-and-links.md).
";

const FAULT_NOTES: &str = "
The record survives every reset but a loss of power. A new fault replaces it. Line repairs start at 0 with each start and
stop at 65535.
";

/// Returns the files that this command writes, each with its text.
pub fn files(root: &Path) -> anyhow::Result<[(PathBuf, String); 2]> {
    const MODULES: &str = "MODIO_MODULES = ";
    let commands = root.join("renode/commands.py");
    let text = fs_err::read_to_string(&commands)?;
    let lines = text.split_inclusive('\n').map(|line| {
        if line.starts_with(MODULES) {
            format!("{MODULES}{:?}\n", Module::ALL.map(Module::name))
        } else {
            line.to_owned()
        }
    });
    let document = root.join("docs/register-map.md");
    Ok([(document, markdown()?), (commands, lines.collect())])
}

/// Returns the whole document.
fn markdown() -> std::result::Result<String, std::fmt::Error> {
    let mut text = String::new();
    write_markdown(&mut text)?;
    Ok(text)
}

fn write_markdown(out: &mut impl Write) -> Result {
    out.write_str(INTRODUCTION)?;
    for block in BLOCKS {
        let Block {
            title, first, last, ..
        } = block;
        write!(out, "\n## {title}: {first:#06X}-{last:04X}\n\n")?;
        if block.first == points::BLOCK.first {
            write_points(out)?;
        } else {
            write_registers(block, out)?;
        }
        if block.first == configuration::BLOCK.first {
            out.write_str(CONFIGURATION_NOTES)?;
            write_store(out)?;
        } else if block.first == fault::BLOCK.first {
            out.write_str(FAULT_NOTES)?;
        } else if block.first == second::BLOCK.first {
            out.write_str(SECOND_NOTES)?;
        } else if block.first == counters::BLOCK.first {
            out.write_str(COUNTER_NOTES)?;
        } else if block.first == edges::BLOCK.first {
            out.write_str(EDGE_NOTES)?;
        } else if block.first == links::BLOCK.first {
            out.write_str(LINK_NOTES)?;
        } else if block.first == deadband::BLOCK.first {
            out.write_str(DEADBAND_NOTES)?;
        } else if block.first == stage::BLOCK.first {
            out.write_str(STAGE_NOTES)?;
        }
    }
    Ok(())
}

fn write_registers(block: &Block, out: &mut impl Write) -> Result {
    if let [(rule, text)] = block.registers().collect::<Vec<_>>()[..]
        && let Value::Fields(_, fields) = text.value
    {
        return write_fields(rule, text.name, fields, out);
    }
    let settings = [&configuration::BLOCK, &deadband::BLOCK, &stage::BLOCK];
    let settings = settings.iter().any(|other| other.first == block.first);
    out.write_str(if settings {
        "| address | name | values (default) | unit | in force | what |\n|---|---|---|---|---|---|\n"
    } else {
        "| address | name | unit | what |\n|---|---|---|---|\n"
    })?;
    for (rule, text) in block.registers() {
        out.write_str("| ")?;
        write_addresses(rule, out)?;
        write!(out, " | {} | ", text.name)?;
        if settings {
            write_values(rule, out)?;
            let in_force = match rule.in_force {
                InForce::Now => "now",
                InForce::Restart => "restart",
            };
            write!(out, " | {}", text.value.unit())?;
            if let (Some(value), Some(narrower)) = (text.narrower, rule.narrower) {
                let unit = value.unit();
                write!(out, "; {} ", plural(narrower.kind))?;
                if unit == Unit::NONE {
                    out.write_str("none")?;
                } else {
                    write!(out, "{unit}")?;
                }
            }
            write!(out, " | {in_force} | ")?;
        } else {
            write!(out, "{} | ", text.value.unit())?;
        }
        out.write_str(match text.scope(rule.count) {
            Scope::Unit => "",
            Scope::Port => "By port. ",
            Scope::Point => "By point. ",
        })?;
        write_about(text, out)?;
        out.write_str(" |\n")?;
    }
    Ok(())
}

/// Writes the registers of each value of a run as rows. n is the point, and each following value of a point is in the next
/// row of all points.
fn write_fields(rule: &Rule, name: &str, fields: &[Field], out: &mut impl Write) -> Result {
    out.write_str("| address | name | values (default) | meaning |\n|---|---|---|---|\n")?;
    let length = fields.len() as u16;
    for (address, field) in (rule.first..).zip(fields) {
        let row = points::COUNT * length;
        let firsts = (address..rule.end()).step_by(row.into());
        let firsts: Vec<_> = firsts
            .map(|first| format!("{first:#06X} + {length} n"))
            .collect();
        write!(out, "| {} | {name} {} | ", firsts.join(", "), field.name)?;
        write_set(field.values, out)?;
        match field.default {
            0..0x8000 => write!(out, " ({})", field.default)?,
            _ => write!(out, " ({:#06X})", field.default)?,
        }
        out.write_str(" |")?;
        write_meaning(field.value, " ", out)?;
        out.write_str(" |\n")?;
    }
    Ok(())
}

fn write_addresses(rule: &Rule, out: &mut impl Write) -> Result {
    write!(out, "{:#06X}", rule.first)?;
    if rule.count > 1 {
        write!(out, "-{:04X}", rule.end().wrapping_sub(1))?;
    }
    Ok(())
}

fn write_values(rule: &Rule, out: &mut impl Write) -> Result {
    write_set(rule.values, out)?;
    if rule.values.allow(rule.default) {
        write!(out, " ({})", rule.default)?;
    }
    if let Some(narrower) = rule.narrower {
        write!(out, "; {} ", plural(narrower.kind))?;
        write_set(narrower.values, out)?;
        write!(out, " ({})", narrower.default)?;
    }
    Ok(())
}

fn write_set(values: Values, out: &mut impl Write) -> Result {
    match values {
        Values::Range { min, max } => write_range(min, max, out),
        Values::RangeOr { also, min, max } if also < min => {
            write!(out, "{also}, ")?;
            write_range(min, max, out)
        }
        Values::RangeOr { also, min, max } => {
            write_range(min, max, out)?;
            write!(out, ", {also:#06X}")
        }
        Values::OneOf(set) => set.iter().enumerate().try_for_each(|(i, value)| {
            out.write_str(if i == 0 { "" } else { " " })?;
            // As the names of a code.
            match value {
                ..0xB000 => write!(out, "{value}"),
                _ => write!(out, "{value:#06X}"),
            }
        }),
    }
}

fn write_range(min: u16, max: u16, out: &mut impl Write) -> Result {
    match max {
        _ if min != max => write!(out, "{min}-{max}"),
        0..=9 => write!(out, "{min}"),
        _ => write!(out, "{min:#06X}"),
    }
}

fn write_about(text: &Text, out: &mut impl Write) -> Result {
    out.write_str(text.about.trim())?;
    write_meaning(text.value, ": ", out)
}

/// Writes the names of codes or bits, with `start` before the first.
fn write_meaning(value: Value, start: &str, out: &mut impl Write) -> Result {
    let separator = |i| if i == 0 { start } else { ", " };
    match value {
        Value::Codes(codes) => {
            for (i, (code, name)) in codes.iter().enumerate() {
                out.write_str(separator(i))?;
                match code {
                    0..=0xFF => write!(out, "{code} = {name}")?,
                    _ => write!(out, "{code:#06X} = {name}")?,
                }
            }
        }
        Value::Bits(bits) => {
            for (i, (bit, name)) in bits.iter().enumerate() {
                write!(out, "{}bit {bit} {name}", separator(i))?;
            }
        }
        Value::Point => write!(out, "{start}address of a point, 0xFFFF = none")?,
        Value::Number(_) | Value::Long(_) | Value::Opaque | Value::Fields(..) => {}
    }
    Ok(())
}

fn plural(kind: Kind) -> &'static str {
    match kind {
        Kind::None => "absent points",
        Kind::BitInput => "bit inputs",
        Kind::BitOutput => "bit outputs",
        Kind::WordInput => "analog inputs",
        Kind::WordOutput => "analog outputs",
    }
}

fn write_points(out: &mut impl Write) -> Result {
    out.write_str(
        "`address = (port - 1) * 4 + (channel - 1)`, for bits and words alike. Points of ports without a slot, and those \
         a module\ndoes not have, are exception 02. The boards have slots at these ports:\n\n\
         | board | ports | points |\n|---|---|---|\n",
    )?;
    for board in Row::ALL {
        let (ports, points) = (board.ports(), board.points());
        let last = |range: &Range<u16>| range.end.wrapping_sub(1);
        write!(out, "| {board} | {}", ports.start)?;
        if board.slots > 1 {
            write!(out, "-{}", last(&ports))?;
        }
        writeln!(out, " | {:#06X}-{:04X} |", points.start, last(&points))?;
    }
    out.write_str("\n| code | module | channel 1 | 2 | 3 | 4 |\n|---|---|---|---|---|---|\n")?;
    for module in Module::ALL {
        write!(out, "| {} | {module} |", module.code())?;
        for kind in module.points() {
            let kind = match kind {
                Kind::None => "-",
                Kind::BitInput => "bit, read",
                Kind::BitOutput => "bit, read and write",
                Kind::WordInput => "word, read",
                Kind::WordOutput => "word, read and write",
            };
            write!(out, " {kind} |")?;
        }
        out.write_str("\n")?;
    }
    out.write_str(
        "\nThe bits of 2relay: 1 and 2 are the mode jumpers of relays 1 and 2 (1 = manual), 3 and 4 their coils. \
         An output reads back\nwhat was commanded, also while its module does not answer. RANGE and SCALE of a point say \
         what its word means. Values\nbelow 0 are in two's complement. A write of another value to an output is exception \
         03.\n\n",
    )?;
    write_readings(out)?;
    out.write_str("\n")?;
    writeln!(
        out,
        "The pulse counter of a point is at {:#06X} + 2 * address.",
        counters::PULSES
    )
}

/// Writes what the words of analog points mean.
fn write_readings(out: &mut impl Write) -> Result {
    out.write_str(
        "| RANGE | SCALE | unit | analog input | analog output |\n|---|---|---|---|---|\n",
    )?;
    for input in points::readings(Kind::WordInput) {
        let name = |names: &[(u16, &'static str)], code: u16| {
            let named = names.iter().find(|named| named.0 == code);
            named.map_or("", |named| named.1)
        };
        let (range, scale) = (input.signal.code(), input.scale.code());
        write!(
            out,
            "| {range} = {} | {scale} = {} | {} | {} to {} | ",
            name(codes::Signal::NAMES, range),
            name(codes::Scale::NAMES, scale),
            input.unit,
            input.min,
            input.max
        )?;
        let mut outputs = points::readings(Kind::WordOutput).iter();
        match outputs.find(|output| (output.signal, output.scale) == (input.signal, input.scale)) {
            Some(output) => writeln!(out, "{} to {} |", output.min, output.max)?,
            None => out.write_str("- |\n")?,
        }
    }
    Ok(())
}

fn write_store(out: &mut impl Write) -> Result {
    out.write_str("\nA save goes to two flash pages: ")?;
    for (i, board) in Row::ALL.iter().enumerate() {
        let loaded = board.layout().store;
        let [first, second] = loaded.addresses();
        let separator = if i == 0 { "" } else { "; " };
        write!(
            out,
            "{separator}on the {board} those at {first:#010X} and {second:#010X}"
        )?;
        if board.store() != loaded {
            let [first, second] = board.store().addresses();
            write!(out, " (without a loader {first:#010X} and {second:#010X})")?;
        }
    }
    writeln!(
        out,
        ".\nIt is a record of the settings that differ from their defaults, with a CRC-32. A setting that this \
         firmware does not know\nis ignored. A setting with a stored value that it does not allow has its default; status \
         bit 1 reports this, and also when nothing\nvalid was found."
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_are_up_to_date() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        for (path, text) in files(&root).unwrap() {
            let written = fs_err::read_to_string(&path).unwrap_or_default();
            assert!(
                written == text,
                "{} is out of date or missing; write it with: cargo xtask docs",
                path.display()
            );
        }
    }

    #[test]
    fn every_register_of_every_block_has_a_line() {
        let text = markdown().unwrap();
        for (rule, about) in BLOCKS.iter().skip(1).flat_map(|block| block.registers()) {
            let begin = format!("| {:#06X}", rule.first);
            let line = text.lines().find(|line| line.starts_with(&begin));
            assert!(
                line.is_some_and(|line| line.contains(about.name)),
                "{begin}"
            );
        }
    }

    #[test]
    fn values_are_written_as_people_read_them() {
        let written = |values| {
            let mut text = String::new();
            write_set(values, &mut text).unwrap();
            text
        };
        assert_eq!(written(Values::range(2, 1000).or(0)), "0, 2-1000");
        assert_eq!(written(Values::up_to(1).or(0xFFFF)), "0-1, 0xFFFF");
        assert_eq!(written(Values::only(0x5A17)), "0x5A17");
        assert_eq!(written(Values::only(0)), "0");
        assert_eq!(written(Values::OneOf(&[12, 24])), "12 24");
    }

    #[test]
    fn a_setting_by_point_names_the_kind_that_differs() {
        let (rule, _) = register_map::rule_at(configuration::RULES, configuration::FILTER).unwrap();
        let mut text = String::new();
        write_values(rule, &mut text).unwrap();
        assert_eq!(text, "0-1000 (5); analog inputs 0-8 (4)");
    }
}
