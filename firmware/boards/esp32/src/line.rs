//! UART0, at the module's USB bridge.

use esp_hal::Blocking;
use esp_hal::peripherals::{GPIO1, GPIO3, UART0};
use esp_hal::uart::{Config, Uart};
use tactomo_firmware::Serial;

/// Bits a second after a reset, which all common USB bridges keep; the rates above are of some. The UART makes each to 0.1 % of the 80 MHz of its
/// clock and a divider in sixteenths.
static RATES: [u32; 4] = [921_600, 1_500_000, 2_000_000, 3_000_000];

fn config(baud: u32) -> Config {
    Config::default().with_baudrate(baud)
}

/// The UART as a line that never waits.
pub struct UartLine<'d>(Uart<'d, Blocking>);

impl<'d> UartLine<'d> {
    /// Sets up the UART on the pins of the USB bridge.
    pub fn new(uart: UART0<'d>, tx: GPIO1<'d>, rx: GPIO3<'d>) -> Self {
        match Uart::new(uart, config(RATES[0])) {
            Ok(uart) => Self(uart.with_tx(tx).with_rx(rx)),
            Err(_) => panic!("the UART does not take its baud rate"),
        }
    }
}

impl Serial for UartLine<'_> {
    fn rates(&self) -> &'static [u32] {
        &RATES
    }

    /// The driver waits until the FIFO is empty: 1.4 ms of 128 bytes at the slowest of the rates.
    fn set_baud(&mut self, baud: u32) {
        if self.0.flush().is_err() || self.0.apply_config(&config(baud)).is_err() {
            panic!("the UART does not take its baud rate");
        }
    }

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
