//! Gives the code the self-description of each board, and the linker of the image the linker script of cortex-m-rt. The
//! build script of board-support writes the memory that it includes.

use std::{env, fs, path::PathBuf};

use modio_description::{FILE, HEAD, PORT_BYTES, checksum};
use register_map::{Module, Row};

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::write(out.join("self_description.rs"), self_descriptions()).expect("OUT_DIR is writable");
    println!("cargo::rerun-if-changed=build.rs");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    // From the build script of board-support.
    let board = env::var("DEP_MODIO_BOARD_BOARD").expect("a feature of board-support selects it");
    fs::write(out.join("board.rs"), type_of(&board)).expect("OUT_DIR is writable");
    println!("cargo::rustc-link-arg-bins=--nmagic");
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    // Functions with the same code are linked once. Nothing compares their addresses.
    println!("cargo::rustc-link-arg-bins=--icf=all");
    println!("cargo::rerun-if-env-changed=MODIO_MAP");
    if let Some(map) = env::var_os("MODIO_MAP") {
        println!("cargo::rustc-link-arg-bins=-Map={}", map.display());
    }
}

/// Returns Rust code with the type of a board in crate register-map, which is its name in other words: `modio-02` is
/// `Modio02`.
fn type_of(board: &str) -> String {
    let words = board.split('-').map(|word| {
        let (first, rest) = word.split_at(1);
        first.to_uppercase() + rest
    });
    let words: String = words.collect();
    format!("/// The board of this image.\npub type B = register_map::board::{words};\n")
}

/// Returns Rust code with the fixed part of each board's self-description: the document without its ports, which
/// the firmware adds.
fn self_descriptions() -> String {
    let mut rows = String::new();
    for board in Row::ALL {
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
        Row::ALL.len(),
    )
}
