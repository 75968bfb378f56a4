//! From the impedances of a detector to the voltages at the converter, and to what the converter makes of them.

use nalgebra::DMatrix;

use super::circuit::{Circuit, Wired};
use super::fault::{Fault, FaultError};
use super::measured;
use super::noise::{Noise, Stream};
use crate::detector::Detector;
use crate::forward::readings_v;
use crate::readings::Readings;

/// A wire that nothing is connected to wanders about this share of the drive, by this standard deviation, forgetting where it was
/// within so many frames, and picks up this much in each reading.
const FLOATING_MEAN: f64 = 0.3;
const FLOATING_DEVIATION: f64 = 0.1;
const FLOATING_FRAMES: f64 = 500.0;
const PICKED_UP: f64 = 0.02;

/// A board that measures a detector: its wires, its faults, its converter.
///
/// Where nothing conducts, everything is at the ground's potential. A channel whose wire is broken, when it is
/// grounded, takes no current: everything else is at the drive's potential, and it reads 0 V itself. When it is not, its input
/// floats: it drifts about, and picks up what is around, the same for the same seed. [Converters](Detector::converters) of the detector are taken as what
/// they are: off by that gain and that bow.
///
/// ```
/// use tactomo_physics::detector::Detector;
/// use tactomo_physics::simulate::Measurement;
///
/// let detector = Detector::default();
/// let mut board = Measurement::new(&detector, &["open:3".parse()?], 1)?;
/// // Nothing touches, so all is quiet but for the electrode whose wire is broken, which floats.
/// let readings = board.pad_voltages(None);
/// assert_eq!(readings.at(0, 5), 0.0);
/// assert!(readings.at(0, 3) > 0.0);
/// # Ok::<(), tactomo_physics::simulate::FaultError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Measurement {
    detector: Detector,
    circuit: Circuit,
    /// Whether a channel is connected to nothing, which is the same whatever is pressed.
    open: Vec<bool>,
    /// Where each channel would float, in shares of the drive.
    floating: Vec<f64>,
    drift: Noise,
    conversion: Noise,
}

impl Measurement {
    /// A board with such faults. `seed` chooses drift and noise.
    ///
    /// # Errors
    /// [`FaultError::Electrode`] if a fault names an electrode that is not there.
    pub fn new(detector: &Detector, faults: &[Fault], seed: u64) -> Result<Self, FaultError> {
        let circuit = Circuit::new(detector, faults)?;
        let open = circuit.wire(&DMatrix::identity(detector.electrodes.len(), detector.electrodes.len())).open;
        let mut drift = Noise::of(seed, Stream::Floating);
        let floating =
            detector.electrodes.iter().map(|_| FLOATING_MEAN + FLOATING_DEVIATION * drift.normal()).collect();
        let conversion = Noise::of(seed, Stream::Conversion);
        Ok(Self { detector: detector.clone(), circuit, open, floating, drift, conversion })
    }

    /// Voltages at the converter in the next frame (V), from the impedances between the electrodes (ohm), or `None` where nothing
    /// conducts.
    pub fn pad_voltages(&mut self, impedance_ohm: Option<&DMatrix<f64>>) -> Readings {
        self.drift_on();
        let mut readings = match impedance_ohm {
            Some(impedance_ohm) => self.driven(&self.circuit.wire(impedance_ohm)),
            None => Readings::from_fn(self.floating.len(), |_, _| 0.0),
        };
        let channels = self.floating.len();
        for (index, volts) in readings.volts_mut().iter_mut().enumerate() {
            let (g, e) = (index / channels, index % channels);
            if self.open[e] && g != e {
                *volts = self.detector.drive_v * (self.floating[e] + PICKED_UP * self.drift.normal());
            }
            *volts = self.circuit.amplified_v(e, *volts);
        }
        readings
    }

    /// The next frame as the converter gives it (V), with its noise and in its steps.
    pub fn readings_v(&mut self, impedance_ohm: Option<&DMatrix<f64>>) -> Readings {
        let mut volts = self.pad_voltages(impedance_ohm);
        let Detector { ground_v, converters, electrodes, .. } = &self.detector;
        for (index, volts) in volts.volts_mut().iter_mut().enumerate() {
            let converter = converters.get(electrodes[index % electrodes.len()].converter);
            let off_v = converter.map_or(0.0, |converter| converter.changes_v(*volts).into_iter().sum());
            *volts += off_v + ground_v;
        }
        let ground_v = *ground_v;
        let mut readings = measured(&volts, &self.detector.adc, &mut self.conversion);
        readings.volts_mut().iter_mut().for_each(|volts| *volts -= ground_v);
        readings
    }

    /// What is connected; other channels as if they were at ground.
    fn driven(&self, wired: &Wired) -> Readings {
        let connected = readings_v(&wired.impedance_ohm, &self.detector);
        Readings::from_fn(connected.electrodes(), |g, e| match (wired.open[g], wired.open[e]) {
            (_, true) => 0.0,
            (true, false) => self.detector.drive_v,
            (false, false) => connected.at(g, e),
        })
    }

    /// An autoregressive step.
    fn drift_on(&mut self) {
        let kept = 1.0 - 1.0 / FLOATING_FRAMES;
        let step = FLOATING_DEVIATION * (1.0 - kept * kept).sqrt();
        for share in &mut self.floating {
            *share = FLOATING_MEAN + kept * (*share - FLOATING_MEAN) + step * self.drift.normal();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn detector() -> Detector {
        let mut detector = Detector::preset(Detector::DEFAULT).unwrap();
        detector.electrodes.truncate(3);
        detector
    }

    /// Three electrodes by 100, 200 and 300 ohm on a node that 400 ohm connect to the driving layer.
    fn star() -> DMatrix<f64> {
        DMatrix::from_fn(3, 3, |i, j| 400.0 + if i == j { 100.0 * (i as f64 + 1.0) } else { 0.0 })
    }

    fn volts(faults: &[&str], seed: u64) -> Readings {
        let faults: Vec<Fault> = faults.iter().map(|fault| fault.parse().unwrap()).collect();
        Measurement::new(&detector(), &faults, seed).unwrap().pad_voltages(Some(&star()))
    }

    /// Potential of the star's node while `ohm` lead from it to ground (V): a divider of 2 V.
    fn divided(ohm: f64) -> f64 {
        2.0 * ohm / (ohm + 400.0)
    }

    fn assert_near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }

    #[test]
    fn a_sound_star_divides_the_drive() {
        let readings = volts(&[], 1);
        assert_near(readings.at(1, 0), divided(204.0));
        assert_near(readings.at(1, 1), divided(204.0) * 4.0 / 204.0);
    }

    #[test]
    fn a_broken_wire_grounds_nothing_and_reads_nothing() {
        let readings = volts(&["open:1"], 1);
        assert_eq!([readings.at(1, 0), readings.at(1, 1), readings.at(1, 2)], [2.0, 0.0, 2.0]);
        assert_near(readings.at(0, 2), divided(104.0));
        let floating = [readings.at(0, 1), readings.at(2, 1)];
        assert!(floating.iter().all(|v| (v - 0.6).abs() < 1.0) && floating[0] != floating[1], "{floating:?}");
    }

    #[test]
    fn shorted_wires_ground_and_read_together() {
        let readings = volts(&["short:0,1"], 1);
        // 100 and 200 ohm side by side; the switch's 4 ohm after them.
        assert_near(readings.at(0, 2), divided(200.0 / 3.0 + 4.0));
        assert_near(readings.at(0, 1), readings.at(1, 0));
        assert_near(readings.at(0, 1), readings.at(0, 2) * 4.0 / (200.0 / 3.0 + 4.0));
        assert_near(readings.at(2, 1), divided(304.0));
    }

    #[test]
    fn exchanged_wires_and_wrong_gains_show_where_they_are() {
        let readings = volts(&["swap:0,2", "gain:1:0.8"], 1);
        assert_near(readings.at(0, 2), divided(304.0));
        assert_near(readings.at(2, 1), 0.8 * divided(104.0));
    }

    #[test]
    fn at_rest_all_is_at_ground_but_for_what_floats() {
        let faults = ["open:2".parse().unwrap()];
        let readings = Measurement::new(&detector(), &faults, 1).unwrap().pad_voltages(None);
        for (g, e) in [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)] {
            assert_eq!(readings.at(g, e), 0.0);
        }
        assert!(readings.at(0, 2) != 0.0);
    }

    #[test]
    fn a_floating_wire_drifts_as_described() {
        let faults = ["open:0".parse().unwrap()];
        let mut measurement = Measurement::new(&detector(), &faults, 7).unwrap();
        let frames = 100_000;
        let mut sums = [0.0; 2];
        for _ in 0..frames {
            let volts = measurement.pad_voltages(None).at(1, 0);
            sums = [sums[0] + volts, sums[1] + volts * volts];
        }
        let [mean, square] = sums.map(|sum| sum / f64::from(frames));
        // About 200 independent stretches: three standard errors.
        assert!((mean - 0.6).abs() < 3.0 * 0.2 / 10.0, "{mean}");
        assert!(((square - mean * mean).sqrt() - 0.204).abs() < 0.04, "{}", (square - mean * mean).sqrt());
    }

    #[test]
    fn a_seed_repeats_everything_and_another_differs() {
        let faults = ["open:1".parse().unwrap()];
        let frames = |seed| {
            let mut measurement = Measurement::new(&detector(), &faults, seed).unwrap();
            [(); 3].map(|()| measurement.readings_v(Some(&star())))
        };
        assert_eq!(frames(1), frames(1));
        assert_ne!(frames(1), frames(2));
    }
}
