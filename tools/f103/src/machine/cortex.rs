//! The configuration of the part's core for crate rigless.

use core::num::{NonZeroU32, NonZeroU64};

use rigless::cpu::armv7m::{Window, processor};
use rigless::emulator::Processor;
use rigless::machine::armv7m::{Config, Core, MpuRegions, Variant};
use rigless::soc::Endian;

use crate::part::Part;

/// Returns the Cortex-M3 of the STM32F103 (PM0056): no MPU, four priority bits.
pub(super) fn m3(part: &Part) -> Box<dyn Processor> {
    // The core's time unit is a cycle of HCLK, so its clock has as many to the second as the unit, a
    // nanosecond by name, does. SysTick's other clock is HCLK / 8 (RM0008 figure 8).
    const UNITS: NonZeroU64 = NonZeroU64::new(1_000_000_000).expect("not 0");
    let core = Core {
        variant: Variant::M3,
        clock_hz: UNITS,
        interrupt_lines: NonZeroU32::new(u32::from(part.interrupt_lines)).expect("not 0"),
        priority_bits: 4,
        refclk_divider: NonZeroU32::new(8).expect("not 0"),
        instructions_per_second: UNITS,
        boot: "flash",
    };
    let window = |base, end| Window {
        base,
        size: end - base,
    };
    // All of the private peripheral bus but the ITM and the system control space.
    let mut config = Config::new(
        core,
        &[
            window(0xE000_1000, 0xE000_E000),
            window(0xE000_F000, 0xE010_0000),
        ],
    );
    config.mpu_regions = MpuRegions::None;
    config.cpuid = part.cpuid;
    match processor(&config, Endian::Little) {
        Ok(core) => core,
        Err(error) => panic!("no core for this host: {error}"),
    }
}
