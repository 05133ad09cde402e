//! Identity and state, 0x0200 to 0x025F: read-only registers.

use core::fmt;

use crate::block::block;
use crate::codes::{ChannelStatus, ModuleState};
use crate::rule::Rule;
use crate::value::Value;
use crate::{Module, Row};

const READ: Rule = Rule::read_only();

/// Value of PRODUCT_CODE.
pub const PRODUCT: u32 = 0x2383_5860;

/// Value of MAP_VERSION: the version of this map.
pub const MAP_VERSION_VALUE: u16 = 2;

/// Bits of STATUS.
pub mod status {
    /// The communication watchdog has tripped. Stays set until COMMAND 5 or a restart.
    pub const COMM_WATCHDOG: u16 = 1 << 0;
    /// The configuration stored at the start was damaged, or a part of it was rejected: defaults are in force
    /// instead.
    pub const STORED_INVALID: u16 = 1 << 1;
    /// A module has a fault. The radio counts as a module while it is on.
    pub const MODULE_FAULT: u16 = 1 << 2;
    /// The configuration has been changed but not saved.
    pub const UNSAVED: u16 = 1 << 3;
    /// A saved change waits for a restart.
    pub const RESTART_NEEDED: u16 = 1 << 4;
    /// The configuration is unlocked.
    pub const UNLOCKED: u16 = 1 << 5;
    /// The crystal does not run; the internal oscillator is in use.
    pub const INTERNAL_OSCILLATOR: u16 = 1 << 6;

    /// Every bit with its name.
    pub const NAMES: &[(u8, &str)] = &[
        (0, "communication watchdog tripped"),
        (1, "stored configuration invalid"),
        (2, "a module has a fault"),
        (3, "configuration not saved"),
        (4, "restart needed"),
        (5, "configuration unlocked"),
        (6, "internal oscillator in use"),
    ];
}

/// Bits of RESET_CAUSE: the flags of the RCC (RM0008 7.3.10, from bit 26 on), in reverse order.
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
    /// The reset pin, which every reset pulls low.
    pub const PIN: u16 = 1 << 5;

    /// Every bit with its name.
    pub const NAMES: &[(u8, &str)] = &[
        (0, "low power"),
        (1, "window watchdog"),
        (2, "independent watchdog"),
        (3, "software"),
        (4, "power-on"),
        (5, "pin"),
    ];
}

/// Bits of BUILD. Bit 0: the sources differ from the commit.
pub mod build {
    /// The running image is signed with the development key.
    pub const DEVELOPMENT_SIGNED: u16 = 1 << 1;
    /// There is no loader, so nothing is signed.
    pub const NO_LOADER: u16 = 1 << 2;
    /// The loader accepts the development key.
    pub const DEVELOPMENT_TRUSTED: u16 = 1 << 3;
    /// The version is not a release: the release with these numbers comes later.
    pub const PRE_RELEASE: u16 = 1 << 4;

    /// Every bit with its name.
    pub const NAMES: &[(u8, &str)] = &[
        (0, "sources differ from the commit"),
        (1, "signed with the development key"),
        (2, "no loader"),
        (3, "the loader accepts the development key"),
        (4, "no release"),
    ];
}

/// Returns the version that FIRMWARE_VERSION, FIRMWARE_PATCH and BUILD hold, as the firmware writes it in texts: `0.3.0`,
/// or `0.3.0-dev` where [`build::PRE_RELEASE`] says that it is no release.
pub fn version([version, patch]: [u16; 2], build: u16) -> impl fmt::Display {
    fmt::from_fn(move |f| {
        let [major, minor] = version.to_be_bytes();
        let no_release = build & build::PRE_RELEASE != 0;
        let suffix = if no_release { "-dev" } else { "" };
        write!(f, "{major}.{minor}.{patch}{suffix}")
    })
}

/// Bits of UPDATE.
pub mod update {
    /// The slot that runs: 1 A, 2 B, 0 no loader.
    pub const SLOT: u16 = 0b11;
    /// Lowest bit of the code of the other slot's state, bits 2 to 4.
    pub const OTHER_SHIFT: u32 = 2;
    /// The running image is on trial.
    pub const TRIAL: u16 = 1 << 5;
    /// SW01 = 254 chose the running slot.
    pub const SWITCHED: u16 = 1 << 6;
}

block! {
    "Identity and state", 0x0200..=0x025F;

    /// 0x23835860
    PRODUCT_CODE "product code": 0x0200 x 2, Value::Opaque, READ;
    /// 256 * major + minor
    FIRMWARE_VERSION "firmware version": 0x0202 x 1, Value::NUMBER, READ;
    /// Patch level
    FIRMWARE_PATCH "firmware patch level": 0x0203 x 1, Value::NUMBER, READ;
    /// This map
    MAP_VERSION "register-map version": 0x0204 x 1, Value::NUMBER, READ;
    /// Board
    BOARD "board": 0x0205 x 1, Value::Codes(&Row::NAMES), READ;
    /// DIP switch at the start
    UNIT_ADDRESS "unit address": 0x0206 x 1, Value::NUMBER, READ;
    /// Why the device last started
    RESET_CAUSE "reset cause": 0x0207 x 1, Value::Bits(reset_cause::NAMES), READ;
    /// Time since the start
    UPTIME "uptime": 0x0208 x 2, Value::long("s"), READ;
    /// State of the device
    STATUS "status": 0x020A x 1, Value::Bits(status::NAMES), READ;
    /// Least free stack since the start
    STACK_FREE "free stack": 0x020B x 1, Value::number("By"), READ;
    /// First 32 bits; 0 = not known
    COMMIT "commit": 0x020C x 2, Value::Opaque, READ;
    /// How the firmware was built
    BUILD "build": 0x020E x 1, Value::Bits(build::NAMES), READ;
    /// CRC-16 of file 1
    DESCRIPTION_CRC "description CRC": 0x020F x 1, Value::Opaque, READ;
    /// It changes at a restart
    MODULE_IN_FORCE "module in force": 0x0210 x 8, Value::Codes(Module::NAMES), READ;
    /// State of the module
    MODULE_STATE "module state": 0x0218 x 8, Value::Codes(ModuleState::NAMES), READ;
    /// 96 bits
    UNIQUE_ID "unique device identity": 0x0220 x 6, Value::Opaque, READ;
    /// Time since the start
    UPTIME_MS "uptime ms": 0x0226 x 2, Value::long("ms"), READ;
    /// For function 70
    SERIAL_NUMBER "serial number": 0x0228 x 2, Value::Opaque, READ;
    /// Bits 0-1 running slot, 2-4 state of the other slot, 5 trial, 6 SW01 = 254
    UPDATE "update": 0x022A x 1, Value::Opaque, READ;
    /// Good frames; counters wrap
    BUS_MESSAGES "bus messages": 0x0230 x 1, Value::NUMBER, READ;
    /// Bad CRC or character, too short or too long
    BUS_ERRORS "bus communication errors": 0x0231 x 1, Value::NUMBER, READ;
    /// Exceptions, broadcasts included
    EXCEPTIONS "exceptions sent": 0x0232 x 1, Value::NUMBER, READ;
    /// Messages, broadcasts included
    UNIT_MESSAGES "messages for this unit": 0x0233 x 1, Value::NUMBER, READ;
    /// Messages without a response
    NO_RESPONSES "no response": 0x0234 x 1, Value::NUMBER, READ;
    /// Exceptions 07 sent
    NAKS "NAK": 0x0235 x 1, Value::NUMBER, READ;
    /// Exceptions 06 sent
    BUSY "busy": 0x0236 x 1, Value::NUMBER, READ;
    /// Messages lost by it
    OVERRUNS "character overruns": 0x0237 x 1, Value::NUMBER, READ;
    /// Gaps above t1.5 inside frames
    T15_GAPS "inter-character gaps": 0x0238 x 1, Value::NUMBER, READ;
    /// State of the channel
    CHANNEL_STATUS "channel status": 0x0240 x 32, Value::Codes(ChannelStatus::NAMES), READ;
}
