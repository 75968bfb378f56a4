//! Clock, delay, watchdog, log, and what led to the last reset.

use core::panic::PanicInfo;

use embedded_hal::delay::DelayNs;
use stm32f4xx_hal::pac::{RCC, TIM2};
use stm32f4xx_hal::timer::{CounterUs, SysDelay};
use stm32f4xx_hal::watchdog::IndependentWatchdog;
use tactomo_board_common::clock::Clock;
use tactomo_board_common::{PanicRecord, RECORD_BYTES, Reset};
use tactomo_firmware::{Chip, log};
use tactomo_protocol::Fault;

/// Microseconds after which the counter begins again (us).
const ROUND_US: u32 = u32::MAX;

/// Memory that a reset leaves alone.
#[unsafe(link_section = ".uninit.PANIC")]
static mut PANIC: [u8; RECORD_BYTES] = [0; RECORD_BYTES];

fn panic_record() -> PanicRecord<'static> {
    let record = &raw mut PANIC;
    // SAFETY: called by the panic handler, which never returns, and once at boot; one core, no interrupts of our own.
    PanicRecord(unsafe { &mut *record })
}

#[panic_handler]
fn panic(panic: &PanicInfo) -> ! {
    panic_record().store(panic.location(), panic.message());
    cortex_m::peripheral::SCB::sys_reset()
}

// The time of the board is in its frames; a second clock for the log would be one too many.
defmt::timestamp!("");

/// Clock, delay, log and watchdog.
pub struct StmChip {
    delay: SysDelay,
    counter: CounterUs<TIM2>,
    clock: Clock,
    watchdog: IndependentWatchdog,
}

impl StmChip {
    /// Of parts that were started.
    pub fn new(delay: SysDelay, counter: CounterUs<TIM2>, watchdog: IndependentWatchdog) -> Self {
        Self { delay, counter, clock: Clock::default(), watchdog }
    }
}

impl DelayNs for StmChip {
    fn delay_ns(&mut self, ns: u32) {
        self.delay.delay_ns(ns);
    }
}

impl Chip for StmChip {
    /// Sees every round of the counter, of 71 minutes, as the watchdog is fed far more often.
    fn now_us(&mut self) -> u64 {
        self.clock.now_us(self.counter.now().ticks(), ROUND_US)
    }

    fn feed_watchdog(&mut self) {
        self.watchdog.feed();
        self.now_us();
    }

    fn pull_log(&mut self, buffer: &mut [u8]) -> usize {
        log::pull(buffer)
    }
}

/// What went wrong before this boot, if something did; forgets it.
pub fn boot_fault(rcc: &RCC) -> Option<Fault> {
    let reset = reset(rcc);
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    reset.boot_fault(&mut panic_record())
}

/// What restarted the chip; power-on counts as a brown-out too.
fn reset(rcc: &RCC) -> Reset {
    let flags = rcc.csr().read();
    if flags.porrstf().bit_is_set() {
        Reset::AsWanted
    } else if flags.wdgrstf().bit_is_set() || flags.wwdgrstf().bit_is_set() {
        Reset::Watchdog
    } else if flags.sftrstf().bit_is_set() {
        Reset::Software
    } else if flags.borrstf().bit_is_set() {
        Reset::BrownOut
    } else {
        Reset::AsWanted
    }
}
