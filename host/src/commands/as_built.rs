//! The argument that says what is true of a simulated detector, and the one place that decides it: models that are simulated get what
//! [`AsBuiltArgs::of`] gives, solvers the description.

use std::borrow::Cow;

use anyhow::ensure;
use tactomo::detector::{Chosen, Detector};
use tactomo::simulate;

/// Whether the simulated detector is the one described.
#[derive(Clone, Debug, clap::Args)]
pub struct AsBuiltArgs {
    /// Simulates the detector as it was built: drawn with this seed from the tolerances around its description, which is all that
    /// solvers know; or the one in a file, such as `detector show --as-built SEED` prints
    #[arg(long, value_name = "SEED|FILE", value_parser = as_built)]
    as_built: Option<AsBuilt>,
}

/// A detector as it was built.
#[derive(Clone, Debug)]
pub enum AsBuilt {
    /// Drawn from the tolerances.
    Seed(u64),
    /// Told.
    Told(Chosen),
}

impl AsBuiltArgs {
    /// Name of the argument.
    pub const NAME: &str = "as_built";

    /// The detector as it is in truth: the one described, unless another one is asked for.
    pub fn of<'a>(&self, described: &'a Detector) -> anyhow::Result<Cow<'a, Detector>> {
        match &self.as_built {
            None => Ok(Cow::Borrowed(described)),
            Some(AsBuilt::Seed(seed)) => Ok(Cow::Owned(simulate::try_drawn(described, *seed)?)),
            Some(AsBuilt::Told(chosen)) => told(described, chosen).map(Cow::Owned),
        }
    }

    /// Whether it is asked for.
    pub fn is_given(&self) -> bool {
        self.as_built.is_some()
    }
}

fn told(described: &Detector, chosen: &Chosen) -> anyhow::Result<Detector> {
    let built = chosen.get()?;
    let (theirs, ours) = (built.electrodes.len(), described.electrodes.len());
    ensure!(
        theirs == ours && built.surface.is_some() == described.surface.is_some(),
        "{} is another detector than {}: as built it has the same {ours} electrodes, not {theirs}, and is flat or curved as that is",
        built.name,
        described.name
    );
    Ok(built)
}

/// A seed, or a detector.
fn as_built(text: &str) -> Result<AsBuilt, String> {
    match text.parse() {
        Ok(seed) => Ok(AsBuilt::Seed(seed)),
        Err(_) => text.parse().map(AsBuilt::Told).map_err(|error| format!("a seed, or a detector: {error}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo::detector::{Calibration, Tolerances};

    fn of(text: &str, described: &Detector) -> anyhow::Result<Detector> {
        let as_built = Some(as_built(text).map_err(anyhow::Error::msg)?);
        AsBuiltArgs { as_built }.of(described).map(Cow::into_owned)
    }

    #[test]
    fn without_the_argument_the_description_is_the_truth() -> anyhow::Result<()> {
        let described = Detector::default();
        assert_eq!(*AsBuiltArgs { as_built: None }.of(&described)?, described);
        assert_eq!(of("7", &described)?, simulate::drawn(&described, 7));
        assert_eq!(of("square-60", &described)?, described);
        Ok(())
    }

    #[test]
    fn what_cannot_be_drawn_or_is_another_detector_says_why() {
        let error = |text: &str, described: &Detector| {
            of(text, described).map_or_else(|error| format!("{error:#}"), |built| panic!("{}", built.name))
        };
        let square = Detector::default();
        let exact = Detector { tolerances: Tolerances::EXACT, ..square.clone() };
        assert!(error("7", &exact).contains("nothing to draw"));
        let calibrated = Detector { calibration: Some(Calibration::default()), ..square.clone() };
        assert!(error("7", &calibrated).contains("--as-built FILE"));
        let wide = Tolerances { gain_share: 1.0, ..Tolerances::default() };
        let wide = error("7", &Detector { tolerances: wide, ..square.clone() });
        assert!(wide.contains("narrow its [tolerances]") && wide.contains("electrodes.gains["), "{wide}");
        assert!(error("display-140x70", &square).contains("the same 16 electrodes, not 32"));
        assert!(error("-7", &square).contains("a seed, or a detector: there is no preset"));
    }
}
