//! A slab under a driving layer that is not ideal.
//!
//! In a mode of wave number `k` the layer, of sheet resistance `R`, is a resistance of `r = R / k^2` per area, and so the gap between it and
//! the slab has the response `T = tt + r`. A leak of `c` per area (S/m2) lies across the gap: all that passes it is divided by `1 + c T`. So
//! a driving layer that is not ideal makes another slab:
//!
//! ```text
//! tt' = T / (1 + c T)     tb' = tb / (1 + c T)     bb' = bb - c tb^2 / (1 + c T)
//! ```
//!
//! Contacts obey the potential across the gap; electrodes are read against `Vcc`, to which points of the driving layer are connected. So
//! each electrode's ampere leaves at the first of them. A point is a disc of even density about a corner, of which a quarter is on the layer;
//! its mean of a mode is `2 J1(k a) / (k a)`. Current from one point to another is one density more, across which there is no voltage, and
//! is eliminated with those of the pads.

use std::f64::consts::PI;
use std::ops::{AddAssign, SubAssign};

use nalgebra::{DMatrix, DVector};

use super::layers::{self, Response};
use super::spline::Grid;
use crate::detector::Layer;
use crate::forward::driving::DrivingLayer;
use crate::geometry::Point;

/// `k a` at which modes between connecting points end: what is left out is 1e-5 of a sheet resistance.
const OWN_END: f64 = 30.0;

/// `k a` at which modes from them to the gap end: what is left out is 1e-3 of a sheet resistance, at the rim of a point.
const GAP_END: f64 = 9.4;

/// One mode of the fields across the slab: half waves along both sides.
pub(super) struct Mode {
    pub m: usize,
    pub n: usize,
    /// Of its field on the top, for a mean of one over what the current enters by.
    pub amplitude: f64,
}

/// The layers of a detector and what lies on them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Covered<'a> {
    layers: &'a [Layer],
    driving: DrivingLayer,
    size_m: [f64; 2],
}

impl<'a> Covered<'a> {
    /// Those of a rectangle.
    pub fn new(layers: &'a [Layer], size_m: [f64; 2], driving: DrivingLayer) -> Self {
        Self { layers, driving, size_m }
    }

    /// The layers, bottom first.
    pub fn layers(&self) -> &'a [Layer] {
        self.layers
    }

    /// Sheet conductance of the layers (S).
    pub fn sheet_s(&self) -> f64 {
        self.layers.iter().map(Layer::sheet_conductance_s).sum()
    }

    /// Length and width (m).
    pub fn size_m(&self) -> [f64; 2] {
        self.size_m
    }

    /// Thickness of the layers (m).
    pub fn thickness_m(&self) -> f64 {
        self.layers.iter().map(|layer| layer.thickness_m).sum()
    }

    /// Response to a wave number (1/m) above zero, with that of the gap for the top's.
    pub fn response(&self, k: f64) -> Response {
        let bare = layers::response(self.layers, k);
        let gap = bare.tt + self.sheet_ohm_m2(k);
        let passed = 1.0 / (1.0 + self.leak_s_per_m2() * gap);
        Response {
            tt: gap * passed,
            tb: bare.tb * passed,
            bb: bare.bb - self.leak_s_per_m2() * bare.tb * bare.tb * passed,
        }
    }

    /// What is left of it at zero. With a leak, in the gauge of which the mean across the gap is the constant
    /// (see [`contact`](crate::forward::contact)).
    pub fn floating(&self) -> Response {
        let bare = layers::floating_response(self.layers);
        match self.driving.leak_s > 0.0 {
            true => Response { tt: 0.0, tb: 0.0, bb: bare.bb + bare.tt - 2.0 * bare.tb },
            false => bare,
        }
    }

    /// Sheet conductance of slab and driving layer one after the other (S), which long waves across the gap see.
    pub fn gap_sheet_s(&self) -> f64 {
        1.0 / (1.0 / self.sheet_s() + self.driving.sheet_ohm)
    }

    /// Wave number (1/m) up to which fields of the electrodes are needed on the top, if the driving layer asks for any.
    pub fn finest(&self) -> f64 {
        if self.has_resistance() { GAP_END / self.point_m() } else { 0.0 }
    }

    /// The densities of the pads, with the impedances between them (ohm) and their fields on the top (`modes x densities`), when each ampere
    /// of the `uniform` ones leaves where the driving layer is connected. A density for each further point is added at the end.
    pub fn connect(
        &self,
        [impedances, fields]: [DMatrix<f64>; 2],
        uniform: &[usize],
        grid: &Grid,
        modes: &[Mode],
    ) -> [DMatrix<f64>; 2] {
        if !self.has_resistance() {
            return [impedances, fields];
        }
        let points_m = self.driving.points_m(self.size_m);
        let (count, all) = (impedances.nrows(), impedances.nrows() + points_m.len());
        let mut fields = fields.resize_horizontally(all, 0.0);
        let mut impedances = impedances.resize(all, all, 0.0);
        for (point, at_m) in points_m.iter().enumerate() {
            let at_pads = fields.columns(0, count).tr_mul(&self.at_pads(*at_m, grid, modes));
            impedances.view_mut((0, count + point), (count, 1)).copy_from(&at_pads);
            impedances.view_mut((count + point, 0), (1, count)).tr_copy_from(&at_pads);
            fields.column_mut(count + point).copy_from(&self.at_gap(*at_m, grid, modes));
            for (other, to_m) in points_m.iter().enumerate() {
                impedances[(count + point, count + other)] = self.between_points_ohm(*at_m, *to_m);
            }
        }
        let impedances = left_at(left_at(impedances, uniform, count).transpose(), uniform, count);
        [impedances, left_at(fields, uniform, count)]
    }

    /// Potential of a pad's density for 1 A that leaves the driving layer at a point, in shares of the density's field on the top.
    fn at_pads(&self, at_m: Point, grid: &Grid, modes: &[Mode]) -> DVector<f64> {
        let share = |mode: &Mode| {
            let waves = [grid.wave_number(0, mode.m), grid.wave_number(1, mode.n)];
            -self.leak_s_per_m2() * self.sheet_ohm_m2(waves[0].hypot(waves[1])) * self.mean(at_m, waves)
        };
        DVector::from_iterator(
            modes.len(),
            modes.iter().map(|mode| if mode.m + mode.n > 0 { share(mode) } else { 0.0 }),
        )
    }

    /// Amplitudes across the gap (ohm) for 1 A that leaves at a point.
    fn at_gap(&self, at_m: Point, grid: &Grid, modes: &[Mode]) -> DVector<f64> {
        let amplitude = |mode: &Mode| {
            let waves = [grid.wave_number(0, mode.m), grid.wave_number(1, mode.n)];
            let k = waves[0].hypot(waves[1]);
            let sheet = self.sheet_ohm_m2(k);
            let passed = sheet / (1.0 + self.leak_s_per_m2() * (layers::response(self.layers, k).tt + sheet));
            self.count_per_m2([mode.m, mode.n]) * passed * self.mean(at_m, waves)
        };
        let amplitudes = modes.iter().map(|mode| if mode.m + mode.n > 0 { amplitude(mode) } else { 0.0 });
        DVector::from_iterator(modes.len(), amplitudes)
    }

    /// Potential below `Vcc` of a point for 1 A that leaves at another (ohm), but for the layer's constant.
    fn between_points_ohm(&self, a: Point, b: Point) -> f64 {
        let end = OWN_END / self.point_m();
        let wave = |axis: usize, mode: usize| mode as f64 * PI / self.size_m[axis];
        let most = [0, 1].map(|axis| (end / wave(axis, 1)) as usize);
        let all = (0..=most[0]).flat_map(|m| (0..=most[1]).map(move |n| [m, n])).skip(1);
        all.map(|[m, n]| ([m, n], [wave(0, m), wave(1, n)]))
            .filter(|(_, [kx, ky])| kx.hypot(*ky) < end)
            .map(|(mode, waves)| {
                let k = waves[0].hypot(waves[1]);
                let (leak, tt, sheet) =
                    (self.leak_s_per_m2(), layers::response(self.layers, k).tt, self.sheet_ohm_m2(k));
                let own = sheet * (1.0 + leak * tt) / (1.0 + leak * (tt + sheet));
                self.count_per_m2(mode) * own * self.mean(a, waves) * self.mean(b, waves)
            })
            .sum()
    }

    /// Mean over a connecting point of a mode, given by its wave numbers along both sides (1/m).
    fn mean(&self, [x, y]: Point, [kx, ky]: [f64; 2]) -> f64 {
        let ka = kx.hypot(ky) * self.point_m();
        2.0 * libm::j1(ka) / ka * (kx * x).cos() * (ky * y).cos()
    }

    /// Square of a mode's amplitude over the area (1/m2), where its mean square is one.
    fn count_per_m2(&self, mode: [usize; 2]) -> f64 {
        let count: f64 = mode.iter().map(|waves| if *waves == 0 { 1.0 } else { 2.0 }).product();
        count / (self.size_m[0] * self.size_m[1])
    }

    fn has_resistance(&self) -> bool {
        self.driving.sheet_ohm > 0.0
    }

    /// Conductance of the leak per area (S/m2).
    fn leak_s_per_m2(&self) -> f64 {
        self.driving.leak_s / (self.size_m[0] * self.size_m[1])
    }

    /// The driving layer's resistance to a mode (ohm m2).
    fn sheet_ohm_m2(&self, k: f64) -> f64 {
        self.driving.sheet_ohm / (k * k)
    }

    /// Radius of a connecting point (m).
    fn point_m(&self) -> f64 {
        DrivingLayer::point_radius_m(self.size_m)
    }
}

/// Columns of densities, of which the `uniform` ones leave at the point whose column is `first`, and the points behind it feed that one.
fn left_at(mut columns: DMatrix<f64>, uniform: &[usize], first: usize) -> DMatrix<f64> {
    let point = columns.column(first).into_owned();
    uniform.iter().for_each(|pad| columns.column_mut(*pad).add_assign(&point));
    (first + 1..columns.ncols()).for_each(|other| columns.column_mut(other).sub_assign(&point));
    columns.remove_column(first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::{Detector, Electrode, Outline};
    use crate::forward::contact::conducting_patches;
    use crate::forward::{ConnectingPoints, ForwardModel, Resolution, Slab};
    use crate::scene::Contact;

    fn square() -> Detector {
        Detector::preset(Detector::DEFAULT).unwrap()
    }

    fn bar(length_m: f64, width_m: f64, thickness_m: f64, pads_m: &[f64]) -> Detector {
        Detector {
            outline: Outline::rectangle(length_m, width_m),
            layers: vec![Layer::uniform(thickness_m, 0.25)],
            electrodes: pads_m.iter().map(|x_m| Electrode::flat(*x_m, 0.0, 0.0005)).collect(),
            ..square()
        }
    }

    fn sheet(sheet_ohm: f64, points: ConnectingPoints) -> DrivingLayer {
        DrivingLayer { sheet_ohm, points, ..DrivingLayer::default() }
    }

    fn under(detector: &Detector, driving: DrivingLayer) -> Slab {
        Slab::under(detector, Resolution::FINE, driving).unwrap().on_image(400)
    }

    fn change_ohm(detector: &Detector, driving: DrivingLayer, contacts: &[Contact]) -> DMatrix<f64> {
        let [with, without] = [driving, DrivingLayer::default()].map(|driving| under(detector, driving));
        with.impedance_ohm(contacts).unwrap() - without.impedance_ohm(contacts).unwrap()
    }

    fn assert_near(found: &DMatrix<f64>, expected: &DMatrix<f64>, tolerance: f64) {
        let off = (found - expected).amax() / expected.amax();
        assert!(off < tolerance, "{off}: {} {}", found[(0, 0)], expected[(0, 0)]);
    }

    /// Neumann function of a square sheet of 60 mm and 1 ohm per square between discs of even density about two places from the corner,
    /// by its series.
    fn sheet_ohm(a: (Point, f64), b: (Point, f64)) -> f64 {
        let wave = |mode: i32| f64::from(mode) * PI / 0.06;
        let mean = |([x, y], radius_m): (Point, f64), [kx, ky]: [f64; 2]| {
            let ka = kx.hypot(ky) * radius_m;
            2.0 * libm::j1(ka) / ka * (kx * x).cos() * (ky * y).cos()
        };
        let modes = (1..400 * 400).map(|i| [wave(i / 400), wave(i % 400)]);
        let count = |waves: &[f64; 2]| waves.iter().map(|k| if *k == 0.0 { 1.0 } else { 2.0 }).product::<f64>();
        modes.map(|k| count(&k) * mean(a, k) * mean(b, k) / (0.06 * 0.06 * (k[0] * k[0] + k[1] * k[1]))).sum()
    }

    const CORNER: (Point, f64) = ([0.0; 2], 0.003);
    const OPPOSITE: (Point, f64) = ([0.06; 2], 0.003);

    #[test]
    fn a_layer_without_resistance_is_the_ideal_one_however_connected() {
        let press = [Contact::flat(0.004, -0.011, 0.003, 1e-3)];
        assert_eq!(change_ohm(&square(), sheet(0.0, ConnectingPoints::Two), &press).amax(), 0.0);
        let small = change_ohm(&square(), sheet(1e-4, ConnectingPoints::Two), &press);
        // What the tables' single precision leaves.
        assert!(small.amax() < 5e-3, "{}", small.amax());
    }

    #[test]
    fn along_a_bar_the_layer_is_a_resistor_before_the_contact() {
        let bar = bar(0.12, 0.008, 0.003, &[-0.05, -0.02, 0.03, 0.055]);
        let [near, far] = [-0.03, 0.025].map(|x_m| {
            change_ohm(&bar, sheet(500.0, ConnectingPoints::One), &[Contact::flat(x_m, 0.001, 0.002, 1e-3)])
        });
        for change in [&near, &far] {
            // But for what the layer's slope under the contact makes of the way its current is spread.
            assert!((change.max() - change.min()) < 4e-3 * change.amax(), "one resistor for all: {change}");
        }
        let ohm = far[(2, 2)] - near[(2, 2)];
        assert!((ohm / (500.0 * 0.055 / 0.008) - 1.0).abs() < 1e-3, "{ohm}");
    }

    #[test]
    fn two_contacts_and_the_layer_are_a_network_of_resistors() {
        let contacts = [Contact::flat(-0.022, -0.004, 0.003, 3e-4), Contact::flat(0.017, 0.012, 0.003, 2e-4)];
        let slab = under(&square(), DrivingLayer::default());
        let spots = slab.spots(0.003).unwrap();
        let [a, b] = contacts.map(|at| spots.spot([at.x_m, at.y_m, 0.0]));
        let between_ohm = spots.between_ohm(&a, &b);
        let between = DMatrix::from_row_slice(2, 2, &[a.own_ohm, between_ohm, between_ohm, b.own_ohm]);
        let cross = DMatrix::from_fn(2, 16, |k, e| [&a, &b][k].electrodes_ohm[e]);
        let network = |layer_ohm: DMatrix<f64>| {
            let conductance_s = contacts.map(|at| at.conductance_s);
            let system = conducting_patches(slab.electrode_fields_ohm(), &cross, &between + layer_ohm, &conductance_s);
            system.impedance_ohm().unwrap()
        };
        let discs = contacts.map(|at| ([at.x_m + 0.03, at.y_m + 0.03], at.radius_m));
        let layer_ohm = DMatrix::from_fn(2, 2, |k, l| {
            let to_corner = |disc| sheet_ohm(disc, CORNER);
            let own = sheet_ohm(CORNER, CORNER);
            3000.0 * (sheet_ohm(discs[k], discs[l]) - to_corner(discs[k]) - to_corner(discs[l]) + own)
        });
        let expected = network(layer_ohm) - network(DMatrix::zeros(2, 2));
        let found = change_ohm(&square(), sheet(3000.0, ConnectingPoints::One), &contacts);
        assert_near(&found, &expected, 0.01);
        // What is not the same for all electrodes: how the contacts share their currents.
        let [apart, expected_apart] = [&found, &expected].map(|all| all.add_scalar(-all.mean()));
        assert_near(&apart, &expected_apart, 0.03);
        assert_near(&found, &found.transpose(), 1e-6);
    }

    #[test]
    fn of_two_opposite_points_each_feeds_half_of_a_contact_in_the_middle() {
        let contact = Contact::flat(0.0, 0.0, 0.003, 1e-3);
        let middle = ([0.03; 2], 0.003);
        let [one, two] = [ConnectingPoints::One, ConnectingPoints::Two]
            .map(|points| change_ohm(&square(), sheet(200.0, points), &[contact]));
        let to_corner = sheet_ohm(middle, middle) - 2.0 * sheet_ohm(middle, CORNER);
        let [own, across] = [CORNER, OPPOSITE].map(|point| sheet_ohm(CORNER, point));
        for (found, expected) in [(&one, to_corner + own), (&two, to_corner + 0.5 * (own + across))] {
            let expected = DMatrix::from_element(16, 16, 200.0 * expected);
            assert_near(found, &expected, 0.003);
        }
        assert!(two.amax() < 0.7 * one.amax());
    }

    #[test]
    fn light_contacts_draw_no_current_so_they_read_as_under_an_ideal_layer() {
        let [driven, ideal] =
            [sheet(300.0, ConnectingPoints::Two), DrivingLayer::default()].map(|driving| under(&square(), driving));
        let differences = |slab: &Slab| {
            let fields = slab.fields_ohm();
            DMatrix::from_fn(fields.nrows(), 15, |node, e| fields[(node, e)] - fields[(node, 15)])
        };
        assert!((differences(&driven) - differences(&ideal)).amax() < 1e-3 * differences(&ideal).amax());
    }

    #[test]
    fn an_even_leak_of_a_bar_is_a_leaky_line() {
        let (length_m, width_m, pads_m) = (0.12, 0.006, [-0.05, -0.015, 0.04]);
        let bar = bar(length_m, width_m, 0.0004, &pads_m);
        let sheet_s = bar.sheet_conductance_s();
        let per_m = 3.0 / length_m;
        let leak_s = sheet_s * per_m * per_m * length_m * width_m;
        let z = under(&bar, DrivingLayer { leak_s, ..DrivingLayer::default() }).impedance_ohm(&[]).unwrap();
        let at = |pad: usize| pads_m[pad] + length_m / 2.0;
        for (a, b) in [(0, 1), (0, 2), (1, 2)] {
            let wave = (per_m * at(a)).cosh() * (per_m * (length_m - at(b))).cosh() / (per_m * length_m).sinh();
            let expected = wave / (width_m * sheet_s * per_m);
            assert!((z[(a, b)] / expected - 1.0).abs() < 3e-3, "{a} {b}: {} {expected}", z[(a, b)]);
        }
    }

    #[test]
    fn all_current_of_a_small_leak_passes_it() {
        let detector = square();
        let of = |share: f64| {
            let leak_s = share * detector.sheet_conductance_s();
            let z = under(&detector, DrivingLayer { leak_s, ..DrivingLayer::default() }).impedance_ohm(&[]).unwrap();
            z.add_scalar(-1.0 / leak_s)
        };
        let [a, b] = [1e-6, 1e-4].map(of);
        assert_near(&a, &b, 1e-3);
    }

    #[test]
    fn a_leak_is_an_even_image_of_conductance_under_whatever_layer() {
        let detector = square();
        let leak_s = 0.2 * detector.sheet_conductance_s();
        for driving in
            [DrivingLayer::default(), sheet(400.0, ConnectingPoints::One), sheet(400.0, ConnectingPoints::Two)]
        {
            let (tight, leaky) = (under(&detector, driving), under(&detector, DrivingLayer { leak_s, ..driving }));
            let areas_m2 = &tight.image_mesh().node_areas_m2;
            let even_s: Vec<f64> = areas_m2.iter().map(|area_m2| leak_s * area_m2 / (0.06 * 0.06)).collect();
            let press_s = tight.image_mesh().image_with([(105, 4e-4), (106, 2e-4), (250, 1e-3)]);
            let both_s: Vec<f64> = even_s.iter().zip(&press_s).map(|(even_s, press_s)| even_s + press_s).collect();
            assert_near(&leaky.impedance_ohm(&[]).unwrap(), &tight.image_impedance_ohm(&even_s).unwrap(), 1e-3);
            let expected = tight.image_fields(&both_s).unwrap();
            let found = leaky.image_fields(&press_s).unwrap();
            assert_near(&found.impedance_ohm, &expected.impedance_ohm, 1e-3);
            assert_near(&found.nodes_ohm, &expected.nodes_ohm, 2e-3);
        }
    }
}
