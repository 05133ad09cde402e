//! What every rival has in common: a mailbox in RAM, where the bench leaves a request and finds the
//! response, and the data that is served.

#![no_std]

use core::{
    hint,
    panic::PanicInfo,
    ptr,
    sync::atomic::{AtomicU32, Ordering},
};

/// Unit address of every rival.
pub const UNIT: u8 = 1;
/// Bit points that can be read and written, each kind.
pub const BITS: usize = 2000;
/// Word points that can be read and written, each kind.
pub const WORDS: usize = 128;
/// The longest ADU.
pub const ADU: usize = 256;

/// Where the bench and a rival meet. Little-endian, without padding.
#[repr(C)]
pub struct Mailbox {
    /// Not 0: there is a request.
    request_len: AtomicU32,
    response_len: AtomicU32,
    request: [u8; ADU],
    response: [u8; ADU],
}

// SAFETY: nothing else has this name, by which the bench finds it.
#[unsafe(export_name = "MAILBOX")]
static mut MAILBOX: Mailbox = Mailbox {
    request_len: AtomicU32::new(0),
    response_len: AtomicU32::new(0),
    request: [0; ADU],
    response: [0; ADU],
};

/// Serves what comes, for ever: `serve` gets a complete frame, CRC included, and leaves the complete
/// response, CRC included, whose length it gives; 0 for none.
pub fn run(mut serve: impl FnMut(&[u8], &mut [u8; ADU]) -> usize) -> ! {
    // SAFETY: this does not return and is called by `main` alone, so there is one reference. The bench
    // writes to the mailbox only while the request's length is 0, and looks at its end below.
    let mailbox = unsafe { &mut *ptr::addr_of_mut!(MAILBOX) };
    loop {
        let len = mailbox.request_len.load(Ordering::Acquire) as usize;
        if len == 0 {
            continue;
        }
        bench_begin();
        let request = hint::black_box(&mailbox.request)
            .get(..len)
            .unwrap_or_default();
        let len = serve(request, &mut mailbox.response);
        bench_end();
        mailbox.response_len.store(len as u32, Ordering::Relaxed);
        mailbox.request_len.store(0, Ordering::Release);
    }
}

/// Its address is where the counting begins.
#[unsafe(no_mangle)]
#[inline(never)]
extern "C" fn bench_begin() {
    hint::black_box(());
    // SAFETY: does nothing, but tells this function from the other, or they would be one.
    unsafe { core::arch::asm!("nop") }
}

/// Its address is where the counting ends.
#[unsafe(no_mangle)]
#[inline(never)]
extern "C" fn bench_end() {
    // SAFETY: as above.
    unsafe { core::arch::asm!("nop", "nop") }
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    bench_panicked()
}

/// The bench looks out for it.
#[unsafe(no_mangle)]
#[inline(never)]
extern "C" fn bench_panicked() -> ! {
    loop {
        hint::spin_loop();
    }
}
