//! CRC-32 as in Ethernet and zip (ISO HDLC): polynomial 0x04C11DB7, reflected.

/// Remainders of the sixteen values of four bits: 64 bytes of table in place of 1 kB.
const NIBBLES: [u32; 16] = {
    let mut all = [0; 16];
    let mut index = 0;
    while index < 16 {
        let mut rest = index as u32;
        let mut bit = 0;
        while bit < 4 {
            rest = if rest & 1 == 1 { rest >> 1 ^ 0xEDB8_8320 } else { rest >> 1 };
            bit += 1;
        }
        all[index] = rest;
        index += 1;
    }
    all
};

/// A checksum that bytes are added to.
#[derive(Clone, Copy, Debug)]
pub struct Crc(u32);

impl Default for Crc {
    fn default() -> Self {
        Self(u32::MAX)
    }
}

impl Crc {
    /// Adds bytes.
    pub fn add(&mut self, bytes: &[u8]) {
        let step = |rest: u32, value: u32| rest >> 4 ^ NIBBLES[((rest ^ value) & 15) as usize];
        let of_byte = |rest, byte: &u8| step(step(rest, u32::from(*byte)), u32::from(*byte >> 4));
        self.0 = bytes.iter().fold(self.0, of_byte);
    }

    /// The checksum of all that were added.
    pub fn sum(self) -> u32 {
        !self.0
    }
}

/// The checksum of some bytes.
pub fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = Crc::default();
    crc.add(bytes);
    crc.sum()
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_check_value_of_the_catalogue() {
        assert_eq!(super::crc32(b"123456789"), 0xCBF4_3926);
    }
}
