//! The GDB server of the running command, tested through GDB's remote protocol.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::Duration;

use super::{Running, elf, state};

/// `movs r0, #0`, then repeatedly `adds r0, #1` and `nop`.
const COUNTING: [u16; 4] = [0x2000, 0x3001, 0xBF00, 0xE7FC];
const START: u32 = 0x0800_0008;
const ADD: u32 = START + 2;

/// A simulator with a GDB server.
struct Debugged {
    _running: Running,
    http: String,
    gdb: String,
}

impl Debugged {
    fn start(directory: &Path) -> Self {
        let elf = elf(directory, &COUNTING);
        let mut running = Running::start_image(elf.to_str().unwrap(), &["--gdb", "127.0.0.1:0"]);
        running.line();
        let http = running.endpoint("http: http://");
        let gdb = running.endpoint("gdb: ");
        Self {
            _running: running,
            http,
            gdb,
        }
    }

    fn connect(&self) -> Gdb {
        let stream = TcpStream::connect(&self.gdb).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(60)))
            .unwrap();
        stream.set_nodelay(true).unwrap();
        Gdb { stream }
    }

    fn virtual_ms(&self) -> u64 {
        state(&self.http)["virtual_ms"].as_u64().unwrap()
    }

    /// Returns whether virtual time passes.
    fn runs(&self) -> bool {
        let before = self.virtual_ms();
        std::thread::sleep(Duration::from_millis(100));
        self.virtual_ms() > before
    }

    /// Waits until virtual time passes again.
    fn runs_on(&self) {
        while !self.runs() {}
    }
}

/// A debugger that is connected to the simulator.
struct Gdb {
    stream: TcpStream,
}

impl Gdb {
    fn send(&mut self, packet: &str) {
        let sum = packet.bytes().fold(0_u8, u8::wrapping_add);
        write!(self.stream, "${packet}#{sum:02x}").unwrap();
    }

    fn byte(&mut self) -> u8 {
        let mut byte = [0];
        self.stream.read_exact(&mut byte).expect("a reply");
        byte[0]
    }

    /// Returns the next packet, without its run-length coding.
    fn packet(&mut self) -> String {
        while self.byte() != b'$' {}
        let (mut text, mut sum) = (String::new(), 0_u8);
        loop {
            match self.byte() {
                b'#' => break,
                b'*' => {
                    let count = self.byte();
                    sum = sum.wrapping_add(b'*').wrapping_add(count);
                    let last = text.chars().last().unwrap();
                    text.extend((29..count).map(|_| last));
                }
                byte => {
                    sum = sum.wrapping_add(byte);
                    text.push(char::from(byte));
                }
            }
        }
        let received = String::from_utf8(vec![self.byte(), self.byte()]).unwrap();
        assert_eq!(received, format!("{sum:02x}"), "the checksum of {text}");
        self.stream.write_all(b"+").unwrap();
        text
    }

    fn ask(&mut self, packet: &str) -> String {
        self.send(packet);
        self.packet()
    }

    /// Returns the core's registers.
    fn registers(&mut self) -> Vec<u32> {
        let text = self.ask("g");
        assert_eq!(text.len(), 23 * 8, "{text}");
        (0..23)
            .map(|n| u32::from_str_radix(&text[8 * n..8 * n + 8], 16).unwrap())
            .map(u32::swap_bytes)
            .collect()
    }

    /// Returns r0 and the program counter.
    fn place(&mut self) -> (u32, u32) {
        let registers = self.registers();
        (registers[0], registers[15])
    }

    /// Returns the text that a monitor command prints.
    fn monitor(&mut self, command: &str) -> String {
        let hex: String = command.bytes().map(|byte| format!("{byte:02x}")).collect();
        self.send(&format!("qRcmd,{hex}"));
        let mut said = String::new();
        loop {
            let packet = self.packet();
            let Some(hex) = packet.strip_prefix('O').filter(|hex| *hex != "K") else {
                assert_eq!(packet, "OK");
                return said;
            };
            said.extend(
                (0..hex.len() / 2)
                    .map(|n| char::from(u8::from_str_radix(&hex[2 * n..2 * n + 2], 16).unwrap())),
            );
        }
    }
}

#[test]
fn a_debugger_halts_steps_and_resumes_the_core() {
    let directory = tempfile::tempdir().unwrap();
    let debugged = Debugged::start(directory.path());
    assert!(debugged.runs());
    let mut gdb = debugged.connect();
    let supported = gdb.ask("qSupported:swbreak+;hwbreak+");
    assert!(supported.contains("swbreak+"), "{supported}");
    assert!(supported.contains("qXfer:features:read+"), "{supported}");
    let description = gdb.ask("qXfer:features:read:target.xml:0,800");
    assert!(description.contains("org.gnu.gdb.arm.m-profile"));
    let halted = gdb.ask("?");
    assert!(
        halted.starts_with("S05") || halted.starts_with("T05"),
        "{halted}"
    );
    assert!(!debugged.runs(), "virtual time is stopped");
    let time = gdb.monitor("time");
    assert!(time.ends_with(" s\n"), "{time}");

    assert_eq!(gdb.ask(&format!("Z0,{ADD:x},2")), "OK");
    let stopped = gdb.ask("c");
    assert!(
        stopped.starts_with("T05") && stopped.contains("swbreak"),
        "{stopped}"
    );
    let (count, pc) = gdb.place();
    assert_eq!(pc, ADD);
    assert_eq!(
        gdb.ask(&format!("m{ADD:x},2")),
        "0130",
        "the memory has the instruction of the image"
    );
    let stopped = gdb.ask("s");
    assert!(
        stopped.starts_with("S05") || stopped.starts_with("T05"),
        "{stopped}"
    );
    assert_eq!(gdb.place(), (count + 1, ADD + 2));
    gdb.ask("c");
    assert_eq!(gdb.place(), (count + 1, ADD), "the core is one round later");
    assert_eq!(gdb.ask(&format!("z0,{ADD:x},2")), "OK");

    gdb.send("c");
    debugged.runs_on();
    gdb.stream.write_all(&[3]).unwrap();
    let interrupted = gdb.packet();
    assert_eq!(&interrupted[1..3], "02", "SIGINT: {interrupted}");
    assert!(!debugged.runs());
    assert!(gdb.place().0 > count + 1);

    assert_eq!(
        gdb.monitor("reset").trim_end(),
        "reset; halted before the first instruction"
    );
    assert_eq!(gdb.place().1, START);
    assert_eq!(gdb.ask(&format!("Z1,{ADD:x},2")), "OK");
    assert!(gdb.ask("c").starts_with("T05"));
    assert_eq!(gdb.place(), (0, ADD));
    assert_eq!(gdb.ask("D"), "OK");
    debugged.runs_on();
}

#[test]
fn a_debugger_reads_and_writes_memory_and_registers() {
    let directory = tempfile::tempdir().unwrap();
    let debugged = Debugged::start(directory.path());
    let mut gdb = debugged.connect();
    assert_eq!(gdb.ask("M20000010,4:78563412"), "OK");
    assert_eq!(gdb.ask("m2000000f,6").get(2..10), Some("78563412"));
    assert_eq!(gdb.ask("m8000000,8"), "0050002009000008");
    assert_eq!(gdb.ask("me000ed00,4"), "31c21f41", "CPUID");
    assert!(
        gdb.ask("m40021000,4").starts_with('E'),
        "an address whose reading has side effects"
    );
    assert!(gdb.ask("M8000000,4:00000000").starts_with('E'));
    assert_eq!(gdb.ask("m8000000,4"), "00500020");
    let registers = gdb.registers();
    let changed: String = [&[0xAA, 0xBB], &registers[2..]]
        .concat()
        .iter()
        .map(|value: &u32| format!("{:08x}", value.swap_bytes()))
        .collect();
    assert_eq!(gdb.ask(&format!("G{changed}")), "OK");
    let now = gdb.registers();
    assert_eq!((&now[..2], &now[2..]), (&[0xAA, 0xBB][..], &registers[2..]));
}

#[test]
fn core_keeps_running_when_a_debugger_disconnects_or_sends_invalid_data() {
    let directory = tempfile::tempdir().unwrap();
    let debugged = Debugged::start(directory.path());
    let mut gdb = debugged.connect();
    assert_eq!(gdb.ask(&format!("Z0,{ADD:x},2")), "OK");
    drop(gdb);
    debugged.runs_on();
    assert!(
        debugged.runs(),
        "the server removes the breakpoint of a debugger that disconnects"
    );
    let mut gdb = debugged.connect();
    gdb.stream
        .write_all(b"+GET / HTTP/1.1\r\n\r\n$zz#00$")
        .unwrap();
    drop(gdb);
    debugged.runs_on();
    let mut gdb = debugged.connect();
    assert_eq!(gdb.ask("m8000000,4"), "00500020");
}

#[test]
fn breakpoint_beyond_the_thousandth_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let debugged = Debugged::start(directory.path());
    let mut gdb = debugged.connect();
    for n in 0..1000 {
        assert_eq!(gdb.ask(&format!("Z0,{:x},2", START + 100 + 2 * n)), "OK");
    }
    assert!(gdb.ask(&format!("Z0,{ADD:x},2")).starts_with('E'));
    assert_eq!(gdb.ask(&format!("z0,{:x},2", START + 100)), "OK");
    assert_eq!(gdb.ask(&format!("Z0,{ADD:x},2")), "OK");
}

#[test]
fn packet_without_end_disconnects_the_debugger() {
    let directory = tempfile::tempdir().unwrap();
    let debugged = Debugged::start(directory.path());
    let mut gdb = debugged.connect();
    gdb.send(&format!("M20000010,4:{}", "0".repeat(4096)));
    // Longer than the server wants, but complete: it is answered.
    gdb.packet();
    let mut begun = vec![b'0'; 20_000];
    begun[0] = b'$';
    // The server may reset the connection.
    let _ = gdb.stream.write_all(&begun);
    assert!(!matches!(gdb.stream.read(&mut [0]), Ok(1)));
    debugged.runs_on();
}
