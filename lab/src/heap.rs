//! Counts what the program allocates while `tactomo-lab tradeoff` or `study growth` asks for it; the rest of the time it only looks at a flag.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicBool, AtomicIsize, Ordering::Relaxed};

use tactomo_study::tradeoff::{Heap, Memory};

static COUNTS: AtomicBool = AtomicBool::new(false);
/// Below zero where more is freed than allocated since the start.
static ALLOCATED: AtomicIsize = AtomicIsize::new(0);
static PEAK: AtomicIsize = AtomicIsize::new(0);

/// The system's allocator, which can be counted.
pub struct Counting;

/// How it is counted: one count at a time.
pub const HEAP: Heap = Heap { start, stop };

fn start() {
    ALLOCATED.store(0, Relaxed);
    PEAK.store(0, Relaxed);
    COUNTS.store(true, Relaxed);
}

fn stop() -> Memory {
    COUNTS.store(false, Relaxed);
    let [kept_bytes, peak_bytes] = [&ALLOCATED, &PEAK].map(|bytes| bytes.load(Relaxed).max(0).unsigned_abs());
    Memory { kept_bytes, peak_bytes }
}

/// Adds a change of what is allocated (bytes), if it is counted. No layout is larger than `isize::MAX`.
fn count(bytes: isize) {
    if COUNTS.load(Relaxed) {
        PEAK.fetch_max(ALLOCATED.fetch_add(bytes, Relaxed) + bytes, Relaxed);
    }
}

// SAFETY: every call is passed on to the system's allocator as it came; counting allocates nothing.
#[allow(unsafe_code, reason = "an allocator cannot be written without")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        // As if both were there for a moment, as they are where the block moves.
        count(new_size as isize);
        count(-(layout.size() as isize));
        unsafe { System.realloc(pointer, layout, new_size) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_allocated_between_start_and_stop_is_counted() {
        const MB: usize = 1 << 20;
        let before = vec![1_u8; 3 * MB];
        start();
        let kept = vec![2_u8; 2 * MB];
        drop(vec![3_u8; 5 * MB]);
        let memory = stop();
        let after = vec![4_u8; 9 * MB];
        // Other tests of this program may allocate a little meanwhile.
        let near = |bytes: usize, expected: usize| bytes.abs_diff(expected) < MB / 2;
        assert!(near(memory.kept_bytes, kept.len()), "{memory:?}");
        assert!(near(memory.peak_bytes, kept.len() + 5 * MB), "{memory:?}");
        assert!(near(stop().kept_bytes, memory.kept_bytes), "not counted after it stopped");
        assert!(before.len() + after.len() > 0);
    }
}
