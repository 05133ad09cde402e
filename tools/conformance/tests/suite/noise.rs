//! Pulses after a request, at the rates at which a character takes less time than other work of the unit, on the boards
//! that the matrix does not have. The interrupt of a start bit must not add to their delay.

use conformance::endpoint::sim::Fitting;
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

use super::{failed, in_process, line, named, others, passed, with_different_modules};

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn pulses_delay_a_reply_by_a_character_at_most_at_high_rates_on_every_board() {
    let cases = named(&["damage/noise-behind-a-frame"]);
    let mut fittings = Vec::new();
    for board in others().map(with_different_modules) {
        for (baud, format) in [
            (115_200, "8E1"),
            (230_400, "8N1"),
            (460_800, "8N2"),
            (921_600, "8N1"),
        ] {
            let line = line(baud, format);
            fittings.push(Fitting {
                line,
                ..board.clone()
            });
        }
    }
    let failed: Vec<String> = fittings
        .into_par_iter()
        .flat_map_iter(|fitting| {
            let outcomes = in_process(&fitting, &cases);
            // This case and the one about the stack.
            assert_eq!(passed(&outcomes) + failed(&outcomes).len(), 2, "both run");
            let rows = failed(&outcomes).into_iter();
            rows.map(move |row| format!("{} {}: {row}", fitting.board, fitting.line))
        })
        .collect();
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}
