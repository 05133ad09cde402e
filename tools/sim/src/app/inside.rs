//! The files inside the program: loader and images of each board if `cargo xtask dist` has built the program, else none.

use register_map::Row;
use sim::board::Layout;
use sim::{Config, Image, Time};

/// Names of files, each with its content.
const FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/files.rs"));

/// Virtual time from power-on until the firmware has certainly logged its version.
const LOGGED: Time = Time::from_ms(100);

/// Returns a file for a board, if the program contains it: `.elf` is the image that runs alone, `-loader.elf` the
/// loader, `.modio` the images for the slots. It is a copy, because the bytes in the program do not have the alignment
/// that the ELF reader needs.
pub fn file(board: &Row, ending: &str) -> Option<Vec<u8>> {
    let name = format!("{board}{ending}");
    let inside = FILES.iter().find(|(file, _)| *file == name);
    inside.map(|(_, content)| content.to_vec())
}

/// Returns the version of the program, and on a line for each board inside it the version of its firmware.
pub fn version() -> String {
    let mut text = format!("modio-sim {}\n", register_map::version!());
    for board in Row::ALL {
        if let (Some(layout), Some(elf)) = (Layout::of(board), file(board, ".elf")) {
            let version = firmware(layout, &elf).unwrap_or_else(|| "of unknown version".to_owned());
            text += &format!("firmware of the {board}: {version}\n");
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
        let images = FILES.iter().filter(|(name, _)| name.ends_with(".modio"));
        assert_eq!(lines.len(), images.count(), "{lines:?}");
        for line in lines {
            assert!(!line.contains("unknown"), "{line}");
        }
    }

    #[test]
    #[ignore = "needs the image: cargo xtask test"]
    fn an_image_reports_its_version() {
        let images = std::env::var("MODIO_IMAGES_MODIO_02").expect("cargo xtask test sets it");
        let elf = std::fs::read(format!("{images}/modio")).unwrap();
        let layout = Layout::of(&register_map::board::MODIO_02).unwrap();
        let version = firmware(layout, &elf).unwrap();
        assert_eq!(version, env!("CARGO_PKG_VERSION"));
    }
}
