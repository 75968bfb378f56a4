//! The guard of the stack on chips with RISC-V cores: a trigger of the core's debug unit.

use core::arch::asm;

/// Bytes of the guard, more than the largest frame of a function takes (20 kB), so that none steps over it. A trigger's region is a power of two and begins at a multiple
/// of it.
const BYTES: usize = 32 * 1024;
/// `mcontrol` of a trigger that stops a store, in machine mode, to any byte of a naturally aligned power of two (ESP32-C3 technical reference manual, "Trigger module").
const STORE_TO_REGION: usize = 1 << 1 | 1 << 6 | 1 << 7;
/// `tcontrol` with triggers enabled in machine mode.
const ENABLED: usize = 1 << 3;

unsafe extern "C" {
    /// Lowest word of the stack; of esp-hal's linker script.
    static _stack_end_cpu0: u32;
}

/// Makes the guard, which is one word of esp-hal's, as long as the largest frame takes. An image whose stack has no 96 kB above it is not linked
/// (`.cargo/config.toml`). What the guard ends in is esp-hal's panic "Detected a write to a stack guard value".
pub fn widen() {
    let begin = (&raw const _stack_end_cpu0).addr().next_multiple_of(BYTES);
    // The ones below the length's highest bit tell the length.
    let region = begin | (BYTES / 2 - 1);
    // SAFETY: trigger 0 is that of esp-hal's guard; nothing but a stack that overflows writes to the region.
    unsafe {
        asm!(
            "csrw 0x7a0, zero // tselect",
            "csrw 0x7a5, {enabled} // tcontrol",
            "csrw 0x7a1, {store} // tdata1",
            "csrw 0x7a2, {region} // tdata2",
            enabled = in(reg) ENABLED,
            store = in(reg) STORE_TO_REGION,
            region = in(reg) region,
        );
    }
}
