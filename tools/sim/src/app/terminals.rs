//! The terminals of a board with fixed inputs and outputs, as they are in JSON.

use register_map::Module;
use register_map::configuration::module_of;
use register_map::points::Kind;
use serde::Serialize;
use sim::Board;
use sim::board::terminals::{self, Value};
use utoipa::ToSchema;

/// A terminal of a board, or an element on it that a person moves.
#[derive(Serialize, ToSchema)]
pub struct Terminal {
    /// Name on the board.
    #[schema(examples("X0", "Y0", "AD0", "POT0", "DA0", "RUN", "24V"))]
    name: &'static str,
    /// Address of its point, if the board has one for it: to read, or for a relay to write.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(maximum = 31)]
    point: Option<u16>,
    #[serde(flatten)]
    state: TerminalState,
}

/// The state of a terminal.
#[derive(Serialize, ToSchema)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum TerminalState {
    /// A digital input.
    Input { energised: bool },
    /// A relay.
    Relay { energised: bool },
    /// An analog input for 0 to 10 V.
    Voltage {
        #[schema(maximum = 12_000)]
        millivolts: u16,
    },
    /// An analog input for 0 to 20 mA.
    Current {
        #[schema(maximum = 25_000)]
        microamperes: u16,
    },
    /// A potentiometer, in thousandths of its range.
    Potentiometer {
        #[schema(maximum = 1000)]
        permille: u16,
    },
    /// An analog output.
    Output { millivolts: u16 },
    /// A switch, which connects its pin to ground or to the supply.
    Switch { high: bool },
    /// The monitor of the 24 V supply.
    Supply { present: bool },
}

impl From<Value> for TerminalState {
    fn from(value: Value) -> Self {
        match value {
            Value::Input(energised) => Self::Input { energised },
            Value::Relay(energised) => Self::Relay { energised },
            Value::Voltage(millivolts) => Self::Voltage { millivolts },
            Value::Current(microamperes) => Self::Current { microamperes },
            Value::Potentiometer(permille) => Self::Potentiometer { permille },
            Value::Output(millivolts) => Self::Output { millivolts },
            Value::Switch(high) => Self::Switch { high },
            Value::Supply(present) => Self::Supply { present },
        }
    }
}

/// Returns the terminals of a board, in their order on it.
pub fn of_board(board: &Board) -> Vec<Terminal> {
    let mut points = points(board);
    let terminals = board.terminals().iter();
    terminals
        .map(|(terminal, value)| {
            let kind = kind_of(terminal.kind);
            let at = points.iter().position(|(each, _)| *each == kind);
            Terminal {
                name: terminal.name,
                point: at.map(|at| points.remove(at).1),
                state: value.into(),
            }
        })
        .collect()
}

/// Returns kind and address of the points of a board with fixed inputs and outputs. Those of a kind have the order of
/// their terminals.
fn points(board: &Board) -> Vec<(Kind, u16)> {
    let layout = board.layout();
    let row = layout.board;
    let ports = row.ports().zip(row.fixed).flat_map(|(port, fixed)| {
        let stored = layout.stored(board.flash(), module_of(port));
        let module = stored.and_then(Module::from_code);
        row.kinds(port, module.unwrap_or(fixed.module))
    });
    ports.zip(row.points().start..).collect()
}

const fn kind_of(terminal: terminals::Kind) -> Kind {
    match terminal {
        terminals::Kind::Input | terminals::Kind::Switch | terminals::Kind::Supply => {
            Kind::BitInput
        }
        terminals::Kind::Relay => Kind::BitOutput,
        terminals::Kind::Voltage | terminals::Kind::Current | terminals::Kind::Potentiometer => {
            Kind::WordInput
        }
        terminals::Kind::Output => Kind::WordOutput,
    }
}

/// The body of `POST /api/terminals/NAME`: what is applied to the terminal.
#[derive(Clone, Copy, Debug, PartialEq, ToSchema)]
#[schema(rename_all = "snake_case")]
pub enum Applied {
    /// Applies a voltage to a digital input, or removes it.
    Energised(bool),
    /// Sets the voltage at an analog input, 0 to 12000 mV.
    Millivolts(u16),
    /// Sets the current into an analog input, 0 to 25000 uA.
    Microamperes(u16),
    /// Turns a potentiometer, 0 to 1000.
    Permille(u16),
    /// Moves a switch.
    High(bool),
    /// Switches the 24 V supply that the monitor sees.
    Present(bool),
}

impl From<Applied> for Value {
    fn from(applied: Applied) -> Self {
        match applied {
            Applied::Energised(energised) => Self::Input(energised),
            Applied::Millivolts(millivolts) => Self::Voltage(millivolts),
            Applied::Microamperes(microamperes) => Self::Current(microamperes),
            Applied::Permille(permille) => Self::Potentiometer(permille),
            Applied::High(high) => Self::Switch(high),
            Applied::Present(present) => Self::Supply(present),
        }
    }
}
