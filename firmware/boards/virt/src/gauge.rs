//! What a frame costs: instructions outside conversions and waits, and stack.

use core::cell::Cell;
use core::hint::black_box;
use core::ptr;

use crate::machine::instructions;

/// Counts instructions, less those of what is left out.
#[derive(Default)]
pub struct Gauge {
    left_out: Cell<u64>,
}

impl Gauge {
    /// Runs `work` without counting it.
    #[inline]
    pub fn leave_out<T>(&self, work: impl FnOnce() -> T) -> T {
        let start = instructions();
        let result = work();
        self.left_out.set(self.left_out.get() + instructions() - start);
        result
    }

    /// Instructions so far that count.
    pub fn count(&self) -> u64 {
        instructions() - self.left_out.get()
    }
}

/// What unused stack is painted with.
const PAINT: u32 = 0x5AFE_57AC;
/// Bytes below the painter's own frame that it leaves alone.
const MARGIN_BYTES: usize = 256;

// The ends of the stack, placed by riscv-rt.
unsafe extern "C" {
    static mut __estack: u32;
    static __sstack: u32;
}

/// Paints the stack that is not in use.
#[inline(never)]
pub fn paint_stack() {
    let here = black_box(0u32);
    let end = (&raw const here).wrapping_byte_sub(MARGIN_BYTES);
    let mut word = &raw mut __estack;
    while word.cast_const() < end {
        // SAFETY: between the end of the stack and what is in use of it.
        unsafe { ptr::write_volatile(word, PAINT) };
        word = word.wrapping_add(1);
    }
}

/// Most bytes of stack that were in use at any time since it was painted.
pub fn stack_used_bytes() -> usize {
    let top = &raw const __sstack;
    let mut word = (&raw mut __estack).cast_const();
    // SAFETY: within the stack.
    while word < top && unsafe { ptr::read_volatile(word) } == PAINT {
        word = word.wrapping_add(1);
    }
    top as usize - word as usize
}
