//! A long run in virtual time: the unit still works at the end, and the simulator uses no more memory.
//!
//! `cargo xtask soak --hours H` runs this test for H hours of virtual time.

use std::{env, fs, time::Instant};

use sim::{Module, Time};

use crate::rig::{FIRST, Rig};

/// Environment variable with the number of hours.
const VARIABLE: &str = "MODIO_SOAK_HOURS";
/// Number of seconds of the test when the variable is not set.
const SECONDS: u64 = 20;
/// Memory that the simulator may use in addition at the end, compared with half of the time, in KiB. In the first nine
/// hours its history of the driver's edges fills up, with 115 KiB in an hour.
const GROWTH: u64 = 1024;

/// Register 0x0208: uptime in s, in two registers; 0x020B: least free stack since the start.
const UPTIME: u8 = 0x08;
const FREE_STACK: u8 = 0x0B;

fn read(rig: &mut Rig, register: u8, count: u8) -> u32 {
    let reply = rig.ask(1, &[3, 2, register, 0, count]);
    let reply = reply.expect("an answer");
    let words = reply[2..].chunks(2);
    words.fold(0, |value, word| {
        value << 16 | u32::from(word[0]) << 8 | u32::from(word[1])
    })
}

/// Memory in use by this process in KiB; `None` on systems other than Linux.
fn memory() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().trim_end_matches("kB").trim().parse().ok()
}

#[test]
#[ignore = "needs the image: cargo xtask test, cargo xtask soak --hours 24"]
fn an_input_changes_and_is_read_every_second_for_hours() {
    let hours: Option<f64> = env::var(VARIABLE)
        .ok()
        .map(|hours| hours.parse().expect(VARIABLE));
    let seconds = hours.map_or(SECONDS, |hours| (hours * 3600.0) as u64);
    let mut rig = Rig::new(Module::Di4, 1);
    let begin = Instant::now();
    let mut early = (0, None);
    for second in 1..=seconds {
        let on = second % 2 == 0;
        rig.board.set_energised(1, on).unwrap();
        rig.board.run_until(Time::from_secs(second));
        let reply = rig.ask(1, &[2, 0, FIRST, 0, 4]);
        assert_eq!(reply, Some(vec![2, 1, u8::from(on)]), "second {second}");
        if second == seconds.div_ceil(2) {
            early = (read(&mut rig, FREE_STACK, 1), memory());
        }
        if hours.is_some() && second % 3600 == 0 {
            let passed = begin.elapsed().as_secs();
            println!(
                "{} h of virtual time in {passed} s, {:?} KiB in use",
                second / 3600,
                memory()
            );
        }
    }
    let uptime = u64::from(read(&mut rig, UPTIME, 2));
    // The crystal may be 100 ppm off.
    let off = uptime.abs_diff(seconds);
    assert!(off <= 1 + seconds / 10_000, "{uptime} s of {seconds} s");
    assert_eq!(
        read(&mut rig, FREE_STACK, 1),
        early.0,
        "bytes of free stack"
    );
    // Other tests in the same process would change its memory.
    if let (Some(_), Some(early), Some(late)) = (hours, early.1, memory()) {
        println!("{early} KiB in use after half of the time, {late} KiB at the end");
        assert!(late <= early + GROWTH, "{early} KiB, then {late} KiB");
    }
}
