//! A row for each board.

use super::{Board, Exactly, Memory, Row, Second};
use crate::Module;
use crate::fixed::FixedPort;
use crate::part::{KIB, STM32F103C8, STM32F103CB, STM32F103RC, STM32F103VC};

/// Makes row and type of each board, and the list of all rows.
macro_rules! boards {
    ($($(#[$doc:meta])* $board:ident = $row:ident { $($field:ident: $value:expr,)* })*) => {
        $(
            $(#[$doc])*
            pub const $row: Row = Row { $($field: $value,)* };

            $(#[$doc])*
            #[derive(Clone, Copy, Debug, PartialEq, Eq)]
            pub struct $board;

            impl Board for $board {
                const ROW: &'static Row = &$row;
                type Ports = Exactly<{ $row.slots as usize }>;
                type Events = Exactly<{ $row.events as usize }>;
                type Kept = Exactly<{ $row.keeps_outputs as usize }>;
                type Stage = Exactly<{ $row.stage as usize }>;
                type BehindLinks = Exactly<{
                    let addresses = $row.behind_links();
                    (addresses.end - addresses.start) as usize
                }>;
                type Second = Exactly<{ $row.second.is_some() as usize }>;
            }
        )*

        /// All boards, in the order of their codes.
        pub(super) const ROWS: [&Row; [$(stringify!($row)),*].len()] = [$(&$row),*];
    };
}

/// The memory of both clones of the FX3U.
const FX3U: Memory = Memory {
    part: STM32F103VC,
    smaller: None,
    stack: 16 * KIB,
    interrupts: ["UART4", "USART1", "EXTI3"],
};

boards! {
    /// The LLD-ModbusIO-02 with an STM32F103CB, or a C8 on a "Blue Pill": one slot, port 5.
    Modio02 = MODIO_02 {
        name: "modio-02",
        code: 1,
        model: "LLD-ModbusIO-02",
        first_port: 5,
        slots: 1,
        fixed: &[],
        switch: true,
        second: Some(Second::Radio),
        events: false,
        keeps_outputs: false,
        stage: false,
        memory: Memory {
            part: STM32F103CB,
            smaller: Some(STM32F103C8),
            stack: 9 * KIB,
            interrupts: ["USART1", "USART3", "EXTI3"],
        },
    }
    /// The larger board with an STM32F103RC: four slots, ports 1 to 4.
    Modio08 = MODIO_08 {
        name: "modio-08",
        code: 2,
        model: "modio-08",
        first_port: 1,
        slots: 4,
        fixed: &[],
        switch: true,
        second: Some(Second::Radio),
        events: true,
        keeps_outputs: true,
        stage: true,
        memory: Memory {
            part: STM32F103RC,
            smaller: None,
            stack: 12 * KIB,
            interrupts: ["USART1", "USART3", "EXTI3"],
        },
    }
    /// The FX3U-14MR's clone: an STM32F103VC.
    Fx3u14 = FX3U_14 {
        name: "fx3u-14",
        code: 3,
        model: "FX3U-14MR",
        first_port: 1,
        slots: 7,
        fixed: &[
            FixedPort::new(Module::Di4, 4),
            FixedPort::new(Module::Di4, 4),
            FixedPort::new(Module::Do4, 4),
            FixedPort::new(Module::Do4, 2),
            FixedPort::new(Module::Ai4, 4).currents(0b1000),
            FixedPort::new(Module::Ai4, 4).currents(0b0011),
            FixedPort::new(Module::Ao4, 2),
        ],
        switch: false,
        second: Some(Second::Rs232),
        events: true,
        keeps_outputs: true,
        stage: true,
        memory: FX3U,
    }
    /// The FX3U-24MR's clone: an STM32F103VC.
    Fx3u24 = FX3U_24 {
        name: "fx3u-24",
        code: 4,
        model: "FX3U-24MR",
        first_port: 1,
        slots: 8,
        fixed: &[
            FixedPort::new(Module::Di4, 4),
            FixedPort::new(Module::Di4, 4),
            FixedPort::new(Module::Di4, 4),
            FixedPort::new(Module::Di4, 4),
            FixedPort::new(Module::Do4, 4),
            FixedPort::new(Module::Do4, 4),
            FixedPort::new(Module::Do4, 2),
            FixedPort::new(Module::Ai4, 4)
                .currents(0b1000)
                .or(Module::Ai2Ao2),
        ],
        switch: false,
        second: Some(Second::Rs232),
        events: true,
        keeps_outputs: true,
        stage: true,
        memory: FX3U,
    }
    /// The "eth_modbus_io5r": an STM32F103CB.
    EthIo5r = ETH_IO5R {
        name: "eth-io5r",
        code: 5,
        model: "eth_modbus_io5r",
        first_port: 1,
        slots: 4,
        fixed: &[
            FixedPort::new(Module::Di4, 4),
            FixedPort::new(Module::Di4, 2),
            FixedPort::new(Module::Do4, 4),
            FixedPort::new(Module::Do4, 1),
        ],
        switch: false,
        second: None,
        events: false,
        keeps_outputs: false,
        stage: false,
        memory: Memory {
            part: STM32F103CB,
            smaller: None,
            stack: 9 * KIB,
            interrupts: ["USART2", "USART3", "EXTI2"],
        },
    }
}

/// Runs tests on several boards: each is a function of a board, `fn test<B: Board>()`, and has a list of boards. The module
/// of each test has a test for each board.
///
/// ```text
/// register_map::on_boards! {
///     unit_address_is_that_of_the_switch: Modio02, Modio08
/// }
/// ```
#[macro_export]
macro_rules! on_boards {
    ($($test:ident: $($board:ident),+)*) => {
        $(
            mod $test {
                $(
                    #[test]
                    #[allow(non_snake_case)]
                    fn $board() {
                        super::$test::<$crate::board::$board>();
                    }
                )+
            }
        )*
    };
}
