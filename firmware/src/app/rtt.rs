//! The RTT control block that a probe or the simulator looks for in RAM, with one channel up.
//!
//! As `rtt_target::rtt_init!` does it, but for the panic there when it is called twice: a release image
//! has none.

use core::{
    ffi::CStr,
    mem::MaybeUninit,
    ptr::{addr_of_mut, slice_from_raw_parts_mut},
    sync::atomic::{AtomicBool, Ordering},
};

use rtt_target::{
    ChannelMode, UpChannel,
    rtt::{RttChannel, RttHeader},
};

/// Bytes of log that wait for a reader.
const SIZE: usize = 512;
const NAME: &CStr = c"Terminal";

#[repr(C)]
struct ControlBlock {
    header: RttHeader,
    up: [RttChannel; 1],
}

// SAFETY: nothing else has this name, by which readers find the block in the image.
#[unsafe(export_name = "_SEGGER_RTT")]
static mut CONTROL_BLOCK: MaybeUninit<ControlBlock> = MaybeUninit::zeroed();
static mut BUFFER: [u8; SIZE] = [0; SIZE];
static OPEN: AtomicBool = AtomicBool::new(false);

/// Opens the channel, which leaves out what no longer fits; `None` when it is open already.
pub fn open() -> Option<UpChannel> {
    if OPEN.swap(true, Ordering::Relaxed) {
        return None;
    }
    // SAFETY: this comes here once, so nothing else refers to the block and the buffer, which last for
    // ever. All zeros are a good block, with neither magic number nor channels. Pointer and length are
    // those of the buffer. The header is last: it is what a reader goes by.
    unsafe {
        let block = addr_of_mut!(CONTROL_BLOCK).cast::<ControlBlock>();
        let channel = addr_of_mut!((*block).up).cast::<RttChannel>();
        let buffer = slice_from_raw_parts_mut(addr_of_mut!(BUFFER).cast(), SIZE);
        (*channel).init(NAME.as_ptr().cast(), ChannelMode::NoBlockSkip, buffer);
        (*block).header.init(1, 0);
        Some(UpChannel::new(channel))
    }
}
