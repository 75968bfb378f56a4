//! Clock, delay, watchdog and log.

use embedded_hal::delay::DelayNs;
use esp_hal::delay::Delay;
use esp_hal::time::{Duration, Instant};
use esp_hal::timer::timg::{MwdtStage, TimerGroup, TimerGroupInstance, Wdt};
use tactomo_board_common::WATCHDOG_TIMEOUT_MS;
use tactomo_firmware::{Chip, log};

defmt::timestamp!("{=u64:us}", now_us());

/// Time since boot in microseconds (us).
fn now_us() -> u64 {
    Instant::now().duration_since_epoch().as_micros()
}

/// Clock, delay, log, and the watchdog of a timer group.
pub struct EspChip<Group> {
    delay: Delay,
    watchdog: Wdt<Group>,
}

impl<Group: TimerGroupInstance> EspChip<Group> {
    /// Starts the watchdog; `esp_hal::init` has stopped all of them.
    pub fn new(group: TimerGroup<'_, Group>) -> Self {
        let mut watchdog = group.wdt;
        watchdog.set_timeout(MwdtStage::Stage0, Duration::from_millis(WATCHDOG_TIMEOUT_MS.into()));
        watchdog.enable();
        Self { delay: Delay::new(), watchdog }
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
        self.watchdog.feed();
    }

    fn pull_log(&mut self, buffer: &mut [u8]) -> usize {
        log::pull(buffer)
    }
}
