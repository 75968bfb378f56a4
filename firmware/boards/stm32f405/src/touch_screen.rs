//! The touch screen on the USB port, which the line looks after and the contacts' finder writes to.

use core::cell::RefCell;

use static_cell::StaticCell;
use stm32f4xx_hal::otg_fs::{USB, UsbBus};
use tactomo_board_common::usb_digitizer::UsbDigitizer;
use tactomo_firmware::hid::{Report, ReportSink};
use usb_device::bus::UsbBusAllocator;
use usb_device::device::{UsbDevice, UsbDeviceState};
use usbd_serial::SerialPort;

type Bus = UsbBus<USB>;

static SCREEN: StaticCell<RefCell<UsbDigitizer<'static, Bus>>> = StaticCell::new();

/// A handle of it. No interrupt uses one, and none is held while another is.
#[derive(Clone, Copy)]
pub struct TouchScreen(&'static RefCell<UsbDigitizer<'static, Bus>>);

impl TouchScreen {
    /// On this port. To be called once.
    pub fn new(bus: &'static UsbBusAllocator<Bus>) -> Self {
        Self(SCREEN.init(RefCell::new(UsbDigitizer::new(bus))))
    }

    /// Looks after the port.
    pub fn poll(self, device: &mut UsbDevice<'static, Bus>, port: &mut SerialPort<'static, Bus>) {
        let mut screen = self.0.borrow_mut();
        device.poll(&mut [port, &mut *screen]);
        screen.set_open(device.state() == UsbDeviceState::Configured);
    }
}

impl ReportSink for TouchScreen {
    fn set_size(&mut self, size_m: [f32; 2]) {
        self.0.borrow_mut().set_size(size_m);
    }

    fn send(&mut self, report: &Report) -> bool {
        self.0.borrow_mut().send(report)
    }
}
