//! What is not known of a detector, compiled for [`tactomo_touch_core`]: changes of its table.
//!
//! Each thing that fields depend on has a model in which it differs by one standard deviation, at the resolution that is fine enough for changes; those of a large
//! logarithm have two, one each way, and a square.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::Modelled;
use super::between::{Between, Paired};
use super::splines::Splines;
use super::table::Fitted;
use crate::solve::fit::target::PAD_ERROR;
use tactomo_physics::detector::{Detector, Parameter};
use tactomo_physics::forward::{ForwardError, ForwardModel, changed_models, pads_ohm, sheet_drops_ohm};
use tactomo_physics::scene::Contact;
use tactomo_physics::threads;
use tactomo_touch_core::{Change, Direction, Unknown};

/// All that is not known of a detector.
#[derive(Clone, Debug, Default)]
pub(crate) struct Changes {
    directions: Vec<Direction>,
    changes: Vec<Change>,
    tables: usize,
    /// Of the last tables, which change the field of one electrode alone.
    electrodes: Vec<usize>,
    /// Some megabytes, which all that measure the detector share.
    fields_ohm: Arc<Vec<f32>>,
    pads_ohm: Vec<f32>,
    distances_ohm: Vec<f32>,
    walls: Vec<f32>,
    ranges_v: Vec<[f32; 2]>,
    own_pads_ohm: Vec<f32>,
}

/// Models whose sum, each so many times, is a change, and the electrode at which alone anything differs, if there is one.
struct Sum {
    models: Vec<(f64, Arc<dyn ForwardModel>)>,
    electrode: Option<usize>,
}

/// One table of changes.
struct Table {
    /// Coefficients of the fields of the electrodes, and of the disc's own (ohm): a column each; none of what changes none.
    fields_ohm: Option<DMatrix<f64>>,
    pads_ohm: DMatrix<f64>,
    between: Between,
    /// The electrode whose field, and those between which and others, are all that changes, if there is one.
    electrode: Option<usize>,
}

/// A parameter with fields.
struct Compiled {
    parameter: Parameter,
    deviation: f64,
    linear: usize,
    square: Option<usize>,
}

impl Changes {
    /// Of a detector, by what its table is fitted with, but for the converters that measure it.
    ///
    /// # Errors
    /// [`ForwardError`] if a detector that is a little different cannot be modelled.
    pub(super) fn of(
        modelled: Modelled<'_>,
        Fitted { splines, paired, .. }: &Fitted,
        cores: usize,
    ) -> Result<Self, ForwardError> {
        let detector = modelled.detector;
        let own_pads_ohm = pads_ohm(&**modelled.model)?.into_iter().map(|ohm| ohm as f32).collect();
        let mut all = Self { own_pads_ohm, ..Self::default() };
        let directions = detector.unknowns().directions;
        if directions.is_empty() {
            return Ok(all);
        }
        let coarse = modelled.model.coarse()?.unwrap_or_else(|| Arc::clone(modelled.model));
        let (compiled, sums) = sums_of(&coarse, &directions)?;
        let base = sampled(&*coarse, splines, modelled.radius_m)?;
        let table = |sum: &Sum| table_of(sum, (&coarse, &base), splines, paired, modelled.radius_m);
        let mut tables = threads::map_on(cores, &sums, table).into_iter().collect::<Result<Vec<_>, ForwardError>>()?;
        let sheet = directions.iter().flatten().any(|(parameter, _)| *parameter == Parameter::DrivingSheet);
        let sheet = sheet.then(|| {
            tables.push(of_driving_sheet(detector, paired));
            tables.len() - 1
        });
        all.write_directions(&directions, &compiled, sheet, &mut tables, detector);
        all.write_tables(&tables, splines.grid.sides(), detector.electrodes.len());
        Ok(all)
    }

    /// With what is not known of the models of its pads and of the converters that measure the detector.
    pub fn measured(&self, detector: &Detector) -> Self {
        let mut all = self.clone();
        all.add_pads(detector);
        all.add_converters(detector);
        all
    }

    /// How they are given to the core.
    pub fn unknown(&self) -> Unknown<'_> {
        Unknown {
            directions: &self.directions,
            changes: &self.changes,
            tables: self.tables,
            electrodes: &self.electrodes,
            fields_ohm: &self.fields_ohm,
            pads_ohm: &self.pads_ohm,
            distances_ohm: &self.distances_ohm,
            walls: &self.walls,
            ranges_v: &self.ranges_v,
            own_pads_ohm: &self.own_pads_ohm,
        }
    }

    /// A direction for each independent step of parameters; one of several with fields has a table of its own.
    fn write_directions(
        &mut self,
        directions: &[Vec<(Parameter, f64)>],
        compiled: &[Compiled],
        sheet: Option<usize>,
        tables: &mut Vec<Table>,
        detector: &Detector,
    ) {
        for steps in directions {
            let start = self.changes.len();
            let mut of_fields = Vec::new();
            let mut square = None;
            for (parameter, step) in steps {
                if let Some(one) = compiled.iter().find(|one| one.parameter == *parameter) {
                    of_fields.push((step / one.deviation, one.linear));
                    square = square.or(one.square);
                } else if *parameter == Parameter::DrivingSheet {
                    of_fields.extend(sheet.map(|table| (*step, table)));
                } else {
                    add_changes(*parameter, *step, detector.electrodes.len(), &mut self.changes);
                }
            }
            if let Some((e, step)) = lone_pad(steps) {
                self.changes.push(Change::Crowding(e, PAD_ERROR.copysign(step) as f32));
            }
            let is_alone = matches!(of_fields[..], [(share, _)] if share == 1.0);
            let table = match of_fields[..] {
                [] => None,
                [(_, table)] if is_alone => Some(table),
                _ => {
                    tables.push(mixed(&of_fields, tables));
                    Some(tables.len() - 1)
                }
            };
            let changes = start..self.changes.len();
            let electrode = match &steps[..] {
                [(parameter, _)] if of_fields.is_empty() || is_alone => parameter.electrode(),
                _ => None,
            };
            self.directions.push(Direction { table, square: square.filter(|_| is_alone), changes, electrode });
        }
    }

    /// The tables that directions have, in the order in which they are stored.
    fn write_tables(&mut self, tables: &[Table], sides: [usize; 2], electrodes: usize) {
        let mut used: Vec<usize> = self.directions.iter().flat_map(|of| [of.table, of.square]).flatten().collect();
        used.sort_unstable_by_key(|table| (tables[*table].electrode.is_some(), *table));
        used.dedup();
        self.electrodes = used.iter().filter_map(|table| tables[*table].electrode).collect();
        let renumbered = |old: Option<usize>| old.and_then(|old| used.iter().position(|table| *table == old));
        for direction in &mut self.directions {
            (direction.table, direction.square) = (renumbered(direction.table), renumbered(direction.square));
        }
        self.tables = used.len();
        let of = |table: &usize| &tables[*table];
        let fields_ohm = Arc::make_mut(&mut self.fields_ohm);
        for node in 0..sides[0] * sides[1] {
            for table in used.iter().map(of) {
                let value = |q: usize| table.fields_ohm.as_ref().map_or(0.0, |fields| fields[(node, q)]);
                let all = table.electrode.map_or(0..electrodes + 1, |e| e..e + 1);
                fields_ohm.extend(all.map(|q| value(q) as f32));
            }
        }
        for table in used.iter().map(of) {
            let pads = (0..electrodes).flat_map(|e| (0..=e).map(move |g| (e, g)));
            self.pads_ohm.extend(pads.map(|place| table.pads_ohm[place] as f32));
            self.distances_ohm.extend(table.between.distances.iter().map(|ohm| *ohm as f32));
            self.walls.extend(table.between.walls.iter().map(|ohm| *ohm as f32));
        }
    }

    /// The model's error of each pad that has no direction of its own, in which that is there by now.
    fn add_pads(&mut self, detector: &Detector) {
        let directions = detector.unknowns().directions;
        let lone: Vec<usize> = directions.iter().filter_map(|steps| Some(lone_pad(steps)?.0)).collect();
        for e in (0..detector.electrodes.len()).filter(|e| !lone.contains(e)) {
            let start = self.changes.len();
            self.changes.push(Change::Crowding(e, PAD_ERROR as f32));
            self.directions.push(Direction { changes: start..start + 1, electrode: Some(e), ..Direction::default() });
        }
    }

    /// What is not known of converters.
    fn add_converters(&mut self, detector: &Detector) {
        let range = |pad: &tactomo_physics::detector::Electrode| detector.converters.get(pad.converter);
        self.ranges_v = detector
            .electrodes
            .iter()
            .map(|pad| range(pad).map_or([0.0, 1.0], |converter| converter.range_v.map(|volts| volts as f32)))
            .collect();
        for (index, converter) in detector.converters.iter().enumerate() {
            let read = |pad: &usize| detector.electrodes[*pad].converter == index;
            let electrodes = || (0..detector.electrodes.len()).filter(read);
            let mut add = |deviation: f64, change: fn(usize, f32) -> Change| {
                let start = self.changes.len();
                if deviation > 0.0 && electrodes().next().is_some() {
                    self.changes.extend(electrodes().map(|e| change(e, deviation as f32)));
                    self.directions.push(Direction { changes: start..self.changes.len(), ..Direction::default() });
                }
            };
            add(converter.gain_share, Change::Gain);
            add(converter.bow_v, Change::Bow);
        }
    }
}

/// The pad whose own impedance is all that a direction changes, and by how much. What the model's impedance of a pad is off by, which is of the same pattern, is part of that direction.
fn lone_pad(steps: &[(Parameter, f64)]) -> Option<(usize, f64)> {
    match steps {
        [(Parameter::Pad(e), step)] => Some((*e, *step)),
        _ => None,
    }
}

/// Changes that need no fields.
fn add_changes(parameter: Parameter, step: f64, n: usize, changes: &mut Vec<Change>) {
    match parameter {
        Parameter::Gain(e) => changes.push(Change::Gain(e, step as f32)),
        Parameter::Offset(e) => changes.push(Change::Offset(e, step as f32)),
        Parameter::Pad(e) => changes.push(Change::Pad(e, step as f32)),
        Parameter::Pads => changes.extend((0..n).map(|e| Change::Pad(e, step as f32))),
        Parameter::OnResistance => changes.push(Change::Switch(step as f32)),
        Parameter::Conductivity => {
            changes.push(Change::Switch(step as f32));
            changes.extend((0..n).map(|e| Change::Pad(e, step as f32)));
        }
        _ => {}
    }
}

/// Models for all parameters with fields, at their deviations.
fn sums_of(
    coarse: &Arc<dyn ForwardModel>,
    directions: &[Vec<(Parameter, f64)>],
) -> Result<(Vec<Compiled>, Vec<Sum>), ForwardError> {
    let mut deviations: Vec<(Parameter, f64)> = Vec::new();
    for (parameter, step) in directions.iter().flatten() {
        match deviations.iter_mut().find(|(known, _)| known == parameter) {
            Some((_, square)) => *square += step * step,
            None => deviations.push((*parameter, step * step)),
        }
    }
    let (mut compiled, mut sums) = (Vec::new(), Vec::new());
    for (parameter, square) in deviations {
        let deviation = square.sqrt();
        let (models, sign) = changed_models(coarse, parameter, deviation)?;
        let (linear, mut second) = (sums.len(), None);
        let sum = |models| Sum { models, electrode: parameter.electrode() };
        match &models[..] {
            [] => continue,
            [ahead, behind] => {
                let both = |a: f64, b: f64| vec![(a, Arc::clone(ahead)), (b, Arc::clone(behind))];
                sums.push(sum(both(0.5, -0.5)));
                second = Some(sums.len());
                sums.push(sum(both(1.0, 1.0).into_iter().chain([(-2.0, Arc::clone(coarse))]).collect()));
            }
            [ahead, ..] => sums.push(sum(vec![(sign, Arc::clone(ahead)), (-sign, Arc::clone(coarse))])),
        }
        compiled.push(Compiled { parameter, deviation, linear, square: second });
    }
    Ok((compiled, sums))
}

/// Fields of discs of the usual radius at all places of the splines.
fn sampled(model: &dyn ForwardModel, splines: &Splines, radius_m: f64) -> Result<Vec<Vec<f64>>, ForwardError> {
    let of_place = |place_m: &[f64; 2]| {
        let fields = model.disc_fields(*place_m, radius_m)?;
        Ok(fields.electrodes_ohm.into_iter().chain([fields.own_ohm]).collect())
    };
    splines.places_m().iter().map(of_place).collect()
}

/// The table of a change; `base` are the fields of a model that is part of most.
fn table_of(
    sum: &Sum,
    (coarse, base): (&Arc<dyn ForwardModel>, &[Vec<f64>]),
    splines: &Splines,
    paired: &Paired,
    radius_m: f64,
) -> Result<Table, ForwardError> {
    let mut values: Vec<Vec<f64>> = base.iter().map(|fields| vec![0.0; fields.len()]).collect();
    let n = coarse.electrode_fields_ohm().nrows();
    let mut pads_ohm = DMatrix::zeros(n, n);
    // An electrode's field at itself changes by factors: their logarithms are summed up.
    let there_ohm = coarse.electrode_fields_ohm().diagonal();
    let mut at_itself_ohm = DVector::zeros(n);
    for (share, model) in &sum.models {
        let own = if Arc::ptr_eq(model, coarse) { None } else { Some(sampled(&**model, splines, radius_m)?) };
        for (sums, fields) in values.iter_mut().zip(own.as_deref().unwrap_or(base)) {
            sums.iter_mut().zip(fields).for_each(|(sum, ohm)| *sum += share * ohm);
        }
        pads_ohm += model.electrode_fields_ohm() * *share;
        at_itself_ohm +=
            model.electrode_fields_ohm().diagonal().zip_map(&there_ohm, |ohm, there| there * (ohm / there).ln())
                * *share;
    }
    pads_ohm.set_diagonal(&at_itself_ohm);
    let what = || ForwardError::Detector {
        detector: coarse.detector().name.clone(),
        what: "its model has no small contacts".to_owned(),
    };
    let between = match sum.electrode {
        Some(e) => {
            leave_to(e, &mut values, &mut pads_ohm);
            paired.nothing()
        }
        None => paired.change(&sum.models).ok_or_else(what)?,
    };
    Ok(Table { fields_ohm: Some(splines.fitted(&values)), pads_ohm, between, electrode: sum.electrode })
}

/// Leaves what one electrode changes to its own field, those at other electrodes, and to nothing else. Models' fields are such that the mean over the electrodes vanishes,
/// so that all change with one, and those of places too: but a function of the place that all fields have in common makes no difference to readings.
fn leave_to(electrode: usize, values: &mut [Vec<f64>], pads_ohm: &mut DMatrix<f64>) {
    let n = pads_ohm.nrows();
    for fields in values {
        let others: f64 = (0..n).filter(|e| *e != electrode).map(|e| fields[e]).sum();
        let own = fields[electrode] - others / (n - 1) as f64;
        fields.fill(0.0);
        fields[electrode] = own;
    }
    for e in (0..n).filter(|e| *e != electrode) {
        (0..n).filter(|g| *g != electrode).for_each(|g| pads_ohm[(e, g)] = 0.0);
    }
}

/// What a driving sheet of one ohm per square changes: it is as if contacts had fields at each other.
fn of_driving_sheet(detector: &Detector, paired: &Paired) -> Table {
    let n = detector.electrodes.len();
    let drop = |a: [f64; 2], b: [f64; 2]| {
        let contacts = [a, b].map(|[x_m, y_m]| Contact::flat(x_m, y_m, paired.ways.near_m, 1.0));
        sheet_drops_ohm(detector, &contacts)[(0, 1)]
    };
    Table { fields_ohm: None, pads_ohm: DMatrix::zeros(n, n), between: paired.of_function(drop), electrode: None }
}

/// The sum of some tables, each so many times.
fn mixed(parts: &[(f64, usize)], tables: &[Table]) -> Table {
    let first = &tables[parts[0].1];
    let mut all = Table {
        fields_ohm: None,
        pads_ohm: DMatrix::zeros(first.pads_ohm.nrows(), first.pads_ohm.ncols()),
        between: Between {
            distances: vec![0.0; first.between.distances.len()],
            walls: vec![0.0; first.between.walls.len()],
        },
        electrode: None,
    };
    for (share, table) in parts.iter().map(|(share, table)| (*share, &tables[*table])) {
        if let Some(fields) = &table.fields_ohm {
            let sum = all.fields_ohm.get_or_insert_with(|| DMatrix::zeros(fields.nrows(), fields.ncols()));
            *sum += fields * share;
        }
        all.pads_ohm += &table.pads_ohm * share;
        let add = |sums: &mut [f64], values: &[f64]| {
            sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += share * value);
        };
        add(&mut all.between.distances, &table.between.distances);
        add(&mut all.between.walls, &table.between.walls);
    }
    all
}
