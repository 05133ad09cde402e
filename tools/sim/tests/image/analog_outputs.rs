//! Analog outputs: which output of the DAC a word reaches, and when. Every word in every RANGE and SCALE is tested on
//! the host, in `modio-drivers`.

use register_map::configuration::{RANGE, SCALE};
use sim::{Channel, Module, Time};

use crate::bench::{Bench, FIRST, SLOT};

/// Returns the codes on the DAC's outputs of these channels.
pub fn codes<const N: usize>(bench: &Bench, channels: [usize; N]) -> [u16; N] {
    channels.map(|n| match bench.board.channel(n) {
        Channel::Ao { code } => code,
        other => panic!("channel {n} is {other:?}"),
    })
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_2ai2ao_has_its_outputs_on_the_last_channels_of_the_dac() {
    let settings = [
        (SCALE + SLOT + 2, 1),
        (SCALE + SLOT + 3, 1),
        (RANGE + SLOT + 3, 1),
    ];
    let mut bench = Bench::set_up(Module::Ai2Ao2, &settings);
    bench.write(SLOT + 2, &[2500, 12_000]).unwrap();
    bench.board.run_for(Time::from_ms(20));
    assert_eq!(codes(&bench, [3, 4]), [1024, 2457]);
    let (registers, _) = bench.board.slot().dac();
    assert_eq!(
        [0, 1].map(|n| registers[n].code),
        [0, 0],
        "DAC outputs A and B are not used"
    );
    assert_eq!(bench.write(SLOT + 2, &[10_001, 12_000]), Err(3));
    assert_eq!(bench.write(SLOT + 2, &[0, 3_999]), Err(3));
    assert_eq!(
        bench.write(SLOT + 1, &[0, 0, 12_000]),
        Err(2),
        "the write starts at an input"
    );
    bench.board.run_for(Time::from_ms(20));
    assert_eq!(codes(&bench, [3, 4]), [1024, 2457]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_write_reaches_the_dac_within_ten_milliseconds() {
    let mut bench = Bench::set_up(Module::Ao4, &[]);
    for code in [4095, 0, 1234, 77] {
        let frame = crate::bench::adu(&[1, 6, 0, FIRST + 3, (code >> 8) as u8, code as u8]);
        let now = bench.board.now();
        let end = bench.board.line().send(now, &frame);
        bench.board.run_until(end + bench.t35() + Time::from_ms(10));
        assert_eq!(codes(&bench, [4]), [code]);
        bench.answer_after(end);
    }
}
