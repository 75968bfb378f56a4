//! A touch screen on a USB port: one interface of the class HID with one endpoint, whose reports and descriptor are the firmware library's.
//!
//! "Device Class Definition for HID 1.11", sections 6.2.1 and 7. Not the crate `usbd-hid`: it refuses every request for a report (0.10), and Windows asks a touch
//! screen for the one that tells how many contacts there can be.

use tactomo_firmware::hid::{
    COUNT_ID, COUNT_REPORT, DESCRIPTOR_BYTES, REPORT_BYTES, Report, ReportSink, TOUCH_ID, descriptor,
};
use usb_device::Result;
use usb_device::bus::{InterfaceNumber, UsbBus, UsbBusAllocator};
use usb_device::class::{ControlIn, ControlOut, UsbClass};
use usb_device::control::{Recipient, Request, RequestType};
use usb_device::descriptor::DescriptorWriter;
use usb_device::endpoint::EndpointIn;

/// Class of an interface for human input.
const CLASS: u8 = 3;
/// Kinds of descriptors.
const HID_DESCRIPTOR: u8 = 0x21;
const REPORT_DESCRIPTOR: u8 = 0x22;
/// Requests.
const GET_REPORT: u8 = 1;
const GET_IDLE: u8 = 2;
const SET_IDLE: u8 = 10;
/// The kind of a report in a request that is a feature; 1 is input.
const FEATURE: u8 = 3;
const INPUT: u8 = 1;
/// How often the host looks for a report (ms): full speed has no more.
const POLL_MS: u8 = 1;
/// Version 1.11, no country, one descriptor: that of the reports, with its length.
const HID: [u8; 7] = {
    let [low, high] = (DESCRIPTOR_BYTES as u16).to_le_bytes();
    [0x11, 0x01, 0, 1, REPORT_DESCRIPTOR, low, high]
};

// What usb-device's feature `control-buffer-256` has room for.
const _: () = assert!(DESCRIPTOR_BYTES <= 256);

/// Nothing touches.
const NOTHING: Report = {
    let mut report = [0; REPORT_BYTES];
    report[0] = TOUCH_ID;
    report
};

/// The interface.
pub struct UsbDigitizer<'a, B: UsbBus> {
    interface: InterfaceNumber,
    endpoint: EndpointIn<'a, B>,
    size_m: [f32; 2],
    /// The report that was sent last.
    last: Report,
    /// Whether a host has set the port up; else what is sent would wait in the port.
    is_open: bool,
}

impl<'a, B: UsbBus> UsbDigitizer<'a, B> {
    /// An interface of this port. The detector's size is not known yet.
    pub fn new(bus: &'a UsbBusAllocator<B>) -> Self {
        Self {
            interface: bus.interface(),
            endpoint: bus.interrupt(REPORT_BYTES as u16, POLL_MS),
            size_m: [0.1; 2],
            last: NOTHING,
            is_open: false,
        }
    }

    /// Whether a host has set the port up: to be told after each look at it.
    pub fn set_open(&mut self, is_open: bool) {
        self.is_open = is_open;
    }
}

impl<B: UsbBus> ReportSink for UsbDigitizer<'_, B> {
    fn set_size(&mut self, size_m: [f32; 2]) {
        self.size_m = size_m;
    }

    fn send(&mut self, report: &Report) -> bool {
        let is_sent = self.is_open && self.endpoint.write(report).is_ok();
        if is_sent {
            self.last = *report;
        }
        is_sent
    }
}

impl<B: UsbBus> UsbClass<B> for UsbDigitizer<'_, B> {
    fn get_configuration_descriptors(&self, writer: &mut DescriptorWriter) -> Result<()> {
        // Neither a keyboard's nor a mouse's protocol for boot loaders.
        writer.interface(self.interface, CLASS, 0, 0)?;
        writer.write(HID_DESCRIPTOR, &HID)?;
        writer.endpoint(&self.endpoint)
    }

    fn reset(&mut self) {
        (self.is_open, self.last) = (false, NOTHING);
    }

    fn control_in(&mut self, transfer: ControlIn<B>) {
        let request = *transfer.request();
        if request.recipient != Recipient::Interface || request.index != u8::from(self.interface).into() {
            return;
        }
        let [number, kind] = request.value.to_le_bytes();
        // A host that takes none of these stays without.
        let _ = match (request.request_type, request.request, kind) {
            (RequestType::Standard, Request::GET_DESCRIPTOR, REPORT_DESCRIPTOR) => {
                transfer.accept_with(&descriptor(self.size_m))
            }
            (RequestType::Standard, Request::GET_DESCRIPTOR, HID_DESCRIPTOR) => {
                let [a, b, c, d, e, f, g] = HID;
                transfer.accept_with(&[2 + HID.len() as u8, HID_DESCRIPTOR, a, b, c, d, e, f, g])
            }
            (RequestType::Class, GET_REPORT, FEATURE) if number == COUNT_ID => transfer.accept_with(&COUNT_REPORT),
            (RequestType::Class, GET_REPORT, INPUT) if number == self.last[0] => transfer.accept_with(&self.last),
            // No end: a report comes when something touches.
            (RequestType::Class, GET_IDLE, _) => transfer.accept_with(&[0]),
            // Others are the device's own, or are refused by it.
            _ => return,
        };
    }

    fn control_out(&mut self, transfer: ControlOut<B>) {
        let request = transfer.request();
        let is_ours = request.recipient == Recipient::Interface && request.index == u8::from(self.interface).into();
        if is_ours && request.request_type == RequestType::Class && request.request == SET_IDLE {
            // There is nothing to say as long as nothing touches, whatever the host would like.
            let _ = transfer.accept();
        }
    }
}

#[cfg(test)]
mod tests;
