//! What the boards with Espressif's chips share: analog inputs, clock, watchdog, panic handler, what led to the last reset.
#![no_std]

pub mod analog;
#[cfg(feature = "esp32")]
pub mod brown_out;
mod chip;
#[cfg(any(feature = "esp32c3", feature = "esp32c6"))]
mod guard;
#[cfg(any(feature = "esp32c3", feature = "esp32c6"))]
pub mod one_input;
mod table;
#[cfg(any(feature = "esp32c3", feature = "esp32c6"))]
pub mod usb_line;

use core::convert::Infallible;
use core::panic::PanicInfo;

use esp_hal::gpio::{Level, Output, OutputConfig, OutputPin};
use esp_hal::ram;
use esp_hal::rtc_cntl::SocResetReason;
use tactomo_board_common::{PanicRecord, RECORD_BYTES, Reset};
use tactomo_firmware::mux::Mux;
use tactomo_firmware::{Adc, Board16, Chip, Identity, Parts, Sampler, Serial, Touch};
use tactomo_protocol::Fault;

pub use chip::EspChip;
pub use table::{Finder, finder};

/// Electrodes of each of these boards.
pub const ELECTRODES: u8 = 16;
/// What the pull-ups are driven at: the linear part of the ADC's range.
const DRIVE_MV: u16 = 2000;

/// Runs a board of that name: tells what led to the last reset, answers and scans, and never returns.
pub fn run<M, S, L, C, T>(name: &str, adc: Adc, parts: Parts<M, S, L, C, T>) -> !
where
    M: Mux<Error = Infallible>,
    S: Sampler,
    L: Serial,
    C: Chip,
    T: Touch,
{
    #[cfg(any(feature = "esp32c3", feature = "esp32c6"))]
    guard::widen();
    let identity = Identity {
        firmware_version: env!("CARGO_PKG_VERSION"),
        board: name,
        electrodes: ELECTRODES,
        adc,
        drive_mv: DRIVE_MV,
    };
    let mut board = match Board16::new(parts, identity) {
        Ok(board) => board,
        Err(_) => panic!("the board's identity does not fit the protocol"),
    };
    adc.ranges.iter().filter(|range| range.electrodes > 0).for_each(|range| {
        defmt::info!("{=u8} electrodes from {=u16} to {=u16} mV", range.electrodes, range.floor, range.ceiling);
    });
    boot_fault().into_iter().for_each(|fault| board.report(fault));
    match board.run() {}
}

/// An output that is high at first, so that the multiplexer's enable or latches stay closed.
pub fn output<'d>(pin: impl OutputPin + 'd) -> Output<'d> {
    Output::new(pin, Level::High, OutputConfig::default())
}

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
    panic_record().store(panic.location(), panic.message());
    esp_hal::system::software_reset()
}

/// What went wrong before this boot, if something did.
fn boot_fault() -> Option<Fault> {
    let reset = esp_hal::system::reset_reason().map_or(Reset::Unknown, reset);
    reset.boot_fault(&mut panic_record())
}

/// What restarted the chip.
#[cfg(feature = "esp32")]
fn reset(reason: SocResetReason) -> Reset {
    use SocResetReason as R;
    match reason {
        R::ChipPowerOn => Reset::AsWanted,
        R::SysBrownOut => Reset::BrownOut,
        R::CoreMwdt0 | R::CoreMwdt1 | R::CpuMwdt0 => Reset::Watchdog,
        R::CoreRtcWdt | R::Cpu0RtcWdt | R::SysRtcWdt => Reset::RtcWatchdog,
        R::CoreSw | R::Cpu0Sw => Reset::Software,
        _ => Reset::Other,
    }
}

/// What restarted the chip.
#[cfg(any(feature = "esp32c3", feature = "esp32c6"))]
fn reset(reason: SocResetReason) -> Reset {
    use SocResetReason as R;
    match reason {
        R::ChipPowerOn | R::CoreUsbUart | R::CoreUsbJtag => Reset::AsWanted,
        R::SysBrownOut => Reset::BrownOut,
        R::CoreMwdt0 | R::CoreMwdt1 | R::Cpu0Mwdt0 | R::Cpu0Mwdt1 => Reset::Watchdog,
        R::CoreRtcWdt | R::Cpu0RtcWdt | R::SysRtcWdt | R::SysSuperWdt => Reset::RtcWatchdog,
        R::CoreSw | R::Cpu0Sw => Reset::Software,
        #[cfg(feature = "esp32c3")]
        R::SysClkGlitch | R::CorePwrGlitch => Reset::Glitch,
        _ => Reset::Other,
    }
}
