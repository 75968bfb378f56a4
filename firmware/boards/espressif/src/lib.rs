//! What the boards with Espressif's chips share: analog inputs, clock, watchdog, panic handler, what led to the last reset.
#![no_std]

pub mod analog;
#[cfg(feature = "esp32")]
pub mod brown_out;
mod chip;
#[cfg(any(feature = "esp32c3", feature = "esp32c6"))]
pub mod one_input;
#[cfg(any(feature = "esp32c3", feature = "esp32c6"))]
pub mod usb_line;

use core::panic::PanicInfo;

use esp_hal::ram;
use esp_hal::rtc_cntl::SocResetReason;
use heapless::String;
use tactomo_board_common::{PanicRecord, RECORD_BYTES};
use tactomo_protocol::Fault;

pub use chip::EspChip;

/// Memory that every reset but power-on leaves alone.
#[ram(unstable(rtc_fast, persistent))]
static mut PANIC: [u8; RECORD_BYTES] = [0; RECORD_BYTES];

fn panic_record() -> PanicRecord<'static> {
    let record = &raw mut PANIC;
    // SAFETY: called by the panic handler, which never returns, and once at boot; one core, no interrupts of our own.
    PanicRecord(unsafe { &mut *record })
}

#[panic_handler]
fn panic(panic: &PanicInfo) -> ! {
    panic_record().store(panic);
    esp_hal::system::software_reset()
}

/// What went wrong before this boot, if something did.
pub fn boot_fault() -> Option<Fault> {
    if let Some(text) = panic_record().take() {
        return Some(Fault::Panic(text));
    }
    let name = match esp_hal::system::reset_reason() {
        None => "unknown",
        Some(reason) => reset_name(reason)?,
    };
    String::try_from(name).ok().map(Fault::Reset)
}

/// What restarted the chip; `None` after power-on, the reset button, or a reset by the host.
#[cfg(feature = "esp32")]
fn reset_name(reason: SocResetReason) -> Option<&'static str> {
    use SocResetReason as R;
    Some(match reason {
        R::ChipPowerOn => return None,
        R::SysBrownOut => "brown-out",
        R::CoreMwdt0 | R::CoreMwdt1 | R::CpuMwdt0 => "watchdog",
        R::CoreRtcWdt | R::Cpu0RtcWdt | R::SysRtcWdt => "RTC watchdog",
        R::CoreSw | R::Cpu0Sw => "software",
        _ => "other",
    })
}

/// What restarted the chip; `None` after power-on, the reset button, or a reset by the host.
#[cfg(feature = "esp32c3")]
fn reset_name(reason: SocResetReason) -> Option<&'static str> {
    use SocResetReason as R;
    Some(match reason {
        R::ChipPowerOn | R::CoreUsbUart | R::CoreUsbJtag => return None,
        R::SysBrownOut => "brown-out",
        R::CoreMwdt0 | R::CoreMwdt1 | R::Cpu0Mwdt0 | R::Cpu0Mwdt1 => "watchdog",
        R::CoreRtcWdt | R::Cpu0RtcWdt | R::SysRtcWdt | R::SysSuperWdt => "RTC watchdog",
        R::CoreSw | R::Cpu0Sw => "software",
        R::SysClkGlitch | R::CorePwrGlitch => "power or clock glitch",
        _ => "other",
    })
}

/// What restarted the chip; `None` after power-on, the reset button, or a reset by the host.
#[cfg(feature = "esp32c6")]
fn reset_name(reason: SocResetReason) -> Option<&'static str> {
    use SocResetReason as R;
    Some(match reason {
        R::ChipPowerOn | R::CoreUsbUart | R::CoreUsbJtag => return None,
        R::SysBrownOut => "brown-out",
        R::CoreMwdt0 | R::CoreMwdt1 | R::Cpu0Mwdt0 | R::Cpu0Mwdt1 => "watchdog",
        R::CoreRtcWdt | R::Cpu0RtcWdt | R::SysRtcWdt | R::SysSuperWdt => "RTC watchdog",
        R::CoreSw | R::Cpu0Sw => "software",
        _ => "other",
    })
}
