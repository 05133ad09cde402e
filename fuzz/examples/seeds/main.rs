//! Writes the seeds of `corpus/`: what is worth starting from, as scripts of each target, one file for
//! each. `cargo run --release --example seeds` in this directory, after a change of a script's form or of
//! what is here.

use std::path::Path;
use std::{fs, io};

mod line;
mod requests;
mod storage;

/// A file of a corpus: its name and bytes.
type Seed = (String, Vec<u8>);

fn main() -> io::Result<()> {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    for (target, seeds) in [
        ("receiver_rtu", line::rtu()),
        ("receiver_ascii", line::ascii()),
        ("pdu", requests::seeds()),
        ("store", storage::seeds()),
    ] {
        let directory = corpus.join(target);
        // What is no seed any more goes.
        match fs::remove_dir_all(&directory) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => fs::create_dir_all(&directory)?,
        }
        for (name, bytes) in &seeds {
            fs::write(directory.join(name), bytes)?;
        }
        let size: usize = seeds.iter().map(|(_, bytes)| bytes.len()).sum();
        println!("{target}: {} seeds, {size} bytes", seeds.len());
    }
    Ok(())
}

/// A length in one byte, and so many bytes.
fn string(bytes: &[u8]) -> Vec<u8> {
    let length = u8::try_from(bytes.len()).expect("a string of a script");
    [&[length], bytes].concat()
}
