//! Tests of the module and the air.

mod air;
mod host;
mod modes;
mod packets;
