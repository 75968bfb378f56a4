//! The ns16550 UART of the emulated machine, polled.

use core::ptr;

use tactomo_firmware::Serial;

const BASE: *mut u8 = 0x1000_0000 as *mut u8;
/// Offset of the data register, both ways.
const DATA: usize = 0;
/// Offset of the FIFO control register.
const FIFO_CONTROL: usize = 2;
/// Offset of the line control register.
const LINE_CONTROL: usize = 3;
/// Offset of the line status register.
const LINE_STATUS: usize = 5;

/// FIFOs on; neither cleared, so that no byte of the host's is lost.
const FIFO_ON: u8 = 1;
/// Eight data bits, no parity, one stop bit.
const EIGHT_N_ONE: u8 = 3;
/// Line status: a byte has come.
const RECEIVED: u8 = 1;
/// Line status: the transmit FIFO is empty.
const SENT: u8 = 1 << 5;
/// Bytes that the transmit FIFO holds.
const FIFO_BYTES: usize = 16;

/// A UART: the machine's, or memory that looks like one.
pub struct Uart {
    base: *mut u8,
}

impl Uart {
    /// Sets up the machine's UART.
    pub fn new() -> Self {
        let uart = Self { base: BASE };
        uart.set(LINE_CONTROL, EIGHT_N_ONE);
        uart.set(FIFO_CONTROL, FIFO_ON);
        uart
    }

    /// Makes `registers` a UART whose host reads everything at once and says nothing. It costs the same instructions.
    pub fn nowhere(registers: &'static mut [u8; 8]) -> Self {
        registers[LINE_STATUS] = SENT;
        Self { base: registers.as_mut_ptr() }
    }

    fn get(&self, register: usize) -> u8 {
        // SAFETY: a byte register of the UART.
        unsafe { ptr::read_volatile(self.base.add(register)) }
    }

    fn set(&self, register: usize, value: u8) {
        // SAFETY: a byte register of the UART.
        unsafe { ptr::write_volatile(self.base.add(register), value) }
    }
}

impl Serial for Uart {
    fn push(&mut self, bytes: &[u8]) -> usize {
        if self.get(LINE_STATUS) & SENT == 0 {
            return 0;
        }
        let fitting = &bytes[..bytes.len().min(FIFO_BYTES)];
        fitting.iter().for_each(|byte| self.set(DATA, *byte));
        fitting.len()
    }

    fn pull(&mut self, buffer: &mut [u8]) -> usize {
        let mut count = 0;
        while count < buffer.len() && self.get(LINE_STATUS) & RECEIVED != 0 {
            buffer[count] = self.get(DATA);
            count += 1;
        }
        count
    }
}
