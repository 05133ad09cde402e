//! Every setting takes the values at the ends of its range, and refuses the values just outside.

use super::*;
use register_map::Values;
use register_map::points::Kind;

/// Returns the values at the ends of a set, and the values just outside.
fn ends(values: Values) -> (Vec<u16>, Vec<u16>) {
    let inside = match values {
        Values::Range { min, max } => std::vec![min, max],
        Values::RangeOr { also, min, max } => std::vec![also, min, max],
        Values::OneOf(set) => set.to_vec(),
    };
    let beside = inside
        .iter()
        .flat_map(|value| [value.checked_sub(1), value.checked_add(1)]);
    let outside = beside.flatten().chain([0x7FFF, 0xFFFF]);
    let outside = outside.filter(|value| !values.allow(*value)).collect();
    (inside, outside)
}

register_map::on_boards! {
    every_setting_takes_the_ends_of_its_range_and_nothing_beyond: Modio02, Modio08
}

fn every_setting_takes_the_ends_of_its_range_and_nothing_beyond<B: Board>() {
    let slot = points::of_port(B::ROW.first_port);
    let module_slot = module_of(B::ROW.first_port);
    let mut settings = Vec::new();
    for rule in B::ROW
        .rules()
        .iter()
        .filter(|rule| ![KEY, COMMAND, HEARTBEAT, UNIT].contains(&rule.first))
    {
        settings.extend(rule.addresses().map(|address| (rule, address)));
    }
    for module in Module::ALL {
        let points = module.points();
        for (rule, address) in &settings {
            let address = *address;
            // Seven data bits need ASCII mode.
            let mode = u16::from(address == FORMAT);
            let mut config = fixed::on::<B>(&[(module_slot, module.code()), (MODE, mode)]);
            let port = port_of(address);
            let channel = point_of(address).and_then(|point| point.checked_sub(slot));
            let kind = channel.and_then(|channel| points.get(usize::from(channel)));
            let (inside, outside) = ends(if port.is_some_and(|port| !B::ROW.has_slot(port)) {
                // A port without a slot cannot have a module.
                Values::only(0)
            } else {
                *rule.values_for(kind.copied().unwrap_or(Kind::None))
            });
            for value in inside {
                assert_eq!(
                    write(&mut config, address, &[value]),
                    DONE,
                    "{address:#06x}"
                );
                assert_eq!(
                    read(&config, address, 1).unwrap(),
                    [value],
                    "{address:#06x}"
                );
            }
            let before = read(&config, address, 1).unwrap();
            for value in outside {
                let written = write(&mut config, address, &[value]);
                assert_eq!(written, VALUE, "{address:#06x} <- {value}");
            }
            assert_eq!(read(&config, address, 1).unwrap(), before, "{address:#06x}");
        }
    }
}
