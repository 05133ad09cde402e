//! The RTT control block, which a debug probe or the simulator finds in RAM, with one up channel.
//!
//! This does the same as `rtt_target::rtt_init!`, but that macro panics when it is called twice, and a release
//! image must not contain a panic.

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

/// Bytes of log kept for the reader.
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

/// Opens the channel, which discards text that does not fit. Returns `None` when it is already open.
pub fn open() -> Option<UpChannel> {
    if OPEN.swap(true, Ordering::Relaxed) {
        return None;
    }
    // SAFETY: this code runs only once, so nothing else refers to the block and the buffer, which are statics. All
    // zeros are a valid block, without a magic number or channels. Pointer and length are those of the buffer. The
    // header is written last, because readers look for it.
    unsafe {
        let block = addr_of_mut!(CONTROL_BLOCK).cast::<ControlBlock>();
        let channel = addr_of_mut!((*block).up).cast::<RttChannel>();
        let buffer = slice_from_raw_parts_mut(addr_of_mut!(BUFFER).cast(), SIZE);
        (*channel).init(NAME.as_ptr().cast(), ChannelMode::NoBlockSkip, buffer);
        (*block).header.init(1, 0);
        Some(UpChannel::new(channel))
    }
}
