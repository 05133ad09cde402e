//! Analog outputs: from the word written to the code at the DAC.

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
fn words_become_the_nearest_code_in_every_range_and_scale() {
    let mut bench = Bench::set_up(Module::Ao4, &[]);
    // Range, scale, smallest and largest word, word of full scale at code 4095.
    let scales = [
        (0, 0, 0, 4095, 4095),
        (1, 0, 0, 4095, 4095),
        (0, 1, 0, 10_000, 10_000),
        (1, 1, 4_000, 20_000, 20_000),
    ];
    for (range, scale, min, max, full_scale) in scales {
        bench.configure(RANGE + SLOT, &[range; 4]);
        bench.configure(SCALE + SLOT, &[scale; 4]);
        let middle = u16::midpoint(min, max);
        for word in [min, min + 1, middle, middle + 1, max - 1, max] {
            let code = (f64::from(word) * 4095.0 / f64::from(full_scale)).round() as u16;
            bench.write(SLOT, &[word, min, word, max]).unwrap();
            bench.board.run_for(Time::from_ms(20));
            let [first, _, third, last] = codes(&bench, [1, 2, 3, 4]);
            assert_eq!(
                [first, third, last],
                [code, code, 4095],
                "{range} {scale} {word}"
            );
            assert_eq!(bench.registers(SLOT, 4), Ok(vec![word, min, word, max]));
        }
        let before = codes(&bench, [1, 2, 3, 4]);
        for refused in [max + 1, u16::MAX].into_iter().chain(min.checked_sub(1)) {
            for channel in 0..4 {
                let mut words = [max; 4];
                words[channel] = refused;
                assert_eq!(bench.write(SLOT, &words), Err(3), "{words:?}");
                let one = SLOT + channel as u16;
                assert_eq!(bench.write_single(6, one, refused), Err(3), "{refused}");
            }
        }
        bench.board.run_for(Time::from_ms(20));
        assert_eq!(
            codes(&bench, [1, 2, 3, 4]),
            before,
            "a refused write moved an output"
        );
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn another_scale_or_range_does_not_move_an_output() {
    let mut bench = Bench::set_up(Module::Ao4, &[]);
    let raw = [0, 819, 2048, 4095];
    bench.write(SLOT, &raw).unwrap();
    for (range, scale, words) in [
        (0, 1, [0, 2000, 5001, 10_000]),
        (1, 1, [0, 4000, 10_002, 20_000]),
        (1, 0, raw),
        (0, 0, raw),
    ] {
        bench.configure(RANGE + SLOT, &[range; 4]);
        bench.configure(SCALE + SLOT, &[scale; 4]);
        bench.board.run_for(Time::from_ms(150));
        assert_eq!(
            bench.registers(SLOT, 4),
            Ok(words.to_vec()),
            "{range} {scale}"
        );
        assert_eq!(codes(&bench, [1, 2, 3, 4]), raw, "{range} {scale}");
    }
    // Outputs have no range NTC.
    assert_eq!(bench.write(RANGE + SLOT, &[2]), Err(3));
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
