//! Analog outputs: when a word reaches the DAC. Every word in every RANGE and SCALE is tested on
//! the host, in `modio-drivers`.

use sim::{Channel, Module, Time};

use crate::rig::{FIRST, Rig};

/// Returns the codes on the DAC's outputs of these channels.
pub fn codes<const N: usize>(rig: &Rig, channels: [usize; N]) -> [u16; N] {
    channels.map(|n| match rig.board.channel(n) {
        Channel::Ao { code } => code,
        other => panic!("channel {n} is {other:?}"),
    })
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_write_reaches_the_dac_within_ten_milliseconds() {
    let mut rig = Rig::set_up(Module::Ao4, &[]);
    for code in [4095, 0, 1234, 77] {
        let frame = crate::rig::adu(&[1, 6, 0, FIRST + 3, (code >> 8) as u8, code as u8]);
        let now = rig.board.now();
        let end = rig.board.line().send(now, &frame);
        rig.board.run_until(end + rig.t35() + Time::from_ms(10));
        assert_eq!(codes(&rig, [4]), [code]);
        rig.answer_after(end);
    }
}
