//! Deliberate faults of the line, of the air and of a board, as in `POST /api/faults` and in scenarios.

use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

/// Typical frequency of the HSI in Hz (DS5319 table 24).
pub const HSI_HZ: f64 = 8_000_000.0;

/// Faults to cause or to clear, or the faults in force. A fault that is not named keeps its value. Of the faults in
/// force only `radio_loss` can be missing.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(min_properties = 1)]
pub struct Faults {
    /// Probability that a bit time on the line is inverted.
    #[serde(default, deserialize_with = "named")]
    #[schema(nullable = false, minimum = 0.0, maximum = 0.5)]
    pub bit_error_rate: Option<f64>,
    /// Share of the bytes that are lost between the line and the pseudo-terminal or the socket, in each direction.
    #[serde(default, deserialize_with = "named")]
    #[schema(nullable = false, minimum = 0.0, maximum = 1.0)]
    pub drop_rate: Option<f64>,
    /// Pulses of 5 us on the line, in each second on average.
    #[serde(default, deserialize_with = "named")]
    #[schema(nullable = false, minimum = 0.0, maximum = 10000.0)]
    pub noise_hz: Option<f64>,
    /// Share of the packets that a LoRa radio loses. Only if modules are fitted (`--lora`).
    #[serde(default, deserialize_with = "named")]
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false, minimum = 0.0, maximum = 1.0)]
    pub radio_loss: Option<f64>,
    /// The DACs of the board's modules do not answer.
    #[serde(default, deserialize_with = "named")]
    #[schema(nullable = false)]
    pub i2c_absent: Option<bool>,
    /// The board's crystal does not work.
    #[serde(default, deserialize_with = "named")]
    #[schema(nullable = false)]
    pub hse_failed: Option<bool>,
    /// Deviation of the part's HSI oscillator from 8 MHz, in percent.
    #[serde(default, deserialize_with = "named")]
    #[schema(nullable = false, minimum = -20.0, maximum = 20.0)]
    pub hsi_percent: Option<f64>,
    /// Frequency of the part's LSI oscillator in kHz. It clocks the watchdog.
    #[serde(default, deserialize_with = "named")]
    #[schema(nullable = false, minimum = 15.0, maximum = 90.0)]
    pub lsi_khz: Option<f64>,
}

/// Reads the value of a fault that is named. `null` is none, so it is refused like any other wrong value.
fn named<'de, D: Deserializer<'de>, T: Deserialize<'de>>(value: D) -> Result<Option<T>, D::Error> {
    T::deserialize(value).map(Some)
}

impl Faults {
    /// Returns whether no fault is named.
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
