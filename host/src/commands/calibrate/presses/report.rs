//! What was found, for people and as JSON.

use std::path::Path;

use serde::Serialize;
use tactomo::calibrate::known::{Corrected, Evidence, Progress};

use super::gather::{Gathered, Skipped};

/// The result.
#[derive(Serialize)]
pub struct Report<'a> {
    detector: &'a str,
    out: String,
    /// Mean distance of the presses from where they are (m): as found.
    before_m: f64,
    /// The median of it (m), which a press in a corner hardly changes.
    before_median_m: f64,
    /// Both if the others correct each of them (m).
    left_out_m: f64,
    left_out_median_m: f64,
    place: Place,
    /// `null` where forces are not known.
    conductance: Option<Conductance>,
    as_presses_come: &'a [Progress],
    /// Presses that the detector's file held already: the first of `presses`.
    kept: usize,
    presses: Vec<Row>,
    skipped: &'a [Skipped],
}

#[derive(Serialize)]
struct Place {
    #[serde(flatten)]
    evidence: Evidence,
    /// Of what is corrected.
    length_m: Option<f64>,
    deviation_m: Option<f64>,
    noise_m: Option<f64>,
}

#[derive(Serialize)]
struct Conductance {
    #[serde(flatten)]
    evidence: Evidence,
    /// Of what is corrected; deviations of the logarithm.
    length_m: Option<f64>,
    deviation: Option<f64>,
    noise: Option<f64>,
}

#[derive(Serialize)]
struct Row {
    /// Where in the file; none of those that the detector's file held.
    place: Option<String>,
    known_m: [f64; 2],
    found_m: [f64; 2],
    before_m: f64,
    left_out_m: f64,
    sigma_left_out_m: f64,
}

impl<'a> Report<'a> {
    /// That of a correction.
    pub fn of(gathered: &'a Gathered, found: &'a Corrected, out: &Path) -> Self {
        let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len().max(1) as f64;
        let names =
            gathered.kept.iter().map(|_| None).chain(gathered.presses.iter().map(|(name, _)| Some(name.clone())));
        let row = |(index, (press, place)): (usize, (_, Option<String>))| {
            let press: tactomo::calibrate::known::KnownPress = press;
            Row {
                place,
                known_m: press.known_m,
                found_m: press.found_m,
                before_m: found.before_m[index],
                left_out_m: found.left_out_m[index],
                sigma_left_out_m: found.left_out_deviations_m[index],
            }
        };
        let correction = found.correction.as_ref();
        let places = correction.and_then(|correction| correction.place.as_ref());
        let conductances = correction.and_then(|correction| correction.conductance.as_ref());
        Self {
            detector: &gathered.detector.name,
            out: out.display().to_string(),
            before_m: mean(&found.before_m),
            before_median_m: median(&found.before_m),
            left_out_m: mean(&found.left_out_m),
            left_out_median_m: median(&found.left_out_m),
            place: Place {
                evidence: found.place,
                length_m: places.map(|errors| errors.length_m),
                deviation_m: places.map(|errors| errors.deviation_m),
                noise_m: places.map(|errors| errors.noise_m),
            },
            conductance: found.conductance.map(|evidence| Conductance {
                evidence,
                length_m: conductances.map(|errors| errors.length_m),
                deviation: conductances.map(|errors| errors.deviation),
                noise: conductances.map(|errors| errors.noise),
            }),
            as_presses_come: &found.progress,
            kept: gathered.kept.len(),
            presses: gathered.all().into_iter().zip(names).enumerate().map(row).collect(),
            skipped: &gathered.skipped,
        }
    }

    /// For people.
    pub fn table(&self) -> String {
        let mut lines = vec![format!("{} presses at known places{}", self.presses.len(), self.kept_words())];
        let off = |[mean_m, median_m]: [f64; 2]| {
            format!("{:.2} mm on average, {:.2} mm in the median", 1e3 * mean_m, 1e3 * median_m)
        };
        lines.push(format!("places as found are off by {}", off([self.before_m, self.before_median_m])));
        lines.push(match (self.place.length_m, self.place.deviation_m) {
            (Some(length_m), Some(deviation_m)) => format!(
                "each corrected by the others: {} (a correction of {:.2} mm that runs over {:.0} mm)",
                off([self.left_out_m, self.left_out_median_m]),
                1e3 * deviation_m,
                1e3 * length_m
            ),
            _ => format!(
                "that is noise as far as so many presses tell (evidence of {} for something smooth): no correction of places",
                evidence(&self.place.evidence)
            ),
        });
        lines.extend(self.conductance.as_ref().map(|found| match (found.length_m, found.deviation) {
            (Some(length_m), Some(deviation)) => format!(
                "conductances are corrected by {:.0} % (one standard deviation) that run over {:.0} mm",
                100.0 * deviation,
                1e3 * length_m
            ),
            _ => format!(
                "conductances follow the law of force everywhere (evidence {}): no correction",
                evidence(&found.evidence)
            ),
        }));
        lines.push(format!("wrote {}", self.out));
        lines.join("\n")
    }

    fn kept_words(&self) -> String {
        match self.kept {
            0 => String::new(),
            kept => format!(", {kept} of them from the detector's file"),
        }
    }
}

fn median(all: &[f64]) -> f64 {
    let mut sorted = all.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or_default()
}

/// Twice the logarithm of how much likelier the presses are with a correction, for people.
fn evidence(of: &Evidence) -> String {
    format!("{:.1} in twice the logarithm", 2.0 * (of.log_evidence_with - of.log_evidence_without))
}
