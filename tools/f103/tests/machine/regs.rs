//! The register addresses that the programs use (RM0008).

pub const RCC_CR: u32 = 0x4002_1000;
pub const RCC_CFGR: u32 = 0x4002_1004;
pub const RCC_AHBENR: u32 = 0x4002_1014;
pub const RCC_APB2ENR: u32 = 0x4002_1018;
pub const RCC_APB1ENR: u32 = 0x4002_101C;
pub const RCC_CSR: u32 = 0x4002_1024;
pub const FLASH_ACR: u32 = 0x4002_2000;
pub const FLASH_KEYR: u32 = 0x4002_2004;
pub const FLASH_SR: u32 = 0x4002_200C;
pub const FLASH_CR: u32 = 0x4002_2010;
pub const FLASH_AR: u32 = 0x4002_2014;
pub const IWDG_KR: u32 = 0x4000_3000;
pub const IWDG_PR: u32 = 0x4000_3004;
pub const IWDG_SR: u32 = 0x4000_300C;
pub const GPIOA: u32 = 0x4001_0800;
pub const GPIOB: u32 = 0x4001_0C00;
pub const GPIOC: u32 = 0x4001_1000;
pub const TIM2: u32 = 0x4000_0000;
pub const USART1: u32 = 0x4001_3800;
pub const USART2: u32 = 0x4000_4400;
pub const USART3: u32 = 0x4000_4800;
pub const GPIOD: u32 = 0x4001_1400;
pub const GPIOE: u32 = 0x4001_1800;
pub const UART4: u32 = 0x4000_4C00;
pub const DAC: u32 = 0x4000_7400;
pub const DMA1: u32 = 0x4002_0000;
pub const DMA2: u32 = 0x4002_0400;
pub const ADC1: u32 = 0x4001_2400;
pub const AFIO: u32 = 0x4001_0000;
pub const EXTI: u32 = 0x4001_0400;
pub const NVIC_ISER: u32 = 0xE000_E100;
pub const SYST_CSR: u32 = 0xE000_E010;
pub const SYST_RVR: u32 = 0xE000_E014;
pub const SYST_CVR: u32 = 0xE000_E018;
pub const AIRCR: u32 = 0xE000_ED0C;
pub const DEMCR: u32 = 0xE000_EDFC;
pub const DWT_CTRL: u32 = 0xE000_1000;
pub const DWT_CYCCNT: u32 = 0xE000_1004;
/// Address where the programs store their results.
pub const OUT: u32 = 0x2000_0000;

/// Returns the bit-band alias of `bit` of the word at `address` in the peripheral region (PM0056 2.2.5).
pub const fn bit_band(address: u32, bit: u32) -> u32 {
    0x4200_0000 + (address - 0x4000_0000) * 32 + bit * 4
}
