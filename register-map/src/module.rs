//! The kinds of I/O module a slot can take, with the codes and names that stand for them.

use core::fmt;
use core::str::FromStr;

use crate::points::PointKind;

/// What is plugged into a slot: the value of a MODULE register, and a `--module` name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
pub enum Module {
    /// An empty slot, or a port that has no slot.
    None = 0,
    /// Four isolated digital inputs.
    Di4 = 1,
    /// Four open-collector digital outputs.
    Do4 = 2,
    /// Two relays, each with a jumper that says whether it is driven by hand.
    Relay2 = 3,
    /// Four analog inputs.
    Ai4 = 4,
    /// Four analog outputs.
    Ao4 = 5,
    /// Two analog inputs and two analog outputs.
    Ai2Ao2 = 6,
}

impl Module {
    /// Every module there is, in the order of the codes.
    pub const ALL: [Self; 7] = [
        Self::None,
        Self::Di4,
        Self::Do4,
        Self::Relay2,
        Self::Ai4,
        Self::Ao4,
        Self::Ai2Ao2,
    ];

    /// Every code with the module's name.
    pub const NAMES: [(u16, &'static str); 7] = {
        let mut names = [(0, ""); 7];
        let mut i = 0;
        while i < names.len() {
            names[i] = (Self::ALL[i].code(), Self::ALL[i].name());
            i += 1;
        }
        names
    };

    /// What this module makes of the four points of its port.
    #[inline]
    #[must_use]
    pub const fn points(self) -> [PointKind; 4] {
        use PointKind::{BitInput, BitOutput, None, WordInput, WordOutput};
        match self {
            Self::None => [None; 4],
            Self::Di4 => [BitInput; 4],
            Self::Do4 => [BitOutput; 4],
            Self::Relay2 => [BitInput, BitInput, BitOutput, BitOutput],
            Self::Ai4 => [WordInput; 4],
            Self::Ao4 => [WordOutput; 4],
            Self::Ai2Ao2 => [WordInput, WordInput, WordOutput, WordOutput],
        }
    }

    /// The code of this module in the MODULE registers, 0 to 6.
    #[must_use]
    pub const fn code(self) -> u16 {
        self as u16
    }

    /// The module with this code, or `None` above 6.
    #[must_use]
    pub const fn from_code(code: u16) -> Option<Self> {
        match code {
            0 => Some(Self::None),
            1 => Some(Self::Di4),
            2 => Some(Self::Do4),
            3 => Some(Self::Relay2),
            4 => Some(Self::Ai4),
            5 => Some(Self::Ao4),
            6 => Some(Self::Ai2Ao2),
            _ => None,
        }
    }

    /// The name on a command line and in JSON: `none`, `4di`, `4do`, `2relay`, `4ai`, `4ao`, `2ai2ao`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Di4 => "4di",
            Self::Do4 => "4do",
            Self::Relay2 => "2relay",
            Self::Ai4 => "4ai",
            Self::Ao4 => "4ao",
            Self::Ai2Ao2 => "2ai2ao",
        }
    }
}

impl fmt::Display for Module {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A name that is no module's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownModule;

impl fmt::Display for UnknownModule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("not a module; one of none, 4di, 4do, 2relay, 4ai, 4ao, 2ai2ao")
    }
}

impl core::error::Error for UnknownModule {}

impl FromStr for Module {
    type Err = UnknownModule;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL
            .into_iter()
            .find(|module| module.name() == name)
            .ok_or(UnknownModule)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_and_names_lead_back_to_the_module() {
        for (code, module) in (0..).zip(Module::ALL) {
            assert_eq!(module.code(), code);
            assert_eq!(Module::from_code(code), Some(module));
            assert_eq!(module.name().parse(), Ok(module));
        }
        assert_eq!(Module::from_code(7), None);
        assert_eq!("4DI".parse::<Module>(), Err(UnknownModule));
    }
}
