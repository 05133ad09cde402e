//! Device identification (V1.1b3 6.21).

use super::fault::Fault;

fn objects() -> Vec<(u8, Vec<u8>)> {
    let texts = [
        "reference",
        "R1",
        "1.0",
        "url",
        "product",
        "model",
        "application",
    ];
    let mut all: Vec<(u8, Vec<u8>)> = (0..)
        .zip(texts)
        .map(|(id, text)| (id, text.as_bytes().to_vec()))
        .collect();
    // Together they take three replies.
    all.extend((0x80..=0x84).map(|id| (id, vec![b'x'; 120])));
    all
}

pub fn answer(pdu: &[u8], fault: Option<Fault>) -> Result<Vec<u8>, u8> {
    let [_, mei, ref rest @ ..] = *pdu else {
        return Err(3);
    };
    if mei != 0x0E {
        return Err(if fault == Some(Fault::Mei03) { 3 } else { 1 });
    }
    let [code, from, ref spare @ ..] = *rest else {
        return Err(3);
    };
    if !spare.is_empty() && fault != Some(Fault::IgnoresSpareBytes) {
        return Err(3);
    }
    let last = match code {
        0 if fault == Some(Fault::TakesReadCode0) => 2,
        1 => 2,
        2 => 0x7F,
        3 | 4 => 0xFF,
        _ => return Err(3),
    };
    let of_code: Vec<_> = objects()
        .into_iter()
        .filter(|object| object.0 <= last)
        .collect();
    let known = of_code.iter().position(|object| object.0 == from);
    let mut reply = vec![0x0E, code, 0x83, 0, 0, 0];
    if code == 4 {
        let unknown = if fault == Some(Fault::Object03) { 3 } else { 2 };
        let (id, value) = &of_code[known.ok_or(unknown)?];
        reply[5] = 1;
        reply.extend([*id, value.len() as u8]);
        reply.extend(value);
        if fault == Some(Fault::IndividualDiffers) {
            *reply.last_mut().unwrap() ^= 1;
        }
        return Ok(reply);
    }
    let zero = fault == Some(Fault::StreamsFromZero) && from < 0x80;
    let start = known.filter(|_| !zero).unwrap_or(0);
    if fault == Some(Fault::RefusesUnknownStart) && known.is_none() {
        return Err(2);
    }
    for (id, value) in &of_code[start..] {
        // One byte more is the function code.
        let full = reply.len() + 2 + value.len() > 252;
        if full && fault != Some(Fault::NeverSplits) {
            (reply[3], reply[4]) = (0xFF, *id);
            break;
        }
        reply[5] += 1;
        reply.extend([*id, value.len() as u8]);
        reply.extend(value);
    }
    reply[5] += u8::from(fault == Some(Fault::CountsObjectsWrong));
    Ok(reply)
}
