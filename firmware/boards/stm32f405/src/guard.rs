//! Memory below the stack that nothing may touch, so that a stack that grows too far is found out before it is in the statics.

use cortex_m::asm;
use cortex_m::peripheral::{MPU, SCB};
use cortex_m_rt::ExceptionFrame;

/// The first 32 kB of memory are the region; the first of its eight parts, 4 kB, are the statics' (`memory.x`). So 28 kB are guarded, more than the largest
/// frame of a function, 20 kB: none steps over it.
const BEGIN: u32 = 0x2000_0000;
const LOG2_BYTES: u32 = 15;
const STATICS: u32 = 0b1;

/// Bits of the region's attributes: in force; never run, and no access (the field of access is zero).
const IN_FORCE: u32 = 1;
const NEVER_RUN: u32 = 1 << 28;
/// Bits of the unit: in force, and what is in no region is as without it.
const ENABLE: u32 = 0b101;

/// Marks of what went wrong with memory: an access, or what an exception puts on the stack.
const VIOLATION: u32 = 1 << 1 | 1 << 4;

/// Arms the guard.
pub fn arm(mpu: &MPU) {
    // SAFETY: the stack is above the region, the statics are in the part that is left out of it (asserted in `memory.x`).
    unsafe {
        mpu.rnr.write(0);
        mpu.rbar.write(BEGIN);
        mpu.rasr.write(NEVER_RUN | STATICS << 8 | (LOG2_BYTES - 1) << 1 | IN_FORCE);
        mpu.ctrl.write(ENABLE);
    }
    asm::dsb();
    asm::isb();
}

/// What the guard and all other faults end in. It may use the memory: the guard is off here.
#[cortex_m_rt::exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    // SAFETY: a register that is only read.
    let cause = unsafe { (*SCB::PTR).cfsr.read() };
    if cause & VIOLATION != 0 {
        panic!("the stack has overflowed");
    }
    panic!("fault {cause:#x} at {:#x}", frame.pc());
}
