//! The time that the loader takes.

use register_map::Row;
use register_map::part::FLASH_BASE;
use serde::Serialize;
use sim::board::Layout;
use sim::{Board, Config, Corner, Image, Time, chip};

/// RAM begins here: code at lower addresses is in flash.
const RAM: u32 = 0x2000_0000;
/// Resolution of the times.
const STEP: Time = Time::from_us(20);
/// More time than the loader ever takes.
const LONGEST: Time = Time::from_ms(10_000);

/// Times of the loader at a corner of the part, in milliseconds.
#[derive(Clone, Debug, Serialize)]
pub struct Boot {
    /// The corner.
    pub corner: &'static str,
    /// From power-on to the application's first instruction.
    pub start_ms: f64,
    /// The check of a new image, with the signature and the reset after it.
    pub check_ms: f64,
}

/// Measures the loader of a board with a signed image for slot A.
///
/// # Errors
///
/// When the image does not start.
pub fn measure(loader: &Image, image: &[u8], board: &Row) -> Result<Vec<Boot>, String> {
    let corners = [(Corner::Nominal, "nominal"), (Corner::Slow, "slow")];
    corners
        .into_iter()
        .map(|(corner, name)| at(loader, image, board, corner, name))
        .collect()
}

fn at(
    loader: &Image,
    image: &[u8],
    map: &Row,
    corner: Corner,
    name: &'static str,
) -> Result<Boot, String> {
    let layout = Layout::of(map).ok_or("the simulator does not know this board")?;
    let slot = map.layout().slots[0];
    let mut flash = vec![0xFF; map.memory.part.flash as usize];
    let at = (slot - FLASH_BASE) as usize;
    let place = flash.get_mut(at..at + image.len());
    place.ok_or("the image is too long")?.copy_from_slice(image);
    let mut config = Config {
        layout,
        chip: chip::Config::holding(flash),
        ..Config::default()
    };
    config.chip.corner = corner;
    let mut board = Board::new(loader, config).map_err(|error| error.to_string())?;
    // The first start checks the image; the second one finds that it is confirmed.
    let first = starts(&mut board, slot)?;
    board.cycle();
    let start_ms = starts(&mut board, slot)?;
    Ok(Boot {
        corner: name,
        start_ms,
        check_ms: first - start_ms,
    })
}

/// Runs until the application starts, and returns the time that this took, in milliseconds.
fn starts(board: &mut Board, slot: u32) -> Result<f64, String> {
    let from = board.now();
    while !(slot..RAM).contains(&board.pc()) {
        board.run_for(STEP);
        if board.now() > from + LONGEST {
            return Err("the loader does not start the image".to_owned());
        }
    }
    Ok((board.now() - from).as_ps() as f64 / 1e9)
}
