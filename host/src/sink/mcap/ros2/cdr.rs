//! Bytes as ROS 2 passes messages on: the plain Common Data Representation of DDS-XTypes (OMG, version 1.3, 7.4.1), little-endian.

/// A message that is being written.
#[derive(Clone, Debug)]
pub(super) struct Cdr(Vec<u8>);

impl Cdr {
    /// Representation CDR_LE and no options; what follows is aligned from there on.
    const HEADER: [u8; 4] = [0, 1, 0, 0];

    /// An empty one.
    pub fn new() -> Self {
        Self(Self::HEADER.to_vec())
    }

    /// The message.
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }

    /// Appends a number by its little-endian bytes, at a place that its size divides.
    pub fn put<const SIZE: usize>(&mut self, number: [u8; SIZE]) -> &mut Self {
        let at = (self.0.len() - Self::HEADER.len()).next_multiple_of(SIZE);
        self.0.resize(at + Self::HEADER.len(), 0);
        self.0.extend(number);
        self
    }

    /// Appends whether something is so.
    pub fn flag(&mut self, is_so: bool) -> &mut Self {
        self.put([u8::from(is_so)])
    }

    /// Appends a real number; NaN if it is not known.
    pub fn number(&mut self, value: Option<f64>) -> &mut Self {
        self.put(value.unwrap_or(f64::NAN).to_le_bytes())
    }

    /// Appends a text with its length and the zero at its end.
    pub fn text(&mut self, text: &str) -> &mut Self {
        self.put((text.len() as u32 + 1).to_le_bytes());
        self.0.extend(text.as_bytes());
        self.put([0])
    }

    /// Appends a sequence: how many there are, then each.
    pub fn all<T>(&mut self, items: impl ExactSizeIterator<Item = T>, mut each: impl FnMut(&mut Self, T)) -> &mut Self {
        self.put((items.len() as u32).to_le_bytes());
        items.for_each(|item| each(self, item));
        self
    }

    /// Appends bytes as a sequence.
    pub fn octets(&mut self, bytes: &[u8]) -> &mut Self {
        self.put((bytes.len() as u32).to_le_bytes());
        self.0.extend(bytes);
        self
    }
}
