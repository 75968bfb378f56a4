//! What the paper leaves open of its solver: the unit of lambda, the readings that are taken and what its pads are; and which SR and PA of its sample A each
//! choice gives.
//!
//! Readings are those of the simulated sample at 2.25 N, without noise. The image of each choice is Tikhonov's, of the same shell of 1 S; readings in
//! another unit, or in shares of the drive, are another lambda.

use nalgebra::{DMatrix, DVector};
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::forward::shell::Shell;
use tactomo_physics::forward::{Auto, ForwardError, ImageMesh, readings_v};
use tactomo_physics::scene::Contact;
use tactomo_touch::metrics::PaperFigures;

use super::super::press::{in_decades, nine_places};
use super::super::{DesignError, Progress};
use super::{COMPARED_N, measured, pressed};

/// The sample.
const SAMPLE: &str = "A";
/// `lambda^2` as printed.
const PRINTED: f64 = 5000.0;
/// Lambdas that are tried besides, in largest singular values: ten a decade.
const TRIED: [f64; 2] = [1e-4, 10.0];
const TRIED_COUNT: usize = 51;
/// A choice gives what was measured if both are as near as this: 1.8 mm of 60.
const NEAR: f64 = 0.03;
/// Radius of pads that are points (m).
const POINT_M: f64 = 2e-4;
/// Triangles of the paper's mesh for each node.
const TRIANGLES_A_NODE: f64 = 2.0;
/// Thickness of the paper's samples (m), if its 1 S/m is of a sheet so thick.
const SHEET_M: f64 = 0.005;

/// One choice and what it gives.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Choice {
    /// What the pads are.
    pub pads: &'static str,
    /// Which readings are taken, and how.
    pub rows: &'static str,
    /// What 5000 is; `None` of a lambda that is only tried.
    pub lambda: Option<&'static str>,
    /// Lambda as a share of the largest singular value.
    pub lambda_share: f64,
    /// SR of the contact in the middle.
    pub spatial_resolution: f64,
    /// Whether its image has collapsed.
    pub is_spread_out: bool,
    /// PA over the nine places.
    pub position_accuracy: f64,
}

/// All choices.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Choices {
    /// SR and PA as measured.
    pub measured: [f64; 2],
    /// What the printed lambda gives, for all pads, readings and units.
    pub printed: Vec<Choice>,
    /// Of each pads and readings the lambda, any from 1e-4 to 10 largest singular values, whose SR and PA are nearest to what was measured.
    pub nearest: Vec<Choice>,
}

impl Choice {
    /// How far from SR and PA as measured.
    fn distance(&self, [resolution, accuracy]: [f64; 2]) -> f64 {
        (self.spatial_resolution - resolution).hypot(self.position_accuracy - accuracy)
    }
}

impl Choices {
    /// The printed lambda as this program takes it, and what changes one thing in that.
    pub fn one_at_a_time(&self) -> impl Iterator<Item = &Choice> {
        let same = |choice: &&Choice| {
            let is = [choice.pads == PADS[0].0, choice.rows == ROWS[0].0, choice.lambda == Some(LAMBDAS[0].0)];
            is.into_iter().filter(|is| *is).count() >= 2
        };
        self.printed.iter().filter(same)
    }

    /// The nearest of all.
    pub fn best(&self) -> Option<&Choice> {
        let all = self.printed.iter().chain(&self.nearest);
        all.min_by(|a, b| a.distance(self.measured).total_cmp(&b.distance(self.measured)))
    }

    /// Whether a choice gives both as measured, and which comes nearest: a sentence.
    pub fn text(&self) -> String {
        let [resolution, accuracy] = self.measured;
        let Some(best) = self.best() else { return "no choice was tried".to_owned() };
        let is_near =
            (best.spatial_resolution - resolution).abs() <= NEAR && (best.position_accuracy - accuracy).abs() <= NEAR;
        format!(
            "{} SR {resolution} and PA {accuracy} of sample {SAMPLE} together{}: SR {:.3}, PA {:.3} with pads and switch {}, {}, {}",
            if is_near { "one choice gives" } else { "no choice of lambda, readings and pads gives" },
            if is_near { "" } else { "; nearest comes" },
            best.spatial_resolution,
            best.position_accuracy,
            best.pads,
            best.rows,
            best.lambda_text()
        )
    }
}

impl Choice {
    /// SR, in brackets where the image has collapsed.
    pub fn resolution_text(&self) -> String {
        let text = format!("{:.3}", self.spatial_resolution);
        if self.is_spread_out { format!("({text})") } else { text }
    }

    /// What lambda is.
    pub fn lambda_text(&self) -> String {
        let share = format!("lambda {:.2e} of the largest singular value", self.lambda_share);
        self.lambda.map_or(share.clone(), |what| format!("{what} ({share})"))
    }
}

/// Makes a detector's pads and switch what they are taken for.
type Pads = fn(&mut Detector);
/// Lambda (V m / S of a sheet of 1 S) from the area of a node (m2).
type OfNode = fn(f64) -> f64;

/// What the pads are.
const PADS: [(&str, Pads); 4] = [
    ("as described", |_| {}),
    ("ideal", |detector| {
        (detector.contact_impedance_ohm_m2, detector.on_resistance_ohm) = (0.0, 0.0);
    }),
    ("the sample's on a sheet of 1 S", |detector| {
        let sheet_s = detector.sheet_conductance_s();
        detector.contact_impedance_ohm_m2 /= sheet_s;
        detector.on_resistance_ohm /= sheet_s;
    }),
    ("ideal points", |detector| {
        (detector.contact_impedance_ohm_m2, detector.on_resistance_ohm) = (0.0, 0.0);
        detector.electrodes.iter_mut().for_each(|pad| pad.radius_m = POINT_M);
    }),
];

/// Which readings are taken: what is made of a frame of them, electrode by electrode of each ground.
type Rows = fn(&mut [f64], usize);

const ROWS: [(&str, Rows); 3] = [
    ("all 256 readings", |_, _| {}),
    ("without the grounded electrode's", |volts, electrodes| {
        (0..electrodes).for_each(|g| volts[g * electrodes + g] = 0.0);
    }),
    ("each ground less its mean", |volts, electrodes| {
        for row in volts.chunks_exact_mut(electrodes) {
            let mean = row.iter().sum::<f64>() / electrodes as f64;
            row.iter_mut().for_each(|volt| *volt -= mean);
        }
    }),
];

/// What 5000 is.
const LAMBDAS: [(&str, OfNode); 6] = [
    ("conductances of nodes, sheet of 1 S", |node_m2| (PRINTED * node_m2).sqrt()),
    ("conductances of triangles, sheet of 1 S", |node_m2| (PRINTED * node_m2 / TRIANGLES_A_NODE).sqrt()),
    ("conductances of nodes, 1 S/m and 5 mm", |node_m2| (PRINTED * node_m2).sqrt() * SHEET_M),
    ("conductances of nodes, readings in mV", |node_m2| (PRINTED * node_m2).sqrt() * 1e-3),
    ("conductances per area (S/m2)", |node_m2| (PRINTED / node_m2).sqrt()),
    ("conductances of nodes, lambda itself 5000", |node_m2| PRINTED * node_m2.sqrt()),
];

/// Tries all of them; `None` if it was stopped before the end.
pub(super) fn of(progress: Progress) -> Result<Option<Choices>, DesignError> {
    let (detector, press) = pressed(SAMPLE)?;
    let model = Auto::new(&detector, None)?.model;
    let contacts = nine_places(&detector).map(|place| press.at(place, COMPARED_N));
    let frames = contacts.iter().map(|contact| {
        let readings = readings_v(&model.impedance_ohm(&[*contact])?, &detector);
        Ok((*contact, readings.volts().to_vec()))
    });
    let frames: Vec<(Contact, Vec<f64>)> = frames.collect::<Result<_, ForwardError>>()?;
    let measured = measured::all()
        .find(|sample| sample.name == SAMPLE)
        .map_or([f64::NAN; 2], |sample| [sample.spatial_resolution, sample.position_accuracy]);
    let found = progress.map("choices", &PADS, |(name, change)| {
        let mut changed = detector.clone();
        change(&mut changed);
        let jacobian = Jacobian::of(&Shell::new(&changed)?);
        Ok::<_, ForwardError>(ROWS.map(|rows| of_rows(name, rows, &jacobian, &frames, measured)))
    });
    let Some(found) = found.into_iter().collect::<Option<Vec<_>>>() else { return Ok(None) };
    let found: Vec<_> = found.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
    let (printed, nearest): (Vec<_>, Vec<_>) = found.into_iter().unzip();
    Ok(Some(Choices {
        measured,
        printed: printed.into_iter().flatten().collect(),
        nearest: nearest.into_iter().flatten().collect(),
    }))
}

/// Of some pads and readings: what 5000 gives in each unit, and the lambda that comes nearest to what was measured.
fn of_rows(
    pads: &'static str,
    (rows, taken): (&'static str, Rows),
    jacobian: &Jacobian,
    frames: &[(Contact, Vec<f64>)],
    measured: [f64; 2],
) -> (Vec<Choice>, Option<Choice>) {
    let linear = Linear::of(jacobian, taken);
    let choice = |lambda_share: f64, lambda| {
        let (spatial_resolution, is_spread_out, position_accuracy) = linear.figures(frames, lambda_share)?;
        Some(Choice { pads, rows, lambda, lambda_share, spatial_resolution, is_spread_out, position_accuracy })
    };
    let areas_m2 = &jacobian.image_mesh.node_areas_m2;
    let node_m2 = areas_m2.iter().sum::<f64>() / areas_m2.len() as f64;
    // Of a sheet of 1 S, singular values are those of this sheet times its conductance.
    let largest = linear.singular_values[0] * jacobian.detector.sheet_conductance_s();
    let printed = LAMBDAS.iter().filter_map(|(what, of)| choice(of(node_m2) / largest, Some(*what))).collect();
    let tried = in_decades(TRIED, TRIED_COUNT).into_iter().filter_map(|share| choice(share, None));
    (printed, tried.min_by(|a, b| a.distance(measured).total_cmp(&b.distance(measured))))
}

/// The linear theory of some readings, as its singular value decomposition.
struct Linear<'a> {
    mesh: &'a ImageMesh,
    width_m: f64,
    electrodes: usize,
    taken: Rows,
    /// `readings x rank`.
    readings: DMatrix<f64>,
    /// Falling.
    singular_values: Vec<f64>,
    /// `nodes x rank`: images (S/m2).
    images: DMatrix<f64>,
}

impl<'a> Linear<'a> {
    /// `J A^(1/2)` through the few dimensions that it has: the fields of all electrodes but the last, less that, and the total conductance. What is made
    /// of readings is linear, so it is made of each column.
    fn of(jacobian: &'a Jacobian, taken: Rows) -> Self {
        let (electrodes, fields, mesh) = (jacobian.electrodes(), &jacobian.fields_ohm, &jacobian.image_mesh);
        let last = electrodes - 1;
        let roots_m: Vec<f64> = mesh.node_areas_m2.iter().map(|area_m2| area_m2.sqrt()).collect();
        let sources = DMatrix::from_fn(fields.nrows(), electrodes, |node, source| {
            let ohm = if source == last { 1.0 } else { fields[(node, source)] - fields[(node, last)] };
            ohm * roots_m[node]
        });
        let mut volts = DMatrix::from_fn(electrodes * electrodes, electrodes, |row, source| {
            let (g, e) = (row / electrodes, row % electrodes);
            let is = |electrode| f64::from(u8::from(source == electrode));
            let share = if source == last { jacobian.total_ohm(g, e) } else { is(e) - is(g) };
            jacobian.detector.drive_v * share
        });
        volts.column_iter_mut().for_each(|mut column| taken(column.as_mut_slice(), electrodes));
        let (nodes, core) = (sources.qr(), |r: DMatrix<f64>| (volts * r.transpose()).svd(true, true));
        let mut core = core(nodes.r());
        core.sort_by_singular_values();
        let none = || DMatrix::zeros(0, 0);
        let mut images = nodes.q() * core.v_t.unwrap_or_else(none).transpose();
        images.row_iter_mut().zip(&roots_m).for_each(|(mut row, root_m)| row /= *root_m);
        Self {
            mesh,
            width_m: jacobian.detector.outline.size_m()[0],
            electrodes,
            taken,
            readings: core.u.unwrap_or_else(none),
            singular_values: core.singular_values.iter().copied().collect(),
            images,
        }
    }

    /// SR of the contact in the middle, whether its image has collapsed, and PA over all; `None` if one is nowhere above zero.
    fn figures(&self, frames: &[(Contact, Vec<f64>)], lambda_share: f64) -> Option<(f64, bool, f64)> {
        let lambda = lambda_share * self.singular_values[0];
        let figures = frames.iter().map(|(contact, volts)| {
            let mut volts = volts.clone();
            (self.taken)(&mut volts, self.electrodes);
            let mut shares = self.readings.tr_mul(&DVector::from_vec(volts));
            let values = shares.iter_mut().zip(&self.singular_values);
            values.for_each(|(share, value)| *share *= value / (value * value + lambda * lambda));
            let image: Vec<f32> = (&self.images * shares).iter().map(|value| *value as f32).collect();
            PaperFigures::of(self.mesh, &image, contact, self.width_m)
        });
        let figures: Vec<PaperFigures> = figures.collect::<Option<_>>()?;
        let middle = figures.get(figures.len() / 2)?;
        let accuracy = figures.iter().map(|one| one.position_accuracy).sum::<f64>() / figures.len() as f64;
        Some((middle.spatial_resolution, middle.is_spread_out, accuracy))
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::PaperSolver;
    use super::super::super::imaging::Images;
    use super::*;
    use std::sync::atomic::AtomicBool;
    use tactomo_physics::readings::Readings;

    #[test]
    fn as_described_it_is_the_studies_own_solver_and_others_differ() {
        let stop = AtomicBool::new(false);
        let choices = of(Progress::new(&stop, &|_| {})).unwrap().unwrap();
        assert_eq!((choices.printed.len(), choices.nearest.len()), (4 * 3 * 6, 4 * 3));
        let own = &choices.printed[0];
        let (detector, press) = pressed(SAMPLE).unwrap();
        let model = Auto::new(&detector, None).unwrap().model;
        let solver = PaperSolver::new(&detector).unwrap();
        let mut images = Images::new(&solver);
        for place in nine_places(&detector) {
            let contact = press.at(place, COMPARED_N);
            let readings: Readings = readings_v(&model.impedance_ohm(&[contact]).unwrap(), &detector);
            images.add(&readings, &contact);
        }
        let expected = images.figures();
        assert!((own.spatial_resolution - expected.spatial_resolution.unwrap()).abs() < 1e-4, "{own:?} {expected:?}");
        assert!((own.position_accuracy - expected.position_accuracy.unwrap()).abs() < 1e-4, "{own:?} {expected:?}");
        // Held down so much that only the readings' projection is left.
        let held = choices.printed.iter().find(|choice| choice.lambda_share > 10.0).unwrap();
        assert!((held.position_accuracy - own.position_accuracy).abs() > 0.01, "{held:?}");
        assert!(choices.best().is_some() && choices.text().contains("sample A"));
    }
}
