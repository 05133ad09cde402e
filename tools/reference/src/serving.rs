//! Reads and writes of the device.

use crate::Device;
use crate::server::identify;

/// Serves the PDU of a request that reads or writes points, or identification.
pub fn answer(device: &mut Device, pdu: &[u8]) -> Result<Vec<u8>, u8> {
    let function = pdu[0];
    match function {
        1..=4 => {
            if pdu.len() != 5 {
                return Err(3);
            }
            read(device, function, field(pdu, 1), field(pdu, 3))
        }
        5 | 6 => write_one(device, pdu),
        15 | 16 => write_many(device, pdu),
        22 => {
            if pdu.len() != 7 {
                return Err(3);
            }
            let at = field(pdu, 1);
            let there = writable(device, device.words.len());
            if at >= there {
                return Err(2);
            }
            // A register that cannot be read cannot be masked.
            device.state.map_or(Ok(()), Err)?;
            let now = usize::from(device.words[at]);
            let [and, or] = [3, 5].map(|from| field(pdu, from));
            let value = (now & and) | (or & (0xFFFF - and));
            if !allowed(device, value) {
                return Err(3);
            }
            device.words[at] = value as u16;
            Ok(pdu.to_vec())
        }
        23 => read_and_write(device, pdu),
        20 => read_files(device, pdu),
        21 => write_files(device, pdu),
        0x2B => identify(device, pdu),
        _ => Err(1),
    }
}

fn field(pdu: &[u8], at: usize) -> usize {
    pdu[at] as usize * 256 + pdu[at + 1] as usize
}

fn allowed(device: &Device, word: usize) -> bool {
    word <= device.max_word as usize
}

fn writable(device: &Device, there: usize) -> usize {
    there.min(device.read_only_from as usize)
}

fn read(device: &Device, function: u8, start: usize, count: usize) -> Result<Vec<u8>, u8> {
    let bits = function < 3;
    if count == 0 || count > if bits { 2000 } else { 125 } {
        return Err(3);
    }
    let bit_table = if function == 2 {
        &device.input_bits
    } else {
        &device.bits
    };
    let word_table = if function == 4 {
        &device.input_words
    } else {
        &device.words
    };
    let there = if bits {
        bit_table.len()
    } else {
        word_table.len()
    };
    if start + count > there {
        return Err(2);
    }
    device.state.map_or(Ok(()), Err)?;
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

fn write_one(device: &mut Device, pdu: &[u8]) -> Result<Vec<u8>, u8> {
    let bit = pdu[0] == 5;
    if pdu.len() != 5 || (bit && field(pdu, 3) != 0 && field(pdu, 3) != 0xFF00) {
        return Err(3);
    }
    let there = if bit {
        device.bits.len()
    } else {
        device.words.len()
    };
    if field(pdu, 1) >= writable(device, there) {
        return Err(2);
    }
    if !bit && !allowed(device, field(pdu, 3)) {
        return Err(3);
    }
    device.state.map_or(Ok(()), Err)?;
    if bit {
        device.bits[field(pdu, 1)] = field(pdu, 3) != 0;
    } else {
        device.words[field(pdu, 1)] = field(pdu, 3) as u16;
    }
    Ok(pdu.to_vec())
}

/// Start and count of a multiple write that is valid.
fn check_many(device: &Device, pdu: &[u8], bits: bool, limit: usize) -> Result<(), u8> {
    let (start, count) = (field(pdu, 1), field(pdu, 3));
    let bytes = if bits { count.div_ceil(8) } else { count * 2 };
    if count == 0 || count > limit || pdu[5] as usize != bytes || pdu.len() != 6 + bytes {
        return Err(3);
    }
    let there = if bits {
        device.bits.len()
    } else {
        device.words.len()
    };
    if start + count > writable(device, there) {
        return Err(2);
    }
    Ok(())
}

fn write_many(device: &mut Device, pdu: &[u8]) -> Result<Vec<u8>, u8> {
    let bits = pdu[0] == 15;
    if pdu.len() < 6 {
        return Err(3);
    }
    check_many(device, pdu, bits, if bits { 1968 } else { 123 })?;
    let count = field(pdu, 3);
    if !bits && (0..count).any(|n| !allowed(device, field(pdu, 6 + 2 * n))) {
        return Err(3);
    }
    device.state.map_or(Ok(()), Err)?;
    for n in 0..count {
        if bits {
            device.bits[field(pdu, 1) + n] = pdu[6 + n / 8] & (1 << (n % 8)) != 0;
        } else {
            device.words[field(pdu, 1) + n] = field(pdu, 6 + 2 * n) as u16;
        }
    }
    Ok(pdu[..5].to_vec())
}

/// Checks the form of both halves, then the addresses of both, then the values. Then writes and reads.
fn read_and_write(device: &mut Device, pdu: &[u8]) -> Result<Vec<u8>, u8> {
    if pdu.len() < 10 {
        return Err(3);
    }
    let (start, count) = (field(pdu, 1), field(pdu, 3));
    let write = [&[16], &pdu[5..]].concat();
    if count == 0 || count > 125 {
        return Err(3);
    }
    check_many(device, &write, false, 121)?;
    if start + count > device.words.len() {
        return Err(2);
    }
    write_many(device, &write)?;
    read(device, 23, start, count)
}

/// The groups of a request of function 20 or 21: reference type, file, first record, count, and where its data begin.
fn groups(pdu: &[u8]) -> Result<Vec<[usize; 5]>, u8> {
    let (least, most) = if pdu[0] == 20 { (7, 245) } else { (9, 251) };
    if pdu.len() < 2 || pdu[1] < least || pdu[1] > most || pdu.len() != 2 + pdu[1] as usize {
        return Err(3);
    }
    let mut groups = Vec::new();
    let mut at = 2;
    while at < pdu.len() {
        if at + 7 > pdu.len() {
            return Err(3);
        }
        let count = field(pdu, at + 5);
        groups.push([
            pdu[at] as usize,
            field(pdu, at + 1),
            field(pdu, at + 3),
            count,
            at + 7,
        ]);
        at += if pdu[0] == 20 { 7 } else { 7 + 2 * count };
        if count == 0 || at > pdu.len() {
            return Err(3);
        }
    }
    Ok(groups)
}

/// Checks that all groups exist; `writing`: and that they can be written.
fn check_groups(device: &Device, groups: &[[usize; 5]], writing: bool) -> Result<(), u8> {
    for [reference, file, record, count, _] in groups {
        if *reference != 6 || *file == 0 || record + count > 10_000 {
            return Err(2);
        }
        let Some(file) = device.files.get(file - 1) else {
            return Err(2);
        };
        let there = if writing {
            writable(device, file.len())
        } else {
            file.len()
        };
        if record + count > there {
            return Err(2);
        }
    }
    Ok(())
}

fn read_files(device: &Device, pdu: &[u8]) -> Result<Vec<u8>, u8> {
    if device.files.is_empty() {
        return Err(1);
    }
    let groups = groups(pdu)?;
    let length: usize = groups.iter().map(|group| 2 + 2 * group[3]).sum();
    if 2 + length > 253 {
        return Err(3);
    }
    check_groups(device, &groups, false)?;
    device.state.map_or(Ok(()), Err)?;
    let mut reply = vec![20, length as u8];
    for [_, file, record, count, _] in groups {
        reply.extend([1 + 2 * count as u8, 6]);
        for word in &device.files[file - 1][record..record + count] {
            reply.extend(word.to_be_bytes());
        }
    }
    Ok(reply)
}

fn write_files(device: &mut Device, pdu: &[u8]) -> Result<Vec<u8>, u8> {
    if device.files.is_empty() {
        return Err(1);
    }
    let groups = groups(pdu)?;
    check_groups(device, &groups, true)?;
    let words = |[_, _, _, count, at]: [usize; 5]| (0..count).map(move |n| field(pdu, at + 2 * n));
    if !groups
        .iter()
        .all(|group| words(*group).all(|word| allowed(device, word)))
    {
        return Err(3);
    }
    device.state.map_or(Ok(()), Err)?;
    for group in groups {
        for (n, word) in words(group).enumerate() {
            device.files[group[1] - 1][group[2] + n] = word as u16;
        }
    }
    Ok(pdu.to_vec())
}
