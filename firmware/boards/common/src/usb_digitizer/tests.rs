//! The touch screen beside a serial port, on a port that a test is the host of.

extern crate std;

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard};
use std::vec::Vec;

use tactomo_firmware::hid::{self, COUNT_REPORT, REPORT_BYTES, ReportSink};
use usb_device::bus::{PollResult, UsbBus, UsbBusAllocator};
use usb_device::device::{UsbDevice, UsbDeviceBuilder, UsbDeviceState, UsbVidPid};
use usb_device::endpoint::{EndpointAddress, EndpointType};
use usb_device::{Result, UsbDirection, UsbError};
use usbd_serial::SerialPort;

use super::UsbDigitizer;

/// Endpoints that the STM32F405 has beside the first, each way.
const ENDPOINTS: usize = 3;
/// Longest packet of the first endpoint.
const PACKET: usize = 8;

/// What is on the wire.
#[derive(Default)]
struct Wire {
    /// Endpoints so far, to the host and from it.
    endpoints: [usize; 2],
    setup: Option<[u8; 8]>,
    /// What the host sends after it.
    data: VecDeque<Vec<u8>>,
    /// Packets to the host, by endpoint.
    sent: [Option<Vec<u8>>; 1 + ENDPOINTS],
    taken: bool,
    is_stalled: bool,
    is_reset: bool,
}

/// A port.
#[derive(Clone, Default)]
struct Port(Arc<Mutex<Wire>>);

impl Port {
    fn wire(&self) -> MutexGuard<'_, Wire> {
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

impl UsbBus for Port {
    fn alloc_ep(
        &mut self,
        direction: UsbDirection,
        address: Option<EndpointAddress>,
        _kind: EndpointType,
        _longest: u16,
        _interval: u8,
    ) -> Result<EndpointAddress> {
        if let Some(address) = address {
            return Ok(address);
        }
        let mut wire = self.wire();
        let count = &mut wire.endpoints[usize::from(direction == UsbDirection::Out)];
        *count += 1;
        if *count > ENDPOINTS {
            Err(UsbError::EndpointOverflow)
        } else {
            Ok(EndpointAddress::from_parts(*count, direction))
        }
    }

    fn enable(&mut self) {}

    fn reset(&self) {}

    fn set_device_address(&self, _address: u8) {}

    fn write(&self, endpoint: EndpointAddress, bytes: &[u8]) -> Result<usize> {
        let mut wire = self.wire();
        let place = &mut wire.sent[endpoint.index()];
        if place.is_some() {
            return Err(UsbError::WouldBlock);
        }
        *place = Some(bytes.to_vec());
        Ok(bytes.len())
    }

    fn read(&self, endpoint: EndpointAddress, bytes: &mut [u8]) -> Result<usize> {
        let mut wire = self.wire();
        if endpoint.index() != 0 {
            return Err(UsbError::WouldBlock);
        }
        let packet = match wire.setup.take() {
            Some(setup) => setup.to_vec(),
            None => wire.data.pop_front().ok_or(UsbError::WouldBlock)?,
        };
        bytes[..packet.len()].copy_from_slice(&packet);
        Ok(packet.len())
    }

    fn set_stalled(&self, _endpoint: EndpointAddress, is_stalled: bool) {
        self.wire().is_stalled |= is_stalled;
    }

    fn is_stalled(&self, _endpoint: EndpointAddress) -> bool {
        false
    }

    fn suspend(&self) {}

    fn resume(&self) {}

    fn poll(&self) -> PollResult {
        let mut wire = self.wire();
        if core::mem::take(&mut wire.is_reset) {
            return PollResult::Reset;
        }
        let ep_setup = wire.setup.is_some().into();
        let ep_out = (ep_setup == 0 && !wire.data.is_empty()).into();
        let ep_in_complete = core::mem::take(&mut wire.taken).into();
        PollResult::Data { ep_out, ep_in_complete, ep_setup }
    }
}

/// The host's end.
struct Host<'a> {
    port: Port,
    device: UsbDevice<'a, Port>,
    serial: SerialPort<'a, Port>,
    screen: UsbDigitizer<'a, Port>,
}

impl<'a> Host<'a> {
    fn new(port: &Port, bus: &'a UsbBusAllocator<Port>) -> Self {
        let (serial, screen) = (SerialPort::new(bus), UsbDigitizer::new(bus));
        let device = UsbDeviceBuilder::new(bus, UsbVidPid(1, 2)).composite_with_iads().build();
        port.wire().is_reset = true;
        let mut host = Self { port: port.clone(), device, serial, screen };
        host.poll();
        host
    }

    fn poll(&mut self) {
        self.device.poll(&mut [&mut self.serial, &mut self.screen]);
        self.screen.set_open(self.device.state() == UsbDeviceState::Configured);
    }

    /// The packet that waits for the host.
    fn take(&mut self, endpoint: usize) -> Option<Vec<u8>> {
        self.port.wire().sent[endpoint].take()
    }

    /// Asks for something; `None` if it is refused.
    fn ask(&mut self, kind: u8, request: u8, value: u16, index: u16, length: u16) -> Option<Vec<u8>> {
        let ([v0, v1], [i0, i1], [l0, l1]) = (value.to_le_bytes(), index.to_le_bytes(), length.to_le_bytes());
        self.port.wire().setup = Some([kind, request, v0, v1, i0, i1, l0, l1]);
        let mut answer = Vec::new();
        loop {
            self.poll();
            if core::mem::take(&mut self.port.wire().is_stalled) {
                self.take(0);
                return None;
            }
            let Some(packet) = self.take(0) else { panic!("no answer to {kind:#x} {request}") };
            answer.extend_from_slice(&packet);
            self.port.wire().taken = true;
            if packet.len() < PACKET || answer.len() >= usize::from(length) {
                break;
            }
        }
        self.poll();
        if kind & 0x80 != 0 {
            self.port.wire().data.push_back(Vec::new());
            self.poll();
        }
        Some(answer)
    }

    fn configure(&mut self) {
        assert_eq!(self.ask(0x00, 9, 1, 0, 0), Some(Vec::new()));
        assert!(self.device.state() == UsbDeviceState::Configured);
    }
}

/// Number of the touch screen's interface, after the two of the serial port.
const SCREEN: u16 = 2;

#[test]
fn a_host_finds_a_serial_port_and_a_touch_screen_on_three_endpoints() {
    let port = Port::default();
    let bus = UsbBusAllocator::new(port.clone());
    let mut host = Host::new(&port, &bus);
    let device = host.ask(0x80, 6, 0x0100, 0, 18).unwrap();
    // Interfaces that belong together are told by associations.
    assert_eq!(device[4..7], [0xEF, 2, 1]);
    let mut rest = &host.ask(0x80, 6, 0x0200, 0, 255).unwrap()[..];
    assert_eq!(usize::from(rest[2]), rest.len());
    let mut descriptors = Vec::new();
    while let Some(length) = rest.first() {
        let (descriptor, more) = rest.split_at((*length).into());
        descriptors.push(descriptor);
        rest = more;
    }
    let of_kind = |kind| descriptors.iter().filter(move |descriptor| descriptor[1] == kind).copied();
    assert!(of_kind(11).eq([&[8, 11, 0, 2, 2, 2, 0, 0]]));
    let classes: Vec<_> = of_kind(4).map(|interface| (interface[2], interface[5])).collect();
    assert_eq!(classes, [(0, 2), (1, 10), (2, 3)]);
    let length = hid::DESCRIPTOR_BYTES as u8;
    assert!(of_kind(0x21).eq([&[9, 0x21, 0x11, 1, 0, 1, 0x22, length, 0]]));
    // An interrupt endpoint to the host, once a millisecond.
    assert_eq!(of_kind(5).last(), Some(&[7, 5, 0x83, 3, REPORT_BYTES as u8, 0, 1][..]));
}

#[test]
fn the_descriptor_of_reports_tells_the_size_and_the_feature_how_many_contacts_there_can_be() {
    let port = Port::default();
    let bus = UsbBusAllocator::new(port.clone());
    let mut host = Host::new(&port, &bus);
    host.screen.set_size([0.06, 0.04]);
    host.configure();
    let descriptor = host.ask(0x81, 6, 0x2200, SCREEN, 1000).unwrap();
    assert_eq!(descriptor, hid::descriptor([0.06, 0.04]));
    assert_eq!(host.ask(0x81, 6, 0x2100, SCREEN, 9).unwrap().len(), 9);
    let count = host.ask(0xA1, 1, 0x0300 | u16::from(hid::COUNT_ID), SCREEN, 64);
    assert_eq!(count.as_deref(), Some(&COUNT_REPORT[..]));
    assert_eq!(host.ask(0xA1, 1, 0x0377, SCREEN, 64), None);
    // The idle time is taken and not heeded.
    assert_eq!(host.ask(0x21, 10, 0, SCREEN, 0), Some(Vec::new()));
    assert_eq!(host.ask(0xA1, 2, 0, SCREEN, 1).as_deref(), Some(&[0][..]));
    // What any interface is asked is answered as for any other.
    assert_eq!(host.ask(0x81, 0, 0, SCREEN, 2).as_deref(), Some(&[0, 0][..]));
    assert_eq!(host.ask(0xA1, 0x21, 0, 0, 7).map(|coding| coding.len()), Some(7));
}

#[test]
fn reports_go_when_a_host_has_set_the_port_up_and_took_the_last() {
    let port = Port::default();
    let bus = UsbBusAllocator::new(port.clone());
    let mut host = Host::new(&port, &bus);
    let report = [1; REPORT_BYTES];
    assert!(!host.screen.send(&report));
    host.configure();
    // What a host asks for before anything was sent: nothing touches.
    let asked = |host: &mut Host| host.ask(0xA1, 1, 0x0100 | u16::from(hid::TOUCH_ID), SCREEN, 64).unwrap();
    let nothing = asked(&mut host);
    assert!(nothing.len() == REPORT_BYTES && nothing[0] == hid::TOUCH_ID && nothing[1..].iter().all(|byte| *byte == 0));
    assert!(host.screen.send(&report) && !host.screen.send(&report));
    assert_eq!(host.take(3).as_deref(), Some(&report[..]));
    assert!(host.screen.send(&report));
    assert_eq!(asked(&mut host), report);
    host.port.wire().is_reset = true;
    host.poll();
    host.take(3);
    assert!(!host.screen.send(&report));
    host.configure();
    assert_eq!(asked(&mut host), nothing);
}

#[test]
fn a_screen_that_was_never_told_of_a_host_sends_nothing() {
    let bus = UsbBusAllocator::new(Port::default());
    assert!(!UsbDigitizer::new(&bus).send(&[1; REPORT_BYTES]));
}
