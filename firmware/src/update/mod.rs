//! An update over the line: takes the blocks of a new image into the slot that does not run, and carries out the orders
//! that change the boot state.
//!
//! ```text
//!   0xB001          blocks, function 15                0xB002
//!   ───────> erase ────────> staged ──> programmed ──────────> CRC-32, new, restart
//!            (background)    (serve)    (background)           (background)
//! ```
//!
//! A request only notes the [`Job`]. The background task does it, one step at a time, so the device serves its points
//! during an update. A block is in RAM until it is programmed, which takes up to 5 ms. There is room for two blocks.

mod missing;
mod work;

#[cfg(test)]
mod tests;

use core::cell::Cell;

use boot_state::commands::{Refused, Running};
use boot_state::{Image, Record};
use modbus_server::{Exception, Span, Words};
use register_map::codes::Command;
use register_map::layout::Layout;
use register_map::state::update as register;
use register_map::update::{BLOCK, BLOCK_BYTES, Header, Reason, Slot, State, block_at, status};

use crate::config::LineName;
pub use boot_state::commands::Order;
use missing::Missing;
pub use work::{Block, Failed, InSlot, Job, described};

/// Seconds after which an image on trial that nobody has confirmed restarts.
pub const TRIAL_S: u32 = 15 * 60;

/// Number of erases of pages that do not take their blocks.
const REPAIRS: u8 = 8;

/// Returns the order of a command.
#[must_use]
pub const fn order_of(command: Command) -> Option<Order> {
    match command {
        Command::Prepare => Some(Order::Prepare),
        Command::Finish => Some(Order::Finish),
        Command::Confirm => Some(Order::Confirm),
        Command::GoBack => Some(Order::GoBack),
        _ => None,
    }
}

/// The update of a device behind the loader.
#[derive(Debug)]
pub struct Update {
    /// The code of the board.
    board: u8,
    layout: &'static Layout,
    running: Running,
    /// SW01 = 254 chose the running slot.
    switched: bool,
    /// The running image and the one in the other slot, as [`described`].
    images: [[u16; 10]; 2],
    /// The numbers of the loader's keys, as file 2 reports them.
    keys: [u16; 4],
    /// The loader wrote no boot state, or nobody can read it. The next start mends that.
    lost: bool,
    /// The line that ordered the preparation.
    line: LineName,
    /// The CRC-32 in the header of the image that is received, once it is known.
    header: Option<u32>,
    missing: Missing,
    staged: [Option<Block>; 2],
    /// Pages that the preparation has still to erase.
    pages: u16,
    /// A page that does not take its blocks and must be erased.
    bad: Option<u16>,
    /// Number of times that a bad page may still be erased.
    repairs: u8,
    /// The first block that came last was refused, so those behind it are of an image for another board or slot.
    refused: Cell<bool>,
    /// Why the first block was refused, or the image is not intact.
    reason: Cell<Option<Reason>>,
    order: Option<Order>,
    /// The image in the other slot was found intact for the order.
    intact: bool,
}

impl Update {
    /// Returns the update of a board with this code and this layout, which runs from `slot`. `images` are the running
    /// image and the other one, as [`described`], and `keys` are the numbers of the loader's keys, zero if it says none.
    /// Without a `record`, the loader found the running image genuine and could not write it down, so nothing is ordered
    /// until the next start.
    #[must_use]
    pub fn new(
        board: u8,
        layout: &'static Layout,
        slot: Slot,
        record: Option<Record>,
        images: [[u16; 10]; 2],
        keys: [u16; 4],
        switched: bool,
    ) -> Self {
        let first = Record {
            preferred: slot,
            states: [State::Empty; 2],
            floor: 0,
            bits: 0,
        };
        let lost = record.is_none();
        let record = record.unwrap_or(first.with(slot, State::Confirmed));
        Self {
            board,
            layout,
            running: Running {
                record,
                slot,
                prepared: false,
            },
            switched,
            images,
            keys,
            lost,
            line: LineName::Rs485,
            header: None,
            missing: Missing::all(0),
            staged: [const { None }; 2],
            pages: 0,
            bad: None,
            repairs: 0,
            refused: Cell::new(false),
            reason: Cell::new(None),
            order: None,
            intact: false,
        }
    }

    /// Returns whether the running image is on trial.
    #[must_use]
    pub fn is_on_trial(&self) -> bool {
        !self.running.is_confirmed()
    }

    /// Returns whether the running image is on trial, and no order to confirm it is being carried out.
    #[must_use]
    pub fn is_unconfirmed(&self) -> bool {
        self.is_on_trial() && self.order.is_none()
    }

    /// Returns register 0x022A.
    #[must_use]
    pub fn register(&self) -> u16 {
        let bit = |mask, set| if set { mask } else { 0 };
        let (other, _) = self.running.other().code();
        (self.running.slot as u16 + 1)
            | u16::from(other) << register::OTHER_SHIFT
            | bit(register::TRIAL, self.is_on_trial())
            | bit(register::SWITCHED, self.switched)
    }

    /// Checks whether the state allows an order, and returns whether it costs a save. `saves` are left of the budget.
    ///
    /// # Errors
    ///
    /// When the state or the budget does not allow it, or the order before is not carried out yet.
    pub fn check(&self, order: Order, saves: u8) -> Result<bool, Refused> {
        let waits = order == Order::Finish && self.is_erasing();
        if self.order.is_some() || self.lost || waits {
            return Err(Refused);
        }
        let costs = self
            .running
            .change(order, self.image_of(order))?
            .costs_a_save;
        if costs && saves == 0 {
            return Err(Refused);
        }
        Ok(costs)
    }

    /// Returns the image that an order is about.
    fn image_of(&self, order: Order) -> Image {
        let [running, other] = &self.images;
        let image = if order == Order::Confirm {
            running
        } else {
            other
        };
        let [_, _, epoch, _, _, _, k1, k0, _, _] = *image;
        let [_, _, high, low] = self.keys;
        let by_second = (k1, k0) == (high, low) && (high, low) != (0, 0);
        Image { epoch, by_second }
    }

    /// Takes an order that [`Self::check`] allows, from this line.
    pub const fn take(&mut self, order: Order, line: LineName) {
        self.order = Some(order);
        self.intact = false;
        if matches!(order, Order::Prepare) {
            self.line = line;
            // No block of the image before is taken any more.
            self.running.prepared = false;
        }
    }

    const fn is_erasing(&self) -> bool {
        self.pages > 0 || self.bad.is_some()
    }

    /// Returns whether a page does not take its blocks, and may not be erased again.
    const fn is_worn(&self) -> bool {
        self.bad.is_some() && self.repairs == 0
    }

    /// Returns whether blocks from this line are taken.
    fn is_open(&self, line: LineName) -> bool {
        self.running.prepared && self.line == line && self.order.is_none()
    }

    /// Checks whether a block from this line can be written, as records of a file.
    ///
    /// # Errors
    ///
    /// 02 when no block of the other slot's image begins there; 03 for another length, and for a first block that is not
    /// the header of an image for this board and that slot; 06 when blocks are not taken, or not at this time.
    pub fn check_write(
        &self,
        file: u16,
        records: Span,
        words: Words<'_>,
        line: LineName,
    ) -> Result<(), Exception> {
        let block = self.block(file, records)?;
        if records.count() != BLOCK {
            return Err(Exception::IllegalDataValue);
        }
        if block == 0
            && let Err(reason) = self.first_of(&bytes_of(words))
        {
            if self.is_open(line) {
                self.reason.set(Some(reason));
                self.refused.set(true);
            }
            return Err(Exception::IllegalDataValue);
        }
        let known = block == 0 || self.header.is_some() && !self.refused.get();
        let [_, second] = &self.staged;
        let takes = self.is_open(line) && self.pages == 0 && !self.is_worn();
        if takes && known && second.is_none() {
            Ok(())
        } else {
            Err(Exception::ServerDeviceBusy)
        }
    }

    /// Returns the block that begins with these records.
    fn block(&self, file: u16, records: Span) -> Result<u16, Exception> {
        let (slot, block) = block_at(file, records.start()).ok_or(Exception::IllegalDataAddress)?;
        let blocks = match self.header {
            Some(_) if block > 0 => self.missing.blocks(),
            _ => self.blocks_of_slot(),
        };
        if slot == self.running.slot.other() && block < blocks {
            Ok(block)
        } else {
            Err(Exception::IllegalDataAddress)
        }
    }

    fn blocks_of_slot(&self) -> u16 {
        (self.layout.slot as usize / BLOCK_BYTES) as u16
    }

    fn blocks_of_page(&self) -> u16 {
        (self.layout.boot.bytes as usize / BLOCK_BYTES) as u16
    }

    /// Returns CRC-32 and number of blocks of the image that begins with this block.
    fn first_of(&self, block: &[u8]) -> Result<(u32, u16), Reason> {
        let address = self.layout.slots[self.running.slot.other() as usize % 2];
        let header = Header::beginning(block).ok_or(Reason::Magic)?;
        header.suits(self.board, address)?;
        Ok((header.crc(), header.blocks(self.layout.slot as usize)?))
    }

    /// Takes a block that [`Self::check_write`] has accepted.
    pub fn write(&mut self, file: u16, records: Span, words: Words<'_>) {
        let Ok(number) = self.block(file, records) else {
            return;
        };
        let bytes = bytes_of(words);
        if number == 0
            && let Ok((crc, blocks)) = self.first_of(&bytes)
        {
            self.reason.set(None);
            self.refused.set(false);
            if self.header != Some(crc) || self.missing.blocks() != blocks {
                self.header = Some(crc);
                self.missing = Missing::all(blocks);
            }
        }
        let place = self.staged.iter_mut().find(|place| place.is_none());
        if let Some(place) = place {
            *place = Some(Block { number, bytes });
        }
    }

    /// Checks whether records of file 2 can be read.
    ///
    /// # Errors
    ///
    /// 02 for records after the end.
    pub fn check_read(&self, records: Span) -> Result<(), Exception> {
        let end = status::BITMAP + self.blocks_of_slot().div_ceil(16);
        if records.end() <= u32::from(end) {
            Ok(())
        } else {
            Err(Exception::IllegalDataAddress)
        }
    }

    /// Returns a record of file 2.
    #[must_use]
    pub fn record(&self, record: u16) -> u16 {
        let other = self.running.other().code();
        let of = |image: u16, word: u16| {
            let word = self.images[usize::from(image % 2)].get(usize::from(word));
            word.copied().unwrap_or_default()
        };
        match record {
            status::STATE => other.0.into(),
            status::REASON => self
                .reason
                .get()
                .map_or(other.1, |reason| reason as u8)
                .into(),
            status::BLOCKS => self.missing.blocks(),
            status::MISSING => self.missing.count(),
            status::SLOT => self.running.slot as u16 + 1,
            status::FLOOR => self.running.record.floor,
            status::PAGES if self.order == Some(Order::Prepare) => self.all_pages(),
            status::PAGES => self.pages + u16::from(self.bad.is_some()),
            IMAGES..CRCS => of(record / 8 - 1, record % 8),
            CRCS..KEYS => of(record / 2, 8 + record % 2),
            KEYS..status::REVOKED => self.keys[usize::from(record % 4)],
            status::REVOKED => self.running.record.is_revoked().into(),
            status::BITMAP.. => self.missing.word(record - status::BITMAP),
            _ => 0,
        }
    }

    fn all_pages(&self) -> u16 {
        let pages = self.blocks_of_slot().checked_div(self.blocks_of_page());
        pages.unwrap_or_default()
    }

    /// Returns the next step of the background task. Pass its end to [`Self::end`].
    // Not inlined, so that its frame does not add to that of the step.
    #[inline(never)]
    #[must_use]
    pub fn next(&self) -> Option<Job> {
        if self.order != Some(Order::Prepare) {
            let [staged, _] = &self.staged;
            let last = self.pages.checked_sub(1);
            let page = self.bad.filter(|_| self.repairs > 0).or(last);
            if let Some(page) = page.filter(|_| !self.is_worn()) {
                return Some(Job::InSlot(InSlot::Erase(page)));
            }
            if let Some(block) = staged {
                return Some(Job::InSlot(InSlot::Program(block.clone())));
            }
        }
        let order = self.order?;
        if matches!(order, Order::Finish | Order::GoBack) && !self.intact {
            return Some(Job::InSlot(InSlot::Check));
        }
        let record = self.running.after(order, self.image_of(order));
        record.ok().map(Job::Write)
    }

    /// Notes the end of the step that [`Self::next`] has returned. `image` describes the image in the other slot, as it
    /// is now. Returns the order that this step has carried out, if any.
    pub fn end(&mut self, job: &Job, done: Result<(), Failed>, image: [u16; 10]) -> Option<Order> {
        self.images[1] = image;
        match (job, done) {
            (Job::InSlot(InSlot::Erase(page)), done) => self.end_erase(*page, done.is_ok()),
            (Job::InSlot(InSlot::Program(block)), done) => {
                self.end_program(block.number, done.is_ok());
            }
            (Job::InSlot(InSlot::Check), Ok(())) => self.intact = true,
            (Job::Write(record), Ok(())) => return self.end_order(*record),
            (Job::InSlot(InSlot::Check) | Job::Write(_), Err(Failed(reason))) => {
                self.order = None;
                if reason.is_some() {
                    self.reason.set(reason);
                    self.missing = Missing::all(self.missing.blocks());
                }
            }
        }
        None
    }

    fn end_erase(&mut self, page: u16, erased: bool) {
        if self.bad == Some(page) {
            self.repairs = self.repairs.saturating_sub(1);
        } else {
            self.pages = self.pages.saturating_sub(1);
        }
        self.bad = (!erased).then_some(page);
        let blocks = self.blocks_of_page();
        self.missing.mark(page * blocks, blocks);
        self.drop_staged_if_worn();
    }

    fn end_program(&mut self, number: u16, fits: bool) {
        let [first, second] = &mut self.staged;
        *first = second.take();
        if fits {
            self.missing.clear(number);
        } else {
            self.bad = number.checked_div(self.blocks_of_page());
        }
        self.drop_staged_if_worn();
    }

    fn drop_staged_if_worn(&mut self) {
        if self.is_worn() {
            self.staged = [const { None }; 2];
        }
    }

    fn end_order(&mut self, record: Record) -> Option<Order> {
        self.running.record = record;
        let order = self.order.take()?;
        match order {
            Order::Prepare => {
                self.running.prepared = true;
                self.header = None;
                self.refused.set(false);
                self.missing = Missing::all(0);
                self.staged = [const { None }; 2];
                self.pages = self.all_pages();
                self.bad = None;
                self.repairs = REPAIRS;
                self.reason.set(None);
            }
            Order::Confirm => self.switched = false,
            // Nothing changes the image any more before the restart.
            Order::Finish | Order::GoBack => self.running.prepared = false,
        }
        Some(order)
    }
}

/// Records of file 2 with the two images, with their CRC-32, and with the keys.
const IMAGES: u16 = status::RUNNING.start;
const CRCS: u16 = status::CRCS.start;
const KEYS: u16 = status::KEYS.start;
const _: () = assert!(IMAGES == 8 && CRCS == 24 && KEYS == 28 && status::REVOKED == 32);

/// Returns the bytes of the records of a block, in the order of the image.
fn bytes_of(words: Words<'_>) -> [u8; BLOCK_BYTES] {
    let mut bytes = [0; BLOCK_BYTES];
    for (pair, word) in bytes.as_chunks_mut().0.iter_mut().zip(words.iter()) {
        *pair = word.to_be_bytes();
    }
    bytes
}
