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

#[test]
fn every_setting_takes_the_ends_of_its_range_and_nothing_beyond() {
    let mut settings = Vec::new();
    for rule in RULES
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
            let mut config = unlocked(&[(MODULE_SLOT, module.code()), (MODE, mode)]);
            let channel = point_of(address).and_then(|point| point.checked_sub(SLOT));
            let kind = channel.and_then(|channel| points.get(usize::from(channel)));
            let is_port = (module_of(1)..=module_of(8)).contains(&address);
            let (inside, outside) = ends(match is_port && address != MODULE_SLOT {
                // A port without a slot cannot have a module.
                true => Values::only(0),
                false => *rule.values_for(kind.copied().unwrap_or(Kind::None)),
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
