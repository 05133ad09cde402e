//! Gives the code the self-description of each board. For the image, also gives the linker the memory layout and the
//! linker script of cortex-m-rt.

use std::{env, fs, path::PathBuf};

use modio_description::{FILE, HEAD, PORT_BYTES, checksum};
use register_map::{
    Board, Module,
    board::Memory,
    part::{FLASH_BASE, RAM_BASE},
};

/// The sections, which are the same on every board.
const SECTIONS: &str = "memory/sections.x";

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::write(out.join("self_description.rs"), self_descriptions()).expect("OUT_DIR is writable");
    println!("cargo::rerun-if-changed=memory");
    println!("cargo::rerun-if-changed=build.rs");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    if let Some(layout) = layout() {
        fs::write(out.join("memory.x"), layout).expect("OUT_DIR is writable");
    }
    println!("cargo::rustc-link-search={}", out.display());
    println!("cargo::rustc-link-arg-bins=--nmagic");
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rerun-if-env-changed=MODIO_MAP");
    if let Some(map) = env::var_os("MODIO_MAP") {
        println!("cargo::rustc-link-arg-bins=-Map={}", map.display());
    }
}

/// Returns Rust code with the fixed part of each board's self-description: the document without its ports, which
/// the firmware adds.
fn self_descriptions() -> String {
    let mut rows = String::new();
    for board in Board::ALL {
        let document =
            modio_description::describe(board, env!("CARGO_PKG_VERSION"), |_| Module::None)
                .encode();
        let ports = usize::from(board.slots) * PORT_BYTES;
        let fixed = &document[..document.len() - ports];
        let (code, crc) = (board.code, checksum(fixed));
        rows += &format!("    Fixed {{ board: {code}, crc: {crc:#06X}, document: &{fixed:?} }},\n");
    }
    format!(
        "/// File number.
const FILE: u16 = {FILE};
/// Number of records in front of the document.
const HEAD: u16 = {HEAD};
/// Bytes of one port at the end of the document.
const PORT_BYTES: usize = {PORT_BYTES};
/// Fixed part of each board's document.
const BOARDS: [Fixed; {}] = [
{rows}];
",
        Board::ALL.len(),
    )
}

/// Bytes of the kept region, at the end of the RAM.
const KEPT: u32 = 512;
/// Bytes of a vector.
const VECTOR: u32 = 4;

/// Returns the linker script for the selected board, or `None` without a board. The feature has the board's name.
fn layout() -> Option<String> {
    let board = Board::ALL.into_iter().find(|board| {
        // Cargo sets an environment variable for each enabled feature.
        let feature = board.name.to_uppercase().replace('-', "_");
        env::var_os(format!("CARGO_FEATURE_{feature}")).is_some()
    })?;
    let Memory { part, stack, .. } = board.memory();
    let ram = board.memory().least().ram;
    let sections = fs::read_to_string(SECTIONS).expect("the linker script is readable");
    Some(format!(
        "/* Memory of the {board}, which must fit every part that it can have. */
MEMORY
{{
  FLASH : ORIGIN = {FLASH_BASE:#X}, LENGTH = {program}
  STACK : ORIGIN = {RAM_BASE:#X}, LENGTH = {stack}
  RAM   : ORIGIN = {RAM_BASE:#X} + {stack}, LENGTH = {variables}
  KEPT  : ORIGIN = {RAM_BASE:#X} + {kept}, LENGTH = {KEPT}
}}
_store = {store:#X};
_page_bytes = {page};
VECTORS_SIZE = {vectors};
{sections}",
        store = board.store.first,
        page = board.store.bytes,
        program = board.store.first - FLASH_BASE,
        variables = ram - stack - KEPT,
        kept = ram - KEPT,
        vectors = VECTOR * (16 + part.interrupts),
    ))
}
