//! The interrupt lines from the blocks to the core.

use super::map::{Block, irq};
use super::{Circuit, Soc};

impl<C: Circuit> Soc<C> {
    /// Marks all interrupt lines that are high as changed, so that they are reported again.
    pub fn repeat_lines(&mut self) {
        self.changed_lines = self.levels;
    }

    /// Takes the mask of the interrupt lines that have changed since the last call. Also returns the levels of all
    /// lines, one bit each.
    pub fn take_lines(&mut self) -> (u64, u64) {
        (core::mem::take(&mut self.changed_lines), self.levels)
    }

    /// Returns whether an interrupt line has changed since [`take_lines`](Self::take_lines).
    #[must_use]
    pub fn lines_changed(&self) -> bool {
        self.changed_lines != 0
    }

    /// Sets the interrupt lines of `block` to the levels of its requests.
    pub(super) fn note_requests(&mut self, block: Block) {
        let line = match block {
            Block::Exti => {
                let requests = self.exti.requests();
                for (line, pins) in irq::EXTI {
                    self.set_line(line, requests & pins != 0);
                }
                return;
            }
            Block::Dma1 | Block::Dma2 => {
                let (n, lines): (_, &[(u16, u32)]) = match block {
                    Block::Dma1 => (0, &irq::DMA1),
                    _ => (1, &irq::DMA2),
                };
                let requests = self.dma[n].requests();
                for &(line, channels) in lines {
                    self.set_line(line, requests & channels != 0);
                }
                return;
            }
            Block::I2c1 => {
                self.set_line(irq::I2C1_EV, self.i2c1.irq_event());
                self.set_line(irq::I2C1_ER, self.i2c1.irq_error());
                return;
            }
            Block::Tim1 => {
                self.set_line(irq::TIM1_UP, self.tim1.update_irq());
                self.set_line(irq::TIM1_CC, self.tim1.capture_compare_irq());
                return;
            }
            Block::Tim2 => irq::TIM2,
            Block::Tim3 => irq::TIM3,
            Block::Tim4 => irq::TIM4,
            Block::Usart1 => irq::USART1,
            Block::Usart2 => irq::USART2,
            Block::Usart3 => irq::USART3,
            Block::Uart4 => irq::UART4,
            Block::Adc1 => irq::ADC1,
            Block::Flash => irq::FLASH,
            _ => return,
        };
        let level = self.block(block).irq();
        self.set_line(line, level);
    }

    fn set_line(&mut self, line: u16, level: bool) {
        let bit = 1u64 << line;
        if (self.levels & bit != 0) != level {
            self.levels ^= bit;
            self.changed_lines |= bit;
        }
    }
}
