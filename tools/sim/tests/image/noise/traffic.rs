//! Valid requests, and their effect on a unit with four outputs.

use fastrand::Rng;

use crate::rig::FIRST;

/// Expected states of the outputs of unit 1.
#[derive(Clone, Debug, Default)]
pub struct Outputs(pub [bool; 4]);

impl Outputs {
    fn byte(&self, first: usize, count: usize) -> u8 {
        let bits = self.0[first..first + count].iter().rev();
        bits.fold(0, |byte, on| byte << 1 | u8::from(*on))
    }

    /// Switches all outputs off. Returns the PDU of this write.
    pub fn all_off(&mut self) -> [u8; 7] {
        self.0 = [false; 4];
        [15, 0, FIRST, 0, 4, 1, 0]
    }
}

/// Returns a write that changes at least one output: the PDU without unit address, and the outputs after it.
pub fn write(rng: &mut Rng, outputs: &Outputs) -> (Vec<u8>, Outputs) {
    let mut after = outputs.clone();
    if rng.bool() {
        let point = rng.u8(0..4);
        let on = &mut after.0[usize::from(point)];
        *on = !*on;
        let value = if *on { 0xFF } else { 0 };
        return (vec![5, 0, FIRST + point, value, 0], after);
    }
    let count = rng.u8(1..=4);
    let first = rng.u8(0..=4 - count);
    let (from, number) = (usize::from(first), usize::from(count));
    for on in &mut after.0[from..from + number] {
        *on = rng.bool();
    }
    after.0[from] = !outputs.0[from];
    let bits = after.byte(from, number);
    (vec![15, 0, FIRST + first, 0, count, 1, bits], after)
}

/// Returns a valid request and its reply, if there is one, each as unit address and PDU. Applies the request to
/// `outputs`.
pub fn request(rng: &mut Rng, outputs: &mut Outputs) -> (Vec<u8>, Option<Vec<u8>>) {
    let with = |unit: u8, pdu: &[u8]| [&[unit], pdu].concat();
    let (unit, pdu, reply) = match rng.u8(0..12) {
        // Reads of the outputs show whether a write that should have been ignored changed them.
        0..=3 => {
            let count = rng.u8(1..=4);
            let first = rng.u8(0..=4 - count);
            let bits = outputs.byte(usize::from(first), usize::from(count));
            let function = rng.u8(1..=2);
            let pdu = vec![function, 0, FIRST + first, 0, count];
            (1, pdu, Some(vec![function, 1, bits]))
        }
        4 | 5 => {
            let (pdu, after) = write(rng, outputs);
            *outputs = after;
            let echo = pdu[..5].to_vec();
            (1, pdu, Some(echo))
        }
        6 => {
            let (pdu, after) = write(rng, outputs);
            *outputs = after;
            (0, pdu, None)
        }
        7 => (rng.u8(2..=247), write(rng, outputs).0, None),
        8 => {
            let code = [0x23, 0x83, 0x58, 0x60];
            (1, vec![3, 2, 0, 0, 2], Some([&[3, 4], &code[..]].concat()))
        }
        9 => {
            // Random data, usually only a little: a frame may have up to 256 bytes with unit, function, sub-function
            // and CRC.
            let most = if rng.u8(0..20) == 0 { 249 } else { 8 };
            let data: Vec<u8> = (0..rng.usize(2..=most)).map(|_| rng.u8(..)).collect();
            let pdu = [&[8, 0, 0], &data[..]].concat();
            (1, pdu.clone(), Some(pdu))
        }
        10 => (1, vec![3, 2, 0, 0, 0], Some(vec![0x83, 3])),
        _ => (1, vec![1, 0, FIRST + 3, 0, 2], Some(vec![0x81, 2])),
    };
    (with(unit, &pdu), reply.map(|reply| with(1, &reply)))
}
