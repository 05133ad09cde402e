//! The fault record of a unit, in one line.

use register_map::codes::FaultKind;
use register_map::fault;

use crate::device::Device;
use crate::failure::Failure;
use crate::value::long;

/// Number of registers from the kind of the fault to its uptime.
const COUNT: u16 = fault::UPTIME + 2 - fault::KIND;

/// Describes the last fault of a unit.
pub async fn fault_record(device: &mut Device, address: u8) -> Result<String, Failure> {
    let usual = std::mem::replace(&mut device.unit, address);
    let words = device.read_words(fault::KIND, COUNT).await;
    device.unit = usual;
    Ok(described(&words?))
}

fn described(words: &[u16]) -> String {
    let kind = words.first().copied().unwrap_or_default();
    if kind == FaultKind::None.code() {
        return "its fault record is empty".to_owned();
    }
    let kind = FaultKind::from_code(kind).map_or("of an unknown kind", FaultKind::name);
    let at = |register: u16| {
        let words = words.get(usize::from(register - fault::KIND)..);
        long(words.and_then(|words| words.get(..2)).unwrap_or_default())
    };
    let (counter, uptime) = (at(fault::PROGRAM_COUNTER), at(fault::UPTIME));
    format!(
        "its last fault, perhaps of before: {kind}, program counter {counter:#010x}, {uptime} s after its start (`modioctl info`)"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_described_with_its_place_and_its_time() {
        let mut words = [0; COUNT as usize];
        assert_eq!(described(&words), "its fault record is empty");
        words[0] = FaultKind::HardFault.code();
        words[2..4].copy_from_slice(&[0x0801, 0x2345]);
        words[11] = 7;
        assert_eq!(
            described(&words),
            "its last fault, perhaps of before: hard fault, program counter 0x08012345, 7 s after its start (`modioctl info`)"
        );
    }
}
