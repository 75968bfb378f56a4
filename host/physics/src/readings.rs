//! The readings of one frame, in volts.

/// `n x n` readings of one frame (V): reading `(g, e)` is electrode `e` while `g` is grounded.
#[derive(Clone, Debug, PartialEq)]
pub struct Readings {
    electrodes: usize,
    volts: Vec<f64>,
}

impl Readings {
    /// Readings row by row (`volts[g * electrodes + e]`); `None` unless there are `electrodes` squared.
    pub fn new(electrodes: usize, volts: Vec<f64>) -> Option<Self> {
        (volts.len() == electrodes * electrodes).then_some(Self { electrodes, volts })
    }

    /// Readings from a function of ground and electrode.
    pub fn from_fn(electrodes: usize, mut volts: impl FnMut(usize, usize) -> f64) -> Self {
        let volts = (0..electrodes * electrodes).map(|i| volts(i / electrodes, i % electrodes)).collect();
        Self { electrodes, volts }
    }

    /// Number of electrodes.
    pub fn electrodes(&self) -> usize {
        self.electrodes
    }

    /// Electrode `e` while `g` is grounded (V).
    ///
    /// # Panics
    /// If `g` or `e` is not an electrode.
    pub fn at(&self, g: usize, e: usize) -> f64 {
        self.volts[g * self.electrodes + e]
    }

    /// All of them, row by row (V).
    pub fn volts(&self) -> &[f64] {
        &self.volts
    }

    /// All of them, row by row (V), to be changed.
    pub fn volts_mut(&mut self) -> &mut [f64] {
        &mut self.volts
    }

    /// The readings of some electrodes alone, in this order.
    ///
    /// # Panics
    /// If there is no such electrode.
    pub fn of(&self, electrodes: &[usize]) -> Self {
        Self::from_fn(electrodes.len(), |g, e| self.at(electrodes[g], electrodes[e]))
    }

    /// The largest (V); zero if there are none.
    pub fn largest_v(&self) -> f64 {
        self.volts.iter().copied().fold(0.0, f64::max)
    }
}
