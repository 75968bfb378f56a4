//! All detectors that can be made of the foams at hand, as a grid of choices with neighbours.

use tactomo_physics::detector::{Detector, Layer, Outline};
use tactomo_physics::hertz::Skin;

use super::super::Layout;
use super::{Material, Wishes};

/// Diameters of electrodes, as shares of the room that each has along the shorter pitch.
const DIAMETERS_OF_PITCH: [f64; 4] = [0.15, 0.25, 0.4, 0.55];
/// Pitches, as shares of side / count.
const SPREADS: [f64; 4] = [0.8, 1.0, 1.1, 1.2];
/// Rings that are tried.
const RINGS: [usize; 4] = [8, 12, 16, 24];
/// Most electrodes along a side.
const ALONG: usize = 8;
/// Rows and columns of a grid have pitches that differ by this factor at most.
const PITCHES: f64 = 3.1;
/// A stack has so many layers at most.
const LAYERS: usize = 2;
/// Voltage of the driving layer (V): all readings are in proportion to it, and the ESP32's converter is calibrated up to 2.45 V at its widest range.
pub(crate) const DRIVE_V: f64 = 2.4;
/// Diameters are rounded to this (m): what can be ordered.
const STEP_M: f64 = 0.1e-3;

/// A choice of everything.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Candidate {
    /// Foam and thickness of each layer, bottom first; by index.
    layers: [Option<[usize; 2]>; LAYERS],
    /// Pattern, pitch and diameter of the electrodes; by index.
    layout: usize,
    spread: usize,
    diameter: usize,
}

/// What there is to choose from.
pub struct Space {
    wishes: Wishes,
    foams: Vec<Material>,
    layouts: Vec<Layout>,
}

impl Space {
    /// All that fits the size and the number of electrodes.
    pub fn new(wishes: &Wishes, foams: &[Material]) -> Self {
        let [width_m, height_m] = wishes.size_m;
        let grids = (1..=ALONG).flat_map(|rows| (1..=ALONG).map(move |columns| [columns, rows]));
        let is_even = |[columns, rows]: &[usize; 2]| {
            let ratio = (width_m / *columns as f64) / (height_m / *rows as f64);
            (1.0 / PITCHES..=PITCHES).contains(&ratio)
        };
        let mut layouts: Vec<Layout> =
            grids.filter(is_even).map(|[columns, rows]| Layout::grid(columns, rows)).collect();
        let staggered = layouts.iter().filter_map(|layout| match *layout {
            Layout::Grid { columns, rows, .. } if columns > 1 && rows > 1 => Some(Layout::Staggered { columns, rows }),
            _ => None,
        });
        let staggered: Vec<_> = staggered.collect();
        layouts.extend(staggered);
        layouts.extend(RINGS.map(|count| Layout::Ring { count }));
        let least = *tactomo_physics::detector::ELECTRODES.start();
        layouts.retain(|layout| (least..=wishes.electrodes).contains(&layout.count()));
        // Neighbours in the list are neighbours in number.
        layouts.sort_by_key(Layout::count);
        Self { wishes: wishes.clone(), foams: foams.to_vec(), layouts }
    }

    /// How many there are, detectors that cannot be built among them.
    pub fn count(&self) -> usize {
        let single: usize = self.foams.iter().map(|foam| foam.thicknesses_m.len()).sum();
        let stacks: usize = (0..self.foams.len())
            .flat_map(|a| (0..self.foams.len()).filter(move |b| *b != a).map(move |b| [a, b]))
            .map(|pair| pair.map(|foam| self.foams[foam].thicknesses_m.len()).iter().product::<usize>())
            .sum();
        (single + stacks) * self.layouts.len() * SPREADS.len() * DIAMETERS_OF_PITCH.len()
    }

    /// Any of them.
    pub fn any(&self, random: &mut fastrand::Rng) -> Candidate {
        let layer = |random: &mut fastrand::Rng| {
            let foam = random.usize(..self.foams.len());
            [foam, random.usize(..self.foams[foam].thicknesses_m.len())]
        };
        let bottom = layer(random);
        let top = if random.bool() { Some(layer(random)).filter(|top| top[0] != bottom[0]) } else { None };
        Candidate {
            layers: [Some(bottom), top],
            layout: random.usize(..self.layouts.len()),
            spread: random.usize(..SPREADS.len()),
            diameter: random.usize(..DIAMETERS_OF_PITCH.len()),
        }
    }

    /// All of them, in order.
    pub fn all(&self) -> Vec<Candidate> {
        let layers: Vec<[usize; 2]> = (0..self.foams.len())
            .flat_map(|foam| (0..self.foams[foam].thicknesses_m.len()).map(move |thickness| [foam, thickness]))
            .collect();
        let tops = |bottom: [usize; 2]| {
            let others = layers.iter().copied().filter(move |top| top[0] != bottom[0]).map(Some);
            std::iter::once(None).chain(others)
        };
        let stacks = layers.iter().flat_map(|bottom| tops(*bottom).map(|top| [Some(*bottom), top]));
        let mut all = Vec::with_capacity(self.count());
        for layers in stacks {
            for layout in 0..self.layouts.len() {
                for spread in 0..SPREADS.len() {
                    for diameter in 0..DIAMETERS_OF_PITCH.len() {
                        all.push(Candidate { layers, layout, spread, diameter });
                    }
                }
            }
        }
        all
    }

    /// Those that differ in one choice, by one step where choices have an order.
    pub fn neighbours(&self, of: &Candidate) -> Vec<Candidate> {
        let mut all = Vec::new();
        let steps = |index: usize, count: usize| {
            [index.checked_sub(1), Some(index + 1).filter(|next| *next < count)].into_iter().flatten()
        };
        all.extend(steps(of.layout, self.layouts.len()).map(|layout| Candidate { layout, ..*of }));
        // Another pattern with about as many electrodes may be some places away in the list.
        let count = self.layouts[of.layout].count();
        let alike =
            (0..self.layouts.len()).filter(|other| *other != of.layout && self.layouts[*other].count() == count);
        all.extend(alike.map(|layout| Candidate { layout, ..*of }));
        all.extend(steps(of.spread, SPREADS.len()).map(|spread| Candidate { spread, ..*of }));
        all.extend(steps(of.diameter, DIAMETERS_OF_PITCH.len()).map(|diameter| Candidate { diameter, ..*of }));
        for (place, layer) in of.layers.iter().enumerate() {
            let with = |layer: Option<[usize; 2]>| {
                let mut layers = of.layers;
                layers[place] = layer;
                Candidate { layers, ..*of }
            };
            if let Some([foam, thickness]) = *layer {
                all.extend(
                    steps(thickness, self.foams[foam].thicknesses_m.len())
                        .map(|thickness| with(Some([foam, thickness]))),
                );
                all.extend(
                    (0..self.foams.len())
                        .filter(|other| *other != foam)
                        .map(|other| with(Some(self.alike(other, foam, thickness)))),
                );
                if place > 0 {
                    all.push(with(None));
                }
            } else if let Some([below, thickness]) = of.layers[0] {
                all.extend(
                    (0..self.foams.len())
                        .filter(|other| *other != below)
                        .map(|other| with(Some(self.alike(other, below, thickness)))),
                );
            }
        }
        // Two layers of one foam are one thicker layer, which is among the single ones.
        all.retain(|candidate| match candidate.layers {
            [Some(bottom), Some(top)] => bottom[0] != top[0],
            _ => true,
        });
        all
    }

    /// Another foam in the thickness next to the one that a foam has.
    fn alike(&self, other: usize, foam: usize, thickness: usize) -> [usize; 2] {
        let wanted_m = self.foams[foam].thicknesses_m[thickness];
        let off = |index: &usize| (self.foams[other].thicknesses_m[*index] / wanted_m).ln().abs();
        let nearest = (0..self.foams[other].thicknesses_m.len()).min_by(|a, b| off(a).total_cmp(&off(b)));
        [other, nearest.unwrap_or(0)]
    }

    /// The detector that a candidate is; `None` if it cannot be built.
    pub fn detector(&self, candidate: &Candidate) -> Option<Detector> {
        let layers: Vec<(f64, &Material)> = candidate
            .layers
            .iter()
            .flatten()
            .map(|[foam, thickness]| (self.foams[*foam].thicknesses_m[*thickness], &self.foams[*foam]))
            .collect();
        let layout = match self.layouts[candidate.layout] {
            Layout::Grid { columns, rows, .. } => Layout::Grid { columns, rows, spread: SPREADS[candidate.spread] },
            // Others have no pitch to choose: they are tried once.
            layout if SPREADS[candidate.spread] == 1.0 => layout,
            _ => return None,
        };
        let room_m = self.room_m(&layout);
        let diameter_m = (DIAMETERS_OF_PITCH[candidate.diameter] * room_m / STEP_M).round() * STEP_M;
        let [width_m, height_m] = self.wishes.size_m;
        let detector = Detector {
            name: self.name(candidate, &layout, diameter_m),
            outline: Outline::rectangle(width_m, height_m),
            layers: layers
                .iter()
                .map(|(thickness_m, foam)| Layer::uniform(*thickness_m, foam.conductivity_s_per_m))
                .collect(),
            electrodes: layout.electrodes(self.wishes.size_m, diameter_m / 2.0),
            drive_v: DRIVE_V - self.wishes.board.ground_v,
            skin: Some(Skin::of_layers(layers.iter().map(|(thickness_m, foam)| (*thickness_m, foam.elasticity_pa)))),
            ..Detector::default()
        };
        detector.check().ok()?;
        Some(self.wishes.board.measuring(detector))
    }

    /// Room that an electrode has along the shorter pitch (m).
    fn room_m(&self, layout: &Layout) -> f64 {
        let [width_m, height_m] = self.wishes.size_m;
        match *layout {
            Layout::Grid { columns, rows, spread } => spread * (width_m / columns as f64).min(height_m / rows as f64),
            Layout::Staggered { columns, rows } => (width_m / columns as f64).min(height_m / rows as f64),
            Layout::Ring { count } => (2.0 * (width_m + height_m) / count as f64).min(width_m.min(height_m) / 2.0),
        }
    }

    /// As one would order it: foams from the top, thickness, electrodes.
    fn name(&self, candidate: &Candidate, layout: &Layout, diameter_m: f64) -> String {
        let layers: Vec<_> = candidate
            .layers
            .iter()
            .flatten()
            .rev()
            .map(|[foam, thickness]| {
                let foam = &self.foams[*foam];
                format!("{} {} mm", foam.name, plain(foam.thicknesses_m[*thickness] * 1e3))
            })
            .collect();
        let diameter_mm = plain(diameter_m * 1e3);
        format!("{}; electrodes of {diameter_mm} mm: {}", layers.join(" on "), layout.name())
    }
}

/// A length or the like that was chosen, without digits that say nothing.
pub(super) fn plain(value: f64) -> String {
    tactomo_physics::detector::short((value * 1e3).round() / 1e3)
}

#[cfg(test)]
mod tests {
    use super::super::wishes::tests::wishes;
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn all_are_different_and_neighbours_are_among_them() {
        let space = Space::new(&Wishes { electrodes: 6, ..wishes() }, &Material::of_paper()[..2]);
        let all = space.all();
        let set: HashSet<_> = all.iter().collect();
        assert_eq!((all.len(), set.len()), (space.count(), all.len()));
        let mut random = fastrand::Rng::with_seed(1);
        for _ in 0..50 {
            let any = space.any(&mut random);
            assert!(set.contains(&any));
            for neighbour in space.neighbours(&any) {
                assert!(set.contains(&neighbour) && neighbour != any);
                assert!(
                    space.neighbours(&neighbour).contains(&any) || neighbour.layers != any.layers,
                    "{any:?} {neighbour:?}"
                );
            }
        }
    }

    #[test]
    fn detectors_are_of_the_size_wanted_and_can_be_ordered() {
        let space = Space::new(&wishes(), &Material::of_paper());
        let detectors: Vec<_> =
            space.all().iter().step_by(997).filter_map(|candidate| space.detector(candidate)).collect();
        assert!(detectors.len() > 20);
        for detector in &detectors {
            assert_eq!(detector.outline.size_m(), [0.06, 0.06]);
            let read = Detector::from_toml(&detector.to_toml(), "");
            assert_eq!(read.map_err(|error| error.to_string()), Ok(detector.clone()));
            assert!(detector.electrodes.len() <= 16 && detector.skin.is_some_and(|skin| skin.young_pa > 1e5));
        }
    }
}
