//! `tactomo material`: what a foam of one's own is to the touch.

use std::path::{Path, PathBuf};

use anyhow::Context;
use serde::Serialize;
use tactomo::calibrate::force::{Candidate, ForcePress, SkinFit, fit_skin};
use tactomo::detector::{Detector, short};
use tactomo::hertz::{Beyond, Skin, Tip};

use super::calibrate::force::PressArgs;
use super::calibrate::force::gather::{Gathered, gather};
use super::calibrate::force::known::measured;
use super::calibrate::force::report::{ReportedPress, scatter_line, siemens, three};
use super::calibrate::write;
use super::scene::{elasticity, poisson};
use tactomo_cli::options;
use tactomo_cli::output::{self, NewFile, message};

/// Measures what a foam of one's own is to the touch.
///
/// Examples:
///   tactomo material fit scale.tactomo --newtons 0.5,1,2,3,5,4,2.5,1.5,0.7,0.3 --tip 5 --elasticity 0.3
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    Fit(Box<FitArgs>),
}

/// Finds the film on a foam, from presses of known force with a tip of known size.
///
/// FILE is what `calibrate force` takes, a recording of presses on a kitchen scale or a table of
/// readings with a press a row; or it is a table of what was measured already, with columns
/// force_n, conductance_s (with the constriction of the current) and, if they are known,
/// conductance_deviation_s and unloading. A dozen presses from light to firm are good. The result
/// is a table [skin] for the detector's file, by which simulated presses in newtons conduct as
/// the foam does.
///
/// Examples:
///   tactomo material fit scale.tactomo --newtons 0.5,1,2,3,5,4,2.5,1.5,0.7,0.3 --tip 5 --elasticity 0.3
///   tactomo material fit forces.csv --detector my.toml --tip 2.5 --flat --out my-foam.toml
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
struct FitArgs {
    #[command(flatten)]
    presses: PressArgs,
    /// Radius of the tip (mm)
    #[arg(long, value_name = "MM", value_parser = options::tip())]
    tip: f64,
    /// The tip is flat, not a ball
    #[arg(long)]
    flat: bool,
    /// Young's modulus of the detector (MPa) [default: that of its foams or of its file]
    #[arg(long, value_name = "MPA", value_parser = elasticity())]
    elasticity: Option<f64>,
    /// Poisson's ratio of the detector [default: that of its file, or 0.3]
    #[arg(long, value_name = "RATIO", value_parser = poisson())]
    poisson: Option<f64>,
    /// Writes the detector with this skin; a file that exists is not replaced
    #[arg(long, value_name = "FILE.toml")]
    out: Option<PathBuf>,
    /// Prints `{detector, out?, skin, film_unit_pa, film_unit_deviation_pa, follows_law, exponent, own_exponent, scatter, hysteresis, presses, ...}` as JSON
    #[arg(long)]
    json: bool,
}

/// Does what is asked.
pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.action {
        Action::Fit(args) => fit(args),
    }
}

fn fit(args: &FitArgs) -> anyhow::Result<()> {
    let out = args.out.as_deref().map(|path| Ok::<_, anyhow::Error>((path, NewFile::new(path)?))).transpose()?;
    let Gathered { detector, presses } = args.gathered()?;
    let own: Vec<ForcePress> = presses.iter().map(|press| press.press).collect();
    let fit = fit_skin(&own, args.tip(), &detector, args.skin(&detector)?)
        .with_context(|| args.presses.file.display().to_string())?;
    let detector = Detector { skin: Some(fit.skin), ..detector };
    let path = out.as_ref().map(|(path, _)| *path);
    let report = Report::of(&detector.name, path, &presses, &fit);
    message!("{}", report.table());
    if let Some((path, out)) = out {
        write(&detector, path, out)?;
        message!("wrote {}: {} with this skin", path.display(), detector.name);
    }
    output::print(&if args.json { serde_json::to_string(&report)? } else { fit.skin.to_toml() })?;
    Ok(())
}

impl FitArgs {
    fn gathered(&self) -> anyhow::Result<Gathered> {
        if let Some(known) = self.presses.known()? {
            return gather(&self.presses, &known);
        }
        let row = |(index, press)| ReportedPress { press, place: format!("row {}", index + 1) };
        let presses = measured(&self.presses.file)?.into_iter().enumerate().map(row).collect();
        Ok(Gathered { detector: self.presses.detector.get()?, presses })
    }

    fn tip(&self) -> Tip {
        let radius_m = self.tip * 1e-3;
        if self.flat { Tip::Flat { radius_m } } else { Tip::Ball { radius_m } }
    }

    fn skin(&self, detector: &Detector) -> anyhow::Result<Skin> {
        let skin = self.elasticity.map(|mpa| Skin::of(mpa * 1e6)).or(detector.skin);
        let skin = skin.with_context(|| {
            format!(
                "presses of one tip do not tell how soft {} is: give --elasticity. A piece of the foam that a flat weight of F newtons on A square metres \
                 presses from its thickness t to t - d has F t / (A d) pascals",
                detector.name
            )
        })?;
        Ok(Skin { poisson: self.poisson.unwrap_or(skin.poisson), ..skin })
    }
}

/// The result.
#[derive(Serialize)]
struct Report<'a> {
    detector: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    out: Option<String>,
    skin: Skin,
    film_unit_pa: f64,
    film_unit_deviation_pa: f64,
    /// Over what the conductivity makes of it; `null` where the presses do not tell it.
    constriction: Option<f64>,
    constriction_deviation: Option<f64>,
    /// Whether the presses' own exponent is the law's, at 95 % confidence.
    follows_law: bool,
    exponent: f64,
    own_exponent: f64,
    own_exponent_deviation: f64,
    range_n: [f64; 2],
    beyond_hertz: Option<Beyond>,
    /// Standard deviation of the logarithm of the conductance about the law.
    scatter: f64,
    /// Half the width between loading and unloading, of the logarithm of the conductance.
    hysteresis: f64,
    /// Presses that do not agree with the others, by their number from 1.
    left_out: Vec<usize>,
    presses: Vec<Row<'a>>,
    candidates: &'a [Candidate],
}

#[derive(Serialize)]
struct Row<'a> {
    place: &'a str,
    force_n: f64,
    conductance_with_constriction_s: f64,
    sigma_conductance_with_constriction_s: f64,
    /// By the law.
    fitted_conductance_s: f64,
}

impl<'a> Report<'a> {
    fn of(detector: &'a str, out: Option<&Path>, presses: &'a [ReportedPress], fit: &'a SkinFit) -> Self {
        let row = |(reported, fitted_s): (&'a ReportedPress, &f64)| Row {
            place: &reported.place,
            force_n: reported.press.force_n,
            conductance_with_constriction_s: reported.press.conductance_s,
            sigma_conductance_with_constriction_s: reported.press.deviation_s,
            fitted_conductance_s: *fitted_s,
        };
        let [own_exponent, own_exponent_deviation] = fit.own_exponent;
        Self {
            detector,
            out: out.map(|path| path.display().to_string()),
            skin: fit.skin,
            film_unit_pa: fit.unit_pa,
            film_unit_deviation_pa: fit.unit_deviation_pa,
            constriction: fit.constriction.map(|[factor, _]| factor),
            constriction_deviation: fit.constriction.map(|[_, deviation]| deviation),
            follows_law: fit.follows_law(),
            exponent: fit.exponent,
            own_exponent,
            own_exponent_deviation,
            range_n: fit.range_n,
            beyond_hertz: fit.beyond,
            scatter: fit.scatter,
            hysteresis: fit.hysteresis,
            left_out: fit.left_out.iter().map(|press| press + 1).collect(),
            presses: presses.iter().zip(&fit.fitted_s).map(row).collect(),
            candidates: &fit.candidates,
        }
    }

    /// For people.
    fn table(&self) -> String {
        let head = format!("{:>5}  {:<16} {:>9}  {:>21}  {:>12}", "press", "where", "N", "G (S)", "by the law");
        let rows = self.presses.iter().zip(1..).map(|(row, number)| {
            let odd = if self.left_out.contains(&number) { "  left out: does not agree with the others" } else { "" };
            let measured = siemens(row.conductance_with_constriction_s, row.sigma_conductance_with_constriction_s);
            let (place, force) = (row.place, short(row.force_n));
            format!("{number:>5}  {place:<16} {force:>9}  {measured:>21}  {:>12.3e}{odd}", row.fitted_conductance_s)
        });
        let kilopascals = [self.film_unit_pa, self.film_unit_deviation_pa].map(|pa| three(pa * 1e-3));
        let constriction = match self.constriction.zip(self.constriction_deviation) {
            Some((factor, deviation)) => {
                format!("{} \u{b1} {} of what the conductivity makes of it", three(factor), three(deviation))
            }
            None => "not determined: the film hides it".to_owned(),
        };
        let lines = [
            format!(
                "film: 1 S/m2 at {} \u{b1} {} kPa, on a foam of {} MPa",
                kilopascals[0],
                kilopascals[1],
                short(self.skin.young_pa * 1e-6)
            ),
            scatter_line(self.scatter, self.hysteresis),
            format!(
                "  exponent              {} of the law, {} \u{b1} {} of the presses alone",
                three(self.exponent),
                three(self.own_exponent),
                three(self.own_exponent_deviation)
            ),
            format!("  constriction          {constriction}"),
        ];
        let warnings = self.warnings();
        std::iter::once(head).chain(rows).chain(lines).chain(warnings).collect::<Vec<_>>().join("\n")
    }

    fn warnings(&self) -> impl Iterator<Item = String> {
        let other = (!self.follows_law).then(|| {
            "warning: the presses do not follow the law of a film: is the tip a ball or flat as said, and of that size where it touches? Else the surface is \
             another one, and newtons are told by `tactomo calibrate force` alone, whose exponent is free"
                .to_owned()
        });
        let beyond =
            self.beyond_hertz.map(|beyond| format!("warning: the firmest press is beyond Hertz's theory: {beyond}"));
        other.into_iter().chain(beyond)
    }
}
