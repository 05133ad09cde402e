//! Classifies Thumb-2 instructions by their costs. The encodings are in the ARMv7-M ARM (DDI 0403E), A5.

/// Classes of instructions with different costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// An instruction of one cycle.
    Simple,
    /// A load of one register.
    Load,
    /// A load relative to the program counter, so from the code itself.
    Literal,
    /// TBB, TBH: a load from the code and a branch.
    Table,
    /// A store of one register.
    Store,
    /// A load or store of this number of registers.
    Multiple(u32),
    /// MLA, MLS.
    Accumulate,
    /// SMULL, UMULL.
    LongMultiply,
    /// SMLAL, UMLAL.
    LongAccumulate,
    /// SDIV, UDIV.
    Divide,
    /// CPS, MSR, MRS.
    System,
    /// DMB, DSB.
    Barrier,
    /// ISB: the following instructions are fetched again.
    Refill,
}

/// Whether and how an instruction ends a segment of code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// It does not: the following instruction is executed next.
    Sequential,
    /// It is a branch, which may be conditional.
    Branch,
    /// It is a branch that may be the return from an exception.
    Return,
    /// It may raise an exception, or enable one that is pending.
    Exception,
}

/// Returns the size in bytes, the class and the end of an instruction. `first` is its first half-word, `second` the
/// half-word after it.
#[must_use]
pub fn decode(first: u16, second: u16) -> (u32, Class, End) {
    if first >> 11 > 0b11100 {
        let (class, end) = wide(u32::from(first), u32::from(second));
        (4, class, end)
    } else {
        let (class, end) = narrow(u32::from(first));
        (2, class, end)
    }
}

/// Returns a load or a store of one register.
const fn access(load: bool) -> (Class, End) {
    let class = if load { Class::Load } else { Class::Store };
    (class, End::Sequential)
}

/// 16-bit encodings, A5.2.
fn narrow(code: u32) -> (Class, End) {
    let simple = (Class::Simple, End::Sequential);
    match code >> 11 {
        0b01000 => special(code),
        0b01001 => (Class::Literal, End::Sequential),
        0b01010 | 0b01011 => access(code >> 9 & 7 >= 3),
        0b01100..=0b10011 => access(code >> 11 & 1 != 0),
        0b10110 | 0b10111 => miscellaneous(code),
        0b11000 | 0b11001 => (Class::Multiple((code & 0xFF).count_ones()), End::Sequential),
        0b11010 | 0b11011 if code >> 8 & 0xF >= 0xE => (Class::Simple, End::Exception),
        0b11010..=0b11100 => (Class::Simple, End::Branch),
        _ => simple,
    }
}

/// Returns the data processing, special data instructions, branch and exchange: A5.2.2, A5.2.3.
fn special(code: u32) -> (Class, End) {
    let to_pc = code & 0x87 == 0x87;
    let end = match code >> 8 & 7 {
        7 if code >> 10 & 1 != 0 => End::Return,
        4 | 6 if to_pc && code >> 10 & 1 != 0 => End::Branch,
        _ => End::Sequential,
    };
    (Class::Simple, end)
}

/// Miscellaneous 16-bit instructions, A5.2.5.
fn miscellaneous(code: u32) -> (Class, End) {
    let several = Class::Multiple((code & 0x1FF).count_ones());
    match code >> 8 & 0xF {
        0x1 | 0x3 | 0x9 | 0xB => (Class::Simple, End::Branch),
        0x4 | 0x5 | 0xC => (several, End::Sequential),
        0xD => (several, End::Return),
        0x6 => (Class::System, End::Exception),
        0xE => (Class::Simple, End::Exception),
        // WFE and WFI. The other encodings are hints and IT.
        0xF if matches!(code & 0xFF, 0x20 | 0x30) => (Class::Simple, End::Exception),
        _ => (Class::Simple, End::Sequential),
    }
}

/// 32-bit encodings, A5.3.
fn wide(first: u32, second: u32) -> (Class, End) {
    match first >> 11 & 3 {
        1 if first >> 9 & 3 == 0 => multiple(first, second),
        2 if second >> 15 != 0 => control(first, second),
        3 => single(first, second),
        _ => (Class::Simple, End::Sequential),
    }
}

/// Load and store multiple, dual and exclusive, table branch: A5.3.5, A5.3.6.
fn multiple(first: u32, second: u32) -> (Class, End) {
    let load = first >> 4 & 1 != 0;
    if first >> 6 & 1 == 0 {
        let end = if load && second >> 15 != 0 {
            End::Return
        } else {
            End::Sequential
        };
        return (Class::Multiple(second.count_ones()), end);
    }
    match (first >> 7 & 3, first >> 4 & 3, second >> 4 & 0xF) {
        (1, 1, 0 | 1) => (Class::Table, End::Branch),
        (0 | 1, 0 | 1, _) => access(load),
        _ => (Class::Multiple(2), End::Sequential),
    }
}

/// Branches and miscellaneous control, A5.3.4.
fn control(first: u32, second: u32) -> (Class, End) {
    if second >> 12 & 5 != 0 || first >> 7 & 7 != 7 {
        return (Class::Simple, End::Branch);
    }
    match first >> 4 & 0x7F {
        0x38 | 0x39 => (Class::System, End::Exception),
        0x3B => match second >> 4 & 0xF {
            4 | 5 => (Class::Barrier, End::Sequential),
            6 => (Class::Refill, End::Exception),
            _ => (Class::Simple, End::Sequential),
        },
        0x3E | 0x3F => (Class::System, End::Sequential),
        _ => (Class::Simple, End::Exception),
    }
}

/// Load and store single, register data processing, multiplication, division: A5.3.7 to A5.3.17.
fn single(first: u32, second: u32) -> (Class, End) {
    let operation = first >> 4 & 0x7F;
    if operation >> 5 == 0 {
        let load = operation & 1 != 0;
        let to_pc = load && operation >> 1 & 3 == 2 && second >> 12 == 0xF;
        let end = if to_pc { End::Return } else { End::Sequential };
        let class = if !load {
            Class::Store
        } else if first & 0xF == 0xF {
            Class::Literal
        } else {
            Class::Load
        };
        return (class, end);
    }
    let class = match operation {
        0x30..=0x37 if second >> 12 != 0xF => Class::Accumulate,
        0x38 | 0x3A => Class::LongMultiply,
        0x39 | 0x3B => Class::Divide,
        0x3C..=0x3F => Class::LongAccumulate,
        _ => Class::Simple,
    };
    (class, End::Sequential)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instructions_have_their_size_class_and_end() {
        use Class::*;
        use End::*;
        // The encodings of an assembler.
        for (text, first, second, expected) in [
            ("movs r0, #1", 0x2001, 0, (2, Simple, Sequential)),
            ("muls r0, r1", 0x4348, 0, (2, Simple, Sequential)),
            ("mov r8, r0", 0x4680, 0, (2, Simple, Sequential)),
            ("mov pc, r0", 0x4687, 0, (2, Simple, Branch)),
            ("cmp r8, r0", 0x4580, 0, (2, Simple, Sequential)),
            ("bx lr", 0x4770, 0, (2, Simple, Return)),
            ("blx r3", 0x4798, 0, (2, Simple, Return)),
            ("ldr r0, [pc, #4]", 0x4801, 0, (2, Literal, Sequential)),
            ("str r0, [r1, r2]", 0x5088, 0, (2, Store, Sequential)),
            ("ldrsb r0, [r1, r2]", 0x5688, 0, (2, Load, Sequential)),
            ("ldr r0, [r1, #4]", 0x6848, 0, (2, Load, Sequential)),
            ("strb r0, [r1, #1]", 0x7048, 0, (2, Store, Sequential)),
            ("ldrh r0, [r1]", 0x8808, 0, (2, Load, Sequential)),
            ("ldr r0, [sp, #4]", 0x9801, 0, (2, Load, Sequential)),
            ("add r0, sp, #4", 0xA801, 0, (2, Simple, Sequential)),
            ("cbz r0, .", 0xB108, 0, (2, Simple, Branch)),
            ("cbnz r0, .", 0xB908, 0, (2, Simple, Branch)),
            ("push {r4, lr}", 0xB510, 0, (2, Multiple(2), Sequential)),
            ("pop {r4, r5}", 0xBC30, 0, (2, Multiple(2), Sequential)),
            ("pop {r4, pc}", 0xBD10, 0, (2, Multiple(2), Return)),
            ("cpsid i", 0xB672, 0, (2, System, Exception)),
            ("bkpt", 0xBE00, 0, (2, Simple, Exception)),
            ("nop", 0xBF00, 0, (2, Simple, Sequential)),
            ("it eq", 0xBF08, 0, (2, Simple, Sequential)),
            ("wfi", 0xBF30, 0, (2, Simple, Exception)),
            ("stm r0!, {r1-r3}", 0xC00E, 0, (2, Multiple(3), Sequential)),
            ("beq .", 0xD0FE, 0, (2, Simple, Branch)),
            ("svc 0", 0xDF00, 0, (2, Simple, Exception)),
            ("b .", 0xE7FE, 0, (2, Simple, Branch)),
            (
                "ldm sp!, {r4, pc}",
                0xE8BD,
                0x8010,
                (4, Multiple(2), Return),
            ),
            ("push {r4-r8}", 0xE92D, 0x01F0, (4, Multiple(5), Sequential)),
            (
                "ldrd r0, r1, [r2]",
                0xE9D2,
                0x0100,
                (4, Multiple(2), Sequential),
            ),
            (
                "strd r0, r1, [r2]",
                0xE9C2,
                0x0100,
                (4, Multiple(2), Sequential),
            ),
            ("ldrex r0, [r1]", 0xE851, 0x0F00, (4, Load, Sequential)),
            ("strex r2, r0, [r1]", 0xE841, 0x0200, (4, Store, Sequential)),
            ("tbb [pc, r0]", 0xE8DF, 0xF000, (4, Table, Branch)),
            ("add.w r0, r1, r2", 0xEB01, 0x0002, (4, Simple, Sequential)),
            ("movw r0, #1", 0xF240, 0x0001, (4, Simple, Sequential)),
            ("bl .", 0xF7FF, 0xFFFE, (4, Simple, Branch)),
            ("b.w .", 0xF7FF, 0xBFFE, (4, Simple, Branch)),
            ("beq.w .", 0xF43F, 0xAFFE, (4, Simple, Branch)),
            ("msr primask, r0", 0xF380, 0x8810, (4, System, Exception)),
            ("mrs r0, primask", 0xF3EF, 0x8010, (4, System, Sequential)),
            ("dsb", 0xF3BF, 0x8F4F, (4, Barrier, Sequential)),
            ("isb", 0xF3BF, 0x8F6F, (4, Refill, Exception)),
            ("clrex", 0xF3BF, 0x8F2F, (4, Simple, Sequential)),
            ("ldr.w r0, [r1, #4]", 0xF8D1, 0x0004, (4, Load, Sequential)),
            ("ldr.w pc, [r1, #4]", 0xF8D1, 0xF004, (4, Load, Return)),
            (
                "ldr.w r0, [pc, #4]",
                0xF8DF,
                0x0004,
                (4, Literal, Sequential),
            ),
            ("ldrb.w r0, [r1, r2]", 0xF811, 0x0002, (4, Load, Sequential)),
            (
                "strh.w r0, [r1, #4]",
                0xF8A1,
                0x0004,
                (4, Store, Sequential),
            ),
            ("lsl.w r0, r1, r2", 0xFA01, 0xF002, (4, Simple, Sequential)),
            ("mul r0, r1, r2", 0xFB01, 0xF002, (4, Simple, Sequential)),
            (
                "mla r0, r1, r2, r3",
                0xFB01,
                0x3002,
                (4, Accumulate, Sequential),
            ),
            (
                "umull r0, r1, r2, r3",
                0xFBA2,
                0x0103,
                (4, LongMultiply, Sequential),
            ),
            (
                "smlal r0, r1, r2, r3",
                0xFBC2,
                0x0103,
                (4, LongAccumulate, Sequential),
            ),
            ("udiv r0, r1, r2", 0xFBB1, 0xF0F2, (4, Divide, Sequential)),
        ] {
            assert_eq!(decode(first, second), expected, "{text}");
        }
    }
}
