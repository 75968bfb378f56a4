//! Readings of the detector at rest, and how they drift.

use tactomo_touch_core::Says;

/// Readings of each cell that rest is the mean of: 0.15 s on the ESP32. Their mean's noise is an eighth of a reading's.
const COUNT: u8 = 64;
/// A reading so many standard deviations from the mean of those before it has moved: of 256 that only have noise, one in 10^12 frames does.
const MOVED: f32 = 8.0;
/// Readings before one can be told from their mean.
const FEW: u8 = 4;
/// Share by which rest follows what is left where nothing touches: 10 s on the ESP32, as slow as warmth.
const FOLLOW: f32 = 1.0 / 4096.0;

/// Readings at rest: the mean of some that stood still. Until they are known they are taken for nothing, as those of a perfect detector are.
#[derive(Debug)]
pub(super) struct Rest<const READINGS: usize> {
    volts: [f32; READINGS],
    counts: [u8; READINGS],
    is_known: bool,
}

impl<const READINGS: usize> Rest<READINGS> {
    pub const NONE: Self = Self { volts: [0.0; READINGS], counts: [0; READINGS], is_known: false };

    /// Begins anew.
    pub fn restart(&mut self) {
        self.counts.fill(0);
        self.is_known = false;
    }

    /// Whether it is known.
    pub fn is_known(&self) -> bool {
        self.is_known
    }

    /// What a reading is above it (V).
    pub fn above(&self, cell: usize, volts: f32) -> f32 {
        match self.volts.get(cell) {
            Some(rest) if self.is_known => volts - rest,
            _ => volts,
        }
    }

    /// Takes a reading of a cell, while rest is not known; one that has moved begins it anew.
    pub fn add(&mut self, cell: usize, volts: f32, noise_v: f32) {
        let (Some(mean), Some(count)) = (self.volts.get_mut(cell), self.counts.get_mut(cell)) else { return };
        if *count >= FEW && (volts - *mean).abs() > MOVED * noise_v {
            return self.restart();
        }
        if *count < COUNT {
            *count += 1;
            *mean = if *count == 1 { volts } else { *mean + (volts - *mean) / f32::from(*count) };
        }
    }

    /// Whether each cell that is read at all has stood still for as long as it takes.
    pub fn has_stood_still(&self) -> bool {
        self.counts.contains(&COUNT) && self.counts.iter().all(|count| [0, COUNT].contains(count))
    }

    /// What stood still is rest.
    pub fn take(&mut self) {
        let unread = self.volts.iter_mut().zip(&self.counts).filter(|(_, count)| **count == 0);
        unread.for_each(|(volts, _)| *volts = 0.0);
        self.is_known = true;
    }

    /// Follows what is left of readings while nothing touches.
    pub fn follow(&mut self, touch_v: &[f32], says: &[Says]) {
        for (rest, (touch_v, says)) in self.volts.iter_mut().zip(touch_v.iter().zip(says)) {
            if *says == Says::Voltage {
                *rest += FOLLOW * touch_v;
            }
        }
    }

    /// Whether so many readings are below rest that it was none: something pressed when it was taken, and has gone.
    pub fn was_touched(&self, touch_v: &[f32], noise_v: f32, electrodes: usize) -> bool {
        self.is_known && touch_v.iter().filter(|volts| **volts < -MOVED * noise_v).count() >= electrodes
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const NOISE_V: f32 = 1e-3;

    /// Two cells that have had so many readings of 1 V and 2 V; a third is never read.
    fn after(count: usize) -> Rest<3> {
        let mut rest = Rest::NONE;
        for _ in 0..count {
            rest.add(0, 1.0, NOISE_V);
            rest.add(1, 2.0, NOISE_V);
        }
        rest
    }

    #[test]
    fn rest_is_known_after_64_readings_of_each_cell_that_is_read() {
        for count in 0..200 {
            let mut rest = after(count);
            assert_eq!((rest.has_stood_still(), rest.is_known()), (count >= 64, false), "{count}");
            assert_eq!([0, 1, 2].map(|cell| rest.above(cell, 5.0)), [5.0; 3], "a perfect detector's is zero");
            rest.take();
            if count > 0 {
                assert_eq!([0, 1, 2, 3].map(|cell| rest.above(cell, 5.0)), [4.0, 3.0, 5.0, 5.0], "{count}");
            }
        }
        let mut rest = after(64);
        rest.add(2, 3.0, NOISE_V);
        assert!(!rest.has_stood_still(), "one of the cells had one reading");
        rest.add(7, 3.0, NOISE_V);
        rest.restart();
        assert!(!rest.has_stood_still() && !rest.is_known());
    }

    /// Of eight deviations, from the fifth reading on.
    #[test]
    fn a_reading_that_has_moved_begins_rest_anew() {
        for (count, moved_v, begins) in
            [(3, 1.0, false), (4, 7.9e-3, false), (4, 8.1e-3, true), (63, -8.1e-3, true), (100, -7.9e-3, false)]
        {
            let mut rest = after(count);
            rest.add(0, 1.0 + moved_v, NOISE_V);
            for _ in 0..64 {
                rest.add(1, 2.0, NOISE_V);
            }
            // Cell 0 is as good as unread after it began anew.
            assert_eq!(rest.has_stood_still(), begins || count >= 63, "{count} readings, then {moved_v} V");
        }
    }

    #[test]
    fn rest_was_none_where_as_many_readings_as_electrodes_are_far_below_it() {
        for electrodes in 1..=3 {
            for below in 0..=3 {
                let touch_v: [f32; 3] = core::array::from_fn(|cell| if cell < below { -8.1e-3 } else { -7.9e-3 });
                let mut rest = after(64);
                assert!(!rest.was_touched(&touch_v, NOISE_V, electrodes), "it is not known");
                rest.take();
                assert_eq!(rest.was_touched(&touch_v, NOISE_V, electrodes), below >= electrodes);
            }
        }
    }

    proptest! {
        #[test]
        fn rest_is_the_mean_of_readings_and_follows_voltages_alone(
            noise in prop::collection::vec(-1.0..1.0f32, 64),
            left_v in -0.1..0.1f32,
        ) {
            let mut rest = Rest::<2>::NONE;
            noise.iter().for_each(|noise| rest.add(0, 1.0 + NOISE_V * noise, NOISE_V));
            noise.iter().for_each(|noise| rest.add(1, 1.0 + NOISE_V * noise, NOISE_V));
            prop_assert!(rest.has_stood_still());
            rest.add(0, 1.0 + 5.0 * NOISE_V, NOISE_V);
            rest.take();
            let mean_v = 1.0 + NOISE_V * noise.iter().sum::<f32>() / 64.0;
            prop_assert!((rest.above(0, 2.0) - (2.0 - mean_v)).abs() < 1e-5, "the mean of the first 64");
            let before_v = [0, 1].map(|cell| rest.above(cell, 0.0));
            for says in [Says::Nothing, Says::AtMost, Says::AtLeast] {
                rest.follow(&[left_v; 2], &[Says::Voltage, says]);
            }
            let moved_v = [0, 1].map(|cell| before_v[cell] - rest.above(cell, 0.0));
            prop_assert!((moved_v[0] - 3.0 * left_v / 4096.0).abs() < 1e-6 && moved_v[1] == 0.0, "{:?}", moved_v);
        }
    }
}
