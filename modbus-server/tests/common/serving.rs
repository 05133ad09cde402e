//! The reference's reading and writing of points.

use super::Points;
use super::reference::identify;

/// Serves the PDU of a request that reads or writes points, or identification.
pub fn answer(points: &mut Points, pdu: &[u8]) -> Result<Vec<u8>, u8> {
    let function = pdu[0];
    match function {
        1..=4 => {
            if pdu.len() != 5 {
                return Err(3);
            }
            read(points, function, field(pdu, 1), field(pdu, 3))
        }
        5 | 6 => write_one(points, pdu),
        15 | 16 => write_many(points, pdu),
        22 => {
            if pdu.len() != 7 {
                return Err(3);
            }
            let at = field(pdu, 1);
            let there = writable(points, points.words.len());
            if at >= there {
                return Err(2);
            }
            // What cannot be read cannot be masked.
            points.state.map_or(Ok(()), |state| Err(state.code()))?;
            let now = usize::from(points.words[at]);
            let [and, or] = [3, 5].map(|from| field(pdu, from));
            let value = (now & and) | (or & (0xFFFF - and));
            if !allowed(points, value) {
                return Err(3);
            }
            points.words[at] = value as u16;
            Ok(pdu.to_vec())
        }
        23 => read_and_write(points, pdu),
        0x2B => identify(points, pdu),
        _ => Err(1),
    }
}

fn field(pdu: &[u8], at: usize) -> usize {
    pdu[at] as usize * 256 + pdu[at + 1] as usize
}

fn allowed(points: &Points, word: usize) -> bool {
    word <= points.max_word as usize
}

fn writable(points: &Points, there: usize) -> usize {
    there.min(points.read_only_from as usize)
}

fn read(points: &Points, function: u8, start: usize, count: usize) -> Result<Vec<u8>, u8> {
    let bits = function < 3;
    if count == 0 || count > if bits { 2000 } else { 125 } {
        return Err(3);
    }
    let bit_table = if function == 2 {
        &points.input_bits
    } else {
        &points.bits
    };
    let word_table = if function == 4 {
        &points.input_words
    } else {
        &points.words
    };
    let there = if bits {
        bit_table.len()
    } else {
        word_table.len()
    };
    if start + count > there {
        return Err(2);
    }
    points.state.map_or(Ok(()), |state| Err(state.code()))?;
    let mut data = vec![0; if bits { count.div_ceil(8) } else { count * 2 }];
    for n in 0..count {
        if bits && bit_table[start + n] {
            data[n / 8] += 1 << (n % 8);
        }
        if !bits {
            data[2 * n] = (word_table[start + n] / 256) as u8;
            data[2 * n + 1] = (word_table[start + n] % 256) as u8;
        }
    }
    Ok([vec![function, data.len() as u8], data].concat())
}

fn write_one(points: &mut Points, pdu: &[u8]) -> Result<Vec<u8>, u8> {
    let bit = pdu[0] == 5;
    if pdu.len() != 5 || (bit && field(pdu, 3) != 0 && field(pdu, 3) != 0xFF00) {
        return Err(3);
    }
    let there = if bit {
        points.bits.len()
    } else {
        points.words.len()
    };
    if field(pdu, 1) >= writable(points, there) {
        return Err(2);
    }
    if !bit && !allowed(points, field(pdu, 3)) {
        return Err(3);
    }
    points.state.map_or(Ok(()), |state| Err(state.code()))?;
    if bit {
        points.bits[field(pdu, 1)] = field(pdu, 3) != 0;
    } else {
        points.words[field(pdu, 1)] = field(pdu, 3) as u16;
    }
    Ok(pdu.to_vec())
}

/// Start and count of a multiple write that can be done.
fn check_many(points: &Points, pdu: &[u8], bits: bool, limit: usize) -> Result<(), u8> {
    let (start, count) = (field(pdu, 1), field(pdu, 3));
    let bytes = if bits { count.div_ceil(8) } else { count * 2 };
    if count == 0 || count > limit || pdu[5] as usize != bytes || pdu.len() != 6 + bytes {
        return Err(3);
    }
    let there = if bits {
        points.bits.len()
    } else {
        points.words.len()
    };
    if start + count > writable(points, there) {
        return Err(2);
    }
    Ok(())
}

fn write_many(points: &mut Points, pdu: &[u8]) -> Result<Vec<u8>, u8> {
    let bits = pdu[0] == 15;
    if pdu.len() < 6 {
        return Err(3);
    }
    check_many(points, pdu, bits, if bits { 1968 } else { 123 })?;
    let count = field(pdu, 3);
    if !bits && (0..count).any(|n| !allowed(points, field(pdu, 6 + 2 * n))) {
        return Err(3);
    }
    points.state.map_or(Ok(()), |state| Err(state.code()))?;
    for n in 0..count {
        if bits {
            points.bits[field(pdu, 1) + n] = pdu[6 + n / 8] & (1 << (n % 8)) != 0;
        } else {
            points.words[field(pdu, 1) + n] = field(pdu, 6 + 2 * n) as u16;
        }
    }
    Ok(pdu[..5].to_vec())
}

/// Form of both halves, then the addresses of both, then values, then the write and the read.
fn read_and_write(points: &mut Points, pdu: &[u8]) -> Result<Vec<u8>, u8> {
    if pdu.len() < 10 {
        return Err(3);
    }
    let (start, count) = (field(pdu, 1), field(pdu, 3));
    let write = [&[16], &pdu[5..]].concat();
    if count == 0 || count > 125 {
        return Err(3);
    }
    check_many(points, &write, false, 121)?;
    if start + count > points.words.len() {
        return Err(2);
    }
    write_many(points, &write)?;
    read(points, 23, start, count)
}
