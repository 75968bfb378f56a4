//! Where fits of lines and rings start: from contacts that stand for them.

use nalgebra::{Matrix2, Matrix3, SymmetricEigen, Vector2, Vector3};
use tactomo_physics::geometry::{self, Point};

use super::strip::{Course, Strip};
use crate::solve::answer::FoundContact;

/// A circle through contacts is one more start if it lies so far from the one of their moments, in radii.
const OTHER: f64 = 0.15;

/// Contacts as weights.
struct Cloud {
    /// Places (m) and weights, which add up to one.
    points: Vec<(Point, f64)>,
    centre_m: Point,
    /// Mean squares along two directions, the larger first (m2), and the first direction.
    squares_m2: [f64; 2],
    along: Point,
    conductance_s: f64,
}

impl Cloud {
    /// A contact weighs what it conducts with its spreading resistance. Its own conductance, where it is firm, the readings hardly tell: it would
    /// outweigh all others, and a fit that starts at twice the conductance is led astray.
    fn of(contacts: &[FoundContact], usual_radius_m: f64) -> Option<Self> {
        let weight = |contact: &FoundContact| contact.apparent_conductance_s.unwrap_or(contact.conductance_s).max(0.0);
        let conductance_s: f64 = contacts.iter().map(weight).sum();
        if !(conductance_s > 0.0 && conductance_s.is_finite()) {
            return None;
        }
        let point = |contact: &FoundContact| ([contact.x_m, contact.y_m], weight(contact) / conductance_s);
        let points: Vec<_> = contacts.iter().map(point).collect();
        let centre_m = [0, 1].map(|axis| points.iter().map(|(at, weight)| weight * at[axis]).sum());
        let mut moments = Matrix2::zeros();
        for ((at, weight), contact) in points.iter().zip(contacts) {
            let away = Vector2::from(*at) - Vector2::from(centre_m);
            let radius_m = contact.radius_m.unwrap_or(usual_radius_m);
            // A disc spreads by the square of half its radius in each direction.
            moments += *weight * (away * away.transpose() + Matrix2::identity() * (0.25 * radius_m * radius_m));
        }
        let eigen = SymmetricEigen::new(moments);
        let first = if eigen.eigenvalues[0] >= eigen.eigenvalues[1] { 0 } else { 1 };
        let squares_m2 = [first, 1 - first].map(|i| eigen.eigenvalues[i].max(0.0));
        let along = [eigen.eigenvectors[(0, first)], eigen.eigenvectors[(1, first)]];
        Some(Self { points, centre_m, squares_m2, along, conductance_s })
    }

    /// The line of the same mean squares: of a length `l`, `l^2 / 12`.
    fn line(&self) -> Course {
        let half_m = (3.0 * self.squares_m2[0]).sqrt();
        Course::Line([-half_m, half_m].map(|by_m| [0, 1].map(|axis| self.centre_m[axis] + by_m * self.along[axis])))
    }

    /// The circle of the same mean square.
    fn ring(&self) -> Course {
        Course::Ring { centre_m: self.centre_m, radius_m: (self.squares_m2[0] + self.squares_m2[1]).sqrt() }
    }

    /// The circle nearest to all places (Kasa, "A circle fitting procedure and its error analysis", 1976): of an arc, of which the
    /// rest is beyond an edge, too. `None` if they lie on a line.
    fn circle(&self) -> Option<Course> {
        let (mut matrix, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for ([x, y], weight) in &self.points {
            let row = Vector3::new(*x, *y, 1.0);
            matrix += *weight * row * row.transpose();
            right += *weight * (x * x + y * y) * row;
        }
        let solved = matrix.try_inverse()? * right;
        let centre_m = [0.5 * solved[0], 0.5 * solved[1]];
        let radius_m = (solved[2] + centre_m[0].powi(2) + centre_m[1].powi(2)).sqrt();
        let is_finite = radius_m.is_finite() && centre_m.iter().all(|at_m| at_m.is_finite());
        is_finite.then_some(Course::Ring { centre_m, radius_m })
    }
}

/// Strips of a usual width that contacts may stand for: one of them for a ring, more for a line too. Two contacts whose widths readings do not
/// tell are no ring.
pub(super) fn starts(contacts: &[FoundContact], usual_width_m: f64) -> Vec<Strip> {
    let Some(cloud) = Cloud::of(contacts, 0.5 * usual_width_m) else { return Vec::new() };
    let may_be_ring = contacts.len() != 2 || contacts.iter().any(|contact| contact.radius_m.is_some());
    let line = (contacts.len() > 1).then(|| cloud.line());
    let mut courses: Vec<_> = line.into_iter().chain(may_be_ring.then(|| cloud.ring())).collect();
    if contacts.len() > 2
        && let Some(circle) = cloud.circle()
        && are_apart(&cloud.ring(), &circle)
    {
        courses.push(circle);
    }
    let strip = |course| Strip { course, width_m: usual_width_m, conductance_s: cloud.conductance_s };
    courses.into_iter().map(strip).collect()
}

fn are_apart(one: &Course, other: &Course) -> bool {
    match (one, other) {
        (Course::Ring { centre_m: a, radius_m: ra }, Course::Ring { centre_m: b, radius_m: rb }) => {
            geometry::distance(*a, *b) + (ra - rb).abs() > OTHER * ra
        }
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn contacts_on_a_line_give_it_back() {
        let [from, to] = [[-0.012, 0.003], [0.015, -0.008]];
        let at = |i: u32| [0, 1].map(|axis| from[axis] + (f64::from(i) + 0.5) / 20.0 * (to[axis] - from[axis]));
        let contacts: Vec<_> = (0..20).map(at).map(|[x, y]| FoundContact::flat(x, y, 1e-4)).collect();
        let starts = starts(&contacts, 0.001);
        let Course::Line(mut ends) = starts[0].course else { panic!("{starts:?}") };
        ends.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
        assert!(geometry::distance(ends[0], from) < 1e-4 && geometry::distance(ends[1], to) < 1e-4, "{ends:?}");
        assert!((starts[0].conductance_s - 2e-3).abs() < 1e-12);
    }

    #[test]
    fn contacts_on_a_circle_or_an_arc_of_it_give_it_back() {
        let (centre, radius_m) = ([0.01, -0.004], 0.012);
        let on = |turn: f64| [centre[0] + radius_m * (TAU * turn).cos(), centre[1] + radius_m * (TAU * turn).sin()];
        for (share, which) in [(1.0, 1), (0.4, 2)] {
            let places = (0..10).map(|i| on(share * f64::from(i) / 10.0));
            let contacts: Vec<_> = places.map(|[x, y]| FoundContact::flat(x, y, 1e-4)).collect();
            let starts = starts(&contacts, 0.001);
            assert_eq!(starts.len(), which + 1);
            let Course::Ring { centre_m, radius_m: found_m } = starts[which].course else { panic!("{starts:?}") };
            assert!(geometry::distance(centre_m, centre) < 1e-4 && (found_m - radius_m).abs() < 1e-4, "{starts:?}");
        }
    }

    #[test]
    fn discs_in_a_row_along_a_shape_give_it_back() {
        let courses = [
            Course::Line([[-0.012, 0.003], [0.015, -0.008]]),
            Course::Ring { centre_m: [0.01, -0.004], radius_m: 0.012 },
        ];
        for (which, course) in courses.into_iter().enumerate() {
            let discs = Strip { course, width_m: 0.002, conductance_s: 3e-3 }.discs(20);
            assert!((discs.iter().map(|disc| disc.conductance_s).sum::<f64>() - 3e-3).abs() < 1e-12);
            let contacts: Vec<_> =
                discs.iter().map(|disc| FoundContact::flat(disc.x_m, disc.y_m, disc.conductance_s)).collect();
            let found = starts(&contacts, 0.002)[which].course;
            assert!((found.length_m() / course.length_m() - 1.0).abs() < 0.01, "{found:?}");
        }
    }

    #[test]
    fn nothing_starts_from_nothing_and_a_perfect_contact_does_not_outweigh_the_rest() {
        assert!(starts(&[], 0.003).is_empty());
        let contact = |x_m: f64, conductance_s: f64| FoundContact {
            apparent_conductance_s: Some(4e-4),
            ..FoundContact::flat(x_m, 0.0, conductance_s)
        };
        let starts = starts(&[contact(-0.01, 1e-3), contact(0.01, 0.3)], 0.003);
        let Course::Line([a, b]) = starts[0].course else { panic!("{starts:?}") };
        assert!((a[0] + b[0]).abs() < 1e-9, "{a:?} {b:?}");
        assert!((starts[0].conductance_s - 8e-4).abs() < 1e-12, "{starts:?}");
    }
}
