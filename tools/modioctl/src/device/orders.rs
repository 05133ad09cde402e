//! The lock, and the commands of register COMMAND.

use std::time::Duration;

use modio_description::Description;
use register_map::codes::{self, Command};
use register_map::configuration::{BAUD, COMMAND, KEY, MODE, OPENING_KEY};
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
                return Err(Failure::Refused(
                    "the unit reports that the settings are not saved: try `modioctl config save`, and see `modioctl info`".to_owned(),
                ));
            }
            sleep(Duration::from_millis(50)).await;
        }
    }

    /// Restarts the unit and waits until it answers. It may answer with the line settings that it had, because a restart
    /// loses what is not saved, and because a gateway in front of it keeps its own; or with those that its registers
    /// announce. Both are tried in turn. The lock must be open.
    pub async fn restart(mut self) -> Result<Self, Failure> {
        let line = self.read_words(BAUD, 3).await?;
        let before = self.uptime().await?;
        self.order(Command::Restart.code(), "restarting").await?;
        let (timeout, retries) = (self.master.endpoint().timeout, 0);
        let usual = self.master.be_patient(timeout, retries);
        let had = self.master.endpoint().clone();
        let announced = announced(&had, &line);
        let lines: Vec<_> = std::iter::once(had.clone()).chain(announced).collect();
        let answering = self.find_line(&lines, before).await?;
        self.master.be_patient(usual.0, usual.1);
        if lines.len() > 1 {
            let shown = shown(self.master.endpoint());
            let text = if answering == 0 {
                format!(
                    "the unit still answers with {shown}: other values of BAUD, FORMAT and MODE were not saved, or are for another line"
                )
            } else {
                format!("the unit now answers with {shown}: use that in your next command")
            };
            output::line(text)?;
        }
        Ok(self)
    }

    /// Waits for a unit that restarts. Asks with each of these settings in turn, and returns the index of those with
    /// which the unit answers. `before` is the unit's uptime before the restart.
    async fn find_line(&mut self, lines: &[Endpoint], before: u32) -> Result<usize, Failure> {
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
                match self.uptime().await {
                    Ok(now) if now < before => return Ok(index),
                    // A unit that was up for a moment before, and is asked slowly. The margin is for its clock.
                    Ok(now) if u64::from(now) <= ordered.elapsed().as_secs() + 1 => {
                        return Ok(index);
                    }
                    Ok(_) => sleep(PAUSE).await,
                    Err(failure @ (Failure::NoAnswer(_) | Failure::Garbled(_))) => last = failure,
                    Err(failure) => return Err(failure),
                }
            }
        }
        Err(match lines {
            [had, announced] => Failure::NoAnswer(format!(
                "unit {} does not answer after the restart, neither with the {} that it had nor with the {} that it announced: {}",
                self.unit,
                shown(had),
                shown(announced),
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

    async fn uptime(&mut self) -> Result<u32, Failure> {
        let words = self.read_words(state::UPTIME, 2).await?;
        Ok(long(&words))
    }
}

/// Returns the endpoint for a unit that announces these values of BAUD, FORMAT and MODE, if they make a difference.
/// Values without a meaning change nothing.
fn announced(now: &Endpoint, line: &[u16]) -> Option<Endpoint> {
    let [baud, format, mode] = line else {
        return None;
    };
    if now.framing == Framing::Mbap {
        return None;
    }
    let mut then = now.clone();
    then.framing = match codes::Mode::from_code(*mode) {
        Some(codes::Mode::Ascii) => Framing::Ascii,
        Some(codes::Mode::Rtu) => Framing::Rtu,
        None => now.framing,
    };
    // A gateway has its own rate and format.
    if now.place.is_serial() {
        let baud = u32::from(*baud) * 100;
        if RATES.contains(&baud) {
            then.baud = baud;
        }
        let format = codes::Format::from_code(*format);
        let format = format.and_then(|format| format.name().parse().ok());
        then.format = format.unwrap_or(now.format);
    }
    // In recovery mode the unit always uses the factory's line settings.
    let same = (then.baud, then.format, then.framing) == (now.baud, now.format, now.framing);
    (!same && now.unit != 255).then_some(then)
}

/// Describes rate, format and framing for people. Only the framing matters to a gateway.
fn shown(endpoint: &Endpoint) -> String {
    let mode = if endpoint.framing == Framing::Ascii {
        "ASCII"
    } else {
        "RTU"
    };
    if endpoint.place.is_serial() {
        format!("{} bit/s {} {mode}", endpoint.baud, endpoint.format)
    } else {
        mode.to_owned()
    }
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
        let line = |now, words: [u16; 3]| announced(now, &words).map(|then| shown(&then));
        assert_eq!(line(&serial, [96, 0, 0]), None);
        assert_eq!(line(&serial, [0, 99, 99]), None);
        let other = "19200 bit/s 7E1 ASCII".to_owned();
        assert_eq!(line(&serial, [192, 4, 1]), Some(other));
        assert_eq!(line(&tcp, [192, 1, 0]), None);
        assert_eq!(line(&tcp, [0, 4, 1]), Some("ASCII".to_owned()));
    }
}
