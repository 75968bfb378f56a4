//! Presses as points: where what describes them is, and how large their readings are. How alike two presses are is a kernel of their distance.

use nalgebra::DMatrix;
use tactomo_physics::algebra::gram_of_rows;

use super::features::Description;

/// Smallest and largest doubt.
const DOUBTS: [f64; 2] = [0.03, 30.0];
/// Sums that run side by side.
const LANES: usize = 8;

/// Sum of products; the shorter slice decides.
#[inline(always)]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    sum(a, b, |a, b| a * b)
}

/// Square of a distance.
#[inline(always)]
pub fn square(a: &[f64], b: &[f64]) -> f64 {
    sum(a, b, |a, b| (a - b) * (a - b))
}

#[inline(always)]
fn sum(a: &[f64], b: &[f64], of: impl Fn(f64, f64) -> f64) -> f64 {
    let length = a.len().min(b.len());
    let (a_lanes, a_rest) = a[..length].as_chunks::<LANES>();
    let (b_lanes, b_rest) = b[..length].as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (a, b) in a_lanes.iter().zip(b_lanes) {
        for lane in 0..LANES {
            sums[lane] += of(a[lane], b[lane]);
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| of(*a, *b)).sum();
    sums.iter().sum::<f64>() + rest
}

/// Points, one for each press.
#[derive(Clone, Debug, PartialEq)]
pub struct Points {
    /// Coordinates of each, those in which presses differ most first.
    pub dimensions: usize,
    /// `points x dimensions`, row by row.
    pub coordinates: Vec<f64>,
    /// Logarithm of the size of the readings (V) of each.
    pub log_sizes: Vec<f64>,
    /// Variance of noise in the coordinates of each over that of a press of median size.
    pub doubts: Vec<f64>,
}

/// How alike presses are: a Gaussian kernel of the distance in the first coordinates and in the size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Likeness {
    /// Coordinates that count; no more than there are.
    pub components: usize,
    /// What a factor e in size counts for.
    pub size_weight: f64,
    /// Distance at which the kernel is `exp(-1/2)`.
    pub width: f64,
}

impl Likeness {
    /// The kernel: of the square of the distance in the coordinates that count, and of the difference in the logarithms of sizes.
    pub fn of(&self, square: f64, log_ratio: f64) -> f64 {
        let sizes = self.size_weight * log_ratio;
        (-0.5 * (square + sizes * sizes) / (self.width * self.width)).exp()
    }
}

impl Points {
    /// Presses with such coordinates, one press after the other, and logarithms of sizes. Noise is the same in all readings, so that it turns the direction
    /// of light presses more than that of firm ones: by its share of their size.
    pub fn new(description: Description, dimensions: usize, coordinates: Vec<f64>, log_sizes: Vec<f64>) -> Self {
        let mut sorted = log_sizes.clone();
        sorted.sort_by(f64::total_cmp);
        let median = sorted.get(sorted.len() / 2).copied().unwrap_or_default();
        let doubt = |log_size: &f64| match description {
            Description::Directions => (2.0 * (median - log_size)).exp().clamp(DOUBTS[0], DOUBTS[1]),
            Description::Channels => 1.0,
        };
        let doubts = log_sizes.iter().map(doubt).collect();
        Self { dimensions, coordinates, log_sizes, doubts }
    }

    /// Number of points.
    pub fn count(&self) -> usize {
        self.log_sizes.len()
    }

    /// Coordinates of a point.
    pub fn at(&self, index: usize) -> &[f64] {
        &self.coordinates[index * self.dimensions..][..self.dimensions]
    }

    /// Coordinates that count of so many.
    pub fn used(&self, components: usize) -> usize {
        components.min(self.dimensions)
    }

    /// The same with no more dimensions than are used.
    pub fn keeping(self, dimensions: usize) -> Self {
        let kept = self.used(dimensions);
        let coordinates = (0..self.count()).flat_map(|index| self.at(index)[..kept].to_vec()).collect();
        Self { dimensions: kept, coordinates, ..self }
    }

    /// Squares of the distances of coordinates to all points, in the first `few` and in the first `many` coordinates.
    pub fn squares_to(&self, direction: &[f64], few: usize, many: usize) -> [Vec<f64>; 2] {
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || self.each_square(direction, few, many),
        )
    }

    #[inline(always)]
    fn each_square(&self, direction: &[f64], few: usize, many: usize) -> [Vec<f64>; 2] {
        let (few, many) = (self.used(few), self.used(many).max(self.used(few)));
        let mut squares = [(); 2].map(|()| Vec::with_capacity(self.count()));
        for known in self.coordinates.chunks_exact(self.dimensions) {
            let of_few = square(&known[..few], &direction[..few]);
            squares[0].push(of_few);
            squares[1].push(of_few + square(&known[few..many], &direction[few..many]));
        }
        squares
    }

    /// Adds the squares of the distances between some points in some coordinates to the lower triangle: they add up over coordinates.
    pub fn add_squares(&self, squares: &mut DMatrix<f64>, points: &[usize], coordinates: std::ops::Range<usize>) {
        let part = DMatrix::from_fn(points.len(), coordinates.len(), |row, column| {
            self.coordinates[points[row] * self.dimensions + coordinates.start + column]
        });
        let products = gram_of_rows(&part);
        let norms = products.diagonal();
        for column in 0..points.len() {
            for row in column..points.len() {
                squares[(row, column)] += norms[row] + norms[column] - 2.0 * products[(row, column)];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_of_distances_add_up_over_coordinates() {
        let coordinates: Vec<f64> = (0..60).map(|i| f64::from(i * i % 17)).collect();
        let points = Points::new(Description::Directions, 20, coordinates, vec![0.0; 3]);
        let [few, many] = points.squares_to(points.at(2), 11, 20);
        let mut squares = DMatrix::zeros(2, 2);
        for coordinates in [0..11, 11..20] {
            points.add_squares(&mut squares, &[0, 2], coordinates);
        }
        assert_eq!((few[2], many[2]), (0.0, 0.0));
        assert!((many[0] - square(points.at(0), points.at(2))).abs() < 1e-12);
        assert!((few[0] - square(&points.at(0)[..11], &points.at(2)[..11])).abs() < 1e-12);
        assert!((squares[(1, 0)] - many[0]).abs() < 1e-9 && squares[(1, 1)].abs() < 1e-9);
    }
}
