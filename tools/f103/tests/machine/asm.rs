//! A small Thumb-2 assembler that keeps the programs of these tests readable.
//!
//! Registers are `r0` to `r7`. `set`, `store` and the wait functions overwrite `r0`, `r1` and `r2`.

use f103::Image;

/// Address of the first instruction, after a vector table with room for the 16 + 60 entries of the largest part.
const CODE: u32 = 0x0800_0140;
const STACK: u32 = 0x2000_5000;

/// Condition of a branch.
#[derive(Clone, Copy)]
pub enum When {
    Always,
    Equal,
    NotEqual,
}

/// Target of a backward branch.
#[derive(Clone, Copy)]
pub struct Label(usize);

/// A forward branch whose target is not known yet.
pub struct Forward(usize, When);

/// A program under construction, at [`CODE`] in flash or anywhere in SRAM.
pub struct Asm {
    base: u32,
    code: Vec<u16>,
    vectors: Vec<(usize, u32)>,
}

impl Asm {
    /// Returns an empty program in flash, with a vector table.
    pub fn new() -> Self {
        Self::at(CODE)
    }

    /// Returns an empty piece of code that runs at `base`.
    pub fn at(base: u32) -> Self {
        Self {
            base,
            code: Vec::new(),
            vectors: Vec::new(),
        }
    }

    /// Returns the address of the next instruction.
    pub fn address(&self) -> u32 {
        self.base + 2 * self.code.len() as u32
    }

    pub fn here(&self) -> Label {
        Label(self.code.len())
    }

    /// Makes the following code the handler of exception `number` (3 = hard fault, 15 = SysTick, 16 + n = interrupt n).
    pub fn handler(&mut self, number: usize) {
        self.vectors.push((number, self.address() | 1));
    }

    pub fn raw(&mut self, halfword: u16) {
        self.code.push(halfword);
    }

    pub fn nop(&mut self) {
        self.raw(0xBF00);
    }

    pub fn wfi(&mut self) {
        self.raw(0xBF30);
    }

    /// `rd = value`: MOVW, MOVT.
    pub fn set(&mut self, rd: u16, value: u32) {
        for (opcode, half) in [(0xF240, value & 0xFFFF), (0xF2C0, value >> 16)] {
            let half = half as u16;
            self.raw(opcode | (half >> 11 & 1) << 10 | half >> 12);
            self.raw((half >> 8 & 7) << 12 | rd << 8 | half & 0xFF);
        }
    }

    /// `rt = [rn + offset]`, a word.
    pub fn ldr(&mut self, rt: u16, rn: u16, offset: u16) {
        self.raw(0x6800 | (offset / 4) << 6 | rn << 3 | rt);
    }

    /// `[rn + offset] = rt`, a word.
    pub fn str(&mut self, rt: u16, rn: u16, offset: u16) {
        self.raw(0x6000 | (offset / 4) << 6 | rn << 3 | rt);
    }

    /// `[rn + offset] = rt`, a half-word.
    pub fn strh(&mut self, rt: u16, rn: u16, offset: u16) {
        self.raw(0x8000 | (offset / 2) << 6 | rn << 3 | rt);
    }

    /// `rd += value`, up to 255.
    pub fn add(&mut self, rd: u16, value: u16) {
        self.raw(0x3000 | rd << 8 | value);
    }

    /// Compares `rn` with `value`, up to 255.
    pub fn cmp(&mut self, rn: u16, value: u16) {
        self.raw(0x2800 | rn << 8 | value);
    }

    /// Sets the flags of `rn & rm`.
    pub fn tst(&mut self, rn: u16, rm: u16) {
        self.raw(0x4200 | rm << 3 | rn);
    }

    /// `rd ^= rm`.
    pub fn eor(&mut self, rd: u16, rm: u16) {
        self.raw(0x4040 | rm << 3 | rd);
    }

    /// Branches to the address in `rm`; register 14 is the link register.
    pub fn bx(&mut self, rm: u16) {
        self.raw(0x4700 | rm << 3);
    }

    /// Calls the address in `rm`.
    pub fn blx(&mut self, rm: u16) {
        self.raw(0x4780 | rm << 3);
    }

    pub fn branch(&mut self, when: When, to: Label) {
        let at = self.code.len();
        self.raw(encode(when, to.0 as i32 - at as i32 - 2));
    }

    pub fn forward(&mut self, when: When) -> Forward {
        self.nop();
        Forward(self.code.len() - 1, when)
    }

    pub fn land(&mut self, from: Forward) {
        let distance = self.code.len() as i32 - from.0 as i32 - 2;
        self.code[from.0] = encode(from.1, distance);
    }

    /// An endless loop whose instructions are counted.
    pub fn spin(&mut self) {
        let top = self.here();
        self.nop();
        self.branch(When::Always, top);
    }

    /// `[address] = value`, a word.
    pub fn store(&mut self, address: u32, value: u32) {
        self.set(0, address);
        self.set(1, value);
        self.str(1, 0, 0);
    }

    /// `[to] = [from]`, a word.
    pub fn copy(&mut self, from: u32, to: u32) {
        self.set(0, from);
        self.ldr(1, 0, 0);
        self.set(0, to);
        self.str(1, 0, 0);
    }

    /// Waits until a bit of `mask` in `[address]` is set.
    pub fn wait_set(&mut self, address: u32, mask: u32) {
        self.set(0, address);
        self.set(2, mask);
        let top = self.here();
        self.ldr(1, 0, 0);
        self.tst(1, 2);
        self.branch(When::Equal, top);
    }

    /// Returns the bytes of the code without the vector table.
    pub fn bytes(&self) -> Vec<u8> {
        self.code
            .iter()
            .flat_map(|half| half.to_le_bytes())
            .collect()
    }

    /// Returns the program with its vector table. Exceptions without a handler loop endlessly.
    pub fn image(mut self) -> Image {
        let idle = self.address() | 1;
        self.raw(0xE7FE);
        let mut table = vec![idle; 80];
        table[0] = STACK;
        table[1] = CODE | 1;
        for &(number, address) in &self.vectors {
            table[number] = address;
        }
        let mut bytes: Vec<u8> = table.iter().flat_map(|word| word.to_le_bytes()).collect();
        bytes.extend(self.bytes());
        Image::from_bytes(&bytes).expect("the program fits")
    }
}

fn encode(when: When, distance: i32) -> u16 {
    let short = |code: u16| {
        assert!((-128..128).contains(&distance), "branch too far");
        code | (distance as u16 & 0xFF)
    };
    match when {
        When::Always => 0xE000 | (distance as u16 & 0x7FF),
        When::Equal => short(0xD000),
        When::NotEqual => short(0xD100),
    }
}
