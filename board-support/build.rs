//! Gives the linker of an image the memory of the board, and the application the interrupts that depend on the board. The
//! features of this package select the board, and what is linked: the loader, the application for a slot behind it, or the
//! application alone.

use std::{env, fs, path::PathBuf};

use register_map::{
    Row,
    board::MODIO_02,
    layout::{HEADER, LOADER, LOADER_KEYS},
    part::{FLASH_BASE, RAM_BASE},
};

/// The sections, which are the same in every image.
const SECTIONS: &str = "memory/sections.x";
/// The section with the numbers of the loader's keys.
const KEYS: &str = "SECTIONS { .keys : { KEEP(*(.keys)) } > KEYS } INSERT AFTER .rodata;\n";
/// Bytes of the kept region, at the end of the RAM.
const KEPT: u32 = 512;
/// Bytes of the loader's variables. The check of a signature needs more stack than the application has.
const LOADER_VARIABLES: u32 = 2048;
/// Bytes of a vector.
const VECTOR: u32 = 4;
/// Handlers of the application whose interrupts depend on the board.
const HANDLERS: [&str; 3] = ["LINE", "SECOND", "SERVE"];

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    println!("cargo::rerun-if-changed=memory");
    println!("cargo::rerun-if-changed=build.rs");
    let is_target = env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("none");
    let boards: Vec<_> = Row::ALL
        .into_iter()
        .filter(|board| is_on(board.name))
        .collect();
    let board = match boards[..] {
        [board] => board,
        [] if !is_target => &MODIO_02,
        _ => panic!("exactly one feature of a board is needed, such as {MODIO_02}"),
    };
    let module = board.name.replace('-', "_");
    let selected = format!("pub use {module}::BOARD;\n");
    fs::write(out.join("board.rs"), selected).expect("OUT_DIR is writable");
    if is_target {
        println!("cargo::metadata=BOARD={board}");
        let handlers = || HANDLERS.into_iter().zip(board.memory.interrupts);
        let mut script = memory(board);
        if !is_on("loader") {
            script.extend(handlers().map(|(handler, name)| format!("{name} = {handler};\n")));
        }
        let interrupts: String = handlers()
            .map(|(handler, name)| {
                format!(
                    "/// The interrupt of this handler.\n\
                     pub const {handler}: Interrupt = Interrupt::{name};\n"
                )
            })
            .collect();
        fs::write(out.join("memory.x"), script).expect("OUT_DIR is writable");
        fs::write(out.join("interrupts.rs"), interrupts).expect("OUT_DIR is writable");
    }
    println!("cargo::rustc-link-search={}", out.display());
}

/// Returns whether a feature of this package is on.
fn is_on(feature: &str) -> bool {
    // Cargo sets an environment variable for each.
    let feature = feature.to_uppercase().replace('-', "_");
    env::var_os(format!("CARGO_FEATURE_{feature}")).is_some()
}

/// Returns the linker script of an image for a board.
fn memory(board: &Row) -> String {
    let (memory, layout) = (board.memory, board.layout());
    // The application alone must fit every part that the board can have.
    let (part, ram) = (memory.part, memory.least().ram);
    let stack = if is_on("loader") {
        ram - KEPT - LOADER_VARIABLES
    } else {
        memory.stack
    };
    let slot = |at: usize| {
        (
            layout.slots[at] + HEADER,
            layout.slot - HEADER,
            layout.store,
        )
    };
    let (origin, length, store) = if is_on("loader") {
        (FLASH_BASE, LOADER_KEYS - FLASH_BASE, layout.store)
    } else if is_on("slot-a") {
        slot(0)
    } else if is_on("slot-b") {
        slot(1)
    } else {
        (FLASH_BASE, board.store().first - FLASH_BASE, board.store())
    };
    let sections = fs::read_to_string(SECTIONS).expect("the linker script is readable");
    let keys_bytes = FLASH_BASE + LOADER - LOADER_KEYS;
    let keys = if is_on("loader") { KEYS } else { "" };
    format!(
        "/* Memory of the {board}. */
MEMORY
{{
  FLASH : ORIGIN = {origin:#X}, LENGTH = {length}
  STACK : ORIGIN = {RAM_BASE:#X}, LENGTH = {stack}
  RAM   : ORIGIN = {RAM_BASE:#X} + {stack}, LENGTH = {variables}
  KEPT  : ORIGIN = {RAM_BASE:#X} + {kept}, LENGTH = {KEPT}
  KEYS  : ORIGIN = {LOADER_KEYS:#X}, LENGTH = {keys_bytes}
}}
_slot_a = {a:#X};
_slot_b = {b:#X};
_slot_bytes = {slot};
_boot = {boot:#X};
_loader_keys = {LOADER_KEYS:#X};
_store = {store:#X};
_page_bytes = {page};
VECTORS_SIZE = {vectors};
{sections}{keys}",
        a = layout.slots[0],
        b = layout.slots[1],
        slot = layout.slot,
        boot = layout.boot.first,
        store = store.first,
        page = part.page,
        variables = ram - stack - KEPT,
        kept = ram - KEPT,
        vectors = VECTOR * (16 + part.interrupts),
    )
}
