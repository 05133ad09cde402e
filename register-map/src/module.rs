//! The kinds of I/O module that a slot can contain, with their codes and names.

use core::fmt;
use core::str::FromStr;

use crate::kind::Kind::{self, BitInput, BitOutput, WordInput, WordOutput};

/// Declares the modules: one row for each with its description, its code, its name, and the kinds of the four points of
/// its port.
macro_rules! modules {
    ($(#[doc = $about:literal] $variant:ident = $code:literal $name:literal $points:expr;)+) => {
        /// The module in a slot: the value of a MODULE register, and a name for `--module`.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[repr(u8)]
        pub enum Module {
            $(#[doc = $about] $variant = $code,)+
        }

        impl Module {
            /// Every module, in the order of the codes.
            pub const ALL: [Self; Self::NAMES.len()] = [$(Self::$variant),+];

            /// Every code with the module's name.
            pub const NAMES: &'static [(u16, &'static str)] = &[$(($code, $name)),+];

            /// Returns the kinds of the four points of this module's port.
            // Not inlined: one table serves every caller.
            #[inline(never)]
            #[must_use]
            pub const fn points(self) -> [Kind; 4] {
                match self {
                    $(Self::$variant => $points,)+
                }
            }

            /// Returns the module with this code, if there is one.
            #[must_use]
            pub const fn from_code(code: u16) -> Option<Self> {
                match code {
                    $($code => Some(Self::$variant),)+
                    _ => None,
                }
            }

            /// Returns the name on a command line and in JSON.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)+
                }
            }

            /// Returns what the module is, for people.
            #[must_use]
            pub const fn about(self) -> &'static str {
                match self {
                    $(Self::$variant => $about.trim_ascii(),)+
                }
            }
        }
    };
}

modules! {
    /// An empty slot, or a port without a slot.
    None = 0 "none" [Kind::None; 4];
    /// Four isolated digital inputs.
    Di4 = 1 "4di" [BitInput; 4];
    /// Four open-collector digital outputs.
    Do4 = 2 "4do" [BitOutput; 4];
    /// Two relays, each with a jumper for manual operation.
    Relay2 = 3 "2relay" [BitInput, BitInput, BitOutput, BitOutput];
    /// Four analog inputs.
    Ai4 = 4 "4ai" [WordInput; 4];
    /// Four analog outputs.
    Ao4 = 5 "4ao" [WordOutput; 4];
    /// Two analog inputs and two analog outputs.
    Ai2Ao2 = 6 "2ai2ao" [WordInput, WordInput, WordOutput, WordOutput];
}

impl Module {
    /// The largest code.
    pub const LAST: u16 = Self::NAMES.len() as u16 - 1;

    /// Returns the code of this module in the MODULE registers, 0 to [`LAST`](Self::LAST).
    #[must_use]
    pub const fn code(self) -> u16 {
        self as u16
    }
}

impl fmt::Display for Module {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Error for a name that is not that of a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownModule;

impl fmt::Display for UnknownModule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("not a module; one of")?;
        for (i, module) in Module::ALL.iter().enumerate() {
            write!(f, "{} {module}", if i == 0 { "" } else { "," })?;
        }
        Ok(())
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
    fn a_module_is_found_by_its_code_and_its_name() {
        for (code, module) in (0..).zip(Module::ALL) {
            assert_eq!(module.code(), code);
            assert_eq!(Module::from_code(code), Some(module));
            assert_eq!(module.name().parse(), Ok(module));
        }
        assert_eq!(Module::from_code(Module::LAST + 1), None);
        assert_eq!("4DI".parse::<Module>(), Err(UnknownModule));
    }
}
