//! The chip's own USB port, as a serial port; with the feature `hid` as a touch screen too.

use static_cell::{ConstStaticCell, StaticCell};
use stm32f4xx_hal::otg_fs::{USB, UsbBus};
use tactomo_firmware::Serial;
use usb_device::bus::UsbBusAllocator;
use usb_device::device::{StringDescriptors, UsbDevice, UsbDeviceBuilder, UsbVidPid};
use usbd_serial::SerialPort;

#[cfg(feature = "hid")]
use crate::touch_screen::TouchScreen;

/// Vendor and product that are shared by serial ports of free designs, which tell themselves apart by their names.
const IDS: UsbVidPid = UsbVidPid(0x16C0, 0x27DD);
/// Memory of the endpoints, in words: all that the port has.
static ENDPOINTS: ConstStaticCell<[u32; 320]> = ConstStaticCell::new([0; 320]);
static BUS: StaticCell<UsbBusAllocator<UsbBus<USB>>> = StaticCell::new();

/// The USB port as a line that never waits: when no host reads, it takes no bytes.
pub struct UsbLine {
    device: UsbDevice<'static, UsbBus<USB>>,
    port: SerialPort<'static, UsbBus<USB>>,
    /// What the port is beside it.
    #[cfg(feature = "hid")]
    pub screen: TouchScreen,
}

impl UsbLine {
    /// Takes the port; `None` if its names do not fit. To be called once.
    pub fn new(usb: USB) -> Option<Self> {
        let bus = BUS.init(UsbBus::new(usb, ENDPOINTS.take()));
        let port = SerialPort::new(bus);
        #[cfg(feature = "hid")]
        let screen = TouchScreen::new(bus);
        let names = StringDescriptors::default().manufacturer("Tactomo").product("Tactomo stm32f405");
        let device = UsbDeviceBuilder::new(bus, IDS).strings(&[names]).ok()?;
        #[cfg(not(feature = "hid"))]
        let device = device.device_class(usbd_serial::USB_CLASS_CDC);
        // Another release, as systems keep what a device was by its numbers.
        #[cfg(feature = "hid")]
        let device = device.composite_with_iads().device_release(0x0011);
        Some(Self {
            device: device.build(),
            port,
            #[cfg(feature = "hid")]
            screen,
        })
    }

    fn poll(&mut self) {
        #[cfg(not(feature = "hid"))]
        self.device.poll(&mut [&mut self.port]);
        #[cfg(feature = "hid")]
        self.screen.poll(&mut self.device, &mut self.port);
    }
}

impl Serial for UsbLine {
    /// The host is answered here too: nothing else polls the port while a row is scanned.
    fn push(&mut self, bytes: &[u8]) -> usize {
        self.poll();
        self.port.write(bytes).unwrap_or(0)
    }

    fn pull(&mut self, buffer: &mut [u8]) -> usize {
        self.poll();
        // What was written last may wait for a full packet.
        let _ = self.port.flush();
        self.port.read(buffer).unwrap_or(0)
    }
}
