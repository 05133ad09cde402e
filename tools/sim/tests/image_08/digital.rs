//! Digital points of all slots: each point is on a separate line.

use register_map::codes::LinkAction;
use register_map::configuration::FILTER;
use register_map::links;
use sim::{Module, Time};

use crate::fitted::{LINES, change, fitted, outputs};

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn every_output_point_switches_its_own_line_and_no_other() {
    let mut bench = fitted([Module::Do4; 4], &[]);
    for point in 0..16 {
        let mut bits = [false; 16];
        bits[point] = true;
        bench.write_bits(0, &bits).unwrap();
        bench.board.run_for(Time::from_ms(5));
        for (n, &(port, pin)) in LINES.as_flattened().iter().enumerate() {
            assert!(bench.board.is_output(port, pin), "P{port}{pin}");
            assert_eq!(bench.board.pin(port, pin), n == point, "P{port}{pin}");
        }
        assert_eq!(bench.bits(1, 0, 16), Ok(bits.to_vec()));
    }
    for (point, port) in (0..16).step_by(4).zip(1..) {
        bench.write_bit(point + 2, true).unwrap();
        bench.board.run_for(Time::from_ms(5));
        assert!(outputs(&bench, port)[2], "port {port}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn every_input_point_follows_its_own_line_and_no_other() {
    let mut bench = fitted([Module::Di4; 4], &[]);
    for point in 0..16 {
        let (port, channel) = (point as u8 / 4 + 1, point % 4 + 1);
        change(&mut bench, port, |slot| slot.set_energised(channel, true)).unwrap();
        bench.board.run_for(Time::from_ms(10));
        let mut expected = vec![false; 16];
        expected[point] = true;
        for function in [1, 2] {
            assert_eq!(bench.bits(function, 0, 16).as_ref(), Ok(&expected));
        }
        change(&mut bench, port, |slot| slot.set_energised(channel, false)).unwrap();
        bench.board.run_for(Time::from_ms(10));
    }
    assert_eq!(bench.bits(2, 0, 16), Ok(vec![false; 16]));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn links_connect_ports_within_2_ms() {
    let modules = [Module::Do4, Module::Di4, Module::None, Module::Di4];
    let mut settings = Vec::new();
    // A lamp with two buttons: input 1 of port 2 and input 2 of port 4.
    for (second, button) in [(false, 4), (true, 13)] {
        settings.push((FILTER + button, 0));
        let link = links::of_point(3, second);
        settings.extend([(link, button), (link + 1, LinkAction::Toggle.code())]);
    }
    let mut bench = fitted(modules, &settings);
    let (port, pin) = LINES[0][3];
    for n in 0..12 {
        bench.board.run_for(Time::from_us(n * 137));
        bench.board.watch_pin(port, pin);
        let now = bench.board.now();
        let (slot, channel) = if n % 3 == 0 { (2, 1) } else { (4, 2) };
        for pressed in [true, false] {
            change(&mut bench, slot, |slot| {
                slot.set_energised(channel, pressed)
            })
            .unwrap();
            bench.board.run_for(Time::from_ms(10));
        }
        let edges = bench.board.pin_edges(port, pin).iter();
        let edges: Vec<_> = edges.filter(|(at, _)| *at > now).collect();
        let [&(at, level)] = edges[..] else {
            panic!("the lamp has {} edges", edges.len());
        };
        assert_eq!(level, n % 2 == 0);
        assert!(at - now <= Time::from_ms(2), "{}", at - now);
    }
}
