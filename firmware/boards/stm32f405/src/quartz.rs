//! The quartz of the board, measured before the chip runs by it.

use stm32f4xx_hal::pac::{RCC, TIM11};
use tactomo_board_common::bounded::within;
use tactomo_board_common::quartz::usual_mhz;

/// Looks before a quartz counts as still: some 0.2 s at ten cycles of 16 MHz a look. One takes some milliseconds to swing.
const MAX_LOOKS: u32 = 300_000;
/// The quartz's cycles are divided by this before the timer sees them, and the timer takes every eighth edge of those.
const DIVIDER: u8 = 31;
const EDGES: u32 = 8;

/// Frequency of the quartz (MHz); `None` if it does not swing, or is no usual one. The chip has to run by the oscillator inside, as after a reset.
///
/// It is measured as the reference manual has it (RM0090, "Internal/external clock measurement using TIM5/TIM11").
pub fn mhz(rcc: &RCC, timer: &TIM11) -> Option<u32> {
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    within(MAX_LOOKS, || rcc.cr().read().hserdy().bit_is_set().then_some(())).ok()?;
    rcc.cfgr().modify(|_, w| w.rtcpre().set(DIVIDER));
    rcc.apb2enr().modify(|_, w| w.tim11en().set_bit());
    // SAFETY: fields of the timer's registers: HSE_RTC at its input; capture of every eighth rising edge; counting by every cycle.
    unsafe {
        timer.or().write(|w| w.bits(0b10));
        timer.ccmr1_input().write(|w| w.bits(0b1101));
        timer.ccer().write(|w| w.bits(1));
        timer.cr1().write(|w| w.bits(1));
    }
    // The first may be of edges from before.
    let [_, begin, end] = [(); 3].map(|()| capture(timer));
    rcc.apb2rstr().modify(|_, w| w.tim11rst().set_bit());
    rcc.apb2rstr().modify(|_, w| w.tim11rst().clear_bit());
    rcc.apb2enr().modify(|_, w| w.tim11en().clear_bit());
    usual_mhz(u32::from(DIVIDER) * EDGES, end?.wrapping_sub(begin?).into())
}

/// What the timer shows at the next edge that counts.
fn capture(timer: &TIM11) -> Option<u16> {
    // Reading the value takes the mark back.
    within(MAX_LOOKS, || timer.sr().read().cc1if().bit_is_set().then(|| timer.ccr1().read().bits() as u16)).ok()
}
