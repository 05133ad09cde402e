//! Handles panics, faults and a failure of the crystal: sets the outputs to a safe state, notes the cause for the
//! next start, and resets the device. Nothing here relies on the interrupted program or on free space on the stack.
//!
//! | trap | noted as |
//! |---|---|
//! | panic | panic; a release image contains none, see `cargo xtask build` |
//! | HardFault; every other fault of the core escalates to it | hard fault, or stack overflow |
//! | NMI | crystal failed; only the clock security system raises the NMI (RM0008 7.2.7, table 63) |
//! | an interrupt without a handler | hard fault with CFSR 0 |
//!
//! In the safe state the lines of all slots float and the RS-485 driver is off. The handlers cannot reach the DAC
//! of an analog module; it keeps its last codes until the next start writes them.

use core::{arch::naked_asm, panic::PanicInfo, ptr};

use board_support::{
    fault::{self, Fault, Kind},
    kept, outputs_off, restart, stack,
};
use cortex_m::{interrupt, peripheral::SCB};

unsafe extern "C" {
    /// End of the stack, defined by memory.x.
    static _stack_end: u32;
    static _stack_start: u32;
}

/// Bytes of stack that [`on_trap`] and the functions it calls may use.
const ROOM: u32 = 512;

/// Number of words in the frame that an exception stacks (PM0056 2.3.7).
const FRAME_WORDS: u32 = 8;
const FRAME_LR: usize = 5;
const FRAME_PC: usize = 6;

/// Exception numbers in ICSR (PM0056 4.4.3).
const NMI: u32 = 2;

#[panic_handler]
fn panic(_info: &PanicInfo<'_>) -> ! {
    interrupt::disable();
    end(&Fault {
        kind: Kind::Panic,
        place: [0; 4],
    })
}

/// Entry point of all traps. When the stack is exhausted, the first push of an ordinary function would fault again
/// and lock the core up. Therefore this code first sets the stack pointer back to the top, unless it is valid with
/// at least [`ROOM`] bytes below it; nothing returns to the data that is overwritten. Then it calls `on_trap` with
/// the stack pointer as the exception left it.
// SAFETY: cortex-m-rt's vector table has this name for the exception. The function never returns.
#[unsafe(no_mangle)]
#[unsafe(naked)]
unsafe extern "C" fn HardFault() -> ! {
    naked_asm!(
        // Disable all interrupts.
        "cpsid i",
        "mov r0, sp",
        "ldr r1, ={end}",
        "ldr r2, ={start}",
        "add r1, r1, #{room}",
        "cmp r0, r1",
        "blo 1f",
        "cmp r0, r2",
        "bls 2f",
        "1: mov sp, r2",
        "2: b {on_trap}",
        end = sym _stack_end,
        start = sym _stack_start,
        room = const ROOM,
        on_trap = sym on_trap,
    )
}

// SAFETY: as above.
#[unsafe(no_mangle)]
#[unsafe(naked)]
unsafe extern "C" fn NonMaskableInt() -> ! {
    naked_asm!("b {entry}", entry = sym HardFault)
}

// SAFETY: as above; cortex-m-rt uses this name for every vector without a separate handler.
#[unsafe(no_mangle)]
#[unsafe(naked)]
unsafe extern "C" fn DefaultHandler() -> ! {
    naked_asm!("b {entry}", entry = sym HardFault)
}

extern "C" fn on_trap(stack_pointer: u32) -> ! {
    outputs_off();
    let (pc, lr) = interrupted(stack_pointer).unwrap_or_default();
    // SAFETY: reading the core's fault registers has no side effect.
    let scb = unsafe { &*SCB::PTR };
    let status = scb.cfsr.read();
    let address = failed_address(scb, status);
    let kind = if scb.icsr.read() & 0x1FF == NMI {
        Kind::Crystal
    } else if fault::is_stack_overflow(stack_pointer, stack::bottom(), address) {
        Kind::StackOverflow
    } else {
        Kind::HardFault
    };
    end(&Fault {
        kind,
        place: [pc, lr, status, address],
    })
}

fn end(fault: &Fault) -> ! {
    outputs_off();
    kept::note(fault);
    restart()
}

/// Returns where the program was, from the frame that the exception stacked, or `None` when the frame cannot be
/// complete.
fn interrupted(stack_pointer: u32) -> Option<(u32, u32)> {
    let whole = stack_pointer >= stack::bottom()
        && stack_pointer <= stack::top().saturating_sub(FRAME_WORDS * 4)
        && stack_pointer.is_multiple_of(4);
    let frame = stack_pointer as *const u32;
    // SAFETY: these are eight words of the stack, which is RAM and may hold any values. This function's own stack
    // lies below them. After a stack overflow it starts again at the top, while they are at the bottom.
    whole.then(|| unsafe {
        (
            ptr::read_volatile(frame.add(FRAME_PC)),
            ptr::read_volatile(frame.add(FRAME_LR)),
        )
    })
}

/// Returns the address whose access failed, or 0 when it is not known (PM0056 4.4.11 to 4.4.14).
fn failed_address(scb: &cortex_m::peripheral::scb::RegisterBlock, status: u32) -> u32 {
    const MMAR_VALID: u32 = 1 << 7;
    const BFAR_VALID: u32 = 1 << 15;
    if status & BFAR_VALID != 0 {
        scb.bfar.read()
    } else if status & MMAR_VALID != 0 {
        scb.mmfar.read()
    } else {
        0
    }
}
