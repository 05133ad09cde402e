//! Stored configurations as literal bytes: every later firmware must read what earlier ones have stored.

use firmware::store::{Given, Page, Saving, Store};
use register_map::Module;
use register_map::configuration::modules;
use register_map::record::{SEALS, encode_page, records};

use register_map::board::Board;

use crate::flash::MockFlash;
use crate::running::{Settings, save, settings, start_well};
use crate::{B, PAGE_SIZE};

/// Written by version 0.1: page mark, then two records, the second with another baud rate. The CRCs were computed
/// by Python's zlib.crc32.
#[rustfmt::skip]
const VERSION_0_1: [u8; 64] = [
    0x6F, 0x6B,
    0x6D, 0x6F, 0x01, 0x01, 1, 0, 0, 0, 3, 0,
    0x01, 0x01, 0x80, 0x04, // BAUD 1152
    0x14, 0x01, 0x06, 0x00, // MODULE of port 5: 2ai2ao
    0xD2, 0x01, 0xFF, 0xFF, // SAFE of point 18: hold
    0x07, 0x0B, 0x1C, 0x4C,
    0x6D, 0x6F, 0x01, 0x01, 2, 0, 0, 0, 5, 0,
    0x01, 0x01, 0xC0, 0x00, // BAUD 192
    0x06, 0x01, 0xE8, 0x03, // FRAME_GAP 1000
    0x14, 0x01, 0x06, 0x00,
    0x62, 0x01, 0x70, 0x0D, // BETA of point 2: 3440
    0xD2, 0x01, 0xFF, 0xFF,
    0xBD, 0xED, 0x91, 0x3B,
    0xFF, 0xFF,
];

/// The records of [`VERSION_0_1`] as they are written now, with seals.
#[rustfmt::skip]
const SEALED: [u8; 72] = [
    0x6F, 0x6B,
    0x6D, 0x6F, 0x01, 0x01, 1, 0, 0, 0, 3, 0,
    0x01, 0x01, 0x80, 0x04,
    0x14, 0x01, 0x06, 0x00,
    0xD2, 0x01, 0xFF, 0xFF,
    0x07, 0x0B, 0x1C, 0x4C, 0, 0, 0, 0,
    0x6D, 0x6F, 0x01, 0x01, 2, 0, 0, 0, 5, 0,
    0x01, 0x01, 0xC0, 0x00,
    0x06, 0x01, 0xE8, 0x03,
    0x14, 0x01, 0x06, 0x00,
    0x62, 0x01, 0x70, 0x0D,
    0xD2, 0x01, 0xFF, 0xFF,
    0xBD, 0xED, 0x91, 0x3B, 0, 0, 0, 0,
    0xFF, 0xFF,
];

/// Written by a later firmware with another register map in the same layout: it contains unknown settings, and a
/// baud rate and a filter that are not allowed here.
#[rustfmt::skip]
const LATER: [u8; 44] = [
    0x6F, 0x6B,
    0x6D, 0x6F, 0x02, 0x01, 9, 0, 0, 0, 6, 0,
    0x01, 0x01, 0x00, 0x48, // BAUD 18432
    0x14, 0x01, 0x04, 0x00, // MODULE of port 5: 4ai
    0x30, 0x01, 0x09, 0x00, // FILTER of point 16: 9
    0x50, 0x01, 0x34, 0x12, // 0x0150: unknown
    0x60, 0x01, 0xD0, 0x07, // BETA of point 0: 2000
    0x00, 0x04, 0x01, 0x00, // 0x0400: a link of point 0, which has no slot
    0x25, 0x94, 0x0C, 0x04,
    0xFF, 0xFF, 0xFF, 0xFF,
];

/// The settings of the newest record in [`VERSION_0_1`] and [`SEALED`].
const STORED: [(u16, u16); 5] = [
    (0x0101, 192),
    (0x0106, 1000),
    (0x0114, 6),
    (0x0162, 3440),
    (0x01D2, 0xFFFF),
];

fn page(bytes: &[u8]) -> [u8; PAGE_SIZE] {
    let mut page = [0xFF; PAGE_SIZE];
    page[..bytes.len()].copy_from_slice(bytes);
    page
}

#[test]
fn the_newest_record_of_version_0_1_is_read_on_either_page() {
    let expected = settings(&STORED);
    for mut flash in [
        MockFlash::with(&VERSION_0_1, &[]),
        MockFlash::with(&[], &VERSION_0_1),
    ] {
        let (loaded, mut store) = start_well(&mut flash);
        assert!(loaded.settings == expected && !loaded.invalid && loaded.rejected == 0);
        assert!(
            !save(&mut store, &mut flash, &expected).unwrap(),
            "already stored"
        );
    }
}

#[test]
fn a_later_firmware_s_record_is_read_as_far_as_it_is_known() {
    let mut flash = MockFlash::with(&LATER, &[]);
    let (loaded, mut store) = start_well(&mut flash);
    let known = settings(&[(0x0114, 4), (0x0160, 2000)]);
    assert!(loaded.settings == known && !loaded.invalid);
    assert_eq!(loaded.rejected, 2, "BAUD and FILTER");
    assert!(
        save(&mut store, &mut flash, &known).unwrap(),
        "the stored record differs"
    );
    assert_eq!(start_well(&mut flash).0.rejected, 0);
}

#[test]
fn a_start_keeps_what_only_a_later_firmware_knows() {
    let mut bytes = page(&LATER);
    bytes[600] = 0; // left by a cut: the record must move
    let mut flash = MockFlash::holding([bytes, [0xFF; PAGE_SIZE]]);
    let before = records(&bytes, B::ROW).next().unwrap().1;
    start_well(&mut flash);
    let (_, moved) = records(&flash.pages[1], B::ROW).next().unwrap();
    assert!(moved.pairs().eq(before.pairs()) && moved.schema == before.schema);
    assert_eq!(records(&flash.pages[0], B::ROW).count(), 0);
}

#[test]
fn record_without_room_for_seals_stays_where_it_is_and_is_read() {
    let pairs: Vec<_> = (0..252).map(|n| (0x0600 + n, 1)).collect();
    let mut bytes = [0xFF; PAGE_SIZE + SEALS];
    encode_page(1, &pairs, &mut bytes).unwrap();
    let page: [u8; PAGE_SIZE] = *bytes.first_chunk().unwrap();
    assert_ne!(page[PAGE_SIZE - 1], 0, "the CRC ends the page");
    let mut flash = MockFlash::holding([page, [0xFF; PAGE_SIZE]]);
    for _ in 0..2 {
        let (loaded, _) = start_well(&mut flash);
        assert!(!loaded.invalid && loaded.rejected == 0);
        assert_eq!(flash.pages[0], page);
    }
}

#[test]
fn another_layout_is_reported_and_kept_until_something_is_saved() {
    let mut bytes = page(&LATER);
    bytes[5] = 2;
    let mut flash = MockFlash::holding([bytes, [0xFF; PAGE_SIZE]]);
    for _ in 0..3 {
        let (loaded, _) = start_well(&mut flash);
        assert!(loaded.invalid && loaded.settings == Settings::defaults());
        assert_eq!(flash.pages[0], bytes, "the page is kept as evidence");
    }
    let (_, mut store) = start_well(&mut flash);
    assert!(save(&mut store, &mut flash, &Settings::defaults()).unwrap());
    assert!(!start_well(&mut flash).0.invalid);
}

#[test]
fn a_preset_is_read_as_a_stored_configuration() {
    for module in Module::ALL {
        let mut page = [0xFF; PAGE_SIZE];
        let pairs: Vec<_> = modules([(5_u16, module)]).collect();
        let size = encode_page(0, &pairs, &mut page).unwrap();
        let mut flash = MockFlash::with(page.get(..size).unwrap(), &[]);
        let (loaded, _) = start_well(&mut flash);
        assert_eq!(loaded.settings.module(5), module);
        assert!(!loaded.invalid && loaded.rejected == 0);
        assert_eq!(flash.erases, [0, 1], "the preset page is not erased");
    }
}

#[test]
fn what_is_stored_is_the_documented_record() {
    let mut flash = MockFlash::with(&SEALED[..32], &[]);
    let (_, mut store) = start_well(&mut flash);
    let settings = settings(&STORED);
    let mut saving = Saving::of_settings(&store, &flash, &settings).unwrap();
    saving
        .perform(&mut flash, Given::Settings(&settings))
        .unwrap();
    saving.finish(&mut store, &flash).unwrap();
    let bytes = firmware::store::Pages::page(&flash, Page::First);
    assert_eq!(bytes[..SEALED.len()], SEALED);
    assert!(Store::open(&flash).load(&flash).settings == settings);
}
