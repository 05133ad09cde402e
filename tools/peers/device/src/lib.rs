//! Shared by all rivals: a mailbox in RAM, in which the bench writes a request and reads the response.

#![no_std]

use core::{
    hint,
    panic::PanicInfo,
    ptr,
    sync::atomic::{AtomicU32, Ordering},
};

use peers::{LONGEST, Server};

/// Exchanges requests and responses between the bench and a rival. Little-endian, without padding.
#[repr(C)]
pub struct Mailbox {
    /// Length of the request; 0 when there is none.
    request_len: AtomicU32,
    response_len: AtomicU32,
    request: [u8; LONGEST],
    response: [u8; LONGEST],
}

// SAFETY: nothing else has this name, by which the bench finds it.
#[unsafe(export_name = "MAILBOX")]
static mut MAILBOX: Mailbox = Mailbox {
    request_len: AtomicU32::new(0),
    response_len: AtomicU32::new(0),
    request: [0; LONGEST],
    response: [0; LONGEST],
};

/// Serves requests forever.
pub fn run(mut server: impl Server) -> ! {
    // SAFETY: this function does not return and only `main` calls it, so there is one reference. The bench writes
    // to the mailbox only while the request's length is 0, and reads it only at `bench_end`.
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
        let len = server.answer(request, &mut mailbox.response).unwrap_or(0);
        bench_end();
        mailbox.response_len.store(len as u32, Ordering::Relaxed);
        mailbox.request_len.store(0, Ordering::Release);
    }
}

/// The bench counts from the address of this function.
#[unsafe(no_mangle)]
#[inline(never)]
extern "C" fn bench_begin() {
    hint::black_box(());
    // SAFETY: does nothing. It makes this function differ from the other one; otherwise the linker would merge
    // them.
    unsafe { core::arch::asm!("nop") }
}

/// The bench counts up to the address of this function.
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

/// The bench detects that this function is called.
#[unsafe(no_mangle)]
#[inline(never)]
extern "C" fn bench_panicked() -> ! {
    loop {
        hint::spin_loop();
    }
}
