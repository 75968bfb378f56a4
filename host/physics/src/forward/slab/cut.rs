//! Discs that are cut by the walls of a rectangle.
//!
//! What is beyond a wall touches nothing, and the rest conducts as well per area as the whole disc would. Densities on the part
//! that is left are those of a whole disc, moved by a map that keeps areas: so they keep their means and their products, and the
//! map is none where nothing is cut. Along x it takes areas left of a place to areas left of its image, along y each chord to
//! the chord there.

/// A disc of radius one about the origin, cut by a rectangle that the origin is in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CutDisc {
    /// Distances of the walls at low and high x, then y, at most 1.
    low: [f64; 2],
    high: [f64; 2],
}

/// Steps that find a place by the area left of it, and the last one's length.
const STEPS: usize = 50;
const SMALL: f64 = 1e-13;

impl CutDisc {
    /// The part of a disc about `centre_m` (from the corner) that is within a rectangle from the corner; `None` if all of it is.
    pub fn new(size_m: [f64; 2], centre_m: [f64; 2], radius_m: f64) -> Option<Self> {
        let low = centre_m.map(|at_m| (at_m / radius_m).clamp(0.0, 1.0));
        let high = [0, 1].map(|axis| ((size_m[axis] - centre_m[axis]) / radius_m).clamp(0.0, 1.0));
        (low != [1.0; 2] || high != [1.0; 2]).then_some(Self { low, high })
    }

    /// Its share of the whole disc's area.
    pub fn share(&self) -> f64 {
        (self.area(self.high[0]) - self.area(-self.low[0])) / std::f64::consts::PI
    }

    /// Where a point of the whole disc goes.
    pub fn map(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let left = (integral(x) - integral(-1.0)) * 2.0 / std::f64::consts::PI;
        let (from, to) = (self.area(-self.low[0]), self.area(self.high[0]));
        let wanted = from + left * (to - from);
        let at_x = self.with_area_left(wanted, x);
        let (half, half_there) = (half_chord(x), half_chord(at_x));
        let along = if half > 0.0 { 0.5 + 0.5 * y / half } else { 0.5 };
        let [bottom, top] = [-half_there.min(self.low[1]), half_there.min(self.high[1])];
        [at_x, bottom + along.clamp(0.0, 1.0) * (top - bottom)]
    }

    /// Newton's method, within bounds that close in.
    fn with_area_left(&self, wanted: f64, first: f64) -> f64 {
        let (mut low, mut high) = (-self.low[0], self.high[0]);
        let mut x = first.clamp(low, high);
        for _ in 0..STEPS {
            let excess = self.area(x) - wanted;
            if excess < 0.0 {
                low = x
            } else {
                high = x
            }
            let half = half_chord(x);
            let next = x - excess / (half.min(self.low[1]) + half.min(self.high[1]));
            let next = if next >= low && next <= high { next } else { 0.5 * (low + high) };
            if (next - x).abs() < SMALL {
                return next;
            }
            x = next;
        }
        x
    }

    /// Area left of `x` that the walls along x leave, whatever those along y cut.
    fn area(&self, x: f64) -> f64 {
        area_below(self.low[1], x) + area_below(self.high[1], x)
    }
}

/// Half the length of the chord at `x`.
fn half_chord(x: f64) -> f64 {
    (1.0 - x * x).max(0.0).sqrt()
}

/// Antiderivative of [`half_chord`].
fn integral(x: f64) -> f64 {
    let x = x.clamp(-1.0, 1.0);
    0.5 * (x * half_chord(x) + x.asin())
}

/// Area from -1 to `x` under the half disc and under a height.
fn area_below(height: f64, x: f64) -> f64 {
    let cut = half_chord(height.min(1.0));
    let round = |x: f64| integral(x) - integral(-1.0);
    let (left, flat) = (x.min(-cut), (x.min(cut) + cut).max(0.0));
    round(left) + height * flat + if x > cut { integral(x) - integral(cut) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_are_those_of_circles_cut() {
        let at_wall = CutDisc::new([0.06, 0.06], [0.0, 0.03], 0.002).unwrap();
        assert!((at_wall.share() - 0.5).abs() < 1e-12);
        let in_corner = CutDisc::new([0.06, 0.06], [0.06, 0.0], 0.002).unwrap();
        assert!((in_corner.share() - 0.25).abs() < 1e-12);
        assert_eq!(CutDisc::new([0.06, 0.06], [0.002, 0.03], 0.002), None);
        let segment = CutDisc::new([0.06, 0.06], [0.03, 0.059], 0.002).unwrap();
        let expected = 1.0 - (0.5f64.acos() - 0.5 * 0.75f64.sqrt()) / std::f64::consts::PI;
        assert!((segment.share() - expected).abs() < 1e-12, "{} {expected}", segment.share());
    }

    #[test]
    fn the_map_keeps_areas_and_is_smooth_at_the_onset() {
        let cut = CutDisc::new([0.06, 0.06], [0.001, 0.0595], 0.002).unwrap();
        // Means over a fine grid of the whole disc, mapped, are means over the part.
        let (mut mapped, mut part) = ([0.0; 3], [0.0; 3]);
        let at = |i: usize| (i as f64 + 0.5) / 200.0 - 1.0;
        for [x, y] in (0..400).flat_map(|i| (0..400).map(move |j| [at(i), at(j)])).filter(|[x, y]| x.hypot(*y) < 1.0) {
            let [u, v] = cut.map([x, y]);
            assert!(u >= -0.5 - 1e-9 && v <= 0.25 + 1e-9 && u.hypot(v) < 1.0 + 1e-9);
            [1.0, u, v * v].into_iter().zip(&mut mapped).for_each(|(value, sum)| *sum += value);
            if x > -0.5 && y < 0.25 {
                [1.0, x, y * y].into_iter().zip(&mut part).for_each(|(value, sum)| *sum += value);
            }
        }
        for moment in [1, 2] {
            assert!((mapped[moment] / mapped[0] - part[moment] / part[0]).abs() < 2e-3, "{mapped:?} {part:?}");
        }
        let hardly = CutDisc::new([0.06, 0.06], [0.002 * (1.0 - 1e-6), 0.03], 0.002).unwrap();
        let [x, y] = hardly.map([0.3, -0.6]);
        assert!((x - 0.3).abs() < 1e-5 && (y + 0.6).abs() < 1e-5 && hardly.share() > 1.0 - 1e-8);
    }
}
