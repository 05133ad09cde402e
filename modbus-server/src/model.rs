//! What the device around the server must bring.

use crate::{Bits, BitsOut, Exception, Span, Words, WordsOut};

/// The points and registers of the device.
///
/// Bits are read alike by functions 01 and 02, words by 03 and 04; function 16 reads a word to write
/// it, and 17 reads words after writing some. The server has checked quantity,
/// byte count and the form of values before it asks; a [`Span`] never wraps. The `check_` methods
/// settle the rest, in the order of V1.1b3: address (02), then value range (03), then the state of
/// the device (04, 06). They change nothing and may be called for a request that is then not
/// carried out.
///
/// The other methods cannot refuse. They are called only after the matching check said yes, but
/// possibly some time after it: what has become impossible meanwhile is theirs to bear (write what
/// is still sensible, read what is there). One call is one request: a read sees one moment, a write
/// is seen as a whole.
pub trait DataModel {
    /// May these bits be read (functions 01 and 02; up to 2000)?
    ///
    /// # Errors
    /// The exception to answer with.
    fn check_read_bits(&self, span: Span) -> Result<(), Exception>;

    /// May these words be read (functions 03, 04 and 17; up to 125)?
    ///
    /// # Errors
    /// The exception to answer with.
    fn check_read_words(&self, span: Span) -> Result<(), Exception>;

    /// May these bits be written (functions 05 and 0F; up to 1968)? `bits` holds as many as `span`.
    ///
    /// # Errors
    /// The exception to answer with; then nothing is written.
    fn check_write_bits(&self, span: Span, bits: Bits<'_>) -> Result<(), Exception>;

    /// May these words be written (functions 06, 10, 16 and 17; up to 123)? `words` holds as many as
    /// `span`.
    ///
    /// # Errors
    /// The exception to answer with; then nothing is written.
    fn check_write_words(&self, span: Span, words: Words<'_>) -> Result<(), Exception>;

    /// Pushes every bit of `span` in order. What is not pushed reads as 0.
    fn read_bits(&self, span: Span, out: &mut BitsOut<'_>);

    /// Pushes every word of `span` in order. What is not pushed reads as 0.
    fn read_words(&self, span: Span, out: &mut WordsOut<'_>);

    /// Writes every bit of `span`.
    fn write_bits(&mut self, span: Span, bits: Bits<'_>);

    /// Writes every word of `span`.
    fn write_words(&mut self, span: Span, words: Words<'_>);

    /// The eight bits of function 07 (V1.1b3 6.7), which are the device's own to name.
    fn exception_status(&self) -> u8 {
        0
    }

    /// The diagnostic register, function 08 sub-function 02 (V1.1b3 6.8): the device's own as well.
    /// A bit that sub-function 0A finds set reads 0 from then on, until it has been 0 here, too, at
    /// a reading.
    fn diagnostic_register(&self) -> u16 {
        0
    }

    /// The identity of function 11 (V1.1b3 6.13), up to 250 bytes; what is beyond is cut off. The
    /// standard leaves its length to the device, and many masters look for the run indicator in
    /// the second byte of the reply's data: one byte serves them all.
    fn server_id(&self) -> &[u8] {
        &[]
    }

    /// The run indicator of function 11: FF, or 00 for a device that is not doing its work.
    fn is_running(&self) -> bool {
        true
    }

    /// An object of the device identification, function 2B/0E (V1.1b3 6.21): 00 vendor, 01 product
    /// code, 02 revision, all or none of them; 03 URL, 04 product, 05 model, 06 application, if
    /// there are; from 80 on the device's own, without a gap. Never asked for 07 to 7F. Up to 244
    /// bytes of text; what is beyond is cut off.
    ///
    /// Without object 00 the device has no such function.
    fn identification(&self, object: u8) -> Option<&[u8]> {
        let _ = object;
        None
    }
}
