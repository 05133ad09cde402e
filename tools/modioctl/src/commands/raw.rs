//! `modioctl raw`.

use crate::bus::{Lost, adu, decode, is_busy};
use crate::cli::Raw;
use crate::device::Device;
use crate::failure::Failure;
use crate::output;

/// Sends a PDU and shows both frames.
pub async fn run(device: &mut Device, options: &Raw) -> Result<(), Failure> {
    let pdu = hex(&options.pdu.concat())?;
    let framing = device.master.endpoint().framing;
    let sent = adu::bytes(framing, &framing.frame(0, device.unit, &pdu));
    output::line(format_args!("-> {sent}  {}", decode::request(&pdu)))?;
    let show = |answer: &[u8]| {
        let frame = adu::bytes(framing, &framing.frame(0, device.unit, answer));
        let words = decode::response(answer, Some(&pdu));
        output::line(format_args!("<- {frame}  {words}"))
    };
    match device.master.ask(device.unit, &pdu).await {
        Ok(answer) => {
            show(&answer)?;
            match answer[..] {
                _ if is_busy(&pdu, &answer) => Err(device.busy(&answer, "the request")),
                [function, code] if function & 0x80 != 0 => {
                    Err(device.exception(code, "the request"))
                }
                _ => Ok(()),
            }
        }
        Err(Lost::Garbled(bytes)) => {
            let shown = adu::bytes(framing, &bytes);
            let other = device.other(&pdu, &bytes);
            let other = other.map_or_else(String::new, |other| format!(": {other}"));
            output::line(format_args!(
                "<- {shown}  not an answer to this request{other}"
            ))?;
            Err(device.lost(Some(&pdu), &Lost::Garbled(bytes)))
        }
        Err(lost) => {
            if let (Lost::Absent(code), [function, ..]) = (&lost, &pdu[..]) {
                show(&[function | 0x80, *code])?;
            }
            Err(device.lost(Some(&pdu), &lost))
        }
    }
}

fn hex(digits: &str) -> Result<Vec<u8>, Failure> {
    let digits: String = digits.chars().filter(|c| !c.is_whitespace()).collect();
    let wrong = || {
        Failure::usage(format!(
            "{digits:?} is not a PDU in hexadecimal; give 1 to 253 bytes, such as 03 0000 0001"
        ))
    };
    let bytes = digits.as_bytes();
    let (pairs, rest) = bytes.as_chunks::<2>();
    if pairs.is_empty() || pairs.len() > 253 || !rest.is_empty() {
        return Err(wrong());
    }
    let byte = |pair: &[u8; 2]| {
        let text = std::str::from_utf8(pair).ok()?;
        text.bytes()
            .all(|c| c.is_ascii_hexdigit())
            .then(|| u8::from_str_radix(text, 16).ok())?
    };
    pairs
        .iter()
        .map(byte)
        .collect::<Option<_>>()
        .ok_or_else(wrong)
}
