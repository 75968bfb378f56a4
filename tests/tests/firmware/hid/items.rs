//! Reads a HID report descriptor, item by item, as "Device Class Definition for HID 1.11" has it in section 6.2.2.

use std::collections::BTreeMap;

/// Which kind of report a field is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    Input,
    Feature,
}

/// A field that says something.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    pub kind: Kind,
    pub report: u8,
    /// Page and usage.
    pub usage: (u32, u32),
    /// Usage of the innermost collection, and how many collections were begun before it.
    pub collection: (u32, usize),
    /// First bit, counted behind the report's number.
    pub bit: usize,
    pub bits: usize,
    pub logical: [i32; 2],
    pub physical: [i32; 2],
    pub unit: u32,
    pub exponent: i32,
}

/// Items that hold for those that follow.
#[derive(Clone, Copy, Default)]
struct Globals {
    page: u32,
    logical: [i32; 2],
    physical: [i32; 2],
    exponent: i32,
    unit: u32,
    bits: usize,
    count: usize,
    report: u8,
}

/// All of a descriptor.
#[derive(Default)]
pub struct Descriptor {
    pub fields: Vec<Field>,
    /// Usage of the outermost collection, with its page.
    pub application: (u32, u32),
    /// Bits of each report behind its number.
    bits: BTreeMap<(Kind, u8), usize>,
}

fn signed(bytes: &[u8]) -> i32 {
    match *bytes {
        [] => 0,
        [one] => i32::from(one.cast_signed()),
        [low, high] => i32::from(i16::from_le_bytes([low, high])),
        [a, b, c, d] => i32::from_le_bytes([a, b, c, d]),
        _ => panic!("an item of {} bytes", bytes.len()),
    }
}

impl Descriptor {
    /// Reads it; panics where it breaks the rules.
    pub fn read(mut bytes: &[u8]) -> Self {
        let (mut descriptor, mut globals) = (Self::default(), Globals::default());
        let (mut usages, mut open, mut begun) = (Vec::new(), Vec::new(), 0);
        while let Some((prefix, rest)) = bytes.split_first() {
            let (data, rest) = rest.split_at([0, 1, 2, 4][usize::from(prefix & 3)]);
            bytes = rest;
            let value = signed(data);
            let unsigned = data.iter().rev().fold(0, |number, byte| number << 8 | u32::from(*byte));
            match prefix & 0xFC {
                0x04 => globals.page = unsigned,
                0x14 => globals.logical[0] = value,
                0x24 => globals.logical[1] = value,
                0x34 => globals.physical[0] = value,
                0x44 => globals.physical[1] = value,
                // Four bits with a sign.
                0x54 => globals.exponent = (value << 28) >> 28,
                0x64 => globals.unit = unsigned,
                0x74 => globals.bits = unsigned as usize,
                0x84 => globals.report = unsigned as u8,
                0x94 => globals.count = unsigned as usize,
                0x08 => usages.push(unsigned),
                0xA0 => {
                    let usage = usages.pop().expect("a collection has a usage");
                    if open.is_empty() {
                        descriptor.application = (globals.page, usage);
                    }
                    open.push((usage, begun));
                    begun += 1;
                }
                0xC0 => _ = open.pop().expect("a collection ends that was begun"),
                0x80 | 0xB0 => {
                    let kind = if prefix & 0xFC == 0x80 { Kind::Input } else { Kind::Feature };
                    let collection = *open.last().expect("a field is in a collection");
                    descriptor.add(kind, unsigned & 1 == 1, &globals, &usages, collection);
                }
                tag => panic!("item {tag:#04x} is not expected"),
            }
            if prefix >> 2 & 3 == 0 {
                // Locals hold up to the next main item.
                usages.clear();
            }
        }
        assert!(open.is_empty() && usages.is_empty());
        descriptor
    }

    fn add(&mut self, kind: Kind, is_constant: bool, globals: &Globals, usages: &[u32], collection: (u32, usize)) {
        let bit = self.bits.entry((kind, globals.report)).or_default();
        if !is_constant {
            assert_eq!(usages.len(), globals.count, "each field has a usage");
            let physical = if globals.physical == [0, 0] { globals.logical } else { globals.physical };
            let Globals { page, logical, exponent, unit, bits, report, .. } = *globals;
            assert!(logical[0] < logical[1] && physical[0] < physical[1]);
            assert!(i64::from(logical[1]) < 1 << bits, "{logical:?} in {bits} bits");
            let field = |(number, usage): (usize, &u32)| {
                let (usage, bit) = ((page, *usage), *bit + number * bits);
                Field { kind, report, usage, collection, bit, bits, logical, physical, unit, exponent }
            };
            self.fields.extend(usages.iter().enumerate().map(field));
        }
        *bit += globals.bits * globals.count;
    }

    /// Bytes of a report with its number.
    pub fn bytes_of(&self, kind: Kind, report: u8) -> usize {
        let bits = self.bits[&(kind, report)];
        assert!(bits.is_multiple_of(8));
        1 + bits / 8
    }

    /// The fields of this usage, in order.
    pub fn of(&self, usage: (u32, u32)) -> Vec<Field> {
        self.fields.iter().filter(|field| field.usage == usage).copied().collect()
    }
}

impl Field {
    /// Its value in a report.
    pub fn value(&self, report: &[u8]) -> u32 {
        assert_eq!(report[0], self.report);
        let bit = |bit: usize| u32::from(report[1 + bit / 8] >> (bit % 8) & 1);
        (0..self.bits).map(|number| bit(self.bit + number) << number).sum()
    }
}
