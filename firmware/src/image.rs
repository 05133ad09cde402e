//! The process image: what the modules' points are, for the line on one side and the scan on the
//! other.
//!
//! The scan copies inputs in and outputs out; requests read and write the image alone. Neither ever
//! waits for the other's hardware, and a request that touches several points sees and leaves one
//! consistent state.

use modbus_server::{Bits, BitsOut, DataModel, Exception, Span, Words, WordsOut};
use modio_drivers::{CHANNELS, Channels, Kind};
use register_map::points;

const SLOT: u16 = points::SLOT_FIRST;

/// The points of the device.
#[derive(Debug)]
pub struct ProcessImage {
    kinds: [Kind; CHANNELS],
    channels: Channels,
    /// The module could not be read or driven at the last scan.
    failing: bool,
}

impl ProcessImage {
    /// An image of a slot whose channels are of these kinds, with everything off.
    #[must_use]
    pub const fn new(kinds: [Kind; CHANNELS]) -> Self {
        Self {
            kinds,
            channels: Channels::new(),
            failing: false,
        }
    }

    /// What stands in the slot's channels, for the scan to take its outputs from.
    #[must_use]
    pub const fn channels(&self) -> Channels {
        self.channels
    }

    /// Takes the inputs a scan has brought, and whether it succeeded. Outputs stay as commanded,
    /// which may have happened during the scan.
    pub fn scanned(&mut self, scanned: &Channels, failing: bool) {
        self.failing = failing;
        for (channel, kind) in self.kinds.iter().enumerate() {
            if *kind == Kind::BitInput {
                self.channels.set_bit(channel, scanned.bit(channel));
            }
        }
    }

    /// Whether the module could not be read or driven at the last scan.
    #[must_use]
    pub const fn failing(&self) -> bool {
        self.failing
    }

    /// Checks that a span's points exist and are all of a kind that will do, then that the module
    /// answers.
    fn check(&self, span: Span, will_do: fn(Kind) -> bool) -> Result<(), Exception> {
        let exists = |address: u16| {
            let channel = usize::from(address.wrapping_sub(SLOT));
            self.kinds.get(channel).copied().is_some_and(will_do)
        };
        // A long span fails at its fifth address at the latest.
        if !span.addresses().all(exists) {
            return Err(Exception::IllegalDataAddress);
        }
        if self.failing {
            return Err(Exception::ServerDeviceFailure);
        }
        Ok(())
    }
}

fn channels_of(span: Span) -> impl Iterator<Item = usize> {
    span.addresses()
        .map(|address| usize::from(address.wrapping_sub(SLOT)))
}

impl DataModel for ProcessImage {
    fn check_read_bits(&self, span: Span) -> Result<(), Exception> {
        self.check(span, |kind| {
            matches!(kind, Kind::BitInput | Kind::BitOutput)
        })
    }

    fn check_read_words(&self, span: Span) -> Result<(), Exception> {
        self.check(span, |_| false)
    }

    fn check_write_bits(&self, span: Span, _bits: Bits<'_>) -> Result<(), Exception> {
        self.check(span, |kind| kind == Kind::BitOutput)
    }

    fn check_write_words(&self, span: Span, _words: Words<'_>) -> Result<(), Exception> {
        self.check(span, |_| false)
    }

    fn read_bits(&self, span: Span, out: &mut BitsOut<'_>) {
        channels_of(span).for_each(|channel| out.push(self.channels.bit(channel)));
    }

    fn read_words(&self, _span: Span, _out: &mut WordsOut<'_>) {}

    fn write_bits(&mut self, span: Span, bits: Bits<'_>) {
        channels_of(span)
            .zip(bits.iter())
            .for_each(|(channel, bit)| self.channels.set_bit(channel, bit));
    }

    fn write_words(&mut self, _span: Span, _words: Words<'_>) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    const ADDRESS: Result<(), Exception> = Err(Exception::IllegalDataAddress);

    fn span(start: u16, count: u16) -> Span {
        Span::new(start, count).unwrap()
    }

    fn read(image: &ProcessImage, span: Span) -> u8 {
        let mut byte = [0];
        image.read_bits(span, &mut BitsOut::new(&mut byte, span.count()));
        byte[0]
    }

    #[test]
    fn only_the_slots_points_exist_and_a_span_must_lie_within_them() {
        let image = ProcessImage::new([Kind::BitInput; 4]);
        assert_eq!(image.check_read_bits(span(0x10, 4)), Ok(()));
        for (start, count) in [
            (0x0F, 1),
            (0x14, 1),
            (0x0F, 2),
            (0x10, 5),
            (0x13, 2),
            (0, 2000),
            (0xFFFF, 1),
        ] {
            assert_eq!(
                image.check_read_bits(span(start, count)),
                ADDRESS,
                "{start:#x}+{count}"
            );
        }
        assert_eq!(image.check_read_words(span(0x10, 1)), ADDRESS);
        let absent = ProcessImage::new([Kind::None; 4]);
        assert_eq!(absent.check_read_bits(span(0x10, 1)), ADDRESS);
    }

    #[test]
    fn inputs_follow_the_scan_and_cannot_be_written() {
        let mut image = ProcessImage::new([Kind::BitInput; 4]);
        let mut scanned = Channels::new();
        scanned.set_bit(1, true);
        image.scanned(&scanned, false);
        assert_eq!(read(&image, span(0x10, 4)), 0b0010);
        assert_eq!(read(&image, span(0x11, 2)), 0b01);
        assert_eq!(
            image.check_write_bits(span(0x10, 1), Bits::new(&[1], 1)),
            ADDRESS
        );
        assert_eq!(
            image.check_write_words(span(0x10, 1), Words::new(&[0, 1])),
            ADDRESS
        );
    }

    #[test]
    fn outputs_keep_what_was_commanded_whatever_the_scan_brings() {
        let mut image = ProcessImage::new([Kind::BitOutput; 4]);
        let bits = Bits::new(&[0b101], 3);
        assert_eq!(image.check_write_bits(span(0x11, 3), bits), Ok(()));
        image.write_bits(span(0x11, 3), bits);
        image.scanned(&Channels::new(), false);
        assert_eq!(read(&image, span(0x10, 4)), 0b1010);
        assert!(image.channels().bit(1) && image.channels().bit(3));
    }

    #[test]
    fn a_failing_module_answers_so_after_the_address_was_found_good() {
        let mut image = ProcessImage::new([Kind::BitInput; 4]);
        image.scanned(&Channels::new(), true);
        assert_eq!(
            image.check_read_bits(span(0x10, 4)),
            Err(Exception::ServerDeviceFailure)
        );
        assert_eq!(image.check_read_bits(span(0x14, 1)), ADDRESS);
        image.scanned(&Channels::new(), false);
        assert_eq!(image.check_read_bits(span(0x10, 4)), Ok(()));
    }
}
