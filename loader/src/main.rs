//! The loader of a modio: chooses which of two images is started, and checks that a new one is genuine. It has no UART,
//! no command and no protocol.
//!
//! [`boot_state::decide`] has the decisions, [`genuine`](loader::genuine) what an image must be. The loader runs on the
//! internal oscillator and leaves everything as after a reset but the watchdog, which cannot be stopped.

#![no_std]
#![no_main]

use core::{arch::naked_asm, panic::PanicInfo};

use board_support::{
    FlashError,
    fault::{Fault, Kind},
    flash::slot_address,
    kept,
    loading::{Loading, slot_bytes},
    pac, restart,
};
use boot_state::{
    Image, Record,
    decide::{Next, Part, Start, Unwritten, decide},
    journal::Journal,
};
use cortex_m_rt::{entry, exception};
use loader::genuine::{self, Key};
use ports::pages::WriteError;
use register_map::{
    Row,
    layout::HEADER,
    update::{Header, Reason, Slot, intact, keys},
};

/// The public keys that the loader trusts. The second one stays in a safe, and ends the first.
const KEYS: [Key; 2] = include!(concat!(env!("OUT_DIR"), "/keys.rs"));

/// The numbers of the keys, for the application.
// SAFETY: the linker script has a separate place for the section, with nothing else in it.
#[unsafe(link_section = ".keys")]
#[used]
static NUMBERS: [u8; keys::BYTES] = include!(concat!(env!("OUT_DIR"), "/numbers.rs"));

/// Whether one of them is a development key, whose private half everybody has.
const DEVELOPMENT: bool = include!(concat!(env!("OUT_DIR"), "/development.rs"));

/// The board that the loader is built for.
const BOARD: &Row = match Row::named(env!("MODIO_BOARD")) {
    Some(board) => board,
    None => panic!("crate register-map has no row for this board"),
};

/// The part, and the boot state in its flash.
struct Unit {
    loading: Loading,
    journal: Journal,
}

impl Unit {
    /// Returns the header of an intact image.
    fn intact(&mut self, slot: Slot) -> Option<Header<'static>> {
        let bytes = slot_bytes(slot as usize);
        intact(bytes, |parts| self.loading.crc32(parts)).ok()
    }
}

impl Part for Unit {
    fn is_intact(&mut self, slot: Slot) -> bool {
        self.intact(slot).is_some()
    }

    fn image(&mut self, slot: Slot) -> Image {
        let header = Header::of(slot_bytes(slot as usize));
        header.map_or(Image::default(), |header| Image {
            epoch: header.epoch(),
            by_second: header.key() == KEYS[1].1,
        })
    }

    fn check(&mut self, slot: Slot, floor: u16, revoked: bool) -> Result<(), Reason> {
        self.loading.run_fast();
        let keys = if revoked { &KEYS[1..] } else { &KEYS };
        let (bytes, address) = (slot_bytes(slot as usize), slot_address(slot as usize));
        genuine::check(bytes, address, BOARD.code as u8, floor, keys)
    }

    fn write(&mut self, record: Record) -> Result<(), Unwritten> {
        loop {
            self.loading.wait_for_supply();
            let pages = &mut self.loading.boot_pages();
            match self.journal.write(pages, record) {
                // The supply has fallen since.
                Err(WriteError::Flash(FlashError::NotNow)) => {}
                written => return written.map_err(|_| Unwritten),
            }
        }
    }
}

#[entry]
fn main() -> ! {
    let (Some(device), Some(core)) = (pac::Peripherals::take(), cortex_m::Peripherals::take())
    else {
        restart();
    };
    let (mut loading, found) = Loading::start(device, DEVELOPMENT);
    let mut journal = Journal::open(&loading.boot_pages());
    if !journal.is_settled() {
        loading.wait_for_supply();
        // When this fails, the state is used as it was read.
        let _ = journal.settle(&mut loading.boot_pages());
    }
    let record = journal.record();
    let start = Start {
        asked: found.asked,
        switched: found.switched,
        chosen: found.chosen.and_then(|slot| Slot::ALL.get(slot).copied()),
    };
    let mut unit = Unit { loading, journal };
    match decide(&mut unit, record, start) {
        // SAFETY: only an intact image is started, and it was found genuine, which includes its address.
        Next::Run { slot, chosen } => unsafe {
            let loading = unit.loading;
            loading.run(slot as usize, HEADER, chosen, &core.SCB)
        },
        Next::Reset => restart(),
        Next::Nothing => unit.loading.show_nothing(),
    }
}

/// The crystal has failed. The next start ends the check that was interrupted, and does not use the crystal.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    kept::note(&Fault {
        kind: Kind::Crystal,
        ..Fault::default()
    });
    restart();
}

#[exception]
unsafe fn DefaultHandler(_: i16) {
    restart();
}

/// Resets the part without the stack, which may be the cause of the fault (PM0056 4.4.5: AIRCR).
// SAFETY: cortex-m-rt's vector table has this name for the exception. The function never returns.
#[unsafe(no_mangle)]
#[unsafe(naked)]
unsafe extern "C" fn HardFault() -> ! {
    naked_asm!(
        "ldr r0, =0xE000ED0C",
        "ldr r1, =0x05FA0004",
        "str r1, [r0]",
        "1: b 1b",
    )
}

/// Never called: only salty contains panics, behind checks of indices that are always right.
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    restart();
}
