//! What the firmware did that no real board would take well, or that the simulator cannot answer truly.
//!
//! Such an access is recorded, never quietly answered with zero. The same finding at the same program
//! counter is kept once and counted, so that a loop of a million bad reads stays readable.

use core::fmt;

use crate::time::Time;

/// How wide an access was.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Width {
    /// 8 bits.
    Byte,
    /// 16 bits.
    Half,
    /// 32 bits.
    Word,
}

/// What was wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum What {
    /// A register or a feature that the simulator does not have, by the name its model gives it.
    Unmodelled {
        /// The address accessed.
        address: u32,
        /// Whether it was a write.
        write: bool,
        /// The register or feature.
        name: &'static str,
    },
    /// No memory and no block answers here: a bus fault on the part.
    NoSuchAddress {
        /// The address accessed.
        address: u32,
        /// Whether it was a write.
        write: bool,
    },
    /// The block's clock is off in RCC (RM0008 7.3.6 to 7.3.8): reads give 0, writes are lost.
    Unclocked {
        /// The address accessed.
        address: u32,
        /// Whether it was a write.
        write: bool,
        /// The block.
        block: &'static str,
    },
    /// An access of a width or alignment that the block does not take.
    OddAccess {
        /// The address accessed.
        address: u32,
        /// The width used.
        width: Width,
        /// The block.
        block: &'static str,
    },
    /// A read of flash by code in SRAM while flash is erased or programmed: the code waits for the end of the operation
    /// (PM0075 2.3.1), although it is in SRAM so that it does not wait.
    StalledRead {
        /// The address read.
        address: u32,
    },
    /// A half-word could not be programmed, or a key was wrong, ... (PM0075).
    Flash(&'static str),
    /// Anything else, in words.
    Other(&'static str),
    /// The core locked up: a fault inside the hard fault or NMI handler.
    LockedUp,
}

/// One thing that was wrong, and where the firmware was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Finding {
    /// When it first happened.
    pub at: Time,
    /// The address of the instruction that did it.
    pub pc: u32,
    /// What it was.
    pub what: What,
    /// How many times it has happened at this `pc`.
    pub count: u64,
}

impl fmt::Display for What {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let verb = |write| if write { "write to" } else { "read of" };
        match *self {
            Self::Unmodelled {
                address,
                write,
                name,
            } => write!(
                f,
                "{} {address:#010x}: not modelled or not allowed: {name}",
                verb(write)
            ),
            Self::NoSuchAddress { address, write } => {
                write!(
                    f,
                    "{} {address:#010x}: nothing there, bus fault",
                    verb(write)
                )
            }
            Self::Unclocked {
                address,
                write,
                block,
            } => write!(
                f,
                "{} {address:#010x}: the clock of {block} is off in RCC",
                verb(write)
            ),
            Self::OddAccess {
                address,
                width,
                block,
            } => write!(
                f,
                "access to {address:#010x}: {block} takes no {width:?} access there"
            ),
            Self::StalledRead { address } => write!(
                f,
                "read of {address:#010x}: code in SRAM reads flash while flash is erased or programmed"
            ),
            Self::Flash(text) => write!(f, "flash: {text}"),
            Self::Other(text) => f.write_str(text),
            Self::LockedUp => f.write_str("the core locked up"),
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: pc {:#010x}: {}", self.at, self.pc, self.what)?;
        if self.count > 1 {
            write!(f, " ({} times)", self.count)?;
        }
        Ok(())
    }
}

/// Findings kept: a firmware gone wild makes no more sense after these.
const KEPT: usize = 1_000;

/// The findings of a board, in the order they first happened.
#[derive(Clone, Debug, Default)]
pub struct Findings {
    list: Vec<Finding>,
}

impl Findings {
    /// Records `what`, done at `at` by the instruction at `pc`; nothing once there are [`KEPT`] of them.
    pub fn add(&mut self, at: Time, pc: u32, what: What) {
        for finding in &mut self.list {
            if finding.pc == pc && finding.what == what {
                finding.count += 1;
                return;
            }
        }
        if self.list.len() < KEPT {
            self.list.push(Finding {
                at,
                pc,
                what,
                count: 1,
            });
        }
    }

    /// Returns everything recorded so far.
    #[must_use]
    pub fn as_slice(&self) -> &[Finding] {
        &self.list
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_repeated_finding_is_counted_not_repeated() {
        let mut findings = Findings::default();
        let what = What::Unclocked {
            address: 0x4001_3800,
            write: true,
            block: "USART1",
        };
        findings.add(Time::from_us(3), 0x0800_0100, what);
        findings.add(Time::from_us(4), 0x0800_0100, what);
        findings.add(Time::from_us(5), 0x0800_0102, what);
        let list = findings.as_slice();
        assert_eq!(list.len(), 2);
        assert_eq!((list[0].count, list[0].at), (2, Time::from_us(3)));
        assert_eq!(
            list[0].to_string(),
            "0.000003 s: pc 0x08000100: write to 0x40013800: the clock of USART1 is off in RCC (2 times)"
        );
    }
}
