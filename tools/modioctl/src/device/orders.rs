//! The lock, and the commands of register COMMAND.

use std::time::Duration;

use modio_description::Description;
use register_map::codes::{self, Command};
use register_map::configuration::{BAUD, COMMAND, KEY, OPENING_KEY};
use register_map::state::{self, status};
use tokio::time::{Instant, sleep};

use super::Device;
use crate::bus::adu::Framing;
use crate::bus::endpoint::Endpoint;
use crate::failure::Failure;

/// Time limit for a save, which erases two pages and writes a change.
const SAVING: Duration = Duration::from_secs(3);
/// Time limit from a restart to the first answer.
const STARTING: Duration = Duration::from_secs(8);

impl Device {
    /// Opens the lock of the settings, for a minute.
    ///
    /// # Errors
    ///
    /// When the unit does not answer or refuses.
    pub async fn unlock(&mut self) -> Result<(), Failure> {
        self.write_words(KEY, &[OPENING_KEY], "opening the lock")
            .await
    }

    /// Writes a command. The lock must be open.
    ///
    /// # Errors
    ///
    /// When the unit does not answer or refuses.
    pub async fn order(&mut self, command: u16, about: &str) -> Result<(), Failure> {
        self.write_words(COMMAND, &[command], about).await
    }

    /// Saves the settings, and waits until they are saved.
    ///
    /// # Errors
    ///
    /// When the unit does not answer or refuses.
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

    /// Restarts the unit and waits until it answers, with the line settings that it then has. The lock must be
    /// open.
    ///
    /// # Errors
    ///
    /// When the unit does not answer or refuses.
    pub async fn restart(mut self) -> Result<Self, Failure> {
        let line = self.read_words(BAUD, 3).await?;
        let before = self.uptime().await?;
        self.order(Command::Restart.code(), "restarting").await?;
        let after = settings(self.master.endpoint(), &line);
        if let Some(endpoint) = after {
            self.master = self.master.reopen(endpoint).await?;
        }
        self.wait_until_back(STARTING).await?;
        if self.uptime().await? > before.max(2) {
            return Err(Failure::Refused(
                "the unit has not restarted: a save may be under way, or the supply is low"
                    .to_owned(),
            ));
        }
        Ok(self)
    }

    async fn uptime(&mut self) -> Result<u32, Failure> {
        let words = self.read_words(state::UPTIME, 2).await?;
        Ok(words
            .iter()
            .fold(0, |long, word| long << 16 | u32::from(*word)))
    }
}

/// Returns the endpoint for a unit with these values of BAUD, FORMAT and MODE, if it differs from the present one.
fn settings(now: &Endpoint, line: &[u16]) -> Option<Endpoint> {
    let [baud, format, mode] = line else {
        return None;
    };
    if now.framing == Framing::Mbap {
        return None;
    }
    let format = codes::Format::NAMES.iter().find(|(code, _)| code == format);
    let then = Endpoint {
        baud: u32::from(*baud) * 100,
        format: format
            .and_then(|(_, name)| name.parse().ok())
            .unwrap_or(now.format),
        framing: if *mode == codes::Mode::Ascii.code() {
            Framing::Ascii
        } else {
            Framing::Rtu
        },
        ..now.clone()
    };
    // With the loader's address the unit always uses the factory's line settings.
    let same = (then.baud, then.format, then.framing) == (now.baud, now.format, now.framing);
    (!same && now.unit != 255).then_some(then)
}

/// Returns the description with these modules in its slots, to which the settings by point belong.
#[must_use]
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
