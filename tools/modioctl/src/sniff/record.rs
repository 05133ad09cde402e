//! Capture files: pcapng with link type `WIRESHARK_UPPER_PDU` (252).
//!
//! Packets of this link type carry the name of the dissector that decodes them. Wireshark therefore decodes Modbus RTU
//! without any configuration. Other link types, such as `USER0` and `RTAC_SERIAL`, need an entry in the user's settings.
//! Each packet starts with tags (type, length, value; big-endian; Wireshark `wsutil/exported_pdu_tlvs.h`):
//!
//! | tag | value |
//! |---|---|
//! | 12 | name of the dissector, padded with zeros: `mbrtu`, or `data` for garbled bytes |
//! | 20, 21 | IPv4 addresses of source and destination; they stand for the master and the units |
//! | 24 | type of the ports: 2, TCP |
//! | 25, 26 | ports of source and destination: 502 is the unit, 1 is the master |
//! | 0 | end of the tags |

use std::borrow::Cow;
use std::io::Write;
use std::time::Duration;

use pcap_file::pcapng::PcapNgWriter;
use pcap_file::pcapng::blocks::enhanced_packet::{EnhancedPacketBlock, EnhancedPacketOption};
use pcap_file::pcapng::blocks::interface_description::{
    InterfaceDescriptionBlock, InterfaceDescriptionOption,
};
use pcap_file::pcapng::blocks::section_header::{SectionHeaderBlock, SectionHeaderOption};
use pcap_file::{DataLink, Endianness, PcapError};

use super::{Kind, Piece};
use crate::bus::Direction;
use crate::bus::adu::Framing;

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

/// A capture file.
pub struct Recorder<W: Write> {
    writer: PcapNgWriter<W>,
    framing: Framing,
}

impl<W: Write> Recorder<W> {
    /// Starts a capture file. `name` is the name of the line in the file.
    ///
    /// # Errors
    ///
    /// Error of the writer.
    pub fn new(writer: W, framing: Framing, name: &str) -> Result<Self, PcapError> {
        let header = SectionHeaderBlock {
            endianness: Endianness::Little,
            options: vec![SectionHeaderOption::UserApplication(Cow::Borrowed(
                concat!("modioctl ", env!("CARGO_PKG_VERSION")),
            ))],
            ..SectionHeaderBlock::default()
        };
        let mut writer = PcapNgWriter::with_section_header(writer, header)?;
        writer.write_pcapng_block(InterfaceDescriptionBlock {
            linktype: DataLink::from(UPPER_PDU),
            snaplen: 0,
            options: vec![
                InterfaceDescriptionOption::IfName(Cow::Owned(name.to_owned())),
                InterfaceDescriptionOption::IfTsResol(NANOSECONDS),
            ],
        })?;
        writer.get_mut().flush().map_err(PcapError::IoError)?;
        Ok(Self { writer, framing })
    }

    /// Writes a piece and flushes the file, so that the file is valid whenever the program ends. `since` is the time
    /// from 1970 to the start of the recording; `comment` is shown as the comment of the packet.
    ///
    /// # Errors
    ///
    /// Error of the writer.
    pub fn write(
        &mut self,
        piece: &Piece,
        since: Duration,
        comment: &str,
    ) -> Result<(), PcapError> {
        let data = packet(self.framing, piece);
        let mut options = vec![EnhancedPacketOption::Comment(Cow::Borrowed(comment))];
        if let Kind::Frame { direction, .. } = &piece.kind {
            // Bits 0 and 1: 1 is inbound, to the units; 2 is outbound, from a unit.
            options.push(EnhancedPacketOption::Flags(match direction {
                Direction::Request => 1,
                Direction::Response => 2,
            }));
        }
        self.writer.write_pcapng_block(EnhancedPacketBlock {
            interface_id: 0,
            timestamp: since.saturating_add(piece.from),
            original_len: u32::try_from(data.len()).unwrap_or(u32::MAX),
            data: Cow::Owned(data),
            options,
        })?;
        self.writer.get_mut().flush().map_err(PcapError::IoError)
    }
}

/// Returns the packet for a piece: tags and bytes. An ASCII frame becomes the RTU frame with the same unit and PDU,
/// because Wireshark has no dissector for Modbus ASCII.
fn packet(framing: Framing, piece: &Piece) -> Vec<u8> {
    let (dissector, from, to, bytes) = match &piece.kind {
        Kind::Garbled => ("data", None, None, Cow::Borrowed(&piece.bytes)),
        Kind::Frame {
            direction,
            unit,
            pdu,
            ..
        } => {
            let bytes = match framing {
                Framing::Rtu => Cow::Borrowed(&piece.bytes),
                Framing::Ascii | Framing::Mbap => Cow::Owned(Framing::Rtu.frame(0, *unit, pdu)),
            };
            let unit = match unit {
                0 => ALL,
                unit => [0, 0, 0, *unit],
            };
            let (unit, master) = (Some((unit, UNIT_PORT)), Some((MASTER, MASTER_PORT)));
            match direction {
                Direction::Request => ("mbrtu", master, unit, bytes),
                Direction::Response => ("mbrtu", unit, master, bytes),
            }
        }
    };
    let mut packet = Vec::new();
    let mut name = dissector.as_bytes().to_vec();
    name.resize(name.len().next_multiple_of(4), 0);
    tag(&mut packet, 12, &name);
    if let (Some((from, from_port)), Some((to, to_port))) = (from, to) {
        tag(&mut packet, 20, &from);
        tag(&mut packet, 21, &to);
        tag(&mut packet, 24, &2_u32.to_be_bytes());
        tag(&mut packet, 25, &from_port.to_be_bytes());
        tag(&mut packet, 26, &to_port.to_be_bytes());
    }
    tag(&mut packet, 0, &[]);
    packet.extend(bytes.iter());
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
    use crate::sniff::Splitter;

    #[test]
    fn capture_file_reads_back_with_times_and_dissectors() {
        let mut splitter = Splitter::new(Framing::Ascii, Duration::ZERO, Duration::from_secs(1));
        let bytes = Framing::Ascii.frame(0, 9, &[3, 0, 0, 0, 1]);
        let mut pieces = splitter.push(&bytes, Duration::from_millis(1500));
        pieces.extend(splitter.push(b"?", Duration::from_millis(1600)));
        pieces.extend(splitter.flush());
        let mut file = Vec::new();
        let mut recorder = Recorder::new(&mut file, Framing::Ascii, "line").unwrap();
        let since = Duration::from_secs(1_700_000_000);
        for piece in &pieces {
            recorder.write(piece, since, "words").unwrap();
        }
        drop(recorder);
        let mut reader = PcapNgReader::new(&file[..]).unwrap();
        let mut packets = Vec::new();
        while let Some(block) = reader.next_block() {
            if let Block::EnhancedPacket(packet) = block.unwrap() {
                packets.push((packet.timestamp, packet.data.into_owned()));
            }
        }
        assert_eq!(packets.len(), 2);
        assert_eq!(packets[0].0, since + Duration::from_millis(1500));
        assert!(packets[0].1.starts_with(b"\0\x0C\0\x08mbrtu\0\0\0"));
        let frame = Framing::Rtu.frame(0, 9, &[3, 0, 0, 0, 1]);
        assert!(packets[0].1.ends_with(&frame), "as RTU");
        assert_eq!(packets[1].1, b"\0\x0C\0\x04data\0\0\0\0?");
    }
}
