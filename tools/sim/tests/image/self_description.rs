//! The self-description: file 1 over the line by function 14, and its CRC in register 0x020F.

use modio_description::{Description, describe, records};
use register_map::Module as Known;
use sim::Module;

use crate::LAYOUT;
use crate::rig::{MODULE, PORT, Rig};

/// Groups of records: file, first record and number of records.
pub type Groups<'a> = &'a [(u16, u16, u16)];

/// Returns the PDU of function 14.
pub fn request(groups: Groups<'_>) -> Vec<u8> {
    let mut pdu = vec![0x14, groups.len() as u8 * 7];
    for (file, record, count) in groups {
        pdu.push(6);
        pdu.extend(
            [*file, *record, *count]
                .map(u16::to_be_bytes)
                .as_flattened(),
        );
    }
    pdu
}

impl Rig {
    /// Reads groups of records by one request. Returns the bytes of each group, or the exception code.
    fn read_file(&mut self, groups: Groups<'_>) -> Result<Vec<Vec<u8>>, u8> {
        let data = self.request(&request(groups))?;
        assert_eq!(usize::from(data[0]), data.len() - 1, "the byte count");
        let mut rest = &data[1..];
        let read = groups.iter().map(|(_, _, count)| {
            let bytes = usize::from(*count) * 2;
            let (group, others) = rest.split_at(2 + bytes);
            assert_eq!(group[..2], [bytes as u8 + 1, 6], "the header of the group");
            rest = others;
            group[2..].to_vec()
        });
        let read = read.collect();
        assert!(rest.is_empty(), "bytes after the groups");
        Ok(read)
    }

    /// Reads all of file 1, with as many records in a request as fit in `groups` groups.
    fn self_description(&mut self, groups: u16) -> Vec<u8> {
        let head = self.read_file(&[(1, 0, 2)]).unwrap().concat();
        let records = records(u16::from_be_bytes([head[0], head[1]]));
        // A reply has 251 bytes for groups, and each group begins with 2 bytes.
        let of_each = (251 / groups - 2) / 2;
        let starts: Vec<u16> = (0..records).step_by(of_each.into()).collect();
        let mut file = Vec::new();
        for some in starts.chunks(groups.into()) {
            let wanted: Vec<_> = some
                .iter()
                .map(|start| (1, *start, of_each.min(records - start)))
                .collect();
            file.extend(self.read_file(&wanted).unwrap().concat());
        }
        assert_eq!(
            self.read_file(&[(1, records, 1)]),
            Err(2),
            "a record beyond the end"
        );
        file
    }

    /// Asserts that file 1 describes this board with this module in its first slot, and that register 0x020F has its
    /// CRC. Returns the CRC.
    fn assert_described(&mut self, module: Known, file: &[u8]) -> u16 {
        let modules = |port| {
            if port == PORT { module } else { Known::None }
        };
        let expected = describe(LAYOUT.board, env!("CARGO_PKG_VERSION"), modules);
        assert_eq!(Description::open(file), Ok(expected));
        let crc = u16::from_be_bytes([file[2], file[3]]);
        assert_eq!(self.register(0x020F), crc, "register 0x020F");
        crc
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn crc_changes_with_the_module_in_force() {
    let mut rig = Rig::set_up(Module::Di4, &[]);
    let file = rig.self_description(1);
    let before = rig.assert_described(Known::Di4, &file);
    rig.configure(MODULE, &[Known::Ai2Ao2.code()]);
    rig.save();
    assert_eq!(
        rig.self_description(1),
        file,
        "the new module is not in force yet"
    );
    rig.tolerant = true;
    rig.restart();
    let file = rig.self_description(3);
    let after = rig.assert_described(Known::Ai2Ao2, &file);
    assert_ne!(before, after);
}
