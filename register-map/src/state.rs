//! Identity and state, 0x0200 to 0x025F: registers to read.

use crate::Module;
use crate::block::block;
use crate::codes::{ChannelStatus, ModuleState};
use crate::rule::Rule;

const READ: Rule = Rule::read_only();

/// The value of PRODUCT_CODE.
pub const PRODUCT: u32 = 0x2383_5860;

/// The value of MAP_VERSION: the version of this map.
pub const MAP_VERSION_VALUE: u16 = 1;

/// The value of BOARD for the modio-02.
pub const BOARD_MODIO_02: u16 = 1;

/// The bits of STATUS.
pub mod status {
    /// The communication watchdog has tripped. Stays until COMMAND 5 or a restart.
    pub const COMM_WATCHDOG: u16 = 1 << 0;
    /// What was stored at the start was not good, all of it or a part: defaults are in force for that.
    pub const STORED_INVALID: u16 = 1 << 1;
    /// A module has a fault.
    pub const MODULE_FAULT: u16 = 1 << 2;
    /// The configuration has been changed but not saved.
    pub const UNSAVED: u16 = 1 << 3;
    /// A saved change waits for a restart.
    pub const RESTART_NEEDED: u16 = 1 << 4;
    /// The configuration is unlocked.
    pub const UNLOCKED: u16 = 1 << 5;
    /// The crystal does not run; the internal oscillator is in use.
    pub const INTERNAL_OSCILLATOR: u16 = 1 << 6;
}

/// The bits of RESET_CAUSE: the flags of the RCC (RM0008 7.3.10, from bit 26 on), the highest first.
pub mod reset_cause {
    /// Low-power management.
    pub const LOW_POWER: u16 = 1 << 0;
    /// The window watchdog.
    pub const WINDOW_WATCHDOG: u16 = 1 << 1;
    /// The independent watchdog.
    pub const INDEPENDENT_WATCHDOG: u16 = 1 << 2;
    /// The software.
    pub const SOFTWARE: u16 = 1 << 3;
    /// Power-on, or a brown-out.
    pub const POWER_ON: u16 = 1 << 4;
    /// The reset pin; every reset pulls it, too.
    pub const PIN: u16 = 1 << 5;
}

block! {
    "Identity and state", 0x0200..=0x025F;

    /// 0x2383 0x5860, high word first
    PRODUCT_CODE "product code": 0x0200 x 2, "", READ, &[];
    /// Firmware version: major << 8 or minor
    FIRMWARE_VERSION "firmware version": 0x0202 x 1, "", READ, &[];
    /// Firmware patch level
    FIRMWARE_PATCH "firmware patch level": 0x0203 x 1, "", READ, &[];
    /// Version of this register map: 1
    MAP_VERSION "register-map version": 0x0204 x 1, "", READ, &[];
    /// Board: 1 = modio-02
    BOARD "board": 0x0205 x 1, "", READ, &[];
    /// Unit address in force, as the DIP switch was at the start
    UNIT_ADDRESS "unit address": 0x0206 x 1, "", READ, &[];
    /// Why the device last started. Bit 0 low power, 1 window watchdog, 2 independent watchdog, 3 software, 4 power-on, 5 pin
    RESET_CAUSE "reset cause": 0x0207 x 1, "", READ, &[];
    /// Time since the start, high word first
    UPTIME "uptime": 0x0208 x 2, "s", READ, &[];
    /// Bit 0 communication watchdog tripped, 1 stored configuration was invalid (defaults in force), 2 a module has a fault,
    /// 3 configuration changed but not saved, 4 a saved change waits for a restart, 5 configuration unlocked, 6 internal oscillator in use
    STATUS "status": 0x020A x 1, "", READ, &[];
    /// Least stack that has been left free since the start
    STACK_FREE "free stack": 0x020B x 1, "bytes", READ, &[];
    /// The commit that the firmware was built from, its first 32 bits, high word first; 0 when that is not known
    COMMIT "commit": 0x020C x 2, "", READ, &[];
    /// How the firmware was built. Bit 0 from sources with changes that are not in the commit, 1 signed with the
    /// development key, 2 not signed
    BUILD "build": 0x020E x 1, "", READ, &[];
    /// By port: the module in force
    MODULE_IN_FORCE "module in force": 0x0210 x 8, "", READ, &Module::NAMES;
    /// By port: how the module fares
    MODULE_STATE "module state": 0x0218 x 8, "", READ, ModuleState::NAMES;
    /// 96 bits that no other device has
    UNIQUE_ID "unique device identity": 0x0220 x 6, "", READ, &[];
    /// Messages seen on the bus with a good CRC; all line counters wrap
    BUS_MESSAGES "bus messages": 0x0230 x 1, "", READ, &[];
    /// Frames with a bad CRC, a character error or fewer than 3 bytes
    BUS_ERRORS "bus communication errors": 0x0231 x 1, "", READ, &[];
    /// Exceptions, those to broadcasts included
    EXCEPTIONS "exceptions sent": 0x0232 x 1, "", READ, &[];
    /// Messages for this unit, broadcasts included
    UNIT_MESSAGES "messages for this unit": 0x0233 x 1, "", READ, &[];
    /// Messages for this unit that got no response, broadcasts included
    NO_RESPONSES "no response": 0x0234 x 1, "", READ, &[];
    /// Negative acknowledges sent
    NAKS "NAK": 0x0235 x 1, "", READ, &[];
    /// Busy exceptions (06) sent
    BUSY "busy": 0x0236 x 1, "", READ, &[];
    /// Messages lost to a character overrun
    OVERRUNS "character overruns": 0x0237 x 1, "", READ, &[];
    /// Gaps above t1.5 between the characters of a frame
    T15_GAPS "inter-character gaps": 0x0238 x 1, "", READ, &[];
    /// By point: how the channel fares
    CHANNEL_STATUS "channel status": 0x0240 x 32, "", READ, ChannelStatus::NAMES;
}
