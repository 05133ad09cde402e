//! Port 5, the slot: four lines that become what the module in it needs.

use stm32f1xx_hal::gpio::{
    Cr, Floating, Input, Output, PA0, PA1, PA2, PA3, PEPin, PinState, PullUp, PushPull,
};

/// A slot line as an input with pull-up.
pub type SlotInput = PEPin<'A', Input<PullUp>>;

/// A slot line as a push-pull output.
pub type SlotOutput = PEPin<'A', Output<PushPull>>;

/// The four lines, floating as after a reset until one of the methods is called.
pub struct Slot {
    pub(crate) line1: PA0<Input<Floating>>,
    pub(crate) line2: PA1<Input<Floating>>,
    pub(crate) line3: PA2<Input<Floating>>,
    pub(crate) line4: PA3<Input<Floating>>,
    pub(crate) cr: Cr<'A', false>,
}

impl Slot {
    /// Four inputs with pull-ups.
    #[must_use]
    pub fn into_inputs(mut self) -> [SlotInput; 4] {
        let cr = &mut self.cr;
        [
            self.line1.into_pull_up_input(cr).erase_number(),
            self.line2.into_pull_up_input(cr).erase_number(),
            self.line3.into_pull_up_input(cr).erase_number(),
            self.line4.into_pull_up_input(cr).erase_number(),
        ]
    }

    /// Four outputs that drive low from their first instant.
    #[must_use]
    pub fn into_outputs_low(mut self) -> [SlotOutput; 4] {
        let (cr, low) = (&mut self.cr, PinState::Low);
        [
            self.line1
                .into_push_pull_output_with_state(cr, low)
                .erase_number(),
            self.line2
                .into_push_pull_output_with_state(cr, low)
                .erase_number(),
            self.line3
                .into_push_pull_output_with_state(cr, low)
                .erase_number(),
            self.line4
                .into_push_pull_output_with_state(cr, low)
                .erase_number(),
        ]
    }
}
