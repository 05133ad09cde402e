//! The firmware images inside the program: one for each board if `cargo xtask dist` has built the program, else none.

use register_map::Board;
use sim::board::Layout;
use sim::{Config, Image, Time};

/// Names of boards, each with its image as an ELF file.
const IMAGES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/images.rs"));

/// Virtual time from power-on until the firmware has certainly logged its version.
const LOGGED: Time = Time::from_ms(100);

/// Returns the image of a board.
///
/// # Errors
///
/// If the program contains no image: what to do, in one line.
pub fn image(board: &Board) -> Result<Image, String> {
    let elf = elf(board).ok_or(
        "no image to run: give one with --elf FILE, or use `cargo xtask sim`, which builds one",
    )?;
    Image::from_elf(&elf).map_err(|error| format!("cannot run the image inside: {error}"))
}

/// Returns the image of a board as an ELF file, if the program contains it. It is a copy, because the bytes in the
/// program do not have the alignment that the ELF reader needs.
fn elf(board: &Board) -> Option<Vec<u8>> {
    let inside = IMAGES.iter().find(|(name, _)| *name == board.name);
    inside.map(|(_, elf)| elf.to_vec())
}

/// Returns the version of the program, and on a line for each image inside it the version of that firmware.
pub fn version() -> String {
    let mut text = format!("modio-sim {}\n", register_map::version!());
    for layout in Layout::ALL {
        if let Some(elf) = elf(layout.board) {
            let version = firmware(layout, &elf).unwrap_or_else(|| "of unknown version".to_owned());
            text += &format!("firmware of the {}: {version}\n", layout.board);
        }
    }
    text
}

/// Runs an image and returns the version in the first line of its log: `modio VERSION on BOARD, ...`.
fn firmware(layout: &'static Layout, elf: &[u8]) -> Option<String> {
    let config = Config {
        layout,
        ..Config::default()
    };
    let mut board = sim::Board::new(&Image::from_elf(elf).ok()?, config).ok()?;
    board.run_until(LOGGED);
    let log = board.take_log();
    let (version, _) = log.strip_prefix("modio ")?.split_once(" on ")?;
    Some(version.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_image_inside_is_for_a_board_and_reports_its_version() {
        let mut lines = version().lines().map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(
            lines.remove(0),
            format!("modio-sim {}", register_map::version!())
        );
        assert_eq!(lines.len(), IMAGES.len(), "{lines:?}");
        for line in lines {
            assert!(!line.contains("unknown"), "{line}");
        }
    }

    #[test]
    #[ignore = "needs the image: cargo xtask test"]
    fn an_image_reports_its_version() {
        let path = std::env::var_os("MODIO_ELF").expect("MODIO_ELF names the image");
        let elf = std::fs::read(path).unwrap();
        let layout = Layout::of(&register_map::board::MODIO_02).unwrap();
        let version = firmware(layout, &elf).unwrap();
        assert_eq!(version, env!("CARGO_PKG_VERSION"));
    }
}
