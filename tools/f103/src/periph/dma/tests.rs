use super::*;

const CCR: u32 = 0x08;
const CNDTR: u32 = 0x0C;
const CPAR: u32 = 0x10;
const CMAR: u32 = 0x14;

fn write(dma: &mut Dma, offset: u32, value: u32) {
    dma.write(offset, value, Time::ZERO).unwrap();
}

fn read(dma: &mut Dma, offset: u32) -> u32 {
    dma.read(offset, Time::ZERO).unwrap()
}

/// Returns a controller whose channel `n` makes `count` transfers with this CCR.
fn started(n: u32, count: u32, ccr: u32) -> Dma {
    let mut dma = Dma::new(7);
    let base = CHANNEL * n;
    write(&mut dma, base + CPAR, 0x4001_244C);
    write(&mut dma, base + CMAR, 0x2000_0010);
    write(&mut dma, base + CNDTR, count);
    write(&mut dma, base + CCR, ccr);
    dma
}

#[test]
fn transfer_has_both_addresses_and_widths_and_is_counted() {
    // MINC, MSIZE = 16, PSIZE = 32.
    let mut dma = started(
        1,
        3,
        ccr::EN | ccr::MINC | 1 << ccr::MSIZE | 2 << ccr::PSIZE,
    );
    let first = dma.take(1).unwrap();
    assert_eq!(first.peripheral, (0x4001_244C, 4));
    assert_eq!(first.memory, (0x2000_0010, 2));
    assert!(!first.to_peripheral);
    assert_eq!(dma.take(1).unwrap().memory, (0x2000_0012, 2));
    assert_eq!(read(&mut dma, CHANNEL + CNDTR), 1);
    assert_eq!(dma.take(0), None, "another channel");
}

#[test]
fn flags_of_the_half_and_of_the_end_request_their_interrupts() {
    let mut dma = started(4, 4, ccr::EN | ccr::DIR | ccr::HTIE | ccr::TCIE);
    assert!(dma.take(4).unwrap().to_peripheral);
    assert_eq!(dma.requests(), 0);
    dma.take(4);
    assert_eq!(read(&mut dma, 0), (flag::HALF | flag::GLOBAL) << 16);
    assert_eq!(dma.requests(), 1 << 4);
    write(&mut dma, 4, flag::HALF << 16);
    assert_eq!((read(&mut dma, 0), dma.requests()), (0, 0));
    dma.take(4);
    dma.take(4);
    assert_eq!(read(&mut dma, 0), (flag::COMPLETE | flag::GLOBAL) << 16);
    assert_eq!(dma.take(4), None, "no transfer is left");
    write(&mut dma, 4, flag::GLOBAL << 16);
    assert_eq!(read(&mut dma, 0), 0);
}

#[test]
fn circular_channel_begins_again_at_its_first_address() {
    let mut dma = started(0, 2, ccr::EN | ccr::MINC | ccr::CIRC);
    let mut addresses = Vec::new();
    for _ in 0..3 {
        addresses.push(dma.take(0).unwrap().memory.0);
    }
    assert_eq!(addresses, [0x2000_0010, 0x2000_0011, 0x2000_0010]);
    assert_eq!(read(&mut dma, CNDTR), 1);
}

#[test]
fn channel_is_set_up_while_it_is_off_only() {
    let mut dma = started(0, 2, ccr::EN);
    for register in [CNDTR, CPAR, CMAR] {
        assert!(dma.write(register, 0, Time::ZERO).is_err());
    }
    assert_eq!(read(&mut dma, CNDTR), 2);
    write(&mut dma, CCR, 0);
    write(&mut dma, CNDTR, 9);
    assert_eq!(dma.take(0), None, "off");
    write(&mut dma, CCR, ccr::EN);
    assert_eq!(dma.take(0).unwrap().memory.0, 0x2000_0010);
    assert_eq!(read(&mut dma, CNDTR), 8);
}

#[test]
fn failed_access_ends_the_channel() {
    let mut dma = started(0, 2, ccr::EN | ccr::TEIE);
    dma.take(0);
    dma.fail(0);
    assert_eq!(read(&mut dma, 0), flag::ERROR | flag::GLOBAL | flag::HALF);
    assert_eq!((dma.requests(), dma.take(0)), (1, None));
    assert!(dma.write(CCR, ccr::MEM2MEM, Time::ZERO).is_err());
    dma.reset(Time::ZERO);
    assert_eq!(read(&mut dma, 0), 0);
}
