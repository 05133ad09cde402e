//! The commands that a module takes in sleep (manual 7).

use super::{Parameters, timing};
use f103::time::Time;

/// Head of a command that stores parameters, and of an answer with them.
const STORED: u8 = 0xC0;
/// Head of a command that sets parameters until the next start.
const TEMPORARY: u8 = 0xC2;
/// Answer to C3 C3 C3: the head, 0x32 for 433 MHz, a version, and 0x10 for a TTL interface plus 20 dBm.
const VERSION: [u8; 4] = [0xC3, 0x32, 0x10, 0x24];

/// A command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Command {
    /// Set the parameters, kept without power or not.
    Set { parameters: Parameters, kept: bool },
    /// Answer the parameters.
    Read,
    /// Answer the version.
    Version,
    /// Reset the module.
    Reset,
}

impl Command {
    /// Returns the command that these bytes are, all of them.
    pub(super) fn of(bytes: &[u8]) -> Option<Self> {
        match *bytes {
            [head @ (STORED | TEMPORARY), a, b, c, d, e] => Some(Self::Set {
                parameters: Parameters::from_bytes([a, b, c, d, e]),
                kept: head == STORED,
            }),
            [0xC1, 0xC1, 0xC1] => Some(Self::Read),
            [0xC3, 0xC3, 0xC3] => Some(Self::Version),
            [0xC4, 0xC4, 0xC4] => Some(Self::Reset),
            _ => None,
        }
    }

    /// Returns the time from the end of the command to its answer, or to the reset.
    pub(super) fn duration(self) -> Time {
        match self {
            Self::Set { kept: true, .. } => timing::STORE,
            Self::Set { .. } | Self::Read | Self::Version => timing::ANSWER,
            Self::Reset => Time::ZERO,
        }
    }
}

/// The parameters of a module: those in force, and those that it keeps without power.
#[derive(Clone, Copy, Debug)]
pub(super) struct Memory {
    pub(super) stored: Parameters,
    pub(super) in_force: Parameters,
    /// Whether the command C2 has set those in force.
    pub(super) temporary: bool,
}

impl Memory {
    /// Returns a memory with these parameters stored and in force.
    pub(super) const fn new(stored: Parameters) -> Self {
        Self {
            stored,
            in_force: stored,
            temporary: false,
        }
    }

    /// Puts the stored parameters in force, as at power-on.
    pub(super) fn restart(&mut self) {
        *self = Self::new(self.stored);
    }

    /// Carries out a command. Returns its answer; empty for a reset, which the module does.
    pub(super) fn carry_out(&mut self, command: Command) -> Vec<u8> {
        match command {
            Command::Set { parameters, kept } => {
                self.in_force = parameters;
                self.temporary = !kept;
                if kept {
                    self.stored = parameters;
                }
                self.answer()
            }
            Command::Read => self.answer(),
            Command::Version => VERSION.to_vec(),
            Command::Reset => Vec::new(),
        }
    }

    /// Returns the parameters in force, as the module answers them.
    fn answer(&self) -> Vec<u8> {
        let head = if self.temporary { TEMPORARY } else { STORED };
        [&[head][..], &self.in_force.bytes()].concat()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_complete_commands_are_commands() {
        for bytes in [
            &[][..],
            &[0xC1, 0xC1],
            &[0xC1, 0xC1, 0xC1, 0xC1],
            &[0xC1, 0xC1, 0xC3],
            &[0xC0, 0, 0, 0x1A, 0x17],
            &[0xC0, 0, 0, 0x1A, 0x17, 0x44, 0],
            &[0xC5, 0, 0, 0x1A, 0x17, 0x44],
        ] {
            assert_eq!(Command::of(bytes), None, "{bytes:02X?}");
        }
        assert_eq!(Command::of(&[0xC3; 3]), Some(Command::Version));
        assert_eq!(Command::of(&[0xC4; 3]), Some(Command::Reset));
    }

    #[test]
    fn parameters_set_with_c2_are_answered_with_c2_and_lost_at_a_restart() {
        let mut memory = Memory::new(Parameters::FACTORY);
        let do_it = |memory: &mut Memory, bytes: &[u8]| {
            let command = Command::of(bytes).expect("a command");
            memory.carry_out(command)
        };
        let set = [0xC2, 0x12, 0x34, 0x3D, 0x1F, 0x40];
        assert_eq!(do_it(&mut memory, &set), set);
        assert_eq!(do_it(&mut memory, &[0xC1; 3]), set);
        memory.restart();
        let factory = [0xC0, 0x00, 0x00, 0x1A, 0x17, 0x44];
        assert_eq!(do_it(&mut memory, &[0xC1; 3]), factory);
        let set = [0xC0, 0x12, 0x34, 0x3D, 0x1F, 0x40];
        assert_eq!(do_it(&mut memory, &set), set);
        memory.restart();
        assert_eq!(do_it(&mut memory, &[0xC1; 3]), set);
    }
}
