//! Ports whose inputs and outputs are part of the board, instead of a slot.

use crate::Module;
use crate::kind::Kind;
use crate::points::CHANNELS;

/// A port without slot. Its MODULE is what its inputs and outputs are like, and can only be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FixedPort {
    /// The module that the port is like.
    pub module: Module,
    /// Another one that MODULE may choose instead.
    pub or: Option<Module>,
    /// Number of channels, 1 to 4. The first ones exist.
    pub channels: u8,
    /// The analog inputs that measure a current (RANGE 1): channel 1 in bit 0. All others have RANGE 0.
    pub currents: u8,
}

impl FixedPort {
    /// Returns a port like this module with this number of channels.
    pub(crate) const fn new(module: Module, channels: u8) -> Self {
        Self {
            module,
            or: None,
            channels,
            currents: 0,
        }
    }

    /// Returns the port with another module that MODULE may choose.
    pub(crate) const fn or(mut self, module: Module) -> Self {
        self.or = Some(module);
        self
    }

    /// Returns the port with analog inputs for a current.
    pub(crate) const fn currents(mut self, channels: u8) -> Self {
        self.currents = channels;
        self
    }

    /// Returns the number of the module's channels that the port does not have.
    #[must_use]
    pub const fn lacks(&self) -> u8 {
        CHANNELS as u8 - self.channels
    }

    /// Returns whether MODULE may have this value.
    #[must_use]
    pub fn takes(&self, code: u16) -> bool {
        code == self.module.code() || self.or.is_some_and(|module| code == module.code())
    }

    /// Returns the kinds of the points with this module.
    #[must_use]
    pub fn kinds(&self, module: Module) -> [Kind; 4] {
        let mut kinds = module.points();
        if let Some(missing) = kinds.get_mut(self.channels.into()..) {
            missing.fill(Kind::None);
        }
        kinds
    }

    /// Returns the only value of RANGE of a channel, 0 to 3, with this kind of point.
    #[must_use]
    pub fn range(&self, channel: u16, kind: Kind) -> u16 {
        match kind {
            Kind::WordInput => u16::from(self.currents >> (channel & 7) & 1),
            _ => 0,
        }
    }
}
