//! From the ideal foam to the measured one, a cause at a time: what each explains of SENS, FMAX, SR and PA.

use tactomo_physics::detector::{Adc, Detector};
use tactomo_physics::forward::{Auto, ForwardError, ForwardModel, readings_v};
use tactomo_physics::hertz::{Skin, Surface};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::{Noise, drawn, measured as through_converter};

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
    drawn: 0,
};
const PRINTED: Setup = Setup { name: "+ eq. (8) as printed", eighth: Eighth::Printed, ..LAW };
const IMAGE: Setup = Setup { name: "... and the image's value, not the potential", has_image: true, ..PRINTED };

/// From the ideal foam on: the first three add up; each further one adds to those three, and the last two to the image too.
pub const SETUPS: [Setup; 7] = [
    Setup { name: "ideal foam", is_ideal: true, ..LAW },
    LAW,
    PRINTED,
    Setup { name: "... and as built, mean of five", drawn: 5, ..PRINTED },
    IMAGE,
    Setup { name: "... image, and noise of 5 mV", has_noise: true, ..IMAGE },
    Setup { name: "... image, and readings less 142 mV", has_floor: true, ..IMAGE },
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

fn of(detector: &Detector, skin: Skin, setup: &Setup, solver: &PaperSolver, seed: u64) -> Result<Figures, DesignError> {
    let model = Auto::new(detector, None)?.model;
    let press = Press::indenter(detector, skin)?;
    let mut bench = Reader { model: &*model, setup, noise: Noise::new(seed) };
    let mut points = Vec::new();
    for force_n in (1..=STEPS).map(force_n) {
        let contact = press.at(MIDDLE, force_n);
        let output = match setup.has_image {
            false => Some(of_drive(&*model, &contact)?),
            true => solver.imaged(&bench.read(&contact)?, &contact).map(|imaged| imaged.output),
        };
        points.extend(output.map(|output| [force_n, output]));
    }
    let curve = Curve::of(&points, setup.eighth);
    let mut images = Images::new(solver);
    for place in nine_places(detector) {
        let contact = press.at(place, COMPARED_N);
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
