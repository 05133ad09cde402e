//! Tests of the name of a serial port in a written file.

use std::io::{Read, Write};
use std::os::unix::fs::symlink;

use modioctl::bus::adu::Framing;
use portable_pty::{PtySize, native_pty_system};
use register_map::Module;

use crate::program::At;
use crate::served::{Answers, Modio};

#[test]
fn export_with_a_port_whose_number_can_change_is_warned_of() {
    let pty = native_pty_system().openpty(PtySize::default()).unwrap();
    let mut requests = pty.master.try_clone_reader().unwrap();
    let mut responses = pty.master.take_writer().unwrap();
    std::thread::spawn(move || {
        let mut server = Modio::modio_02(Module::Di4);
        let mut bytes = [0; 256];
        while let Ok(count @ 1..) = requests.read(&mut bytes) {
            if let Some((unit, pdu)) = Framing::Rtu.open(&bytes[..count]) {
                let _ = responses.write_all(&server.response(unit, &pdu));
            }
        }
    });
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("by-path")).unwrap();
    let port = pty.master.tty_name().unwrap();
    let other = "can be another adapter";
    let socket = "is a USB socket of this computer";
    for (name, system, warning, warnings) in [
        ("ttyUSB0", "home-assistant", other, 1),
        ("ttyACM3", "json", other, 1),
        ("by-path/usb-0:1.2", "telegraf", socket, 1),
        ("ttyUSB1", "csv", "warning", 0),
        ("ttyUSB2", "node-red", other, 1),
        ("by-path/usb-0:1.3", "csv", "warning", 0),
        ("line", "telegraf", "warning", 0),
    ] {
        let path = folder.path().join(name);
        symlink(&port, &path).unwrap();
        let ran = At::port(path.display()).run(&format!("export {system}"));
        assert_eq!(ran.err.matches(warning).count(), warnings, "{ran:?}");
        ran.fine();
    }
}
