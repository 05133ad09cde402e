//! Makes the boards that the options name, each with its image, flash and modules.

use std::collections::BTreeMap;
use std::path::Path;

use register_map::{codes::Lora, configuration};
use sim::board::{Firmware, InSlot, Layout};
use sim::options::{Files, Fitting, Options};
use sim::radio::Parameters;
use sim::{Board, Config, Image};

use super::flash_file::FlashFile;
use super::inside;
use super::unit::Unit;

/// What to do without a file to run.
const NO_FILE: &str = "give a loader and an image with --loader FILE and --image FILE, or an image that runs alone with --elf FILE, or \
     use `cargo xtask sim`, which builds them";

/// Makes the boards. A board with a flash file starts with the contents of the file, into which the firmware is written
/// if that is necessary.
///
/// # Errors
///
/// In one line: an image or a file is missing or invalid, or a board does not have a slot that is named.
pub fn fitted(options: &Options) -> Result<Vec<(Board, Unit)>, String> {
    let fittings = options.fittings()?;
    let mut all = BTreeMap::new();
    let several = fittings.len() > 1;
    let mut boards = Vec::new();
    for (fitting, number) in fittings.into_iter().zip(1..) {
        let name = fitting.board.name;
        let layout = Layout::of(fitting.board).ok_or("the simulator does not know this board")?;
        let firmware = match all.get(name) {
            Some(firmware) => firmware,
            None => all.entry(name).or_insert(firmware(layout, options)?),
        };
        let (image, config, flash) = config(&fitting, number, options, layout, firmware)?;
        let board = Board::new(&image, config).map_err(|error| {
            let what = match several {
                true => format!("{}: {error}", fitting.name),
                false => error.to_string(),
            };
            format!("{name}: {what}")
        })?;
        boards.push((board, Unit::new(fitting.name, flash)));
    }
    Ok(boards)
}

/// Returns what a type of board runs: the files that the options name, or those inside the program.
fn firmware(layout: &Layout, options: &Options) -> Result<Firmware, String> {
    let board = layout.board;
    let inside =
        |ending| inside::file(board, ending).ok_or_else(|| format!("no file to run: {NO_FILE}"));
    let elf = |path: Option<&Path>, ending| match path {
        Some(path) => Image::read(path).map_err(|error| format!("cannot run the image {error}")),
        None => {
            let image = Image::from_elf(&inside(ending)?);
            image.map_err(|error| format!("cannot run the image inside: {error}"))
        }
    };
    Ok(match options.files_of(board)? {
        Files::Alone(path) => Firmware::Alone(elf(path, ".elf")?),
        Files::Loaded { loader, image } => {
            let image = match image {
                Some(path) => InSlot::read(layout, path),
                None => InSlot::from_file(layout, &inside(".modio")?)
                    .map_err(|what| format!("inside: {what}")),
            };
            let image = image.map_err(|what| format!("cannot run the image {what}"))?;
            Firmware::Loaded(elf(loader, "-loader.elf")?, image)
        }
    })
}

/// Returns the image and the configuration of board `number` of the line, from 1, and its flash file.
fn config(
    fitting: &Fitting,
    number: u8,
    options: &Options,
    layout: &'static Layout,
    firmware: &Firmware,
) -> Result<(Image, Config, Option<FlashFile>), String> {
    let path = fitting.flash.as_deref();
    let opened = path.map(|path| FlashFile::open(path, layout.part.flash_size));
    let (mut file, stored) = opened.transpose()?.unzip();
    let mut flash = stored
        .flatten()
        .unwrap_or_else(|| vec![0xFF; layout.part.flash_size]);
    let programmed = firmware.program(layout, &mut flash, options.reflash);
    let (image, note) = programmed.map_err(|error| format!("{}: {error}", fitting.board))?;
    if let Some(file) = &mut file {
        file.note = note;
    }
    let mut config = Config {
        layout,
        dip: fitting.dip,
        module: fitting.module,
        slots: fitting.slots.clone(),
        radio: options.lora.as_ref().map(|_| Parameters::FACTORY),
        ..Config::default()
    };
    config.chip.corner = options.corner;
    // Give each part its own unique identity and its own random seed.
    let [.., last] = &mut config.chip.unique_id;
    *last = last.wrapping_add(number - 1);
    config.chip.seed += u64::from(number - 1);
    if options.preset() {
        write_preset(&config, &mut flash);
    }
    config.chip.flash = Some(flash);
    Ok((image, config, file))
}

/// Stores the modules of all slots in the configuration, and that the radio is on if there is one, if nothing is stored
/// yet. The radio serves points and reads only, as the pages recommend for a real unit: a user who tries the radio here
/// meets the same refusals.
fn write_preset(config: &Config, flash: &mut [u8]) {
    if config.layout.stores_nothing(flash) {
        let mut settings: Vec<_> = configuration::modules(config.plugged()).collect();
        if config.radio.is_some() {
            settings.push((configuration::LORA, Lora::PointsOnly.code()));
        }
        // One setting for each port, and one more: a page has room for all of them.
        if !settings.is_empty() {
            config.layout.store(flash, &settings);
        }
    }
}

#[cfg(test)]
mod tests {
    use register_map::{Module, record};
    use sim::board::{MODIO_02, MODIO_08};
    use sim::memory::FLASH_BASE;

    use super::*;

    #[test]
    fn preset_stores_every_module_and_is_not_written_over_stored_data() {
        for layout in [&MODIO_02, &MODIO_08] {
            let fitted = |module| Config {
                layout,
                slots: layout
                    .slots
                    .iter()
                    .map(|slot| (slot.port, module))
                    .collect(),
                ..Config::default()
            };
            let mut flash = vec![0xFF; layout.part.flash_size];
            write_preset(&fitted(Module::Do4), &mut flash);
            let at = (layout.board.store().first - FLASH_BASE) as usize;
            let page = at..at + layout.board.store().bytes as usize;
            let (_, record) = record::records(&flash[page], layout.board).next().unwrap();
            let modules = layout.board.ports().map(|port| (0x010F + port, 2));
            assert!(record.pairs().eq(modules), "{}", layout.board);
            let before = flash.clone();
            write_preset(&fitted(Module::Di4), &mut flash);
            assert_eq!(flash, before, "a stored record is not replaced");

            let mut flash = vec![0xFF; layout.part.flash_size];
            let [_, second] = layout.board.store().addresses();
            flash[(second - FLASH_BASE) as usize + 500] = 0;
            let before = flash.clone();
            write_preset(&fitted(Module::Di4), &mut flash);
            assert_eq!(flash, before, "damaged data is not replaced either");
        }
    }

    #[test]
    fn preset_switches_a_fitted_radio_on() {
        let layout = &MODIO_02;
        let config = Config {
            layout,
            radio: Some(Parameters::FACTORY),
            ..Config::default()
        };
        let mut flash = vec![0xFF; layout.part.flash_size];
        write_preset(&config, &mut flash);
        let at = (layout.board.store().first - FLASH_BASE) as usize;
        let (_, record) = record::records(&flash[at..], layout.board).next().unwrap();
        assert_eq!(record.pairs().last(), Some((configuration::LORA, 2)));
    }
}
