//! The reference server with the tables of this test, and with the faults that a test asks for.

use modbus_reference::server::{EXCEPTIONS, NAK, NO_RESPONSE, OVERRUNS, UNIT_MESSAGES};
use modbus_reference::{Device, Server as Reference};

use super::fault::Fault;
use super::modio::Modio;
use super::modio_fault::ModioFault;

/// Coils and registers: the first address and their number.
const COILS: (u16, usize) = (100, 2100);
const INPUTS: (u16, usize) = (0, 19);
const HOLDING: (u16, usize) = (1000, 200);
const INPUT_REGISTERS: (u16, usize) = (50, 10);
/// The largest value that holding registers accept.
const MOST: u16 = 4095;

/// A reply, or an exception code.
type Answer = Result<Vec<u8>, u8>;

/// The reference server with the points of this unit.
pub fn reference(delimiter: Option<u8>) -> Reference {
    let texts = [
        "reference",
        "R1",
        "1.0",
        "url",
        "product",
        "model",
        "application",
    ];
    let object = |id: usize| match id {
        // Together these objects need three replies.
        0x80..=0x84 => Some(vec![b'x'; 120]),
        _ => texts.get(id).map(|text| text.as_bytes().to_vec()),
    };
    let device = Device {
        bits: vec![false; COILS.1],
        input_bits: (0..INPUTS.1).map(|n| n.is_multiple_of(3)).collect(),
        words: vec![1; HOLDING.1],
        input_words: (0..INPUT_REGISTERS.1 as u16).map(|n| n * 7).collect(),
        max_word: MOST,
        files: vec![(0..300).collect()],
        objects: (0..=255).map(object).collect(),
        ..Device::new(0, 0)
    };
    Reference::new(delimiter, device)
}

/// The fault and the modio that change the replies of the reference.
pub struct Server {
    pub fault: Option<Fault>,
    /// The points and registers, if the unit is a modio.
    pub modio: Option<Modio>,
}

impl Server {
    /// Whether this is a modio with this fault.
    pub fn modio_has(&self, fault: ModioFault) -> bool {
        self.modio.as_ref().is_some_and(|modio| modio.has(fault))
    }

    pub fn has(&self, fault: Fault) -> bool {
        self.fault == Some(fault)
    }

    /// Serves a request to this unit or to all units. Returns the PDU of the reply.
    pub fn request(
        &mut self,
        reference: &mut Reference,
        broadcast: bool,
        pdu: &[u8],
    ) -> Option<Vec<u8>> {
        if pdu[0] >= 0x80
            && let Some(modio) = &mut self.modio
        {
            modio.odd_request();
        }
        let (old_counters, old_count) = (reference.counters, reference.events);
        let old_log = reference.log.clone();
        let (delimiter, listening) = (reference.delimiter, reference.listening);
        let sub = (pdu[0] == 8).then(|| word(pdu, 1));
        let short = matches!(pdu[0], 7 | 0x0B | 0x0C | 0x11);
        let mut request = pdu.to_vec();
        let mut obeys_broadcast = false;
        match (self.fault, sub) {
            (Some(Fault::AnswersBroadcasts), _)
            | (Some(Fault::ObeysBroadcastDiagnostics), Some(_)) => obeys_broadcast = true,
            (Some(Fault::TalksInListenOnly), _) => reference.listening = false,
            (Some(Fault::WritesInListenOnly), _) if listening => {
                // Carry out the write and discard the answer.
                let _ = self.answer(reference, pdu);
            }
            (Some(Fault::IgnoresDiagnosticData), Some(2 | 4 | 0x0A..=0x14)) => {
                request = vec![8, 0, pdu[2], 0, 0];
            }
            (Some(Fault::TakesAnyRestart), Some(1)) => request = vec![8, 0, 1, 0, 0],
            (Some(Fault::IgnoresSpareBytes), None) if short => request.truncate(1),
            _ => {}
        }
        let obeyed_as_broadcast = broadcast && !obeys_broadcast;
        let mut reply = reference.request(obeyed_as_broadcast, &request, |reference, pdu| {
            self.answer(reference, pdu)
        });
        let exception = match reply.as_deref() {
            Some([function, code]) if function & 0x80 != 0 => Some(*code),
            _ => None,
        };
        // The last events.
        let position = |wanted: fn(&u8) -> bool| reference.log.iter().rposition(wanted);
        let received = position(|event| event & 0x80 != 0);
        let sent = position(|event| event & 0xC0 == 0x40);
        if exception.is_some() && self.modio_has(ModioFault::LongExceptions) {
            reply.iter_mut().for_each(|reply| reply.push(reply[1]));
        }
        if exception == Some(6) && self.modio_has(ModioFault::LogsBusyAsRefused) {
            sent.into_iter().for_each(|at| reference.log[at] = 0x41);
        }
        let Some(fault) = self.fault else {
            return reply;
        };
        let (events, counts) = (&mut reference.log, &mut reference.counters);
        match (fault, sub) {
            (Fault::BroadcastsAreNoMessages, _) if broadcast => counts[UNIT_MESSAGES] -= 1,
            (Fault::BroadcastsUncounted, _) if broadcast => counts[NO_RESPONSE] -= 1,
            (Fault::CountsNak, _) => counts[NAK] += 1,
            (Fault::ExceptionsUncounted, _) if exception.is_some() => counts[EXCEPTIONS] -= 1,
            (Fault::CountsExceptions, _) if exception.is_some() => reference.events += 1,
            (Fault::OverrunsStay, _) => counts[OVERRUNS] = 3,
            (Fault::NeverClears, Some(1 | 0x0A)) | (Fault::RestartKeepsCounters, Some(1)) => {
                (reference.counters, reference.events) = (old_counters, old_count);
            }
            (Fault::ClearsOneAlone, Some(1 | 0x0A)) => {
                counts[1..].copy_from_slice(&old_counters[1..])
            }
            (Fault::BroadcastsLoggedAsOthers, _) => {
                received.into_iter().for_each(|at| events[at] &= !0x40)
            }
            (Fault::ExceptionsLoggedAsReplies, _) => {
                sent.into_iter().for_each(|at| events[at] &= !0x0F)
            }
            (Fault::SilenceUnlogged | Fault::RepliesUnlogged, _)
                if reply.is_some() == (fault == Fault::RepliesUnlogged) =>
            {
                if let Some(at) = sent {
                    events.remove(at);
                }
            }
            (Fault::EntryUnlogged, Some(4)) | (Fault::RestartUnlogged, Some(1)) => {
                events.pop();
            }
            (Fault::ModeUnlogged, _) => events.iter_mut().for_each(|event| *event &= !0x20),
            (Fault::KeepsLog, Some(1)) => *events = [old_log, vec![0]].concat(),
            (Fault::KeepsDelimiter, Some(3)) => reference.delimiter = delimiter,
            (Fault::TalksInListenOnly, Some(1)) => {}
            (Fault::TalksInListenOnly, _) => reference.listening |= listening,
            (Fault::ObeysBroadcastDiagnostics, _) if broadcast => reply = None,
            (Fault::SilentToDelimiter, Some(3)) => reply = None,
            (Fault::SilentToUnknown, _) if exception == Some(1) => reply = None,
            (Fault::EchoesShortDiagnostics, Some(_)) if pdu.len() < 3 => reply = Some(pdu.to_vec()),
            (Fault::EchoesAnySubFunction, Some(_)) if exception == Some(1) => {
                reply = Some(pdu.to_vec());
            }
            (Fault::TakesAnyDelimiter, Some(3)) => reply = Some(pdu.to_vec()),
            (Fault::ShortEcho, Some(0)) => reply.as_mut()?.truncate(5),
            (Fault::ShortRegister, Some(2)) => drop(reply.as_mut()?.pop()),
            // The worked frame with a wrong CRC is an exception reply.
            (Fault::IgnoresCrc, _) if pdu[0] > 0x80 => reply = Some(vec![pdu[0], 1]),
            (Fault::AddsAByte, None) if short => reply.as_mut()?.push(0),
            (Fault::LogBackwards, _) if pdu[0] == 0x0C => reply.as_mut()?[8..].reverse(),
            (Fault::LogCountDiffers, _) if pdu[0] == 0x0C => reply.as_mut()?[5] ^= 7,
            _ => {}
        }
        reply
    }

    /// Serves a PDU. Returns the PDU of the reply, or an exception code.
    fn answer(&mut self, reference: &mut Reference, pdu: &[u8]) -> Answer {
        let of_modio = self.modio.as_mut();
        let answer = match of_modio.and_then(|modio| modio.answer(pdu, &reference.counters)) {
            Some(answer) => return answer,
            None if matches!(pdu[0], 7 | 8 | 0x0B | 0x0C | 0x11) => return reference.answer(pdu),
            None => self.serve(&mut reference.device, pdu),
        };
        answer.map(|data| [vec![pdu[0]], data].concat())
    }

    /// Serves a request for points, files or identification. The fault changes the request or the reply.
    fn serve(&self, device: &mut Device, pdu: &[u8]) -> Answer {
        let mut request = pdu.to_vec();
        if let Some(answer) = self.spoil(device, &mut request) {
            return answer;
        }
        let answer = right(device, &request);
        let (at, value) = (word(pdu, 1), word(pdu, 3));
        let Some(fault) = self.fault else {
            return answer;
        };
        match (fault, pdu[0], answer) {
            (Fault::TakesCoil1234, 5, Ok(_)) | (Fault::PlainOr, 0x16, Ok(_)) => {
                Ok(pdu[1..].to_vec())
            }
            (Fault::EchoesNowhere, 5 | 6 | 0x16, Err(2)) => Ok(pdu[1..].to_vec()),
            (Fault::EchoesData, 0x0F | 0x10, Ok(_)) => Ok(pdu[1..].to_vec()),
            (Fault::WritesPadding | Fault::IgnoresOtherByteCounts, 0x0F, Ok(_)) => {
                Ok(pdu[1..5].to_vec())
            }
            (Fault::WritesNeighbour, 6, Ok(reply)) => {
                if let Ok(next) = place(HOLDING, at + 1, 1) {
                    device.words[next] = value;
                }
                Ok(reply)
            }
            (Fault::StoresRefused, 6, Err(3)) => {
                if let Ok(at) = place(HOLDING, at, 1) {
                    device.words[at] = value;
                }
                Err(3)
            }
            (Fault::DirtyPadding, 1 | 2, Ok(mut reply)) if !value.is_multiple_of(8) => {
                *reply.last_mut().unwrap() |= 0x80;
                Ok(reply)
            }
            (Fault::CountsRegisters, 3 | 4, Ok(mut reply)) => {
                reply[0] /= 2;
                Ok(reply)
            }
            (Fault::Mei03, 0x2B, Err(1)) | (Fault::Object03, 0x2B, Err(2)) => Err(3),
            (Fault::TakesReadCode0, 0x2B, Ok(mut reply)) => {
                reply[1] = pdu[2];
                Ok(reply)
            }
            (Fault::IndividualDiffers, 0x2B, Ok(mut reply)) if pdu[2] == 4 => {
                *reply.last_mut().unwrap() ^= 1;
                Ok(reply)
            }
            (Fault::CountsObjectsWrong, 0x2B, Ok(mut reply)) => {
                reply[5] += 1;
                Ok(reply)
            }
            (Fault::TakesAnyFileRequest, 0x14, Err(3)) => Ok(vec![0]),
            (Fault::NeverSplits, 0x2B, Ok(mut reply)) if reply[3] != 0 => {
                let rest = right(device, &[0x2B, 0x0E, pdu[2], reply[4]])?;
                reply[3..5].fill(0);
                reply[5] += rest[5];
                reply.extend(&rest[6..]);
                Ok(reply)
            }
            (_, _, answer) => answer,
        }
    }

    /// Changes a request, so that the right reply to the changed request is the reply of the fault. Returns the answer
    /// itself where the fault does not depend on the reply.
    fn spoil(&self, device: &mut Device, request: &mut Vec<u8>) -> Option<Answer> {
        let (function, len) = (request[0], request.len());
        let (at, value) = (word(request, 1), word(request, 3));
        let bits = function < 3;
        let whole = usize::from(value).div_ceil(8);
        let bad_values = |data: &[u8]| data.chunks(2).any(|pair| word(pair, 0) > MOST);
        let fault = self.fault?;
        match (fault, function) {
            (Fault::IgnoresSpareBytes, _) => request.truncate(match function {
                1..=6 => 5,
                0x16 => 7,
                0x2B => 4,
                _ => len,
            }),
            (Fault::IgnoresLength, 1..=4) => request.truncate(5),
            (Fault::IgnoresSpareData, 0x0F | 0x10) if len > 6 => {
                request.truncate(6 + usize::from(request[5]));
            }
            (Fault::FillsTruncated, 0x17) if len > 10 => {
                request.resize(10 + usize::from(request[9]), 0);
            }
            (Fault::AddressFirst, 1..=4)
            | (Fault::CoilAddressFirst, 5)
            | (Fault::AddressFirstInWrites, 0x0F | 0x10) => {
                let quantity = if function < 5 { value.max(1) } else { 1 };
                place(table(function), at, quantity).err()?;
                return Some(Err(2));
            }
            (Fault::AddressFirstInWrites, 0x17) => {
                place(HOLDING, word(request, 5), 1).err()?;
                return Some(Err(2));
            }
            (Fault::ValueFirst, 6) if value > MOST => return Some(Err(3)),
            (Fault::ValueFirst, 0x10) if len > 6 && bad_values(&request[6..]) => {
                return Some(Err(3));
            }
            (Fault::TakesCoil1234, 5) if value == 0x1234 => set(request, 3, 0xFF00),
            (Fault::NeverSwitchesOff, 5) if value == 0 => return Some(Ok(request[1..].to_vec())),
            (Fault::PlainOr, 0x16) if len == 7 => {
                let now = device.words[place(HOLDING, at, 1).ok()?];
                let result = (now & value) | word(request, 5);
                set(request, 3, 0);
                set(request, 5, result);
            }
            (Fault::MasksBeyondRange, _) => {
                device.max_word = if function == 0x16 { u16::MAX } else { MOST };
            }
            (Fault::Answers2001, 1 | 2) if value == 2001 => set(request, 3, 2000),
            (Fault::Answers126, 3 | 4) if value == 126 => set(request, 3, 125),
            (Fault::AnswersQuantity0, 1..=4) if value == 0 => return Some(Ok(vec![0])),
            (Fault::RefusesLongestReads, 1..=4) if value >= if bits { 2000 } else { 125 } => {
                return Some(Err(3));
            }
            (Fault::ReadsPastTheEnd, 1..=4)
                if value > 1 && place(table(function), at, value).is_err() =>
            {
                set(request, 3, value - 1);
            }
            (Fault::Wraps, 1..=4) if at.checked_add(value).is_none() => {
                set(request, 1, table(function).0);
            }
            (Fault::WritesQuantity0, 0x0F | 0x10) if value == 0 && len == 6 => {
                return Some(Ok(request[1..5].to_vec()));
            }
            (Fault::WritesQuantity0, 0x17) if len == 10 && word(request, 7) == 0 => {
                let read = [&[3], &request[1..5]].concat();
                return Some(right(device, &read));
            }
            (Fault::RefusesLongestWrites, 0x0F) if value == 1968 => return Some(Err(3)),
            (Fault::RefusesLongestWrites, 0x10) if value == 123 => return Some(Err(3)),
            (Fault::IgnoresOtherByteCounts, 0x0F) if len > 6 => {
                request.resize(6 + whole, 0);
                request[5] = whole as u8;
            }
            (Fault::IgnoresOtherByteCounts, 0x17) if len == 10 + usize::from(request[9]) => {
                let words = u16::from(request[9] / 2);
                set(request, 7, words);
            }
            (Fault::IgnoresByteCount, 0x10) if len > 6 && (1..=123).contains(&value) => {
                request.resize(6 + usize::from(value) * 2, 0);
                request[5] = (value * 2) as u8;
            }
            (Fault::WritesPadding, 0x0F) => set(request, 3, whole as u16 * 8),
            (Fault::WritesCoilsPartly, 0x0F) => {
                for n in 0..usize::from(value).min(8 * len.saturating_sub(6)) {
                    if let Ok(coil) = place(COILS, at.saturating_add(n as u16), 1) {
                        device.bits[coil] = request[6 + n / 8] >> (n % 8) & 1 == 1;
                    }
                }
            }
            (Fault::WritesPartly, 0x10) if len > 6 => {
                for (address, pair) in (at..=u16::MAX).zip(request[6..].chunks_exact(2)) {
                    let one = [&[6], &address.to_be_bytes()[..], pair].concat();
                    if let refused @ Err(_) = right(device, &one) {
                        return Some(refused);
                    }
                }
            }
            (Fault::WritesWhereItReads, 0x17) if len > 10 => set(request, 5, at),
            (Fault::WritesBeforeItChecks, 0x17) if len > 10 => {
                let write = [&[0x10], &request[5..]].concat();
                right(device, &write).err()?;
            }
            (Fault::ReadsFirst, 0x17) if len > 10 => {
                let read = [&[3], &request[1..5]].concat();
                let reply = right(device, &read);
                return Some(right(device, request).and(reply));
            }
            (Fault::Reads124, 0x17) if value > 124 => return Some(Err(3)),
            (Fault::TakesAnyReference, 0x14) if len == 9 => request[2] = 6,
            (Fault::TakesFile0, 0x14) if len == 9 && word(request, 3) == 0 => set(request, 3, 1),
            (Fault::WrapsRecords, 0x14) if len == 9 && word(request, 5) > 9999 => {
                set(request, 5, 0);
            }
            (Fault::TakesReadCode0, 0x2B) if request.get(2) == Some(&0) => request[2] = 1,
            (Fault::StreamsFromZero, 0x2B) if len == 4 && request[2] < 4 && request[3] < 0x80 => {
                request[3] = 0;
            }
            (Fault::RefusesUnknownStart, 0x2B)
                if len == 4 && device.objects[usize::from(request[3])].is_none() =>
            {
                return Some(Err(2));
            }
            _ => {}
        }
        None
    }
}

/// The index in a table of `quantity` points from address `at` on.
fn place((first, count): (u16, usize), at: u16, quantity: u16) -> Result<usize, u8> {
    let start = at.checked_sub(first).map(usize::from).ok_or(2)?;
    if start + usize::from(quantity) <= count {
        Ok(start)
    } else {
        Err(2)
    }
}

fn table(function: u8) -> (u16, usize) {
    match function {
        1 | 5 | 0x0F => COILS,
        2 => INPUTS,
        4 => INPUT_REGISTERS,
        _ => HOLDING,
    }
}

/// The word at a place of a request; 0 if the request is shorter.
pub fn word(pdu: &[u8], at: usize) -> u16 {
    pdu.get(at..at + 2)
        .map_or(0, |pair| u16::from_be_bytes([pair[0], pair[1]]))
}

/// Replaces the word at a place of a request, if there is one.
pub fn set(request: &mut [u8], at: usize, value: u16) {
    if let Some(pair) = request.get_mut(at..at + 2) {
        pair.copy_from_slice(&value.to_be_bytes());
    }
}

/// Serves a request without a fault. Its addresses are those of this unit.
fn right(device: &mut Device, pdu: &[u8]) -> Answer {
    let mut request = pdu.to_vec();
    let fields: &[usize] = if pdu[0] == 0x17 { &[1, 5] } else { &[1] };
    for at in fields {
        let points = pdu[0] < 0x20 && !matches!(pdu[0], 0x14 | 0x15);
        if let Some(address) = request.get_mut(*at..at + 2).filter(|_| points) {
            let first = word(pdu, *at).wrapping_sub(table(pdu[0]).0);
            address.copy_from_slice(&first.to_be_bytes());
        }
    }
    let reply = modbus_reference::answer(device, &request)?;
    Ok(match pdu[0] {
        // Echo the request, with the addresses of the request.
        5 | 6 | 0x0F | 0x10 | 0x16 => pdu[1..reply.len()].to_vec(),
        _ => reply[1..].to_vec(),
    })
}
