//! What the device around the server must bring.

use crate::{Bits, BitsOut, Exception, Span, Words, WordsOut};

/// The points and registers of the device.
///
/// Bits are read alike by functions 01 and 02, words by 03 and 04. The server has checked quantity,
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

    /// May these words be read (functions 03 and 04; up to 125)?
    ///
    /// # Errors
    /// The exception to answer with.
    fn check_read_words(&self, span: Span) -> Result<(), Exception>;

    /// May these bits be written (functions 05 and 0F; up to 1968)? `bits` holds as many as `span`.
    ///
    /// # Errors
    /// The exception to answer with; then nothing is written.
    fn check_write_bits(&self, span: Span, bits: Bits<'_>) -> Result<(), Exception>;

    /// May these words be written (functions 06 and 10; up to 123)? `words` holds as many as
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
}
