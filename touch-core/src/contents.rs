//! What a table is made of, and how it is written.

use crate::crc::Crc;
use crate::table::{Head, MAGIC, VERSION, bytes_of};

/// What a table is made of, each in the order that [`table`](crate::table) says; as many as the counts need.
#[derive(Clone, Copy, Debug)]
pub struct Contents<'a> {
    /// Numbers of the detector and its board.
    pub head: Head,
    /// Places of the electrodes (m).
    pub places_m: &'a [[f32; 3]],
    /// Coefficients along x and y.
    pub sides: [usize; 2],
    /// Fields between the electrodes (ohm): lower triangle.
    pub pads_ohm: &'a [f32],
    /// Gain and unseen offset (V) of each channel.
    pub channels: &'a [[f32; 2]],
    /// Coefficients of the spline over distances (ohm).
    pub distances_ohm: &'a [f32],
    /// `Q`: lower triangle.
    pub walls: &'a [f32],
    /// Value at code 0 and step of a code, of each quantity.
    pub codes: &'a [[f32; 2]],
    /// Which cells are on the detector, a bit each.
    pub mask: &'a [u8],
    /// Codes of the coefficients.
    pub coefficients: &'a [i16],
}

impl Contents<'_> {
    /// Writes the table.
    pub fn write(&self, out: &mut impl Extend<u8>) {
        let mut crc = Crc::default();
        let mut put = |bytes: &[u8]| {
            crc.add(bytes);
            out.extend(bytes.iter().copied());
        };
        let (electrodes, knots) = (self.places_m.len(), self.distances_ohm.len());
        put(&MAGIC);
        for count in [usize::from(VERSION), electrodes, self.sides[0], self.sides[1], knots, 0] {
            put(&(count as u16).to_le_bytes());
        }
        put(&(bytes_of(electrodes, self.sides, knots) as u32).to_le_bytes());
        put(&self.layout().to_le_bytes());
        let [channels, codes] = [self.channels, self.codes].map(<[_]>::as_flattened);
        for floats in [&self.head.numbers(), self.pads_ohm, channels, self.distances_ohm, self.walls, codes] {
            floats.iter().for_each(|value| put(&value.to_le_bytes()));
        }
        put(self.mask);
        self.coefficients.iter().for_each(|code| put(&code.to_le_bytes()));
        let sum = crc.sum();
        out.extend(sum.to_le_bytes());
    }

    /// What stands for the electrodes' places.
    fn layout(&self) -> u32 {
        let mut crc = Crc::default();
        self.places_m.as_flattened().iter().for_each(|place_m| crc.add(&place_m.to_le_bytes()));
        crc.sum()
    }
}
