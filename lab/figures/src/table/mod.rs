//! The figures: what there is, and where it comes from. A page of documents has a file here.

mod calibrate;
mod design;
mod hardware;
mod physics;
mod reference;
mod solvers;

use crate::figure::{Figure, Fold, Spread};

/// All figures, in the order of the documents.
pub fn figures() -> Vec<Figure> {
    [
        reference::figures(),
        physics::figures(),
        solvers::figures(),
        design::figures(),
        calibrate::figures(),
        hardware::figures(),
    ]
    .concat()
}

/// One of a run: its id, what it says, where it stands.
fn figure(job: &'static str, id: impl Into<String>, says: impl Into<String>, path: impl Into<String>) -> Figure {
    Figure {
        id: id.into(),
        says: says.into(),
        unit: "",
        job,
        path: path.into(),
        scale: 1.0,
        fold: Fold::One,
        spread: Spread::By(0.0),
    }
}

impl Figure {
    /// In this unit, which is the report's times `scale`.
    fn unit(self, unit: &'static str, scale: f64) -> Self {
        Self { unit, scale, ..self }
    }

    /// A share, in per cent.
    fn per_cent(self) -> Self {
        self.unit("%", 100.0)
    }

    /// Millimetres.
    fn mm(self) -> Self {
        self.unit("mm", 1e3)
    }

    /// May be off by so much of its unit.
    fn by(self, spread: f64) -> Self {
        Self { spread: Spread::By(spread), ..self }
    }

    /// May be off by this share of itself.
    fn share(self, share: f64) -> Self {
        Self { spread: Spread::Share(share), ..self }
    }

    /// The largest of several.
    fn largest(self) -> Self {
        Self { fold: Fold::Largest, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::JOBS;
    use crate::picture::PICTURES;

    #[test]
    fn ids_are_one_of_a_kind_and_runs_are_there() {
        let figures = figures();
        // A chart may be called as its run is: both are taken together.
        let drawn = PICTURES.iter().filter(|picture| !matches!(picture.how, crate::picture::How::Chart { .. }));
        let own = JOBS.iter().map(|job| job.name).chain(drawn.map(|picture| picture.id()));
        let mut ids: Vec<String> =
            figures.iter().map(|figure| figure.id.clone()).chain(own.map(str::to_owned)).collect();
        let count = ids.len();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), count, "an id is there twice");
        for figure in &figures {
            assert!(JOBS.iter().any(|job| job.name == figure.job), "{} has no run", figure.id);
            assert!(!figure.says.is_empty() && !figure.id.contains([' ', '*']), "{}", figure.id);
        }
    }
}
