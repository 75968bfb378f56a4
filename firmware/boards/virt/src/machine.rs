//! What QEMU's `virt` machine has besides its UART: a clock, a way to reset or leave, and a word from whoever started it.

use core::ptr;

use tactomo_board_common::{PanicRecord, RECORD_BYTES};

use crate::table::ELECTRODES;

/// Machine timer of the core-local interruptor, low and high half.
const TIMER_LOW: *const u32 = 0x0200_BFF8 as *const u32;
const TIMER_HIGH: *const u32 = 0x0200_BFFC as *const u32;
/// Ticks of the machine timer in a microsecond.
const TICKS_PER_US: u64 = 10;
/// The test device: ends or resets the machine.
const TEST_DEVICE: *mut u32 = 0x0010_0000 as *mut u32;
const TEST_PASS: u32 = 0x5555;
const TEST_RESET: u32 = 0x7777;

// Placed by `memory.x`.
unsafe extern "C" {
    static _request: u32;
    static mut _panic_record: [u8; RECORD_BYTES];
    #[cfg(feature = "contacts")]
    static mut _table: [u8; TABLE_BYTES];
    #[cfg(feature = "contacts")]
    static mut _spare: [u8; TABLE_BYTES];
    static _press: Press;
}

/// Room for a table (bytes), as `memory.x` has it.
#[cfg(feature = "contacts")]
const TABLE_BYTES: usize = 128 * 1024;
/// Readings of a frame, a row for each ground.
pub type Press = [[u16; ELECTRODES]; ELECTRODES];

/// What whoever started the machine wants of it, set with
/// `-device loader,addr=0x80120000,data-len=4,data=REQUEST`; an ordinary run leaves it zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Run until the power goes off.
    Run,
    /// Panic once, in the first boot.
    Panic,
    /// Leave QEMU with exit code 0 when the host stops the stream.
    ExitOnStop,
    /// Scan without a host, print what a frame costs, and leave.
    Measure,
    /// The same of contacts that are found in what was put into memory.
    MeasureContacts,
    /// Print the reports of a touch screen that something presses for a while, and leave.
    Press,
}

impl Request {
    /// Reads the word.
    pub fn read() -> Self {
        // SAFETY: a word of RAM that nothing else uses.
        match unsafe { ptr::read_volatile(&raw const _request) } {
            1 => Self::Panic,
            2 => Self::ExitOnStop,
            3 => Self::Measure,
            4 => Self::MeasureContacts,
            5 => Self::Press,
            _ => Self::Run,
        }
    }
}

/// Time since power-on in microseconds (us).
pub fn now_us() -> u64 {
    ticks() / TICKS_PER_US
}

fn ticks() -> u64 {
    loop {
        // SAFETY: the two halves of the machine timer.
        let [high, low, again] =
            unsafe { [ptr::read_volatile(TIMER_HIGH), ptr::read_volatile(TIMER_LOW), ptr::read_volatile(TIMER_HIGH)] };
        if high == again {
            return u64::from(high) << 32 | u64::from(low);
        }
    }
}

/// Leaves QEMU with exit code 0.
pub fn exit() -> ! {
    end(TEST_PASS)
}

/// Resets the machine; RAM keeps what is not loaded from the ELF file.
pub fn reset() -> ! {
    end(TEST_RESET)
}

fn end(how: u32) -> ! {
    // SAFETY: the register of the test device.
    unsafe { ptr::write_volatile(TEST_DEVICE, how) };
    loop {
        riscv::asm::nop();
    }
}

/// Waits by the machine timer.
pub fn wait_ns(ns: u32) {
    let wait = (u64::from(ns) * TICKS_PER_US).div_ceil(1000);
    let start = ticks();
    // One more, because the tick under way at the start is not whole.
    while ticks() - start <= wait {}
}

/// Instructions since power-on.
pub fn instructions() -> u64 {
    riscv::register::minstret::read64()
}

/// The memory for a table, and for a new one.
#[cfg(feature = "contacts")]
pub fn table_memory() -> [&'static mut [u8]; 2] {
    let (table, spare) = (&raw mut _table, &raw mut _spare);
    // SAFETY: RAM that nothing else uses; called once at boot.
    unsafe { [&mut *table, &mut *spare] }
}

/// Readings of something that presses.
pub fn press() -> &'static Press {
    // SAFETY: RAM that nothing else uses, and nothing writes to.
    unsafe { &_press }
}

/// The memory that outlives a reset.
pub fn panic_record() -> PanicRecord<'static> {
    let record = &raw mut _panic_record;
    // SAFETY: RAM that nothing else uses; called once at boot and by the panic handler, which does not return.
    PanicRecord(unsafe { &mut *record })
}
