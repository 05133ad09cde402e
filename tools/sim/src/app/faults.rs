//! Deliberate faults of the line, of the air and of a board, as in `POST /api/faults` and in scenarios.

use serde::{Deserialize, Deserializer};

/// Typical frequency of the HSI in Hz (DS5319 table 24).
pub const HSI_HZ: f64 = 8_000_000.0;

/// Faults to change; `None` leaves a fault unchanged.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Faults {
    /// Probability that a bit time on the line is inverted, 0 to 0.5.
    #[serde(deserialize_with = "named")]
    pub bit_error_rate: Option<f64>,
    /// Share of bytes lost between the line and the pty or socket, in each direction, 0 to 1.
    #[serde(deserialize_with = "named")]
    pub drop_rate: Option<f64>,
    /// Mean number of noise pulses per second, 0 to 10,000.
    #[serde(deserialize_with = "named")]
    pub noise_hz: Option<f64>,
    /// Share of packets that a LoRa radio loses, 0 to 1.
    #[serde(deserialize_with = "named")]
    pub radio_loss: Option<f64>,
    /// The DACs of the plugged modules do not answer.
    #[serde(deserialize_with = "named")]
    pub i2c_absent: Option<bool>,
    /// The crystal does not work.
    #[serde(deserialize_with = "named")]
    pub hse_failed: Option<bool>,
    /// Deviation of the HSI from 8 MHz, -20 to 20 %.
    #[serde(deserialize_with = "named")]
    pub hsi_percent: Option<f64>,
    /// Frequency of the LSI, 15 to 90 kHz.
    #[serde(deserialize_with = "named")]
    pub lsi_khz: Option<f64>,
}

/// Reads the value of a fault that is named. `null` is none, so it is refused like any other wrong value.
fn named<'de, D: Deserializer<'de>, T: Deserialize<'de>>(value: D) -> Result<Option<T>, D::Error> {
    T::deserialize(value).map(Some)
}

impl Faults {
    /// Whether no fault is named.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Checks that every value is in its range.
    ///
    /// # Errors
    ///
    /// Names the first value that is out of its range, and the range.
    pub fn check(&self) -> Result<(), String> {
        for (name, value, least, most) in [
            ("bit_error_rate", self.bit_error_rate, 0.0, 0.5),
            ("drop_rate", self.drop_rate, 0.0, 1.0),
            ("noise_hz", self.noise_hz, 0.0, 10_000.0),
            ("radio_loss", self.radio_loss, 0.0, 1.0),
            ("hsi_percent", self.hsi_percent, -20.0, 20.0),
            ("lsi_khz", self.lsi_khz, 15.0, 90.0),
        ] {
            if value.is_some_and(|value| !(least..=most).contains(&value)) {
                return Err(format!("`{name}` must be a number from {least} to {most}"));
            }
        }
        Ok(())
    }
}
