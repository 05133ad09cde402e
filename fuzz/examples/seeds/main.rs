//! Writes the seeds in `corpus/`: useful starting points, as scripts of each target, one file per seed. Run `cargo
//! run --release --example seeds` in this directory after a change of a script's format or of a seed.

use std::path::Path;
use std::{fs, io};

mod descriptions;
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
        ("description", descriptions::seeds()),
    ] {
        let directory = corpus.join(target);
        // Remove old seeds first.
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

/// Returns a length in one byte, followed by the bytes.
fn string(bytes: &[u8]) -> Vec<u8> {
    let length = u8::try_from(bytes.len()).expect("a string has at most 255 bytes");
    [&[length], bytes].concat()
}
