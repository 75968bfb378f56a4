//! UART0, at the module's USB bridge.

use esp_hal::Blocking;
use esp_hal::peripherals::{GPIO1, GPIO3, UART0};
use esp_hal::uart::{Config, Uart};
use tactomo_firmware::Serial;

/// What common USB bridges keep up with.
const BAUD: u32 = 921_600;

/// The UART as a line that never waits.
pub struct UartLine<'d>(Uart<'d, Blocking>);

impl<'d> UartLine<'d> {
    /// Sets up the UART on the pins of the USB bridge.
    pub fn new(uart: UART0<'d>, tx: GPIO1<'d>, rx: GPIO3<'d>) -> Self {
        match Uart::new(uart, Config::default().with_baudrate(BAUD)) {
            Ok(uart) => Self(uart.with_tx(tx).with_rx(rx)),
            Err(_) => panic!("the UART does not take its baud rate"),
        }
    }
}

impl Serial for UartLine<'_> {
    /// A full FIFO would make the driver wait, so it is asked first.
    fn push(&mut self, bytes: &[u8]) -> usize {
        if bytes.is_empty() || !self.0.write_ready() {
            return 0;
        }
        self.0.write(bytes).unwrap_or(0)
    }

    /// After an error of the line the bytes are noise, or lost: the receiver finds the next packet.
    fn pull(&mut self, buffer: &mut [u8]) -> usize {
        self.0.read_buffered(buffer).unwrap_or(0)
    }
}
