//! The uptime in ms, and the times of the edges of digital inputs.

use super::*;

#[test]
fn uptime_counts_milliseconds_in_32_bits() {
    let mut rig = Rig::new(Module::Di4, &[]);
    assert_eq!(rig.read(0x0226, 2), Ok(std::vec![0, 0]));
    rig.device.tick(0x0001_0002);
    assert_eq!(rig.read(0x0226, 2), Ok(std::vec![1, 2]));
    assert_eq!(rig.write(0x0226, &[0, 0]), Err(2));
}

#[test]
fn an_input_has_the_uptime_of_its_last_edge() {
    let modules = [Module::Di4, Module::Do4, Module::Relay2, Module::Ai4];
    let mut rig = Rig::<Modio08>::on(modules, &[]);
    rig.scan_port(0, |channels| channels.set_bit(3, true));
    assert_eq!(
        rig.read(0x0380, 64).unwrap(),
        [0; 64],
        "the level at the start is no edge"
    );
    rig.scan_port(0, |channels| channels.set_bit(3, false));
    assert_eq!(rig.read(0x0386, 2).unwrap(), [0, 1], "0 stands for no edge");
    rig.device.tick(0x0001_0000);
    rig.scan_port(0, |channels| channels.set_bit(3, true));
    assert_eq!(rig.read(0x0386, 2).unwrap(), [1, 0]);
    // The mode of a relay is an input, and its coil an output.
    for bit in [false, true] {
        rig.scan_port(2, |channels| (0..4).for_each(|c| channels.set_bit(c, bit)));
    }
    let relays = rig.read(0x0390, 8).unwrap();
    assert_eq!(relays, [1, 0, 1, 0, 0, 0, 0, 0]);
    assert_eq!(rig.read(0x0380, 65), Err(2));
    assert_eq!(rig.write(0x0386, &[0, 0]), Err(2));
}

#[test]
fn file_3_is_the_log_of_edges() {
    let modules = [Module::None, Module::Di4, Module::None, Module::Di4];
    let mut rig = Rig::<Modio08>::on(modules, &[]);
    let number = |bytes: &[u8]| u16::from_be_bytes([bytes[0], bytes[1]]);
    rig.scan_port(1, |_| {});
    rig.scan_port(3, |_| {});
    rig.device.tick(7);
    rig.scan_port(3, |channels| channels.set_bit(2, true));
    rig.device.tick(40);
    let mut channels = *rig.device.points.ports()[1].channels();
    channels.set_bit(0, true);
    rig.device.scanned(1, &channels, &[None; 4], true, 40);
    // The count and the two newest edges in one request.
    let bytes = rig.read_file(&[(3, 0, 1), (3, 187, 6)]).unwrap();
    assert_eq!(number(&bytes), 2);
    assert_eq!(
        bytes[2..],
        [0x01, 0x0E, 0, 0, 0, 7, 0x81, 0x04, 0, 0, 0, 47]
    );
    assert_eq!(rig.read_file(&[(3, 192, 2)]), Err(2), "after the end");
    let write = [0x15, 9, 6, 0, 3, 0, 0, 0, 1, 0, 0];
    assert_eq!(rig.ask(&write), [0x95, 2]);
}
