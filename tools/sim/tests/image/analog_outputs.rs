//! Analog outputs: when a word reaches the DAC. Every word in every RANGE and SCALE is tested on
//! the host, in `modio-drivers`.

use sim::{Channel, Module, Time};

use crate::bench::{Bench, FIRST};

/// Returns the codes on the DAC's outputs of these channels.
pub fn codes<const N: usize>(bench: &Bench, channels: [usize; N]) -> [u16; N] {
    channels.map(|n| match bench.board.channel(n) {
        Channel::Ao { code } => code,
        other => panic!("channel {n} is {other:?}"),
    })
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
