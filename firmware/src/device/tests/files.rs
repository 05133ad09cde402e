//! The self-description, file 1.

use super::*;

impl<B: Board> Rig<B> {
    /// Reads records of a file in one request. Returns the exception, or the bytes of all groups.
    pub(super) fn read_file(&mut self, groups: &[(u16, u16, u16)]) -> Result<Vec<u8>, u8> {
        let mut pdu = std::vec![0x14, groups.len() as u8 * 7];
        for (file, record, count) in groups {
            let [[f1, f0], [r1, r0], [c1, c0]] = [*file, *record, *count].map(u16::to_be_bytes);
            pdu.extend([6, f1, f0, r1, r0, c1, c0]);
        }
        let reply = self.ask(&pdu);
        if reply[0] == 0x94 {
            return Err(reply[1]);
        }
        assert_eq!(usize::from(reply[1]), reply.len() - 2);
        let (mut rest, mut bytes) = (&reply[2..], Vec::new());
        for (_, _, count) in groups {
            let (group, others) = rest.split_at(2 + usize::from(*count) * 2);
            assert_eq!(group[..2], [*count as u8 * 2 + 1, 6]);
            bytes.extend(&group[2..]);
            rest = others;
        }
        assert!(rest.is_empty());
        Ok(bytes)
    }

    /// Reads file 1 from its first record to its last, in requests of a few records.
    fn self_description(&mut self) -> Vec<u8> {
        let head = self.read_file(&[(1, 0, 2)]).unwrap();
        let records = modio_description::records(u16::from_be_bytes([head[0], head[1]]));
        let mut file = Vec::new();
        for record in (0..records).step_by(99) {
            let count = (records - record).min(99);
            file.extend(self.read_file(&[(1, record, count)]).unwrap());
        }
        assert_eq!(self.read_file(&[(1, records, 1)]), Err(2), "after the end");
        assert_eq!(self.read_file(&[(1, records - 1, 2)]), Err(2));
        file
    }
}

#[test]
fn file_1_describes_the_unit_with_its_modules_in_force() {
    for module in Module::ALL {
        let mut rig = Rig::new(module, &[]);
        let file = rig.self_description();
        let expected =
            modio_description::describe(&MODIO_02, env!("CARGO_PKG_VERSION"), |_| module);
        assert_eq!(modio_description::Description::open(&file), Ok(expected));
        let crc = rig.read(0x020F, 1).unwrap()[0];
        assert_eq!(crc.to_be_bytes(), file[2..4]);
    }
}

#[test]
fn file_1_describes_all_slots_of_a_board() {
    let modules = [Module::Ai2Ao2, Module::None, Module::Di4, Module::Relay2];
    let mut rig = Rig::<Modio08>::on(modules, &[]);
    let file = rig.self_description();
    let expected = modio_description::describe(&MODIO_08, env!("CARGO_PKG_VERSION"), |port| {
        modules[usize::from(port - 1)]
    });
    assert_eq!(modio_description::Description::open(&file), Ok(expected));
}

#[test]
fn module_that_is_not_in_force_does_not_change_file_1() {
    let mut rig = Rig::new(Module::Di4, &[]);
    let file = rig.self_description();
    rig.unlock();
    assert_eq!(rig.write(at::module_of(5), &[Module::Ao4.code()]), Ok(()));
    assert_eq!(rig.self_description(), file);
}

#[test]
fn groups_of_one_request_are_read_in_their_order() {
    let mut rig = Rig::new(Module::Di4, &[]);
    let file = rig.self_description();
    let bytes = rig.read_file(&[(1, 5, 2), (1, 0, 1), (1, 5, 1)]).unwrap();
    let expected = [&file[10..14], &file[..2], &file[10..12]].concat();
    assert_eq!(bytes, expected);
    // The longest reply: 251 bytes of groups.
    let longest = rig.read_file(&[(1, 9, 124)]).unwrap();
    assert_eq!(longest, file[18..18 + 248]);
    assert_eq!(rig.read_file(&[(1, 9, 125)]), Err(3));
}

/// Reading can begin at every record, also at the borders of head, fixed part and ports.
#[test]
fn each_record_can_be_read_alone() {
    let mut rig = Rig::new(Module::Ai2Ao2, &[]);
    let file = rig.self_description();
    for (record, bytes) in (0..).zip(file.chunks(2)) {
        assert_eq!(rig.read_file(&[(1, record, 1)]).unwrap(), bytes);
    }
}

#[test]
fn other_files_return_illegal_data_address() {
    let mut rig = Rig::new(Module::None, &[]);
    for file in [0, 2, 4, 0x100, 0x101, 0xFFFF] {
        assert_eq!(rig.read_file(&[(file, 0, 1)]), Err(2), "file {file}");
        assert_eq!(rig.read_file(&[(1, 0, 1), (file, 0, 1)]), Err(2));
    }
    assert_eq!(rig.ask(&[0x14]), [0x94, 3]);
}

#[test]
fn files_cannot_be_written() {
    let mut rig = Rig::new(Module::None, &[]);
    let file = rig.self_description();
    for number in [1, 2, 0x100] {
        let [f1, f0] = u16::to_be_bytes(number);
        let request = [0x15, 9, 6, f1, f0, 0, 0, 0, 1, 0x12, 0x34];
        assert_eq!(rig.ask(&request), [0x95, 2], "file {number}");
    }
    assert_eq!(rig.ask(&[0x15, 9, 6]), [0x95, 3]);
    assert_eq!(rig.self_description(), file);
}
