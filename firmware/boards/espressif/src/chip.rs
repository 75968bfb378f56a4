//! Clock, delay, watchdog and log.

use embedded_hal::delay::DelayNs;
use esp_hal::delay::Delay;
use esp_hal::time::{Duration, Instant};
use esp_hal::timer::timg::{MwdtStage, TimerGroup, TimerGroupInstance, Wdt};
use tactomo_board_common::WATCHDOG_TIMEOUT_MS;
#[cfg(feature = "esp32")]
use tactomo_board_common::paint::Paint;
use tactomo_firmware::{Chip, log};

defmt::timestamp!("{=u64:us}", now_us());

/// Time since boot in microseconds (us).
fn now_us() -> u64 {
    Instant::now().duration_since_epoch().as_micros()
}

/// Bytes below the stack that are painted, more than the largest frame of a function takes (20 kB).
#[cfg(feature = "esp32")]
const PAINTED: usize = 32 * 1024;

/// The lowest memory of the stack. An image that leaves no 96 kB above it is not linked (`.cargo/config.toml`).
#[cfg(feature = "esp32")]
fn below_stack() -> &'static [core::sync::atomic::AtomicU32] {
    unsafe extern "C" {
        /// Lowest word of the stack; of esp-hal's linker script.
        static _stack_end_cpu0: u32;
    }
    // Above the word that esp-hal guards.
    const GUARDED: usize = 64;
    // SAFETY: memory of the stack that is deeper than it goes, so nothing else refers to it.
    unsafe { core::slice::from_raw_parts((&raw const _stack_end_cpu0).byte_add(GUARDED).cast(), PAINTED / 4) }
}

/// Clock, delay, log, and the watchdog of a timer group.
pub struct EspChip<Group> {
    delay: Delay,
    watchdog: Wdt<Group>,
    #[cfg(feature = "esp32")]
    below_stack: Paint<'static>,
}

impl<Group: TimerGroupInstance> EspChip<Group> {
    /// Starts the watchdog; `esp_hal::init` has stopped all of them.
    pub fn new(group: TimerGroup<'_, Group>) -> Self {
        let mut watchdog = group.wdt;
        watchdog.set_timeout(MwdtStage::Stage0, Duration::from_millis(WATCHDOG_TIMEOUT_MS.into()));
        watchdog.enable();
        Self {
            delay: Delay::new(),
            watchdog,
            #[cfg(feature = "esp32")]
            below_stack: Paint::new(below_stack()),
        }
    }
}

impl<Group: TimerGroupInstance> DelayNs for EspChip<Group> {
    fn delay_ns(&mut self, ns: u32) {
        self.delay.delay_ns(ns);
    }
}

impl<Group: TimerGroupInstance> Chip for EspChip<Group> {
    fn now_us(&mut self) -> u64 {
        now_us()
    }

    fn feed_watchdog(&mut self) {
        #[cfg(feature = "esp32")]
        assert!(self.below_stack.is_whole(), "the stack has overflowed");
        self.watchdog.feed();
    }

    fn pull_log(&mut self, buffer: &mut [u8]) -> usize {
        log::pull(buffer)
    }
}
