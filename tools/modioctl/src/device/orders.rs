//! The lock, and the commands of register COMMAND.

use std::time::Duration;

use modio_description::Description;
use register_map::codes::{self, Command};
use register_map::configuration::{BAUD, COMMAND, KEY, MODE, OPENING_KEY, UNIT};
use register_map::second;
use register_map::state::{self, status};
use tokio::time::{Instant, sleep};

use super::{Device, place};
use crate::bus::adu::Framing;
use crate::bus::endpoint::{Endpoint, RATES};
use crate::failure::Failure;
use crate::output;
use crate::value::long;

/// Time limit for a save, which erases two pages and writes a change.
const SAVING: Duration = Duration::from_secs(3);
/// Time limit from a restart to the first answer.
const STARTING: Duration = Duration::from_secs(8);
/// Time from the reply to the order until the unit has restarted, and pause before it is asked again.
const PAUSE: Duration = Duration::from_millis(100);

impl Device {
    /// Opens the lock of the settings, for a minute.
    pub async fn unlock(&mut self) -> Result<(), Failure> {
        self.write_words(KEY, &[OPENING_KEY], "opening the lock")
            .await
    }

    /// Writes a command. The lock must be open.
    pub async fn order(&mut self, command: u16, about: &str) -> Result<(), Failure> {
        self.write_words(COMMAND, &[command], about).await
    }

    /// Saves the settings, and waits until they are saved.
    pub async fn save(&mut self) -> Result<(), Failure> {
        self.order(Command::Save.code(), "saving").await?;
        let until = Instant::now() + SAVING;
        loop {
            let words = self.read_words(state::STATUS, 1).await?;
            if words.iter().all(|word| word & status::UNSAVED == 0) {
                return Ok(());
            }
            if Instant::now() > until {
                // It may save later: a unit whose supply is low waits.
                return Err(Failure::Busy(
                    "the unit reports that the settings are not saved: try `modioctl config save`, and see `modioctl info`".to_owned(),
                ));
            }
            sleep(Duration::from_millis(50)).await;
        }
    }

    /// Restarts the unit and waits until it answers. It may answer with the address and the line settings that it had,
    /// because a restart loses what is not saved, and because a gateway in front of it keeps its own; or with those that
    /// its registers announce. Both are tried in turn. The lock must be open.
    pub async fn restart(mut self) -> Result<Self, Failure> {
        let line = match self.is_on_second_line().await? {
            true => Vec::new(),
            false => self.read_words(BAUD, 3).await?,
        };
        let unit = self.stored_unit().await?;
        let before = Before {
            uptime: self.uptime().await?,
            unique_id: self.unique_id().await?,
        };
        self.order(Command::Restart.code(), "restarting").await?;
        let (timeout, retries) = (self.master.endpoint().timeout, 0);
        let usual = self.master.be_patient(timeout, retries);
        let mut had = self.master.endpoint().clone();
        had.unit = self.unit;
        let announced = announced(&had, &line, unit);
        let lines: Vec<_> = std::iter::once(had).chain(announced).collect();
        let answering = self.find_line(&lines, &before).await?;
        self.master.be_patient(usual.0, usual.1);
        if let [had, announced] = &lines[..] {
            let text = if answering == 0 {
                let shown = shown(had, announced);
                format!(
                    "the unit still answers with {shown}: other values of BAUD, FORMAT, MODE and UNIT were not saved, or are for another line"
                )
            } else {
                let shown = shown(announced, had);
                format!("the unit now answers with {shown}: use that in your next command")
            };
            output::line(text)?;
        }
        Ok(self)
    }

    /// Waits for a unit that restarts. Asks with each of these addresses and settings in turn, and returns the index of
    /// those with which the unit answers.
    async fn find_line(&mut self, lines: &[Endpoint], before: &Before) -> Result<usize, Failure> {
        let ordered = Instant::now();
        let until = ordered + STARTING.max(self.master.endpoint().timeout * 4);
        // A unit that has not restarted yet would also answer.
        sleep(PAUSE).await;
        let mut last = Failure::Refused(
            "the unit has not restarted: a save may be under way, or the supply is low".to_owned(),
        );
        while Instant::now() < until {
            for (index, line) in lines.iter().enumerate() {
                // The adapter may not support the settings that the unit announced.
                if let Err(failure) = self.master.change_line(line.clone()) {
                    last = failure;
                    continue;
                }
                self.unit = line.unit;
                match self.has_restarted(before, ordered).await {
                    Ok(true) => return Ok(index),
                    Ok(false) => sleep(PAUSE).await,
                    Err(
                        failure @ (Failure::NoAnswer(_) | Failure::Garbled(_) | Failure::Busy(_)),
                    ) => last = failure,
                    Err(failure) => return Err(failure),
                }
            }
        }
        Err(match lines {
            [had, announced] => Failure::NoAnswer(format!(
                "unit {} does not answer after the restart, neither with the {} that it had nor with the {} that it announced: {}",
                had.unit,
                shown(had, announced),
                shown(announced, had),
                if self.is_serial() {
                    "`modioctl --timeout 0.2s scan --rates all --formats all` looks for it"
                } else {
                    "set the gateway to what the unit has"
                }
            )),
            _ => last.while_doing("after the restart"),
        })
    }

    /// Prints a warning when the registers at these addresses change the unit's line and the connection is a gateway,
    /// which does not follow.
    pub fn warn_of_line(&self, addresses: impl IntoIterator<Item = u16>) {
        let mut addresses = addresses.into_iter();
        if !self.is_serial() && addresses.any(|address| (BAUD..=MODE).contains(&address)) {
            eprintln!(
                "modioctl: warning: BAUD, FORMAT and MODE are in force after save and restart, and the gateway at {} keeps its own settings: change them there too, or the unit no longer answers",
                place(self.master.endpoint())
            );
        }
    }

    /// Prints a warning when a saved change waits for a restart that may be one of the line, and the connection is a
    /// gateway.
    pub async fn warn_of_restart(&mut self) -> Result<(), Failure> {
        let waits = self.waits_for_restart().await?;
        self.warn_of_line(waits.then_some(BAUD));
        Ok(())
    }

    /// Returns whether a saved setting takes effect after the next restart.
    pub async fn waits_for_restart(&mut self) -> Result<bool, Failure> {
        let words = self.read_words(state::STATUS, 1).await?;
        Ok(words.iter().any(|word| word & status::RESTART_NEEDED != 0))
    }

    /// Returns whether the unit that answers now is the one of before, and has restarted since the order.
    async fn has_restarted(&mut self, before: &Before, ordered: Instant) -> Result<bool, Failure> {
        let now = self.uptime().await?;
        // A unit that was up for a moment before, and is asked slowly, can have a higher uptime. The margin is for its
        // clock.
        let is_new = now < before.uptime || u64::from(now) <= ordered.elapsed().as_secs() + 1;
        // Another unit can have the new address already.
        Ok(is_new && self.unique_id().await? == before.unique_id)
    }

    async fn uptime(&mut self) -> Result<u32, Failure> {
        let words = self.read_words(state::UPTIME, 2).await?;
        Ok(long(&words))
    }

    async fn unique_id(&mut self) -> Result<Vec<u16>, Failure> {
        self.read_words(state::UNIQUE_ID, 6).await
    }

    /// Returns whether the requests arrive over the unit's second line, such as a radio: BAUD, FORMAT and MODE are those of
    /// the first line, which does not count them.
    async fn is_on_second_line(&mut self) -> Result<bool, Failure> {
        let before = match self.read_words(second::BUS_MESSAGES, 1).await {
            Err(Failure::Refused(_)) => return Ok(false),
            before => before?,
        };
        let first = self.read_words(state::BUS_MESSAGES, 1).await?;
        Ok(self.read_words(state::BUS_MESSAGES, 1).await? == first
            && self.read_words(second::BUS_MESSAGES, 1).await? != before)
    }

    /// Returns the value of UNIT, or `None` for a unit with an address switch.
    async fn stored_unit(&mut self) -> Result<Option<u8>, Failure> {
        match self.read_words(UNIT, 1).await {
            Ok(words) => {
                let unit = words.first().and_then(|unit| u8::try_from(*unit).ok());
                Ok(unit.filter(|unit| (1..=247).contains(unit)))
            }
            Err(Failure::Refused(_)) => Ok(None),
            Err(failure) => Err(failure),
        }
    }
}

/// What is known of a unit before its restart.
struct Before {
    uptime: u32,
    unique_id: Vec<u16>,
}

/// Returns the endpoint for a unit that announces these values of BAUD, FORMAT and MODE, none on the second line, and of
/// UNIT if it has no switch, if they make a difference. Values without a meaning change nothing.
fn announced(now: &Endpoint, line: &[u16], unit: Option<u8>) -> Option<Endpoint> {
    // In recovery mode the unit always uses the factory's line settings.
    if now.unit == 255 {
        return None;
    }
    let mut then = now.clone();
    then.unit = unit.unwrap_or(now.unit);
    if let [baud, format, mode] = line
        && now.framing != Framing::Mbap
    {
        change_line(&mut then, *baud, *format, *mode);
    }
    let all = |of: &Endpoint| (of.unit, of.baud, of.format, of.framing);
    (all(&then) != all(now)).then_some(then)
}

/// Changes an endpoint to these values of BAUD, FORMAT and MODE. Values without a meaning change nothing.
fn change_line(endpoint: &mut Endpoint, baud: u16, format: u16, mode: u16) {
    match codes::Mode::from_code(mode) {
        Some(codes::Mode::Ascii) => endpoint.framing = Framing::Ascii,
        Some(codes::Mode::Rtu) => endpoint.framing = Framing::Rtu,
        None => {}
    }
    // A gateway has its own rate and format.
    if endpoint.place.is_serial() {
        let baud = u32::from(baud) * 100;
        if RATES.contains(&baud) {
            endpoint.baud = baud;
        }
        let format = codes::Format::from_code(format);
        if let Some(format) = format.and_then(|format| format.name().parse().ok()) {
            endpoint.format = format;
        }
    }
}

/// Describes rate, format and framing of an endpoint for people, and its address if that of the other one differs. Only
/// the framing matters to a gateway.
fn shown(endpoint: &Endpoint, other: &Endpoint) -> String {
    let mut parts = Vec::new();
    if endpoint.unit != other.unit {
        parts.push(format!("address {},", endpoint.unit));
    }
    if endpoint.place.is_serial() {
        parts.push(format!("{} bit/s {}", endpoint.baud, endpoint.format));
    }
    parts.push(match endpoint.framing {
        Framing::Ascii => "ASCII".to_owned(),
        Framing::Rtu => "RTU".to_owned(),
        Framing::Mbap => "Modbus TCP".to_owned(),
    });
    parts.join(" ")
}

/// Returns the description with these modules in its slots, to which the settings by point belong.
pub fn with_modules(
    mut description: Description,
    module: impl Fn(u8) -> Option<u16>,
) -> Description {
    for port in &mut description.ports {
        if let Some(code) = module(port.number) {
            port.module = code;
        }
    }
    description
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::endpoint::Place;

    #[test]
    fn values_without_a_meaning_do_not_change_the_line() {
        let serial = Endpoint::new(Place::Serial("COM3".to_owned()), Framing::Rtu);
        let tcp = Endpoint::new(Place::Tcp("a:1".to_owned()), Framing::Rtu);
        let line = |now: &Endpoint, words: [u16; 3], unit| {
            let then = announced(now, &words, unit)?;
            Some(shown(&then, now))
        };
        assert_eq!(line(&serial, [96, 0, 0], None), None);
        assert_eq!(line(&serial, [0, 99, 99], Some(1)), None);
        let other = |text: &str| Some(text.to_owned());
        let ascii = other("19200 bit/s 7E1 ASCII");
        assert_eq!(line(&serial, [192, 4, 1], None), ascii);
        assert_eq!(line(&tcp, [192, 1, 0], None), None);
        assert_eq!(line(&tcp, [0, 4, 1], None), other("ASCII"));
        let both = other("address 17, 9600 bit/s 8N2 RTU");
        assert_eq!(line(&serial, [96, 0, 0], Some(17)), both);
        let gateway = Endpoint::new(Place::ModbusTcp("a:1".to_owned()), Framing::Mbap);
        let address = other("address 17, Modbus TCP");
        assert_eq!(line(&gateway, [96, 0, 1], Some(17)), address);
    }
}
