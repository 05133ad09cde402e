//! The interface that the device must implement.

use crate::{
    Adu, Bits, BitsOut, Exception, Function, Server, Span, Table, TextOut, Words, WordsOut,
};

/// The points and registers of the device.
///
/// Bits are in the coils and the discrete inputs, words in the holding registers and the input registers. The
/// methods that read receive the [`Table`]. A model whose coils and discrete inputs are the same points, or whose
/// holding and input registers are the same words, ignores it. Writes always go to the coils or the holding
/// registers. Every table is empty by default, so a model without bits leaves the methods for bits out.
///
/// The server checks quantity, byte count and the form of values before it calls the model; a [`Span`] never wraps.
/// The `check_` methods decide the rest, in the order of V1.1b3: address (02), then value range (03), then the
/// state of the device (04, 06). They change nothing and may be called for a request that is then not executed.
/// Function 16 reads a holding register to write it; function 17 writes some and then reads some.
///
/// The methods that read and write cannot fail. They are called right after the matching check succeeded. One call serves one request, except that each group of file records has its own call. So a read returns
/// the values of one moment, and a write takes effect as a whole.
pub trait DataModel {
    /// Returns whether the device has this function. The server answers a function that the device does not have
    /// with exception 01, before any other check. The default is all functions.
    fn has(&self, function: Function) -> bool {
        let _ = function;
        true
    }

    /// Checks whether these bits of `table` can be read (functions 01 and 02; up to 2000).
    ///
    /// # Errors
    /// The exception to answer with. The default is 02 for every span.
    fn check_read_bits(&self, table: Table, span: Span) -> Result<(), Exception> {
        let _ = (table, span);
        Err(Exception::IllegalDataAddress)
    }

    /// Checks whether these words of `table` can be read (functions 03, 04 and 17; up to 125).
    ///
    /// # Errors
    /// The exception to answer with. The default is 02 for every span.
    fn check_read_words(&self, table: Table, span: Span) -> Result<(), Exception> {
        let _ = (table, span);
        Err(Exception::IllegalDataAddress)
    }

    /// Checks whether these coils can be written (functions 05 and 0F; up to 1968). `bits` holds as
    /// many as `span`.
    ///
    /// # Errors
    /// The exception to answer with; then nothing is written. The default is 02 for every span.
    fn check_write_bits(&self, span: Span, bits: Bits<'_>) -> Result<(), Exception> {
        let _ = (span, bits);
        Err(Exception::IllegalDataAddress)
    }

    /// Checks whether these holding registers can be written (functions 06, 10, 16 and 17; up to
    /// 123). `words` holds as many as `span`.
    ///
    /// # Errors
    /// The exception to answer with; then nothing is written. The default is 02 for every span.
    fn check_write_words(&self, span: Span, words: Words<'_>) -> Result<(), Exception> {
        let _ = (span, words);
        Err(Exception::IllegalDataAddress)
    }

    /// Pushes every bit of `span` in order. Bits that are not pushed read as 0.
    fn read_bits(&self, table: Table, span: Span, out: &mut BitsOut<'_>) {
        let _ = (table, span, out);
    }

    /// Called before [`read_words`](Self::read_words) of functions 03, 04 and 17, with the server of this request. A model whose registers show
    /// the server's [`counters`](Server::counters), which include the request, copies them here.
    fn before_read_words(&mut self, span: Span, server: &Server) {
        let _ = (span, server);
    }

    /// Pushes every word of `span` in order. Words that are not pushed read as 0.
    fn read_words(&self, table: Table, span: Span, out: &mut WordsOut<'_>) {
        let _ = (table, span, out);
    }

    /// Writes every coil of `span`.
    fn write_bits(&mut self, span: Span, bits: Bits<'_>) {
        let _ = (span, bits);
    }

    /// Writes every holding register of `span`.
    fn write_words(&mut self, span: Span, words: Words<'_>) {
        let _ = (span, words);
    }

    /// Returns whether the device has files. The server of a device without files answers functions 14 and 15 with
    /// exception 01, before any other check. The default is no files.
    fn has_files(&self) -> bool {
        false
    }

    /// Checks whether these records of a file can be read (function 14, V1.1b3 6.14). A record is a word. A request
    /// may have several groups of records, each checked by its own call, up to 124 words in total.
    ///
    /// `file` is 1 or more, and no record is above 9999: the server answers all others with exception 02.
    ///
    /// # Errors
    /// The exception to answer with: the same as for tables, and 08 if the memory of the file is damaged. The
    /// default is 02 for every record.
    fn check_read_file(&self, file: u16, records: Span) -> Result<(), Exception> {
        let _ = (file, records);
        Err(Exception::IllegalDataAddress)
    }

    /// Checks whether these records of a file can be written (function 15, V1.1b3 6.15), as
    /// [`check_read_file`](Self::check_read_file) does; up to 122 words. `words` holds as many as `records`.
    ///
    /// # Errors
    /// The exception to answer with; then nothing of the request is written. The default is 02 for every record.
    fn check_write_file(
        &self,
        file: u16,
        records: Span,
        words: Words<'_>,
    ) -> Result<(), Exception> {
        let _ = (file, records, words);
        Err(Exception::IllegalDataAddress)
    }

    /// Pushes every word of `records` in order. Words that are not pushed read as 0. Called for each group of a
    /// request.
    fn read_file(&self, file: u16, records: Span, out: &mut WordsOut<'_>) {
        let _ = (file, records, out);
    }

    /// Writes every word of `records`. Called for each group of a request, in order, after all of them were checked.
    fn write_file(&mut self, file: u16, records: Span, words: Words<'_>) {
        let _ = (file, records, words);
    }

    /// Returns the eight bits of function 07 (V1.1b3 6.7). The device defines their meaning.
    fn exception_status(&self) -> u8 {
        0
    }

    /// Returns the diagnostic register, function 08 sub-function 02 (V1.1b3 6.8). The device defines its meaning,
    /// too. Sub-function 0A clears bits: a bit that was set then reads as 0 until this method has returned it as 0
    /// once.
    fn diagnostic_register(&self) -> u16 {
        0
    }

    /// Returns the server ID of function 11 (V1.1b3 6.13), up to 250 bytes; the rest is cut. The standard leaves
    /// its length to the device, and many masters expect the run indicator in the second byte of the reply's data.
    /// An ID of one byte works with all masters.
    fn server_id(&self) -> &[u8] {
        &[]
    }

    /// Returns the additional data of function 11, after the run indicator (V1.1b3 6.13). It is cut where it
    /// exceeds 250 bytes together with the server ID.
    fn additional_data(&self) -> &[u8] {
        &[]
    }

    /// Returns the run indicator of function 11: FF for true, 00 for false.
    fn is_running(&self) -> bool {
        true
    }

    /// Appends an object of the device identification to `text` and returns `true`; returns `false` if the object
    /// does not exist. Function 2B/0E (V1.1b3 6.21): 00 vendor, 01 product code and 02 revision, either all or none
    /// of them; 03 URL, 04 product, 05 model and 06 application, if they exist; from 80 on the device's own
    /// objects, without a gap. Never called for 07 to 7F. The text may have up to 244 bytes; the rest is cut.
    ///
    /// A device without object 00 does not have this function.
    fn identification(&self, object: u8, text: &mut TextOut<'_>) -> bool {
        let _ = (object, text);
        false
    }

    /// Checks a request with a function code that is no [`Function`]: a user-defined one, 65 to 72 and 100 to 110
    /// (V1.1b3 5.1), or one of the standard that the server does not support. `data` are the bytes after the
    /// function code.
    ///
    /// # Errors
    /// The exception to answer with. The default is 01.
    fn check_custom(&self, code: u8, data: &[u8]) -> Result<(), Exception> {
        let _ = (code, data);
        Err(Exception::IllegalFunction)
    }

    /// Serves a request that [`check_custom`](Self::check_custom) accepted; a broadcast is not served. `adu` holds
    /// the unit address, the function code and the data of the request. Replace the data by those of the reply: keep
    /// the first two bytes ([`Adu::truncate`]), then [`Adu::push`] up to 252 bytes; the rest is cut.
    fn serve_custom(&mut self, code: u8, adu: &mut Adu) {
        let _ = code;
        adu.truncate(2);
    }
}
