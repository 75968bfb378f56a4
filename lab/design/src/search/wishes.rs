//! What a person wants of a detector.

use tactomo_physics::detector::short;

use super::Board;

/// What is wanted; all of it at once.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Wishes {
    /// Width and height (m).
    pub size_m: [f64; 2],
    /// Smallest force that has to be seen (N).
    pub smallest_n: f64,
    /// Largest force that must not saturate it (N).
    pub largest_n: f64,
    /// Standard error of a place (m), of a press in the middle of the range of force, anywhere on the surface.
    pub place_m: f64,
    /// Two such presses of this distance (m) have to be told apart.
    pub two_points_m: f64,
    /// Frames a second.
    pub frames_per_s: f64,
    /// Electrodes at most: channels of the board.
    pub electrodes: usize,
    /// Radius of what presses (m).
    pub tip_m: f64,
    /// What reads it.
    pub board: Board,
}

/// One of the wishes that can be met more or less.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Wish {
    /// See small forces.
    Smallest,
    /// Stand large ones.
    Largest,
    /// Tell places.
    Place,
    /// Tell two points.
    TwoPoints,
    /// Be fast.
    Frames,
}

/// Wishes that exclude each other or make no sense.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{field} {what}")]
pub struct WrongWish {
    /// The option.
    pub field: &'static str,
    /// What is wrong with it, and what is allowed.
    pub what: String,
}

impl Wish {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Smallest, Self::Largest, Self::Place, Self::TwoPoints, Self::Frames];

    /// Its name for people.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Smallest => "smallest force",
            Self::Largest => "largest force",
            Self::Place => "place error",
            Self::TwoPoints => "two points",
            Self::Frames => "frames a second",
        }
    }

    /// Whether less is better.
    pub const fn is_less_better(self) -> bool {
        matches!(self, Self::Smallest | Self::Place | Self::TwoPoints)
    }

    /// What is given of it, to three digits, with its unit.
    pub fn text(self, value: f64) -> String {
        match self {
            // Below this it is the mesh between the layers that decides, which nothing here knows.
            Self::Smallest if value < 1e-3 => "under 0.001 N".to_owned(),
            _ => self.with_unit(value, |value| tactomo_study::view::PLAIN.text(Some(value))),
        }
    }

    /// What is wished of it, as people write it, with its unit.
    pub fn wished(self, value: f64) -> String {
        self.with_unit(value, short)
    }

    fn with_unit(self, value: f64, digits: impl Fn(f64) -> String) -> String {
        match self {
            Self::Smallest | Self::Largest => format!("{} N", digits(value)),
            Self::Place | Self::TwoPoints => format!("{} mm", digits(value * 1e3)),
            Self::Frames => format!("{value:.0} frames/s"),
        }
    }
}

impl Wishes {
    /// Force that places and two points are told at (N): as far from the smallest as from the largest.
    pub fn middle_n(&self) -> f64 {
        (self.smallest_n * self.largest_n).sqrt()
    }

    /// What is wanted of one of them.
    pub fn wanted(&self, wish: Wish) -> f64 {
        match wish {
            Wish::Smallest => self.smallest_n,
            Wish::Largest => self.largest_n,
            Wish::Place => self.place_m,
            Wish::TwoPoints => self.two_points_m,
            Wish::Frames => self.frames_per_s,
        }
    }

    /// Checks that they can be wished together.
    ///
    /// # Errors
    /// The first [`WrongWish`].
    pub fn check(&self) -> Result<(), WrongWish> {
        let wrong = |field, what: String| Err(WrongWish { field, what });
        let [width_m, height_m] = self.size_m;
        let above_zero = [
            ("--size", width_m),
            ("--size", height_m),
            ("--smallest", self.smallest_n),
            ("--largest", self.largest_n),
            ("--place", self.place_m),
            ("--two-points", self.two_points_m),
            ("--frames", self.frames_per_s),
            ("--tip", self.tip_m),
        ];
        for (field, value) in above_zero {
            if !(value > 0.0 && value.is_finite()) {
                return wrong(field, format!("is {value}; a number above zero is needed"));
            }
        }
        if self.smallest_n >= self.largest_n {
            return wrong("--smallest", format!("is {} N, not below --largest, {} N", self.smallest_n, self.largest_n));
        }
        let side_m = width_m.min(height_m);
        for (field, value_m) in
            [("--two-points", self.two_points_m), ("--place", self.place_m), ("--tip", 2.0 * self.tip_m)]
        {
            if value_m > side_m {
                return wrong(field, format!("is larger than the detector's shorter side, {:.1} mm", side_m * 1e3));
            }
        }
        let allowed = tactomo_physics::detector::ELECTRODES;
        if !allowed.contains(&self.electrodes) {
            return wrong(
                "--electrodes",
                format!("is {}; {} to {} are possible", self.electrodes, allowed.start(), allowed.end()),
            );
        }
        if self.electrodes > self.board.most_electrodes() {
            return wrong(
                "--electrodes",
                format!(
                    "is {}; the board {} has inputs for {}: give --board ideal, or fewer",
                    self.electrodes,
                    self.board.name,
                    self.board.most_electrodes()
                ),
            );
        }
        let fastest = self.board.frames_per_s(*allowed.start());
        if self.frames_per_s > fastest {
            return wrong(
                "--frames",
                format!(
                    "is {}; with the {} electrodes that a detector needs at least, {fastest:.0} frames a second are possible on the board {}",
                    self.frames_per_s,
                    allowed.start(),
                    self.board.name
                ),
            );
        }
        Ok(())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A board without a floor, of as many frames a second whatever it reads.
    pub fn board() -> Board {
        let adc = tactomo_physics::detector::Adc::default();
        let (converters, inputs) = (Vec::new(), vec![0; 16]);
        Board { name: "even".to_owned(), adc, ground_v: 0.0, converters, inputs, frames_per_s: vec![400.0; 16] }
    }

    pub fn wishes() -> Wishes {
        Wishes {
            size_m: [0.06, 0.06],
            smallest_n: 0.2,
            largest_n: 5.0,
            place_m: 1e-3,
            two_points_m: 8e-3,
            frames_per_s: 100.0,
            electrodes: 16,
            tip_m: 2.5e-3,
            board: board(),
        }
    }

    #[test]
    fn wishes_that_exclude_each_other_say_so() {
        assert_eq!(wishes().check(), Ok(()));
        for (wrong, field, named) in [
            (Wishes { size_m: [0.0, 0.06], ..wishes() }, "--size", "above zero"),
            (Wishes { place_m: -1.0, ..wishes() }, "--place", "above zero"),
            (Wishes { smallest_n: 6.0, ..wishes() }, "--smallest", "not below --largest"),
            (Wishes { two_points_m: 0.07, ..wishes() }, "--two-points", "shorter side"),
            (Wishes { electrodes: 3, ..wishes() }, "--electrodes", "4 to 32"),
            (Wishes { electrodes: 17, ..wishes() }, "--electrodes", "the board even has inputs for 16"),
            (Wishes { frames_per_s: 1e6, ..wishes() }, "--frames", "are possible"),
            (Wishes { largest_n: f64::NAN, ..wishes() }, "--largest", "above zero"),
        ] {
            let error = wrong.check().unwrap_err();
            assert!(error.field == field && error.what.contains(named), "{error}");
        }
    }
}
