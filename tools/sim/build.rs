//! Puts loaders and images into the program, so that it runs without other files. They are all files in the directory
//! that the variable `MODIO_SIM_IMAGES` names. `cargo xtask dist` sets the variable. Without it, the program has no
//! images.

use std::env;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

const VARIABLE: &str = "MODIO_SIM_IMAGES";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed={VARIABLE}");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let mut rows = String::new();
    if let Some(directory) = env::var_os(VARIABLE) {
        println!(
            "cargo::rerun-if-changed={}",
            Path::new(&directory).display()
        );
        for (name, file) in images(Path::new(&directory)) {
            // Copy the image beside the code that includes it, so that the program contains no path of this computer.
            fs::copy(&file, out.join(&name)).expect("OUT_DIR must be writable");
            writeln!(
                rows,
                "    ({name:?}, include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{name}\"))),"
            )
            .expect("writing to a String cannot fail");
        }
    }
    fs::write(out.join("files.rs"), format!("&[\n{rows}]\n")).expect("OUT_DIR must be writable");
}

/// Returns the files in a directory, sorted by name.
fn images(directory: &Path) -> Vec<(String, PathBuf)> {
    let files = fs::read_dir(directory)
        .unwrap_or_else(|error| panic!("{VARIABLE}: {}: {error}", directory.display()));
    let mut found: Vec<(String, PathBuf)> = files
        .map(|file| file.expect("the directory must be readable").path())
        .filter_map(|file| Some((file.file_name()?.to_str()?.to_owned(), file)))
        .collect();
    found.sort();
    assert!(
        !found.is_empty(),
        "{VARIABLE}: no image in {}",
        directory.display()
    );
    found
}
