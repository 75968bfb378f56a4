//! What readings would be if the detector were a little different: patterns of what is not known of it.
//!
//! Thickness, conductivity, electrodes' places and the like are not looked for in a frame, but they are in its readings: nuisance
//! parameters. To first order a change `s` of theirs, in standard deviations, adds `P s` to the readings, with a column of `P` for each
//! independent direction in which the detector may differ ([`Detector::unknowns`]). With `s` normal, `P P^T` is the covariance of what a
//! model of the described detector is wrong by: the approximation error (Kaipio and Somersalo, Statistical and computational inverse
//! problems, 2005, section 5.8).
//!
//! `P` depends on what touches. Each parameter has a model of the detector with that parameter changed by one standard deviation, made
//! once, and a column is the difference of two answers. Pads, channels and the multiplexer need no model: with `L = Z[g][g] + R`,
//! a resistance `d` in series with ground `g` adds `(Vcc - V[g][e]) d / L`, a factor of a channel `V[g][e]` itself.
//!
//! Nor does the conductivity. Readings stay as they are if it, the contacts' conductances, and one over pads' and switch's resistances are
//! multiplied alike: so a conductivity that is larger by a factor is contacts that conduct less by it, and pads and a switch that resist more. Nor
//! does a driving layer with a resistance: under one contact it is a contact that conducts less, and only what contacts have in common of it is
//! more than that. What is a change of conductances alone, readings cannot tell from them, and nothing is gained by calling it an error of the
//! readings: patterns leave it out, and are those of a detector on which contacts' conductances have changed along
//! ([`conductance_deviations`](Nuisance::conductance_deviations)); whoever says what a conductance is adds it. As an error of the readings it made firm
//! contacts several in one of ten answers: it is large, and far from linear, where the readings hardly change with a conductance. (Dots of glue
//! are left out: their own resistance hardly matters.)

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::driving::{sheet_between_ohm, sheet_drops_ohm};
use super::{ForwardError, ForwardModel, Joint, Through, readings_v};
use crate::detector::{Detector, Electrode, Parameter};
use crate::readings::Readings;
use crate::scene::Contact;
use crate::threads;

/// Standard deviation of a logarithm from which its square is reckoned with as well: below, it makes less than a thirtieth of the change.
const CURVED: f64 = 0.05;

/// Models of a detector in which one thing each is different.
pub struct Nuisance {
    model: Arc<dyn ForwardModel>,
    /// What the changed ones are a change of: as coarse as they are, which is fine enough for a covariance.
    coarse: Arc<dyn ForwardModel>,
    parameters: Vec<Changed>,
    /// Steps of the parameters, in their standard deviations, in each direction: `parameters x directions`.
    directions: DMatrix<f64>,
    /// Contact resistance of each pad (ohm).
    pads_ohm: Vec<f64>,
}

/// A parameter changed by one standard deviation.
struct Changed {
    parameter: Parameter,
    /// In its unit.
    deviation: f64,
    /// The detector with that change, and with the opposite one if the square counts; none where no model is needed.
    models: Vec<Arc<dyn ForwardModel>>,
    /// Of the change, for the one model that there is.
    sign: f64,
}

/// The change of the readings by one standard deviation of a parameter (V).
struct Change {
    /// Odd and even part; the latter only where it counts.
    odd: Vec<f64>,
    even: Option<Vec<f64>>,
}

/// A detector that differs from the described one in some of its parameters.
pub struct Similar {
    model: Arc<dyn ForwardModel>,
    /// Steps of those that belong to the board.
    board: Vec<(Parameter, f64)>,
    /// Factor on the conductivity.
    conductivity: f64,
    /// Sheet resistance of the driving layer (ohm per square), to first order.
    driving_sheet_ohm: f64,
}

impl Similar {
    /// Readings of contacts (V), as the board that it is measured by has them, with conductances changed along with the detector.
    ///
    /// # Errors
    /// [`ForwardError`] if a contact is not on the detector or none conducts.
    pub fn readings_v(&self, contacts: &[Contact], measured: &Detector) -> Result<Readings, ForwardError> {
        let along =
            |contact: &Contact| Contact { conductance_s: self.conductivity * contact.conductance_s, ..*contact };
        let contacts: Vec<_> = contacts.iter().map(along).collect();
        let mut impedance_ohm = self.model.impedance_ohm(&contacts)?;
        if self.driving_sheet_ohm != 0.0 {
            impedance_ohm += sheet_between_ohm(&*self.model, &contacts)? * self.driving_sheet_ohm;
        }
        let board = measured.stepped(&self.board);
        let mut readings = readings_v(&impedance_ohm, &board);
        let n = readings.electrodes();
        // Described gains and offsets are taken out of readings before they get here.
        let of = |(b, m): (&Electrode, &Electrode)| [b.gain / m.gain, b.unseen_offset_v - m.unseen_offset_v];
        let channels: Vec<_> = board.electrodes.iter().zip(&measured.electrodes).map(of).collect();
        for (index, volts) in readings.volts_mut().iter_mut().enumerate() {
            let [gain, offset_v] = channels[index % n];
            *volts = gain * *volts + offset_v;
        }
        Ok(readings)
    }
}

impl Nuisance {
    /// How many independent directions there are.
    pub fn directions(&self) -> usize {
        self.directions.ncols()
    }

    /// The detector after such steps in each direction, in standard deviations.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if it cannot be modelled.
    pub fn similar(&self, steps: &[f64]) -> Result<Similar, ForwardError> {
        let deviations = &self.directions * DVector::from_column_slice(steps);
        let steps = self.parameters.iter().zip(&deviations).map(|(of, step)| (of.parameter, step * of.deviation));
        let steps: Vec<_> = steps.collect();
        let model = self.model.of_similar(&self.model.detector().stepped(&steps))?;
        let sum_of =
            |wanted| steps.iter().filter(|(parameter, _)| *parameter == wanted).map(|(_, step)| step).sum::<f64>();
        let (conductivity, driving_sheet_ohm) =
            (sum_of(Parameter::Conductivity).exp(), sum_of(Parameter::DrivingSheet));
        let board = steps.iter().filter(|(parameter, _)| parameter.is_of_board()).copied().collect();
        Ok(Similar { model, board, conductivity, driving_sheet_ohm })
    }

    /// Of all that is not known of the detector that a model is of, as it is described; `None` if that is nothing. It takes a model for most
    /// parameters, made in so many threads.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if a detector that is a little different cannot be modelled.
    pub fn new(
        model: &Arc<dyn ForwardModel>,
        described: &Detector,
        cores: usize,
    ) -> Result<Option<Self>, ForwardError> {
        let unknowns = described.unknowns().directions;
        let mut parameters: Vec<(Parameter, f64)> = Vec::new();
        for (parameter, step) in unknowns.iter().flatten() {
            match parameters.iter_mut().find(|(known, _)| known == parameter) {
                Some((_, square)) => *square += step * step,
                None => parameters.push((*parameter, step * step)),
            }
        }
        if parameters.is_empty() {
            return Ok(None);
        }
        let step_of = |steps: &[(Parameter, f64)], parameter: Parameter| {
            steps.iter().filter(|(of, _)| *of == parameter).map(|(_, step)| step).sum::<f64>()
        };
        let directions = DMatrix::from_fn(parameters.len(), unknowns.len(), |row, column| {
            let (parameter, square) = parameters[row];
            step_of(&unknowns[column], parameter) / square.sqrt()
        });
        let coarse = model.coarse()?.unwrap_or_else(|| Arc::clone(model));
        let changed = |(parameter, square): &(Parameter, f64)| Changed::new(&coarse, *parameter, square.sqrt());
        let parameters = threads::map_on(cores, &parameters, changed);
        let parameters = parameters.into_iter().collect::<Result<_, _>>()?;
        let pads_ohm = pads_ohm(&**model)?;
        Ok(Some(Self { model: Arc::clone(model), coarse, parameters, directions, pads_ohm }))
    }

    /// The nuisance parameters, seen through some of the electrodes, in this order, with some of all of them joined: `through` is the model so
    /// seen. What belongs to electrodes that are left out is left out.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if a detector that is a little different cannot be modelled.
    pub fn through(
        &self,
        through: &Arc<dyn ForwardModel>,
        kept: &[usize],
        joints: &[Joint],
    ) -> Result<Self, ForwardError> {
        let seen = |model: &Arc<dyn ForwardModel>| {
            Arc::new(Through::new(Arc::clone(model), kept.to_vec(), joints.to_vec())) as Arc<dyn ForwardModel>
        };
        let renumbered = |parameter: Parameter| match parameter.electrode() {
            Some(e) => kept.iter().position(|kept| *kept == e).map(|to| parameter.with_electrode(to)),
            None => Some(parameter),
        };
        let left = self.parameters.iter().enumerate().filter_map(|(row, changed)| {
            let models = || changed.models.iter().map(seen).collect();
            let of = |parameter| Changed { parameter, models: models(), ..*changed };
            Some((row, of(renumbered(changed.parameter)?)))
        });
        let (rows, parameters): (Vec<usize>, Vec<Changed>) = left.unzip();
        // Joined pads share what is under them.
        let pads_ohm = match joints {
            [] => kept.iter().map(|e| self.pads_ohm[*e]).collect(),
            _ => pads_ohm(&**through)?,
        };
        let (model, coarse) = (Arc::clone(through), seen(&self.coarse));
        Ok(Self { model, coarse, parameters, directions: self.directions.select_rows(&rows), pads_ohm })
    }

    /// Standard deviation of the logarithm of each contact's conductance by what of the detector no readings tell from it. Patterns leave it out.
    pub fn conductance_deviations(&self, contacts: &[Contact]) -> Vec<f64> {
        let below_ohm = sheet_drops_ohm(self.model.detector(), contacts).diagonal();
        let by = |k: usize, changed: &Changed| match changed.parameter {
            Parameter::Conductivity => Some(changed.deviation),
            // 1/C is less than it seems by what is below it.
            Parameter::DrivingSheet => Some(changed.deviation * below_ohm[k] * contacts[k].conductance_s),
            _ => None,
        };
        let deviation = |k: usize| {
            let steps = self.parameters.iter().enumerate().filter_map(|(row, changed)| Some((row, by(k, changed)?)));
            let steps: Vec<_> = steps.collect();
            let along =
                |column: usize| steps.iter().map(|(row, step)| step * self.directions[(*row, column)]).sum::<f64>();
            (0..self.directions()).map(|column| along(column).powi(2)).sum::<f64>().sqrt()
        };
        (0..contacts.len()).map(deviation).collect()
    }

    /// Changes of the readings of contacts (V), as `measured` has them, by one standard deviation of each independent error: a column each, in the readings' order.
    /// The contacts' conductances change along, so that patterns have [nothing that is but a change of these](Self::conductance_deviations).
    ///
    /// # Errors
    /// [`ForwardError`] if a contact is not on the detector or none conducts.
    pub fn patterns_v(&self, contacts: &[Contact], measured: &Detector) -> Result<DMatrix<f64>, ForwardError> {
        let impedance_ohm = self.model.impedance_ohm(contacts)?;
        let coarse = readings_v(&self.coarse.impedance_ohm(contacts)?, measured);
        let at = At { contacts, measured, readings: readings_v(&impedance_ohm, measured), impedance_ohm, coarse };
        let changes = self.parameters.iter().map(|changed| self.change_v(changed, &at));
        let changes = changes.collect::<Result<Vec<_>, _>>()?;
        let size = at.readings.volts().len();
        let odd = DMatrix::from_fn(size, changes.len(), |row, column| changes[column].odd[row]);
        let first = odd * &self.directions;
        // Of a normal number of deviation one, the mean of the fourth power is 3.
        let even: Vec<_> = changes.iter().filter_map(|change| change.even.as_ref()).collect();
        let second = DMatrix::from_fn(size, even.len(), |row, column| 3f64.sqrt() * even[column][row]);
        let columns = first.ncols();
        let mut all = first.resize_horizontally(columns + even.len(), 0.0);
        all.columns_mut(columns, even.len()).copy_from(&second);
        Ok(all)
    }

    fn change_v(&self, changed: &Changed, at: &At<'_>) -> Result<Change, ForwardError> {
        let odd = |odd| Ok(Change { odd, even: None });
        let before = at.coarse.volts();
        match changed.parameter {
            Parameter::Gain(e) => {
                odd(at.each(|_, read, volts| if read == e { changed.deviation * volts } else { 0.0 }))
            }
            Parameter::Offset(e) => odd(at.each(|_, read, _| if read == e { changed.deviation } else { 0.0 })),
            Parameter::OnResistance => odd(at.of_switch(changed.deviation)),
            Parameter::Conductivity => {
                let resistances = at.of_switch(1.0).into_iter().zip(at.under_pads(|g| self.pads_ohm[g]));
                odd(resistances.map(|(switch, pads)| changed.deviation * (switch + pads)).collect())
            }
            Parameter::DrivingSheet => {
                odd(at.of_impedance(&(sheet_between_ohm(&*self.model, at.contacts)? * changed.deviation)))
            }
            Parameter::Pads => {
                let ohm = |sign: f64| (sign * changed.deviation).exp_m1();
                let half = |sign: f64| 0.5 * (ohm(1.0) + sign * ohm(-1.0));
                let of = |factor: f64| at.under_pads(|g| factor * self.pads_ohm[g]);
                Ok(Change { odd: of(half(-1.0)), even: Some(of(half(1.0))) })
            }
            Parameter::Pad(e) => {
                odd(at.under_pads(|g| if g == e { changed.deviation * self.pads_ohm[g] } else { 0.0 }))
            }
            _ => {
                let volts = |model: &Arc<dyn ForwardModel>| {
                    Ok(readings_v(&model.impedance_ohm(at.contacts)?, at.measured).volts().to_vec())
                };
                let after = changed.models.iter().map(volts).collect::<Result<Vec<_>, ForwardError>>()?;
                Ok(match &after[..] {
                    [ahead, behind] => {
                        let half = |sign: f64| ahead.iter().zip(behind).map(move |(a, b)| 0.5 * (a + sign * b));
                        let even = half(1.0).zip(before).map(|(middle, volts)| middle - volts).collect();
                        Change { odd: half(-1.0).collect(), even: Some(even) }
                    }
                    after => {
                        let after = after.iter().flatten();
                        let odd = after.zip(before).map(|(after, before)| changed.sign * (after - before)).collect();
                        Change { odd, even: None }
                    }
                })
            }
        }
    }
}

/// Where changes are taken.
struct At<'a> {
    contacts: &'a [Contact],
    measured: &'a Detector,
    readings: Readings,
    impedance_ohm: DMatrix<f64>,
    /// Readings that the changed models are a change of.
    coarse: Readings,
}

impl At<'_> {
    /// What a change of the impedances (ohm) changes (V).
    fn of_impedance(&self, change_ohm: &DMatrix<f64>) -> Vec<f64> {
        let drive_v = self.measured.drive_v;
        self.each(|g, e, volts| {
            ((drive_v - volts) * change_ohm[(g, g)] - drive_v * change_ohm[(e, g)]) / self.load_ohm(g)
        })
    }

    /// What a change of the logarithm of the switch's resistance changes (V).
    fn of_switch(&self, log: f64) -> Vec<f64> {
        let ohm = log * self.measured.on_resistance_ohm;
        self.each(|g, _, volts| (self.measured.drive_v - volts) * ohm / self.load_ohm(g))
    }

    fn each(&self, value: impl Fn(usize, usize, f64) -> f64) -> Vec<f64> {
        let electrodes = self.readings.electrodes();
        let of = |(index, volts): (usize, &f64)| value(index / electrodes, index % electrodes, *volts);
        self.readings.volts().iter().enumerate().map(of).collect()
    }

    /// `Z[g][g] + R` (ohm).
    fn load_ohm(&self, g: usize) -> f64 {
        self.impedance_ohm[(g, g)] + self.measured.on_resistance_ohm
    }

    /// What a resistance under each pad (ohm) changes while it is grounded.
    fn under_pads(&self, ohm: impl Fn(usize) -> f64) -> Vec<f64> {
        self.each(|g, e, volts| {
            let over = if e == g { -volts } else { self.measured.drive_v - volts };
            over * ohm(g) / self.load_ohm(g)
        })
    }
}

impl Changed {
    fn new(model: &Arc<dyn ForwardModel>, parameter: Parameter, deviation: f64) -> Result<Self, ForwardError> {
        let (models, sign) = changed_models(model, parameter, deviation)?;
        Ok(Self { parameter, deviation, models, sign })
    }
}

/// Models of a detector of which one thing is changed by a deviation: two, ahead and behind, where the square counts; one, and the sign of its change; none where no model
/// is needed.
///
/// # Errors
/// [`ForwardError::Detector`] if it cannot be modelled.
pub fn changed_models(
    model: &Arc<dyn ForwardModel>,
    parameter: Parameter,
    deviation: f64,
) -> Result<(Vec<Arc<dyn ForwardModel>>, f64), ForwardError> {
    let with = |step: f64| model.of_similar(&model.detector().stepped(&[(parameter, step)]));
    Ok(match parameter {
        Parameter::Gain(_)
        | Parameter::Offset(_)
        | Parameter::OnResistance
        | Parameter::Pads
        | Parameter::Pad(_)
        | Parameter::Conductivity
        | Parameter::DrivingSheet => (Vec::new(), 1.0),
        Parameter::Thickness | Parameter::TopOverBottom if deviation > CURVED => {
            (vec![with(deviation)?, with(-deviation)?], 1.0)
        }
        Parameter::ElectrodeX(_) | Parameter::ElectrodeY(_) => match with(deviation) {
            Ok(ahead) => (vec![ahead], 1.0),
            // Another pad, or the wall, is in the way.
            Err(_) => (vec![with(-deviation)?], -1.0),
        },
        _ => (vec![with(deviation)?], 1.0),
    })
}

/// Contact resistance of the pads (ohm), with what the crowding of the current on them makes of it: a change of all contact impedances by
/// a share of one changes `Z[g][g]` by so much.
///
/// # Errors
/// [`ForwardError::Detector`] if the detector with other pads cannot be modelled.
pub fn pads_ohm(model: &dyn ForwardModel) -> Result<Vec<f64>, ForwardError> {
    const STEP: f64 = 0.1;
    let more = model.of_similar(&model.detector().stepped(&[(Parameter::Pads, STEP)]))?;
    let [before, after] = [model.electrode_fields_ohm(), more.electrode_fields_ohm()];
    // Fields have a constant that is common to all; what differs between pads tells it: it is that of the mean over pairs of pads.
    let n = before.nrows();
    let constant = if n < 2 {
        0.0
    } else {
        let off = (0..n * n).filter(|i| i / n != i % n).map(|i| after[(i / n, i % n)] - before[(i / n, i % n)]);
        off.sum::<f64>() / (n * (n - 1)) as f64
    };
    Ok((0..n).map(|g| ((after[(g, g)] - before[(g, g)] - constant) / STEP.exp_m1()).max(0.0)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::Tolerances;
    use crate::forward::{DrivingLayer, Resolution, Slab};

    const SHEET_S: f64 = 0.2273 * 0.005;

    /// The one pattern of a detector with such tolerances under contacts (V), and how conductances change along.
    fn pattern(tolerances: Tolerances, contacts: &[Contact]) -> (Vec<f64>, Vec<f64>) {
        let detector = Detector { tolerances, ..Detector::default() };
        let model: Arc<dyn ForwardModel> = Arc::new(Slab::new(&detector).unwrap().on_image(100));
        let nuisance = Nuisance::new(&model, &detector, 1).unwrap().unwrap();
        let patterns_v = nuisance.patterns_v(contacts, &detector).unwrap();
        assert_eq!(patterns_v.ncols(), 1, "no square of what contacts can be");
        (patterns_v.as_slice().to_vec(), nuisance.conductance_deviations(contacts))
    }

    fn changed(contacts: &[Contact], logs: &[f64]) -> Vec<Contact> {
        let along =
            |(contact, log): (&Contact, &f64)| Contact { conductance_s: contact.conductance_s * log.exp(), ..*contact };
        contacts.iter().zip(logs).map(along).collect()
    }

    fn read_v(detector: &Detector, sheet_ohm: f64, contacts: &[Contact]) -> Vec<f64> {
        let layer = DrivingLayer { sheet_ohm, ..DrivingLayer::default() };
        let slab = Slab::under(detector, Resolution::STANDARD, layer).unwrap().on_image(100);
        readings_v(&slab.impedance_ohm(contacts).unwrap(), detector).volts().to_vec()
    }

    /// Largest difference over the largest change.
    fn off(found_v: &[f64], a_v: &[f64], b_v: &[f64]) -> f64 {
        let largest = |all: &mut dyn Iterator<Item = f64>| all.map(f64::abs).fold(0.0, f64::max);
        let change = || a_v.iter().zip(b_v).map(|(a, b)| a - b);
        largest(&mut found_v.iter().zip(change()).map(|(found, change)| found - change)) / largest(&mut change())
    }

    fn some() -> [Vec<Contact>; 2] {
        let at = |x_m, y_m, sheets: f64| Contact::flat(x_m, y_m, 0.003, sheets * SHEET_S);
        [vec![at(0.011, -0.006, 0.8)], vec![at(-0.018, 0.012, 2.0), at(0.016, 0.009, 0.3)]]
    }

    #[test]
    fn conductivity_is_what_pads_and_switch_do_to_contacts_that_change_along() {
        for contacts in some() {
            let tolerances = Tolerances { conductivity_share: 0.01, ..Tolerances::EXACT };
            let (found_v, logs) = pattern(tolerances, &contacts);
            let more = Detector::default().stepped(&[(Parameter::Conductivity, 0.01)]);
            let along = changed(&contacts, &logs);
            let off = off(&found_v, &read_v(&more, 0.0, &along), &read_v(&Detector::default(), 0.0, &contacts));
            assert!(off < 0.03, "{off}");
        }
    }

    #[test]
    fn a_driving_sheet_is_what_contacts_have_in_common_of_it() {
        for contacts in some() {
            let tolerances = Tolerances { driving_sheet_ohm: 2.0, ..Tolerances::EXACT };
            let (found_v, logs) = pattern(tolerances, &contacts);
            let exact_v = read_v(&Detector::default(), 0.0, &contacts);
            let along_v = read_v(&Detector::default(), 2.0, &changed(&contacts, &logs));
            let as_it_was_v = read_v(&Detector::default(), 2.0, &contacts);
            // A hundredth and less of what it would be if conductances stayed is left of one contact: nothing.
            let largest = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            let pattern_v: Vec<_> = exact_v.iter().zip(&found_v).map(|(exact, found)| exact + found).collect();
            let off = largest(&along_v, &pattern_v) / largest(&as_it_was_v, &exact_v);
            assert!(off < 0.03, "{off}");
            assert_eq!(contacts.len() > 1, found_v.iter().any(|volts| *volts != 0.0));
        }
    }
}
