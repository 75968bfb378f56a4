//! The chip's own USB serial port.

use esp_hal::Blocking;
use esp_hal::peripherals::USB_DEVICE;
use esp_hal::usb::usb_serial_jtag::UsbSerialJtag;
use tactomo_firmware::Serial;

/// The USB port as a line that never waits: when no host reads, it takes no bytes.
pub struct UsbLine<'d>(UsbSerialJtag<'d, Blocking>);

impl<'d> UsbLine<'d> {
    /// Takes the port.
    pub fn new(usb: USB_DEVICE<'d>) -> Self {
        Self(UsbSerialJtag::new(usb))
    }
}

impl Serial for UsbLine<'_> {
    fn push(&mut self, bytes: &[u8]) -> usize {
        let count = bytes.iter().take_while(|byte| self.0.write_byte_nb(**byte).is_ok()).count();
        if count > 0 {
            // Hands the bytes to the host's next poll; whether that has come yet does not matter.
            let _ = self.0.flush_tx_nb();
        }
        count
    }

    fn pull(&mut self, buffer: &mut [u8]) -> usize {
        let received = core::iter::from_fn(|| self.0.read_byte().ok());
        buffer.iter_mut().zip(received).map(|(place, byte)| *place = byte).count()
    }
}
