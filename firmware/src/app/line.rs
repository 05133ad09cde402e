//! The RS-485 line of the board.

use board_support::{Rs485, Rs485Timer};
use firmware::line;

use crate::board::Units;

/// USART1 with PA8 to PA10; TIM2, and TIM1 for the start bit and the time limit of a reply.
pub type Line = line::Line<Rs485, Rs485Timer, Units>;
