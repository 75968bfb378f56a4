//! The converter of the simulated board, on the pads of a simulated detector.

use std::sync::Arc;

use tactomo_firmware::{Sampler, TimedOut};
use tactomo_physics::detector::Adc;
use tactomo_physics::simulate::{Noise, Physics, code};

use super::circuit::Circuit;
use super::converter::Converter;
use super::input::Input;
use super::model::{Analog, Figures, Wiring};
use super::pads::{Moment, Pads, seconds};

/// Converts what the pads have, as the board's model does.
pub(super) struct SimulatedSampler {
    circuit: Arc<Circuit>,
    pads: Pads,
    conversion_ns: u64,
    noise: Noise,
    front: Front,
}

/// What lies between a pad and its code.
enum Front {
    /// Nothing but the converter of the detector's description.
    Ideal(Adc),
    /// A board's inputs and ADCs.
    Real(RealFront),
}

impl SimulatedSampler {
    /// `adc` is for boards without figures of their own. The seed draws the chip's errors and the noise.
    pub(super) fn new(
        circuit: &Arc<Circuit>,
        physics: Box<dyn Physics>,
        figures: &'static Figures,
        adc: Adc,
        seed: u64,
    ) -> Self {
        let mut noise = Noise::new(seed);
        let front = match &figures.analog {
            Some(analog) => Front::Real(RealFront::new(analog, figures.wiring, &mut noise)),
            None => Front::Ideal(adc),
        };
        Self {
            circuit: Arc::clone(circuit),
            pads: Pads::new(physics, figures.analog.is_some()),
            conversion_ns: figures.conversion_ns,
            noise,
            front,
        }
    }
}

impl Sampler for SimulatedSampler {
    fn sample(&mut self, electrode: u8) -> Result<u16, TimedOut> {
        let code = match &mut self.front {
            Front::Ideal(adc) => {
                let volts = self.pads.at(moment(&self.circuit), electrode);
                // The board refuses converters of more than 16 bits.
                code(volts, adc, &mut self.noise).min(u32::from(u16::MAX)) as u16
            }
            Front::Real(front) => front.convert(electrode, &self.circuit, &mut self.pads, &mut self.noise),
        };
        self.circuit.advance(self.conversion_ns);
        Ok(code)
    }
}

fn moment(circuit: &Circuit) -> Moment {
    Moment {
        ground: circuit.grounded(),
        groundings: circuit.groundings(),
        grounded_ns: circuit.grounded_ns(),
        now_ns: circuit.now_ns(),
    }
}

/// Inputs and ADCs of a board.
struct RealFront {
    converters: Vec<Converter>,
    /// Each with the converter that it is on, and the electrode that it is joined to.
    inputs: Vec<(Input, usize, u8)>,
    wiring: Wiring,
    /// Groundings that the inputs know of.
    groundings: u64,
}

impl RealFront {
    fn new(analog: &'static Analog, wiring: Wiring, chip: &mut Noise) -> Self {
        let converters = analog.converters.iter().map(|figures| Converter::drawn(figures, chip)).collect();
        let (strapping, strapping_input) = &analog.strapping;
        let runs = analog.converters.iter().enumerate();
        let on = runs.flat_map(|(index, converter)| std::iter::repeat_n(index, converter.electrodes));
        let inputs = on.enumerate().map(|(electrode, converter)| {
            let figures = if strapping.contains(&electrode) { strapping_input } else { &analog.input };
            (Input::new(*figures), converter, electrode as u8)
        });
        let count = match wiring {
            Wiring::Transparent => usize::MAX,
            Wiring::Latched => 1,
        };
        Self { converters, inputs: inputs.take(count).collect(), wiring, groundings: 0 }
    }

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
            input.follow(seconds(selected_ns), pads.at(Moment { now_ns: selected_ns, ..now }, *joined));
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
