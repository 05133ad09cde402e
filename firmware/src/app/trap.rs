//! What happens when the program is wrong, or the crystal dies: outputs safe, a note of what it was for
//! the next start, and a reset. Nothing here relies on the interrupted program being sound, or on there
//! being any stack left.
//!
//! | trap | noted as |
//! |---|---|
//! | panic | panic; there is none in a release image, see `cargo xtask build` |
//! | HardFault, to which every other fault of the core escalates | hard fault, or stack overflow |
//! | NMI | crystal failed: the clock security system is all that raises it (RM0008 7.2.7, table 63) |
//! | an interrupt without a handler | hard fault with CFSR 0 |
//!
//! Safe is: the lines of all slots floating and the RS-485 driver off. An analog module's DAC is out of reach
//! and keeps its last codes until the next start writes them.

use core::{arch::naked_asm, panic::PanicInfo, ptr};

use board_support::{
    fault::{self, Fault, Kind},
    outputs_off, restart, stack,
};
use cortex_m::{interrupt, peripheral::SCB};

unsafe extern "C" {
    /// The stack's ends, placed by memory.x.
    static _stack_end: u32;
    static _stack_start: u32;
}

/// Bytes of stack that [`on_trap`] may use, with what it calls.
const ROOM: u32 = 512;

/// Words of the frame that an exception stacks (PM0056 2.3.7).
const FRAME_WORDS: u32 = 8;
const FRAME_LR: usize = 5;
const FRAME_PC: usize = 6;

/// The numbers of the exceptions in ICSR (PM0056 4.4.3).
const NMI: u32 = 2;

#[panic_handler]
fn panic(_info: &PanicInfo<'_>) -> ! {
    interrupt::disable();
    let kind = Kind::Panic;
    end(Fault {
        kind,
        ..Fault::default()
    })
}

/// The entry of all the traps: on a stack that is at its end the first push of an ordinary function
/// would fault again, and lock the core up. So first of all, unless the stack pointer is good and has
/// [`ROOM`] below it, it goes back to the top; nothing returns to what lies there. Then `on_trap` with
/// the stack pointer as the exception left it.
// SAFETY: cortex-m-rt's vector table has this name for the exception. It never returns.
#[unsafe(no_mangle)]
#[unsafe(naked)]
unsafe extern "C" fn HardFault() -> ! {
    naked_asm!(
        // No interrupt comes between any more.
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

// SAFETY: as above; the name of every vector that has no handler of its own.
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
    end(Fault {
        kind,
        pc,
        lr,
        status,
        address,
    })
}

fn end(fault: Fault) -> ! {
    outputs_off();
    fault::note(fault);
    restart()
}

/// Where the program was, from the frame the exception stacked; `None` when it cannot have been stacked
/// whole.
fn interrupted(stack_pointer: u32) -> Option<(u32, u32)> {
    let whole = stack_pointer >= stack::bottom()
        && stack_pointer <= stack::top().saturating_sub(FRAME_WORDS * 4)
        && stack_pointer.is_multiple_of(4);
    let frame = stack_pointer as *const u32;
    // SAFETY: eight words of the stack, which is RAM; what they hold may be anything. This function's own
    // stack is below them, or starts over at the top while they are at the bottom.
    whole.then(|| unsafe {
        (
            ptr::read_volatile(frame.add(FRAME_PC)),
            ptr::read_volatile(frame.add(FRAME_LR)),
        )
    })
}

/// The address whose access failed, 0 when it is not known (PM0056 4.4.11 to 4.4.14).
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
