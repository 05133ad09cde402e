//! `modioctl module`, `reboot` and `identify`: commands that the unit executes.

use register_map::codes::Command;
use register_map::{points, state};

use super::note::{Note, UNDO};
use crate::cli::Module;
use crate::device::{Device, fetch};
use crate::failure::Failure;
use crate::names::slots;
use crate::output;
use crate::value::{parse, show};

/// Sets up a slot for a module.
pub async fn run(mut device: Device, options: Module, note: &Note) -> Result<(), Failure> {
    let Module::Set { port, module } = options;
    let book = fetch(&mut device).await?.book;
    let description = book.of_modio()?;
    if !description.ports.iter().any(|known| known.number == port) {
        return Err(Failure::usage(format!(
            "port {port} has no slot: {} has slots at {}",
            description.board,
            slots(description)
        )));
    }
    let item = book.find(&format!("p{port}.module"))?;
    let words = parse(&item, &module, false)?;
    let pairs = device.pairs(&book).await?;
    device.unlock().await?;
    let name = &item.name;
    let write = device.write_item(&item, &words);
    note.during(
        format_args!("{name} may be written{UNDO}"),
        "nothing is written",
        write,
    )
    .await?;
    note.during(
        format_args!("{name} is written, and may be saved: repeat the command"),
        format_args!("{name} is written{UNDO}"),
        device.save(),
    )
    .await?;
    note.set(format_args!(
        "{name} is saved, and in force after the next restart"
    ));
    let mut device = device.restart().await?;
    note.set(format_args!("{name} is saved, and the unit has restarted"));
    let index = u16::from(port) - 1;
    let in_force = device.read_words(state::MODULE_IN_FORCE + index, 1).await?;
    if in_force != words {
        return Err(Failure::Refused(format!(
            "port {port} has module {} in force, not {module}: see `modioctl info`",
            show(&item, &in_force, false)
        )));
    }
    // The state of a module is known only after some scans.
    tokio::time::sleep(std::time::Duration::from_millis(300)).await;
    let fares = book.find(&format!("p{port}.module_state"))?;
    let state = device.read_items(std::slice::from_ref(&fares)).await?;
    let state = state.first().map(|words| show(&fares, words, false).text);
    let state = state.unwrap_or_default();
    output::line(format_args!(
        "port {port}: {}, saved and in force; state: {state}",
        show(&item, &words, false)
    ))?;
    device.warn_of_lost_pairs(&pairs).await;
    Ok(())
}

/// Restarts the unit.
pub async fn reboot(mut device: Device) -> Result<(), Failure> {
    device.unlock().await?;
    device.warn_of_restart().await?;
    let mut device = device.restart().await?;
    let states = device.read_words(state::MODULE_STATE, points::PORTS);
    let bad = states.await?.iter().any(|state| *state > 1);
    output::line(match bad {
        true => "restarted; a module has a fault, see `modioctl info`",
        false => "restarted",
    })
}

/// Makes the unit blink its LEDs.
pub async fn identify(device: &mut Device) -> Result<(), Failure> {
    device.unlock().await?;
    let about = "blinking (older firmware does not support it)";
    device.order(Command::Identify.code(), about).await?;
    output::line(format_args!(
        "all LEDs of unit {} blink for 10 s",
        device.unit
    ))
}
