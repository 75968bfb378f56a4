//! From the ideal foam to the measured one, a cause at a time: what each explains of SENS, FMAX, SR and PA.

use tactomo_physics::detector::{Adc, Detector};
use tactomo_physics::forward::{Auto, ForwardError, ForwardModel, readings_v};
use tactomo_physics::geometry::Point;
use tactomo_physics::hertz::{Skin, Surface};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::{Noise, drawn, measured as through_converter};
use tactomo_touch::solve::Lambda;

use super::super::imaging::Images;
use super::super::limit::of_drive;
use super::super::press::{MIDDLE, STEPS, force_n, nine_places};
use super::super::rank::mean;
use super::super::samples::{COMPARED_N, Measured, stacked};
use super::super::{DesignError, PaperSolver, Press};
use super::Eighth;
use super::bench::Curve;

/// The floor of an ESP32's first converter (V): below, it tells nothing.
const FLOOR_V: f64 = 0.142;
/// Noise of its readings (V).
const NOISE_V: f64 = 5e-3;

/// In series with every contact (ohm), as a bound: the paper's rubber of EC-20BH was attached to the contactor, and a millimetre of carbon-loaded
/// silicone has a few ohm through 5 mm (some 0.05 ohm m). The paper does not give its resistance.
const RUBBER_OHM: f64 = 100.0;
/// How much more contacts conduct at most while force is taken off, as a bound: the paper shows both states of its foams, but gives no number.
const UNLOADING: f64 = 0.5;
/// The paper's lambda^2 of 5000 has no unit: a hundred times less and more.
const LAMBDAS: [Lambda; 2] = [Lambda::Paper(50.0), Lambda::Paper(500_000.0)];

/// What is taken into account.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setup {
    /// In a few words.
    pub name: &'static str,
    is_ideal: bool,
    eighth: Eighth,
    /// Whether the output is the paper's image at its centroid; else it is the potential at the contact, eq. (4).
    has_image: bool,
    has_floor: bool,
    has_noise: bool,
    /// In series with every contact (ohm).
    rubber_ohm: f64,
    /// The curve is fitted to loading and unloading, where contacts conduct more by this share; `None` to loading alone.
    unloading: Option<f64>,
    /// Of the image.
    pub lambda: Lambda,
    /// How many detectors are drawn as built; figures are their means. None is as described.
    drawn: u64,
}

const LAW: Setup = Setup {
    name: "+ the film's law, flat indenter",
    is_ideal: false,
    eighth: Eighth::Derived,
    has_image: false,
    has_floor: false,
    has_noise: false,
    rubber_ohm: 0.0,
    unloading: None,
    lambda: Lambda::PAPER,
    drawn: 0,
};
const PRINTED: Setup = Setup { name: "+ eq. (8) as printed", eighth: Eighth::Printed, ..LAW };
const IMAGE: Setup = Setup { name: "... and the image's value, not the potential", has_image: true, ..PRINTED };

/// From the ideal foam on: the first three add up; each further one adds to those three, and those with an image to the image too.
pub const SETUPS: [Setup; 11] = [
    Setup { name: "ideal foam", is_ideal: true, ..LAW },
    LAW,
    PRINTED,
    Setup { name: "... and as built, mean of five", drawn: 5, ..PRINTED },
    Setup { name: "... and rubber of 100 ohm on the contactor", rubber_ohm: RUBBER_OHM, ..PRINTED },
    Setup { name: "... and unloading too, with half as much again", unloading: Some(UNLOADING), ..PRINTED },
    IMAGE,
    Setup { name: "... image, and noise of 5 mV", has_noise: true, ..IMAGE },
    Setup { name: "... image, and readings less 142 mV", has_floor: true, ..IMAGE },
    Setup { name: "... image, and lambda^2 of 50", lambda: LAMBDAS[0], ..IMAGE },
    Setup { name: "... image, and lambda^2 of 500 000", lambda: LAMBDAS[1], ..IMAGE },
];

/// A sample's figures; `None` where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Figures {
    /// SENS, in a unit that is the same for all samples.
    pub sensitivity: Option<f64>,
    /// FMAX (N).
    pub maximum_n: Option<f64>,
    /// SR, of an image that has not collapsed.
    pub spatial_resolution: Option<f64>,
    /// PA, likewise.
    pub position_accuracy: Option<f64>,
}

/// The figures of a sample with what a setup takes into account.
pub fn figures(measured: Measured, setup: &Setup, solver: &PaperSolver, seed: u64) -> Result<Figures, DesignError> {
    let (stack, described) = stacked(measured.name)?;
    let detectors: Vec<Detector> = match setup.drawn {
        0 => vec![described.taken_as_exact()],
        count => (0..count).map(|other| drawn(&described, seed + other)).collect(),
    };
    let skin = Skin::from(&stack);
    let skin = if setup.is_ideal { skin.with(Surface::IDEAL) } else { skin };
    let all: Vec<Figures> =
        detectors.iter().map(|detector| of(detector, skin, setup, solver, seed)).collect::<Result<_, _>>()?;
    let of = |figure: fn(&Figures) -> Option<f64>| mean(&all.iter().filter_map(figure).collect::<Vec<_>>());
    Ok(Figures {
        sensitivity: of(|one| one.sensitivity),
        maximum_n: of(|one| one.maximum_n),
        spatial_resolution: of(|one| one.spatial_resolution),
        position_accuracy: of(|one| one.position_accuracy),
    })
}

impl Setup {
    /// A contact with the rubber in series.
    fn through_rubber(&self, contact: Contact) -> Contact {
        Contact { conductance_s: contact.conductance_s / (1.0 + contact.conductance_s * self.rubber_ohm), ..contact }
    }

    /// Contacts of growing forces, and of the same forces while they are taken off: what conducts more then stays as it is until that is what the
    /// force has, a play operator (`host/physics/src/simulate/foam.rs`).
    fn states(&self, loading: impl Iterator<Item = (f64, Contact)>) -> Vec<(f64, Contact)> {
        let mut states: Vec<(f64, Contact)> = loading.collect();
        let Some(share) = self.unloading else { return states };
        let mut conductance_s = states.last().map_or(0.0, |(_, contact)| contact.conductance_s);
        let unloading: Vec<_> = states
            .iter()
            .rev()
            .map(|(force_n, contact)| {
                conductance_s = conductance_s.min((1.0 + share) * contact.conductance_s);
                (*force_n, Contact { conductance_s, ..*contact })
            })
            .collect();
        states.extend(unloading);
        states
    }
}

fn of(detector: &Detector, skin: Skin, setup: &Setup, solver: &PaperSolver, seed: u64) -> Result<Figures, DesignError> {
    let model = Auto::new(detector, None)?.model;
    let press = Press::indenter(detector, skin)?;
    let press = |place: Point, force_n: f64| setup.through_rubber(press.at(place, force_n));
    let mut bench = Reader { model: &*model, setup, noise: Noise::new(seed) };
    let mut points = Vec::new();
    for (force_n, contact) in setup.states((1..=STEPS).map(|step| (force_n(step), press(MIDDLE, force_n(step))))) {
        let output = match setup.has_image {
            false => Some(of_drive(&*model, &contact)?),
            true => solver.imaged(&bench.read(&contact)?, &contact).map(|imaged| imaged.output),
        };
        points.extend(output.map(|output| [force_n, output]));
    }
    let curve = Curve::of(&points, setup.eighth);
    let mut images = Images::new(solver);
    for place in nine_places(detector) {
        let contact = press(place, COMPARED_N);
        images.add(&bench.read(&contact)?, &contact);
    }
    let imaging = images.figures();
    Ok(Figures {
        sensitivity: curve.map(|curve| curve.sensitivity),
        maximum_n: curve.map(|curve| curve.maximum_n),
        spatial_resolution: imaging.sharpness(),
        position_accuracy: imaging.accuracy(),
    })
}

/// Reads a sample as a setup does.
struct Reader<'a> {
    model: &'a dyn ForwardModel,
    setup: &'a Setup,
    noise: Noise,
}

impl Reader<'_> {
    fn read(&mut self, contact: &Contact) -> Result<Readings, ForwardError> {
        let detector = self.model.detector();
        let mut readings = readings_v(&self.model.impedance_ohm(std::slice::from_ref(contact))?, detector);
        if self.setup.has_noise {
            let adc = Adc { noise_lsb: NOISE_V / detector.adc.lsb_v(), ..detector.adc };
            readings = through_converter(&readings, &adc, &mut self.noise);
        }
        if self.setup.has_floor {
            readings.volts_mut().iter_mut().for_each(|volt| *volt = (*volt - FLOOR_V).max(0.0));
        }
        Ok(readings)
    }
}
