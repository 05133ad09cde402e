//! Capture files: pcapng with link type `WIRESHARK_UPPER_PDU` (252).
//!
//! Packets of this link type carry the name of the dissector that decodes them. Wireshark therefore decodes Modbus
//! RTU without any configuration. Other link types, such as `USER0` and `RTAC_SERIAL`, need an entry in the user's
//! settings. Each packet starts with tags (type, length, value; big-endian; Wireshark `wsutil/exported_pdu_tlvs.h`):
//!
//! | tag | value |
//! |---|---|
//! | 12 | name of the dissector, padded with zeros: `mbrtu`, or `data` for garbled bytes |
//! | 20, 21 | IPv4 addresses of source and destination; they stand for the master and the units |
//! | 24 | type of the ports: 2, TCP |
//! | 25, 26 | ports of source and destination: 502 is the unit, 1 is the master |
//! | 0 | end of the tags |

use std::borrow::Cow;
use std::io::{self, BufWriter, Write};
use std::time::Duration;

use pcap_file::pcapng::PcapNgWriter;
use pcap_file::pcapng::blocks::enhanced_packet::{EnhancedPacketBlock, EnhancedPacketOption};
use pcap_file::pcapng::blocks::interface_description::{
    InterfaceDescriptionBlock, InterfaceDescriptionOption,
};
use pcap_file::pcapng::blocks::section_header::{SectionHeaderBlock, SectionHeaderOption};
use pcap_file::{DataLink, Endianness, PcapError};

use crate::Direction;
use crate::adu::Framing;

/// Link type of packets that name their own dissector.
const UPPER_PDU: u32 = 252;
/// Time stamps in nanoseconds: 10 to the power of -9.
const NANOSECONDS: u8 = 9;
/// Port that stands for a unit.
const UNIT_PORT: u32 = 502;
/// Port that stands for the master.
const MASTER_PORT: u32 = 1;
/// Address that stands for the master.
const MASTER: [u8; 4] = [0, 0, 0, 0];
/// Address that stands for all units.
const ALL: [u8; 4] = [255; 4];

/// Flag of a packet: its check is wrong.
const CRC_ERROR: u32 = 1 << 24;

/// Bytes that were received together, for a capture file.
#[derive(Clone, Copy, Debug)]
pub struct Packet<'a> {
    /// Time of the first byte, since 1970.
    pub time: Duration,
    /// Direction of the bytes, if known. Only a frame with a known direction becomes a Modbus packet.
    pub direction: Option<Direction>,
    /// Framing of the line. Bytes that are not such a frame become a packet of protocol "data".
    pub framing: Framing,
    /// The bytes as received.
    pub bytes: &'a [u8],
    /// Comment of the packet.
    pub comment: &'a str,
}

/// A capture file. Each packet is written immediately and completely, so the file is valid whenever the program
/// ends.
pub struct Recorder<W: Write> {
    writer: PcapNgWriter<BufWriter<W>>,
}

impl<W: Write> Recorder<W> {
    /// Starts a capture file. `program` is the name and version of the program that writes the file, `name` the name of
    /// the line.
    ///
    /// # Errors
    ///
    /// Error of the writer.
    pub fn new(writer: W, program: &str, name: &str) -> io::Result<Self> {
        let header = SectionHeaderBlock {
            endianness: Endianness::Little,
            options: vec![SectionHeaderOption::UserApplication(Cow::Owned(
                program.to_owned(),
            ))],
            ..SectionHeaderBlock::default()
        };
        let mut writer =
            PcapNgWriter::with_section_header(BufWriter::new(writer), header).map_err(plain)?;
        writer
            .write_pcapng_block(InterfaceDescriptionBlock {
                linktype: DataLink::from(UPPER_PDU),
                snaplen: 0,
                options: vec![
                    InterfaceDescriptionOption::IfName(Cow::Borrowed(name)),
                    InterfaceDescriptionOption::IfTsResol(NANOSECONDS),
                ],
            })
            .map_err(plain)?;
        writer.get_mut().flush()?;
        Ok(Self { writer })
    }

    /// Writes a packet.
    ///
    /// # Errors
    ///
    /// Error of the writer.
    pub fn write(&mut self, packet: &Packet) -> io::Result<()> {
        let opened = packet.framing.open(packet.bytes);
        let mut options = vec![EnhancedPacketOption::Comment(Cow::Borrowed(packet.comment))];
        if let Some(direction) = packet.direction {
            // Bits 0 and 1: 1 is inbound, to the units; 2 is outbound, from a unit.
            let way = match direction {
                Direction::Request => 1,
                Direction::Response => 2,
            };
            let error = if opened.is_none() { CRC_ERROR } else { 0 };
            options.push(EnhancedPacketOption::Flags(way | error));
        }
        let data = match (packet.direction, &opened) {
            (Some(direction), Some((unit, pdu))) => frame(direction, *unit, pdu),
            _ => garbled(packet.bytes),
        };
        self.writer
            .write_pcapng_block(EnhancedPacketBlock {
                interface_id: 0,
                timestamp: packet.time,
                original_len: u32::try_from(data.len()).unwrap_or(u32::MAX),
                data: Cow::Owned(data),
                options,
            })
            .map_err(plain)?;
        self.writer.get_mut().flush()
    }
}

fn plain(error: PcapError) -> io::Error {
    match error {
        PcapError::IoError(error) => error,
        other => io::Error::other(other),
    }
}

/// Returns the packet for a frame: tags and the RTU frame. An ASCII frame becomes the RTU frame with the same unit and
/// PDU, because Wireshark has no dissector for Modbus ASCII.
fn frame(direction: Direction, unit: u8, pdu: &[u8]) -> Vec<u8> {
    let bytes = Framing::Rtu.frame(0, unit, pdu);
    let unit = match unit {
        0 => ALL,
        unit => [0, 0, 0, unit],
    };
    let [unit, master] = [(unit, UNIT_PORT), (MASTER, MASTER_PORT)];
    let ((from, from_port), (to, to_port)) = match direction {
        Direction::Request => (master, unit),
        Direction::Response => (unit, master),
    };
    let mut packet = Vec::new();
    tag(&mut packet, 12, b"mbrtu\0\0\0");
    tag(&mut packet, 20, &from);
    tag(&mut packet, 21, &to);
    tag(&mut packet, 24, &2_u32.to_be_bytes());
    tag(&mut packet, 25, &from_port.to_be_bytes());
    tag(&mut packet, 26, &to_port.to_be_bytes());
    tag(&mut packet, 0, &[]);
    packet.extend(bytes);
    packet
}

/// Returns the packet for bytes that are not a frame.
fn garbled(bytes: &[u8]) -> Vec<u8> {
    let mut packet = Vec::new();
    tag(&mut packet, 12, b"data");
    tag(&mut packet, 0, &[]);
    packet.extend(bytes);
    packet
}

fn tag(packet: &mut Vec<u8>, number: u16, value: &[u8]) {
    packet.extend(number.to_be_bytes());
    packet.extend(u16::try_from(value.len()).unwrap_or(u16::MAX).to_be_bytes());
    packet.extend(value);
}

#[cfg(test)]
mod tests {
    use pcap_file::pcapng::{Block, PcapNgReader};

    use super::*;

    /// Time, data and flags of each packet in a file.
    fn packets(file: &[u8]) -> Vec<(Duration, Vec<u8>, Option<u32>)> {
        let mut reader = PcapNgReader::new(file).unwrap();
        let mut packets = Vec::new();
        while let Some(block) = reader.next_block() {
            if let Block::EnhancedPacket(packet) = block.unwrap() {
                let flags = packet.options.iter().find_map(|option| match option {
                    EnhancedPacketOption::Flags(flags) => Some(*flags),
                    _ => None,
                });
                packets.push((packet.timestamp, packet.data.into_owned(), flags));
            }
        }
        packets
    }

    #[test]
    fn capture_file_is_read_back_with_times_dissectors_and_directions() {
        let (rtu, ascii) = (Framing::Rtu, Framing::Ascii);
        let request = [3, 0, 0, 0, 1];
        let (way, back) = (Some(Direction::Request), Some(Direction::Response));
        let mut file = Vec::new();
        let mut recorder = Recorder::new(&mut file, "test 1", "line").unwrap();
        let time = Duration::new(1_700_000_000, 123_456_789);
        for (direction, framing, bytes) in [
            (way, ascii, ascii.frame(0, 9, &request)),
            (back, rtu, rtu.frame(0, 9, &[0x83, 2])),
            (None, rtu, b"?".to_vec()),
            (back, rtu, b"??".to_vec()),
        ] {
            let packet = Packet {
                time,
                direction,
                framing,
                bytes: &bytes,
                comment: "words",
            };
            recorder.write(&packet).unwrap();
        }
        drop(recorder);
        let packets = packets(&file);
        assert!(packets.iter().all(|(at, ..)| *at == time));
        let flags = packets.iter().map(|(_, _, flags)| *flags);
        assert_eq!(
            flags.collect::<Vec<_>>(),
            [Some(1), Some(2), None, Some(2 | CRC_ERROR)]
        );
        for (packet, pdu) in packets.iter().zip([&request[..], &[0x83, 2]]) {
            assert!(packet.1.starts_with(b"\0\x0C\0\x08mbrtu\0\0\0"));
            assert!(packet.1.ends_with(&rtu.frame(0, 9, pdu)), "as RTU");
        }
        assert_eq!(packets[2].1, b"\0\x0C\0\x04data\0\0\0\0?");
    }

    #[test]
    fn every_packet_reaches_the_file_in_one_piece() {
        /// Stores what each call writes.
        #[derive(Default)]
        struct Calls(Vec<Vec<u8>>);
        impl Write for &mut Calls {
            fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
                self.0.push(bytes.to_vec());
                Ok(bytes.len())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let mut calls = Calls::default();
        let mut recorder = Recorder::new(&mut calls, "test 1", "line").unwrap();
        for length in [4, 256, 4096] {
            let packet = Packet {
                time: Duration::ZERO,
                direction: None,
                framing: Framing::Rtu,
                bytes: &vec![7; length],
                comment: "words",
            };
            recorder.write(&packet).unwrap();
        }
        drop(recorder);
        let whole: Vec<_> = (1..=calls.0.len())
            .map(|count| packets(&calls.0[..count].concat()).len())
            .collect();
        assert_eq!(whole, [0, 1, 2, 3]);
    }
}
