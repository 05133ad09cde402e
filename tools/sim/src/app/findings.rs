//! The findings of the chip model, as they are in JSON.

use serde::Serialize;
use utoipa::ToSchema;

use super::scene::Scene;

/// The findings of the chip model.
#[derive(Serialize, ToSchema)]
pub struct Findings {
    findings: Vec<Finding>,
}

/// A finding of the chip model.
#[derive(Serialize, ToSchema)]
struct Finding {
    /// Virtual time of the first occurrence, in us.
    at_us: u64,
    /// Address of the instruction.
    pc: String,
    what: String,
    count: u64,
}

/// Returns the findings of the chip model of board `n`.
pub fn of_board(scene: &Scene, n: usize) -> Findings {
    let findings = scene.bus.board(n).findings().iter();
    let findings = findings.map(|finding| Finding {
        at_us: finding.at.as_us(),
        pc: format!("{:#010x}", finding.pc),
        what: finding.what.to_string(),
        count: finding.count,
    });
    Findings {
        findings: findings.collect(),
    }
}
