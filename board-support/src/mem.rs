//! Small versions of the functions that the compiler calls to copy and fill memory.
//!
//! Those of `compiler_builtins` are unrolled for speed and take 1.4 KB of flash, but the image copies only a few
//! hundred bytes at start and a few per request. The versions here work by words (a copy by two) when both addresses
//! are word-aligned, and otherwise by bytes. They are in assembly because a compiler replaces such a loop by a call of
//! `memcpy`. The linker prefers them, because the symbols of `compiler_builtins` are weak.
//!
//! Names and arguments follow the C standard (`memcpy`, `memmove`, `memset`) and the Run-time ABI for the Arm
//! architecture, 4.3.4 (`__aeabi_*`, whose `memset` takes the length before the value). Each function changes only
//! r0 to r3, r12 and the flags.

use core::arch::global_asm;

global_asm!(
    ".macro modio_function names:vararg",
    "  .irp name, \\names",
    "  .global \\name",
    "  .type \\name, %function",
    "  .thumb_func",
    "\\name:",
    "  .endr",
    ".endm",
    // r0: destination, r1: source, r2: number of bytes. Copies upwards, or downwards where copying upwards would
    // overwrite the end of the source.
    ".section .text.modio_copy, \"ax\", %progbits",
    "modio_function memmove, __aeabi_memmove, __aeabi_memmove4, __aeabi_memmove8",
    "  subs r3, r0, r1",
    "  cmp r3, r2",
    "  blo 3f",
    "modio_function memcpy, __aeabi_memcpy, __aeabi_memcpy4, __aeabi_memcpy8",
    "  mov r12, r0",
    "  orr r3, r0, r1",
    "  lsls r3, r3, #30",
    "  bne 2f",
    "1:",
    "  subs r2, #8",
    "  itttt hs",
    "  ldrhs r3, [r1], #4",
    "  strhs r3, [r12], #4",
    "  ldrhs r3, [r1], #4",
    "  strhs r3, [r12], #4",
    "  bhs 1b",
    "  adds r2, #8",
    "2:",
    "  subs r2, #1",
    "  ittt hs",
    "  ldrbhs r3, [r1], #1",
    "  strbhs r3, [r12], #1",
    "  bhs 2b",
    "  bx lr",
    "3:",
    "  subs r2, #1",
    "  ittt hs",
    "  ldrbhs r3, [r1, r2]",
    "  strbhs r3, [r0, r2]",
    "  bhs 3b",
    "  bx lr",
    // r0: destination, r1: number of bytes, r2 (only `__aeabi_memset`): value.
    ".section .text.modio_fill, \"ax\", %progbits",
    "modio_function __aeabi_memclr, __aeabi_memclr4, __aeabi_memclr8",
    "  movs r2, #0",
    "modio_function __aeabi_memset, __aeabi_memset4, __aeabi_memset8",
    "  mov r3, r1",
    "  mov r1, r2",
    "  mov r2, r3",
    // r0: destination, r1: value, r2: number of bytes.
    "modio_function memset",
    "  mov r12, r0",
    "  uxtb r1, r1",
    "  orr r1, r1, r1, lsl #8",
    "  orr r1, r1, r1, lsl #16",
    "  lsls r3, r0, #30",
    "  bne 2f",
    "1:",
    "  subs r2, #4",
    "  itt hs",
    "  strhs r1, [r12], #4",
    "  bhs 1b",
    "  adds r2, #4",
    "2:",
    "  subs r2, #1",
    "  itt hs",
    "  strbhs r1, [r12], #1",
    "  bhs 2b",
    "  bx lr",
    ".text",
    ".purgem modio_function",
);
