//! Power cuts at every flash operation of an update.

use super::*;

/// A change of the flash: a page erased, or a half-word programmed.
#[derive(Clone)]
enum Change {
    Erased(usize),
    Programmed(usize, [u8; 2]),
}

/// Returns the changes that made `after` of `before`, in their order: pages from the last one on, then half-words.
fn changes(before: &[u8], after: &[u8]) -> Vec<Change> {
    let pages = before.chunks(PAGE_SIZE).zip(after.chunks(PAGE_SIZE));
    let gains = |(before, after): &(&[u8], &[u8])| {
        let mut bytes = before.iter().zip(*after);
        bytes.any(|(before, after)| after & !before != 0)
    };
    let erased: Vec<usize> = (0..)
        .zip(pages)
        .filter(|(_, pair)| gains(pair))
        .map(|(n, _)| n)
        .collect();
    let mut now = before.to_vec();
    for page in &erased {
        now[page * PAGE_SIZE..][..PAGE_SIZE].fill(0xFF);
    }
    let halves = now.chunks(2).zip(after.chunks(2)).enumerate();
    let programmed = halves.filter(|(_, (now, after))| now != after);
    let programmed =
        programmed.map(|(n, (_, after))| Change::Programmed(2 * n, [after[0], after[1]]));
    let erased = erased.into_iter().rev().map(Change::Erased);
    erased.chain(programmed).collect()
}

/// Changes a flash, completely or, with a seed, as a power cut leaves it: some bits have changed.
fn change(flash: &mut [u8], change: &Change, cut: Option<u64>) {
    let mut noise = cut.unwrap_or_default() | 1;
    let mut random = || {
        noise = noise
            .wrapping_mul(0x5851_F42D_4C95_7F2D)
            .wrapping_add(0x1405_7B7E_F767_814F);
        if cut.is_none() {
            0
        } else {
            (noise >> 56) as u8
        }
    };
    match change {
        Change::Erased(page) => {
            let bytes = &mut flash[page * PAGE_SIZE..][..PAGE_SIZE];
            bytes.iter_mut().for_each(|byte| *byte |= !random());
        }
        Change::Programmed(at, bytes) => {
            for (byte, new) in flash[*at..at + 2].iter_mut().zip(bytes) {
                *byte = (*byte & random()) | new;
            }
        }
    }
}

/// A whole update, from the order to prepare to the confirmation: the flash before it, and its changes.
fn recorded() -> (Vec<u8>, Vec<Change>) {
    // Something to erase is in slot B.
    let mut rig = unit_of([&image(0), &image(1)]);
    let first = rig.board.flash().to_vec();
    let (mut before, mut all) = (first.clone(), Vec::new());
    let mut note = |rig: &Rig| {
        let after = rig.board.flash();
        if before != after {
            all.extend(changes(&before, after));
            before = after.to_vec();
        }
    };
    assert_eq!(rig.order(Command::Prepare), Ok(()));
    note(&rig);
    while rig.update_status().pages > 0 {
        note(&rig);
    }
    for (number, block) in (0..).zip(image(1).chunks(BLOCK_BYTES)) {
        while rig.block(Slot::B, number, block).is_err() {}
        note(&rig);
    }
    rig.board.run_for(ERASE);
    assert_eq!(rig.order(Command::Finish), Ok(()));
    let end = rig.board.now() + CHECK;
    while rig.board.now() < end {
        rig.board.run_for(Time::from_ms(1));
        note(&rig);
    }
    assert_eq!(rig.order(Command::Confirm), Ok(()));
    rig.board.run_for(ERASE);
    note(&rig);
    assert_eq!(runs_from(&mut rig), 1);
    (first, all)
}

/// Number of cuts. Every change of the boot state and every erase is among them.
const CUTS: usize = 200;

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_power_cut_in_any_flash_operation_of_an_update_leaves_a_unit_that_serves() {
    let (mut flash, all) = recorded();
    let boot = (LAYOUT.board.layout().boot.first - 0x0800_0000) as usize;
    let always = |change: &Change| match change {
        Change::Erased(_) => true,
        Change::Programmed(at, _) => *at >= boot,
    };
    let rare = all.iter().filter(|change| always(change)).count();
    let step = (all.len() - rare) / usize::max(CUTS, rare + 1).saturating_sub(rare).max(1);
    println!(
        "{} operations, {rare} of them each, of the others one in {step}",
        all.len()
    );
    let (mut starts, mut passed) = ([0, 0], 0);
    for (n, next) in all.iter().enumerate() {
        passed += usize::from(!always(next));
        if always(next) || passed.is_multiple_of(step) {
            let mut cut = flash.clone();
            change(&mut cut, next, Some(n as u64));
            let mut rig = starting(cut);
            let (slot, _) = after(&mut rig);
            starts[slot] += 1;
            // It can be updated, or confirmed first.
            if rig.register(UPDATE) & 1 << 5 != 0 {
                assert_eq!(rig.order(Command::Confirm), Ok(()), "cut {n}");
                rig.board.run_for(ERASE);
            }
            assert_eq!(rig.order(Command::Prepare), Ok(()), "cut {n}");
        }
        change(&mut flash, next, None);
    }
    println!("started from A and B: {starts:?}");
    assert!(starts[0] > 100 && starts[1] > 10, "{starts:?}");
}
