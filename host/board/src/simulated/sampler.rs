//! The converter of the simulated board, on the pads of a simulated detector.

use std::sync::Arc;

use tactomo_firmware::{Row, Sampler, TimedOut};
use tactomo_physics::detector::{Adc, Detector};
use tactomo_physics::simulate::{Noise, Physics, code};
use tactomo_protocol::MAX_ELECTRODES;

use super::circuit::Circuit;
use super::converter::Converter;
use super::model::{Analog, Figures, Wiring};
use super::pads::{Moment, Pads, seconds};
use crate::inputs::Input;

/// Converts what the pads have, as the board's model does.
pub(super) struct SimulatedSampler {
    circuit: Arc<Circuit>,
    pads: Pads,
    conversion_ns: u64,
    noise: Noise,
    front: Front,
    /// Electrodes of each converter, from electrode 0 on.
    runs: Vec<u8>,
}

/// What lies between a pad and its code.
enum Front {
    /// Nothing but the converter of the detector's description.
    Ideal(Adc),
    /// A board's inputs and ADCs.
    Real(RealFront),
}

impl SimulatedSampler {
    /// The detector's converter is for boards without figures of their own. The seed draws the chip's errors and the noise.
    pub(super) fn new(
        circuit: &Arc<Circuit>,
        physics: Box<dyn Physics>,
        figures: &'static Figures,
        detector: &Detector,
        seed: u64,
    ) -> Self {
        let mut noise = Noise::new(seed);
        let front = match &figures.analog {
            Some(analog) => Front::Real(RealFront::new(analog, figures.wiring, pads_ohm(detector), &mut noise)),
            None => Front::Ideal(detector.adc),
        };
        let runs = match &figures.analog {
            Some(analog) => analog.converters.iter().map(|converter| converter.electrodes as u8).collect(),
            None => vec![MAX_ELECTRODES as u8],
        };
        Self {
            circuit: Arc::clone(circuit),
            pads: Pads::new(physics, detector.ground_v, figures.analog.is_some()),
            conversion_ns: figures.conversion_ns,
            noise,
            front,
            runs,
        }
    }
}

impl SimulatedSampler {
    /// The code of a conversion that begins now.
    fn convert(&mut self, electrode: u8) -> u16 {
        match &mut self.front {
            Front::Ideal(adc) => {
                let volts = self.pads.at(moment(&self.circuit), electrode);
                // The board refuses converters of more than 16 bits.
                code(volts, adc, &mut self.noise).min(u32::from(u16::MAX)) as u16
            }
            Front::Real(front) => front.convert(electrode, &self.circuit, &mut self.pads, &mut self.noise),
        }
    }
}

impl Sampler for SimulatedSampler {
    fn sample(&mut self, electrode: u8) -> Result<u16, TimedOut> {
        let code = self.convert(electrode);
        self.circuit.advance(self.conversion_ns);
        Ok(code)
    }

    /// Converters work side by side, each through its own electrodes: a row takes as long as the one that has most.
    fn sample_row<R: Row>(&mut self, row: &mut R) -> Result<(), R::Error> {
        let asked = row.electrodes();
        let mut begin = 0;
        let mut queues: Vec<_> = self
            .runs
            .iter()
            .map(|count| {
                let run = begin..begin + count;
                begin = run.end;
                run.filter(move |electrode| asked >> electrode & 1 == 1)
            })
            .collect();
        loop {
            let slot: Vec<u8> = queues.iter_mut().filter_map(Iterator::next).collect();
            if slot.is_empty() {
                return Ok(());
            }
            slot.iter().try_for_each(|electrode| row.select(*electrode))?;
            let discarded = row.discarded();
            for number in 0..discarded + row.conversions() {
                row.attend();
                for electrode in &slot {
                    let code = self.convert(*electrode);
                    if number >= discarded {
                        row.take(*electrode, Ok(code));
                    }
                }
                self.circuit.advance(self.conversion_ns);
            }
        }
    }
}

/// Resistance of each electrode's pad (ohm).
fn pads_ohm(detector: &Detector) -> Vec<f64> {
    detector.electrodes.iter().map(|electrode| detector.pad_ohm(electrode)).collect()
}

fn moment(circuit: &Circuit) -> Moment {
    Moment {
        ground: circuit.grounded(),
        groundings: circuit.groundings(),
        first_ns: circuit.scene_begins_ns(),
        grounded_ns: circuit.grounded_ns(),
        now_ns: circuit.now_ns(),
    }
}

/// Inputs and ADCs of a board.
struct RealFront {
    converters: Vec<Converter>,
    /// Each with the converter that it is on, and the electrode that it is joined to.
    inputs: Vec<(Input, usize, u8)>,
    /// Resistance of each electrode's pad (ohm).
    pads_ohm: Vec<f64>,
    wiring: Wiring,
    /// Groundings that the inputs know of.
    groundings: u64,
}

impl RealFront {
    fn new(analog: &'static Analog, wiring: Wiring, pads_ohm: Vec<f64>, chip: &mut Noise) -> Self {
        let converters = analog.converters.iter().map(|figures| Converter::drawn(figures, chip)).collect();
        let (strapping, strapping_input) = &analog.strapping;
        let runs = analog.converters.iter().enumerate();
        let on = runs.flat_map(|(index, converter)| std::iter::repeat_n(index, converter.electrodes));
        let inputs = on.zip(&pads_ohm).enumerate().map(|(electrode, (converter, pad_ohm))| {
            let figures = if strapping.contains(&electrode) { strapping_input } else { &analog.input };
            (Input::new(*figures, *pad_ohm), converter, electrode as u8)
        });
        let count = match wiring {
            Wiring::Transparent => pads_ohm.len(),
            Wiring::Latched => 1,
        };
        Self { converters, inputs: inputs.take(count).collect(), pads_ohm, wiring, groundings: 0 }
    }

    /// Samples now, as the conversion begins: what time the firmware and the chip take before that is counted after it, to be on the safe side.
    fn convert(&mut self, electrode: u8, circuit: &Circuit, pads: &mut Pads, noise: &mut Noise) -> u16 {
        let now = moment(circuit);
        self.take_ground(now, pads);
        let index = match self.wiring {
            Wiring::Transparent => usize::from(electrode),
            Wiring::Latched => 0,
        };
        // The firmware asks for no electrode beyond the board's inputs.
        let Some((input, converter, joined)) = self.inputs.get_mut(index) else { return 0 };
        if self.wiring == Wiring::Latched && *joined != circuit.selected() {
            *joined = circuit.selected();
            let selected_ns = circuit.selected_ns();
            let pad_v = pads.at(Moment { now_ns: selected_ns, ..now }, *joined);
            let pad_ohm = self.pads_ohm.get(usize::from(*joined)).copied().unwrap_or(f64::INFINITY);
            input.change_to(seconds(selected_ns), pad_v, pad_ohm);
        }
        input.follow(seconds(now.now_ns), pads.at(now, *joined));
        let converter = &mut self.converters[*converter];
        converter.held_v = input.sample(converter.held_v);
        converter.millivolts(converter.held_v, noise)
    }

    /// All pads jump when another electrode is grounded.
    fn take_ground(&mut self, now: Moment, pads: &mut Pads) {
        if self.groundings == now.groundings {
            return;
        }
        self.groundings = now.groundings;
        let grounded = Moment { now_ns: now.grounded_ns, ..now };
        for (input, _, joined) in &mut self.inputs {
            input.follow(seconds(now.grounded_ns), pads.at(grounded, *joined));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::circuit::{MuxLine, MuxPin};
    use super::super::model::BoardModel;
    use super::*;
    use crate::inputs::InputFigures;
    use tactomo_firmware::Mux;
    use tactomo_firmware::mux::Transparent;
    use tactomo_physics::readings::Readings;
    use tactomo_physics::scene::{Hand, Scene, SceneName};
    use tactomo_physics::simulate::Simulation;

    /// Electrodes on strapping pins of the ESP32.
    const STRAPPING: [u8; 4] = [7, 8, 9, 11];
    const SETTLE_NS: u64 = 20_000;
    /// Ten time constants of the slowest input below.
    const SCANS: u32 = 20;

    struct Fixed(Readings);

    impl Physics for Fixed {
        fn readings_v(&mut self, _time_s: f64) -> Readings {
            self.0.clone()
        }
    }

    /// Five fingers on the default detector.
    fn pressed() -> Readings {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let scene = Scene::new(SceneName::FiveFingers, &detector, Hand::relative(&detector), 1);
        Simulation::new(&detector, scene, &[], 1).unwrap().readings_v(1.0)
    }

    fn esp32() -> (&'static Analog, InputFigures) {
        let analog = BoardModel::Esp32.figures().analog.as_ref().unwrap();
        (analog, analog.strapping.1)
    }

    /// How a scan is made.
    #[derive(Clone, Copy)]
    struct Scanning {
        strapping: InputFigures,
        settle_ns: u64,
        /// Conversions of a reading, of which the last counts.
        conversions: usize,
    }

    /// Largest errors (mV) that settling and kickback make in the last scan: of strapping inputs, and of others.
    fn errors_mv(volts: &Readings, scanning: Scanning) -> [f64; 2] {
        let (esp32, _) = esp32();
        let analog: &'static Analog = Box::leak(Box::new(Analog {
            converters: esp32.converters,
            input: esp32.input,
            strapping: (&[7, 8, 9, 11], scanning.strapping),
        }));
        let circuit = Arc::new(Circuit::default());
        let mut noise = Noise::new(1);
        let mut front = RealFront::new(analog, Wiring::Transparent, pads_ohm(&Detector::default()), &mut noise);
        let mut pads = Pads::new(Box::new(Fixed(volts.clone())), 0.0, true);
        let mut mux = Transparent::new([0, 1, 2, 3].map(|bit| MuxPin::new(&circuit, MuxLine::Address(bit))));
        let mut errors = [0.0; 2];
        for scan in 0..SCANS {
            for ground in 0..16 {
                mux.ground(ground).unwrap();
                circuit.advance(scanning.settle_ns);
                // ADC2's ten inputs, one after the other; ADC1 works beside it on the first six.
                for slot in 0..10 {
                    let pair = [slot, slot + 6];
                    let electrodes = if slot < 6 { &pair[..] } else { &pair[1..] };
                    for _ in 0..scanning.conversions {
                        for electrode in electrodes {
                            front.convert(*electrode, &circuit, &mut pads, &mut noise);
                        }
                        circuit.advance(10_000);
                    }
                    for electrode in electrodes.iter().filter(|_| scan + 1 == SCANS) {
                        let found_v = front.converters[usize::from(*electrode >= 6)].held_v;
                        let error_mv = 1e3 * (found_v - volts.at(ground.into(), (*electrode).into())).abs();
                        let kind = usize::from(!STRAPPING.contains(electrode));
                        errors[kind] = f64::max(errors[kind], error_mv);
                    }
                }
            }
        }
        errors
    }

    /// What `docs/hardware.md` says of strapping pins: readings up to 1.35 V.
    #[test]
    fn strapping_resistors_need_a_capacitor_across_them_and_no_wait_replaces_it() {
        let volts = pressed();
        let (_, wired) = esp32();
        let across = |across_f| InputFigures { across_f, ..wired };
        let bare = Scanning { strapping: across(0.0), settle_ns: SETTLE_NS, conversions: 1 };
        let [strapping_mv, others_mv] = errors_mv(&volts, bare);
        assert!(strapping_mv > 100.0, "{strapping_mv}");
        assert!(others_mv < 1e-6, "{others_mv}");
        let [patient_mv, _] = errors_mv(&volts, Scanning { settle_ns: 200_000, ..bare });
        assert!((patient_mv - strapping_mv).abs() < 1e-3, "the conversions make it, not the settling");
        let repeated = [2, 3, 4].map(|conversions| errors_mv(&volts, Scanning { conversions, ..bare })[0]);
        assert!(repeated[0] < strapping_mv / 5.0 && repeated[1] > 1.0 && repeated[2] < 1.0, "{repeated:?}");
        let capacitors = [1e-9, 10e-9, 47e-9].map(across);
        let bypassed = capacitors.map(|strapping| errors_mv(&volts, Scanning { strapping, ..bare })[0]);
        assert!(bypassed[0] > 10.0 && bypassed[1] > 1.0 && bypassed[2] < 1.0, "{bypassed:?}");
        assert_eq!(wired, across(47e-9), "which is what the model has");
        let to_ground = InputFigures { node_f: 47e-9, ..across(0.0) };
        assert!(errors_mv(&volts, Scanning { strapping: to_ground, ..bare })[0] > 500.0, "not from pin to ground");
    }
}
