//! What can change readings at rest, and how to tell it from a touch.
//!
//! Three things move readings a little: the offset of each channel, alike whatever is grounded; leakage, an even image of conductance; and
//! contacts. Small ones add up, each by a pattern of its own: `V[g][e] += o[e]` of an offset, `Vcc dC (N(e,x) - N(g,x) - N(e,g) + N(g,g))`
//! of a contact at `x`, and the mean of that over the surface of leakage. A grounded electrode reads its offset and hardly anything of a
//! contact, so offsets do not hide contacts; and what leakage does not explain of a change, a contact has to.

use super::mean_fields_ohm;
use crate::forward::jacobian::Jacobian;

/// Places of contacts that are looked at: closer together than electrodes by a factor of three.
const PLACES: usize = 200;
/// Directions that are this much shorter than the longest are noise.
const SHORTEST: f64 = 1e-3;

/// Patterns of small changes of a detector's readings.
#[derive(Clone, Debug)]
pub struct BaselinePatterns {
    electrodes: usize,
    kept: Vec<usize>,
    /// Readings by one sheet conductance of leakage (V).
    leakage_v: Vec<f64>,
    /// What of that offsets do not explain: its direction, and its length (V).
    leakage_along: Vec<f64>,
    leakage_length_v: f64,
    /// Directions of all that contacts do besides.
    contacts_along: Vec<Vec<f64>>,
    places: Vec<Place>,
}

/// A place of contact.
#[derive(Clone, Debug)]
struct Place {
    at_m: [f64; 3],
    /// Direction of its pattern in those of contacts, and length for one sheet conductance (V).
    along: Vec<f64>,
    length_v: f64,
    /// Its part that is like leakage (V for one sheet conductance).
    leakage_v: f64,
}

/// What a small change of readings is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaselineChange {
    /// Conductance of leakage and contact together (sheet conductances), and the length of what it changes besides offsets (V).
    pub total_sheets: f64,
    /// Length of that in the readings (V): of noise its deviation.
    pub total_v: f64,
    /// Leakage beside the contact (sheet conductances).
    pub leakage_sheets: f64,
    /// The contact that explains most of what leakage does not: its conductance (sheet conductances).
    pub contact_sheets: f64,
    /// Length of what it changes that leakage and offsets do not (V): of noise its deviation.
    pub contact_v: f64,
    /// Where it is (m).
    pub place_m: [f64; 3],
    /// What nothing of that explains (V, root of the mean square).
    pub scatter_v: f64,
}

impl BaselinePatterns {
    /// The patterns of a detector, seen through some of its electrodes.
    pub fn new(jacobian: &Jacobian, kept: &[usize]) -> Self {
        let electrodes = jacobian.electrodes();
        let sheet_s = jacobian.detector.sheet_conductance_s();
        let mut all = Self {
            electrodes,
            kept: kept.to_vec(),
            leakage_v: vec![0.0; electrodes * electrodes],
            leakage_along: Vec::new(),
            leakage_length_v: 0.0,
            contacts_along: Vec::new(),
            places: Vec::new(),
        };
        let means_ohm = mean_fields_ohm(jacobian);
        all.leakage_v = all.pattern(|g, e| {
            jacobian.detector.drive_v * sheet_s * (means_ohm[e] - means_ohm[g] + jacobian.total_ohm(g, e))
        });
        let mut besides_offsets = all.leakage_v.clone();
        all.take_off_offsets(&mut besides_offsets);
        (all.leakage_along, all.leakage_length_v) = unit(besides_offsets);
        let nodes = jacobian.fields_ohm.nrows();
        for node in (0..nodes).step_by((nodes / PLACES).max(1)) {
            let mut pattern_v = all.pattern(|g, e| sheet_s * jacobian.volts_per_s(g, e, node));
            all.take_off_offsets(&mut pattern_v);
            let leakage_v = take_off(&mut pattern_v, &all.leakage_along);
            let (along, length_v) = unit(pattern_v);
            all.places.push(Place { at_m: jacobian.image_mesh.place_m(node), along, length_v, leakage_v });
        }
        all.contacts_along = directions(&all.places, electrodes);
        for place in &mut all.places {
            place.along = all.contacts_along.iter().map(|direction| dot(direction, &place.along)).collect();
        }
        all
    }

    /// Electrodes that are looked at.
    pub fn kept(&self) -> &[usize] {
        &self.kept
    }

    /// Readings by one sheet conductance of leakage (V).
    pub fn leakage_v(&self) -> &[f64] {
        &self.leakage_v
    }

    /// What a change of readings (V) is made of.
    ///
    /// # Panics
    /// If there are not as many as electrodes squared.
    pub fn explain(&self, change_v: &[f64]) -> BaselineChange {
        assert_eq!(change_v.len(), self.electrodes * self.electrodes, "readings of another number of electrodes");
        let mut left_v = self.pattern(|g, e| change_v[g * self.electrodes + e]);
        self.take_off_offsets(&mut left_v);
        let total_v = take_off(&mut left_v, &self.leakage_along);
        let along: Vec<f64> = self.contacts_along.iter().map(|direction| take_off(&mut left_v, direction)).collect();
        let scored = self.places.iter().map(|place| (dot(&place.along, &along), place));
        let best = scored.filter(|(length_v, _)| *length_v > 0.0).max_by(|a, b| a.0.total_cmp(&b.0));
        let n = self.kept.len();
        let freedom = (n * n).saturating_sub(n + 1 + self.contacts_along.len()).max(1);
        let total_sheets = total_v / self.leakage_length_v.max(f64::MIN_POSITIVE);
        let nothing = BaselineChange {
            total_sheets,
            total_v,
            leakage_sheets: total_sheets,
            contact_sheets: 0.0,
            contact_v: 0.0,
            place_m: [0.0; 3],
            scatter_v: (dot(&left_v, &left_v) / freedom as f64).sqrt(),
        };
        let Some((contact_v, place)) = best else { return nothing };
        let contact_sheets = contact_v / place.length_v;
        BaselineChange {
            leakage_sheets: (total_v - contact_sheets * place.leakage_v) / self.leakage_length_v,
            contact_sheets,
            contact_v,
            place_m: place.at_m,
            ..nothing
        }
    }

    /// Largest offset of a channel and largest of what remains (V), of readings that are offsets and leakage.
    pub fn largest_v(&self, readings_v: &[f64], leakage_sheets: f64) -> [f64; 2] {
        let at = |g: usize, e: usize| g * self.electrodes + e;
        let mut left_v = self.pattern(|g, e| readings_v[at(g, e)] - leakage_sheets * self.leakage_v[at(g, e)]);
        let offsets_v = self.take_off_offsets(&mut left_v);
        [offsets_v, left_v].map(|volts| volts.iter().map(|volts| volts.abs()).fold(0.0, f64::max))
    }

    /// Values of all pairs of electrodes that are looked at, zero elsewhere.
    fn pattern(&self, value: impl Fn(usize, usize) -> f64) -> Vec<f64> {
        let mut pattern = vec![0.0; self.electrodes * self.electrodes];
        for g in &self.kept {
            for e in &self.kept {
                pattern[g * self.electrodes + e] = value(*g, *e);
            }
        }
        pattern
    }

    /// Takes off each channel's mean, which it gives (V).
    fn take_off_offsets(&self, volts: &mut [f64]) -> Vec<f64> {
        let n = self.electrodes;
        let offset_v = |e: &usize| self.kept.iter().map(|g| volts[g * n + e]).sum::<f64>() / self.kept.len() as f64;
        let offsets_v: Vec<f64> = self.kept.iter().map(offset_v).collect();
        for g in &self.kept {
            self.kept.iter().zip(&offsets_v).for_each(|(e, offset)| volts[g * n + e] -= offset);
        }
        offsets_v
    }
}

/// Orthonormal directions of all patterns: Gram and Schmidt's, the longest remainder first.
fn directions(places: &[Place], electrodes: usize) -> Vec<Vec<f64>> {
    let mut patterns: Vec<Vec<f64>> =
        places.iter().map(|place| place.along.iter().map(|value| value * place.length_v).collect()).collect();
    let mut directions = Vec::new();
    let mut longest_v = 0.0_f64;
    while directions.len() < electrodes {
        let lengths = patterns.iter().map(|pattern| dot(pattern, pattern).sqrt()).enumerate();
        let Some((next, length_v)) = lengths.max_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        longest_v = longest_v.max(length_v);
        if length_v.is_nan() || length_v <= SHORTEST * longest_v {
            break;
        }
        let (direction, _) = unit(patterns[next].clone());
        patterns.iter_mut().for_each(|pattern| {
            take_off(pattern, &direction);
        });
        directions.push(direction);
    }
    directions
}

/// Takes off the part along a direction of length one, which it gives.
fn take_off(volts: &mut [f64], direction: &[f64]) -> f64 {
    let along = dot(volts, direction);
    volts.iter_mut().zip(direction).for_each(|(volts, direction)| *volts -= along * direction);
    along
}

/// Direction and length; of nothing, zeros.
fn unit(mut vector: Vec<f64>) -> (Vec<f64>, f64) {
    let length = dot(&vector, &vector).sqrt();
    let scale = if length > 0.0 { 1.0 / length } else { 0.0 };
    vector.iter_mut().for_each(|value| *value *= scale);
    (vector, length)
}

/// Scalar product, in eight sums for the processor to do at once.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a_lanes, a_rest) = a.as_chunks::<8>();
    let (b_lanes, b_rest) = b.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for (a, b) in a_lanes.iter().zip(b_lanes) {
        (0..8).for_each(|lane| sums[lane] += a[lane] * b[lane]);
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::Detector;
    use crate::forward::{ForwardModel, Slab, readings_v};
    use crate::scene::{Contact, Shape, Touch};
    use crate::simulate::Noise;

    fn slab() -> Slab {
        Slab::new(&Detector::preset(Detector::DEFAULT).unwrap()).unwrap().on_image(900)
    }

    fn patterns(slab: &Slab) -> BaselinePatterns {
        BaselinePatterns::new(&Jacobian::of(slab), &(0..16).collect::<Vec<_>>())
    }

    fn sheet_s(slab: &Slab) -> f64 {
        slab.detector().sheet_conductance_s()
    }

    /// Readings of an even image (V).
    fn even_v(slab: &Slab, sheets: f64) -> Vec<f64> {
        let areas_m2 = &slab.image_mesh().node_areas_m2;
        let density = sheets * sheet_s(slab) / areas_m2.iter().sum::<f64>();
        let image_s: Vec<f64> = areas_m2.iter().map(|area_m2| density * area_m2).collect();
        readings_v(&slab.image_impedance_ohm(&image_s).unwrap(), slab.detector()).volts().to_vec()
    }

    fn contact_v(slab: &Slab, at_m: [f64; 2], sheets: f64) -> Vec<f64> {
        let contact = Contact::flat(at_m[0], at_m[1], 0.0025, sheets * sheet_s(slab));
        readings_v(&slab.impedance_ohm(&[contact]).unwrap(), slab.detector()).volts().to_vec()
    }

    fn sum(parts: &[&[f64]]) -> Vec<f64> {
        (0..parts[0].len()).map(|i| parts.iter().map(|part| part[i]).sum()).collect()
    }

    #[test]
    fn a_light_contact_shows_through_offsets_and_leakage() {
        let slab = slab();
        let patterns = patterns(&slab);
        let mut noise = Noise::new(3);
        let channels: Vec<f64> = (0..16).map(|_| 2e-3 * noise.normal()).collect();
        let offsets: Vec<f64> = (0..256).map(|i| channels[i % 16]).collect();
        let leakage = even_v(&slab, 0.01);
        for at_m in [[0.004, 0.003], [-0.021, 0.018], [0.026, -0.027]] {
            let found = patterns.explain(&sum(&[&offsets, &leakage, &contact_v(&slab, at_m, 0.003)]));
            let off_m = (found.place_m[0] - at_m[0]).hypot(found.place_m[1] - at_m[1]);
            assert!(off_m < 0.006 && (found.contact_sheets / 0.003 - 1.0).abs() < 0.2, "{found:?}");
            assert!((found.leakage_sheets / 0.01 - 1.0).abs() < 0.1 && found.scatter_v < 0.1e-3, "{found:?}");
        }
        let none = patterns.explain(&sum(&[&offsets, &leakage]));
        assert!(none.contact_sheets < 1e-4 && (none.leakage_sheets / 0.01 - 1.0).abs() < 0.02, "{none:?}");
        let [largest_v, left_v] = patterns.largest_v(&sum(&[&offsets, &leakage]), none.leakage_sheets);
        let expected = channels.iter().map(|volts| volts.abs()).fold(0.0, f64::max);
        assert!((largest_v - expected).abs() < 0.2e-3 && left_v < 0.5e-3, "{largest_v} {expected} {left_v}");
    }

    #[test]
    fn noise_is_as_large_as_it_is_in_every_direction() {
        let patterns = patterns(&slab());
        let mut noise = Noise::new(9);
        let (mut total, mut scatter, mut most) = (0.0, 0.0, 0.0_f64);
        for _ in 0..500 {
            let found = patterns.explain(&(0..256).map(|_| noise.normal()).collect::<Vec<_>>());
            (total, scatter) = (total + found.total_v.powi(2) / 500.0, scatter + found.scatter_v / 500.0);
            most = most.max(found.contact_v);
        }
        assert!((total.sqrt() - 1.0).abs() < 0.15 && (scatter - 1.0).abs() < 0.02, "{total} {scatter}");
        assert!(most < 6.0, "{most}: what counts as a contact");
    }

    #[test]
    fn only_what_lies_evenly_about_the_middle_is_like_leakage() {
        let slab = slab();
        let patterns = patterns(&slab);
        let of = |at_m, shape| {
            let image_s = slab.image_mesh().conductances_s(&[Touch::flat(at_m, shape, 0.01 * sheet_s(&slab))]).unwrap();
            let volts = readings_v(&slab.image_impedance_ohm(&image_s).unwrap(), slab.detector());
            let found = patterns.explain(volts.volts());
            found.contact_sheets / found.leakage_sheets.max(1e-9)
        };
        let palm = of([0.0, 0.0], Shape::Disc { radius_m: 0.02 });
        let bar = of([0.0, 0.0], Shape::Line { length_m: 0.05, width_m: 0.003, angle_rad: 0.3 });
        let cup = of([0.008, 0.005], Shape::Ring { radius_m: 0.018, width_m: 0.003 });
        assert!(palm > 0.5 && bar > 0.5 && cup > 0.5, "{palm} {bar} {cup}");
        // The limit: a cup in the very middle.
        assert!(of([0.0, 0.0], Shape::Ring { radius_m: 0.023, width_m: 0.003 }) < 0.3);
    }

    #[test]
    fn electrodes_that_are_left_out_say_nothing() {
        let slab = slab();
        let kept: Vec<usize> = (0..16).filter(|e| *e != 3).collect();
        let patterns = BaselinePatterns::new(&Jacobian::of(&slab), &kept);
        let mut volts = even_v(&slab, 0.01);
        let sound = patterns.explain(&volts);
        volts.iter_mut().enumerate().filter(|(i, _)| i / 16 == 3 || i % 16 == 3).for_each(|(_, volts)| *volts = 0.6);
        assert_eq!((patterns.explain(&volts), patterns.kept().len()), (sound, 15));
        assert!((sound.leakage_sheets / 0.01 - 1.0).abs() < 0.02 && sound.contact_sheets < 1e-4, "{sound:?}");
    }
}
