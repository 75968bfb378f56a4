//! What the report shows.

use super::spectrum::AVERAGED;
use super::{DetectorReport, Report, Spectrum};
use crate::view::{Axis, Chart, Figures, Format, Mark, PLAIN, Series, TEXT, Table, Unit, Value, View, same_axis};

/// Charts end at this share of the noise.
const LEAST: f64 = 0.05;
/// Length of an axis, over the last number: what is behind that is for the word at the line.
const ROOM: f64 = 1.12;
const MILLIVOLTS: Format = Format { unit: "mV", si: "v", factor: 1e3, digits: Some(2) };

/// Two charts for each detector, and their numbers.
pub fn view(report: &Report) -> View {
    let lead = "The readings of a press are a sum of patterns, the strongest first. Patterns **above the dotted line tell something** of what touches; \
                what is below it is noise, from which no solver can make an image.";
    let caption = "Dots that follow the line are signal (the discrete Picard condition); where they stay at 1, whatever the line does, they are noise. Where nothing \
                   else touches there are as many patterns as electrodes, however low the noise. A firm press (0.3 sheet conductances) gives the readings of a \
                   light one (0.03) beside it more patterns, but weak ones.";
    let legend = vec![
        ("contacts", "singular values: coefficient of a light press, in the mean over all places".to_owned()),
        ("collapsed", format!("coefficients of {} presses, simulated with noise", report.presses)),
    ];
    let mut charts: Vec<Chart> = report.detectors.iter().flat_map(charts).collect();
    same_axis(&mut charts, 1);
    let view = View::new("How many unknowns the readings tell", lead)
        .with(Figures { legend, ..Figures::of(caption, charts) })
        .with(numbers(report));
    View { method: method(report), ..view }
}

fn states(of: &DetectorReport) -> [(&'static str, &Spectrum); 2] {
    [("light presses alone", &of.alone), ("light presses beside a firm one", &of.beside_firm)]
}

fn charts(of: &DetectorReport) -> [Chart; 2] {
    let shown = |spectrum: &Spectrum| spectrum.singular_values.iter().take_while(|value| **value > LEAST).count();
    // Both have the same axis, that of the longer one.
    let last = states(of).map(|(_, spectrum)| shown(spectrum)).into_iter().max().unwrap_or(0) as f64;
    states(of).map(|(state, spectrum)| {
        let count = shown(spectrum);
        let numbered = |values: &[f64]| {
            values.iter().take(count).enumerate().map(|(i, value)| (i as f64 + 1.0, *value)).collect::<Vec<_>>()
        };
        let presses = spectrum.coefficients.iter().flat_map(|one| numbered(one));
        let dots = Series::dots("", "collapsed", presses.map(Mark::from)).unlabelled();
        let line = Series::line("", "contacts", numbered(&spectrum.singular_values)).undotted();
        let subtitle = format!(
            "times the noise of a frame, {} mV · {} of {} singular values above it",
            MILLIVOLTS.text(Some(of.noise_v)),
            spectrum.above_noise,
            spectrum.singular_values.len()
        );
        let axes = [
            Axis::linear("number of the singular value", Unit::Plain).within([0.0, ROOM * last]),
            Axis::log("", Unit::Plain).floor(LEAST),
        ];
        Chart {
            level: Some((1.0, "noise".to_owned())),
            guide: Some((of.electrodes as f64 + 0.5, format!("{} electrodes", of.electrodes))),
            ..Chart::new(format!("{}: {state}", of.detector), subtitle, axes, [dots, line]).sized([620.0, 360.0])
        }
    })
}

fn numbers(report: &Report) -> Table {
    let rows = report.detectors.iter().flat_map(|of| states(of).map(|(state, spectrum)| (of, state, spectrum)));
    type Row<'a> = (&'a DetectorReport, &'static str, &'a Spectrum);
    let count = |value: fn(&Spectrum) -> usize| move |(_, _, spectrum): &Row| value(spectrum);
    let whole = PLAIN.digits(0);
    Table::of("", rows)
        .group("detector", |(of, ..)| {
            format!("{}: {} electrodes, {} independent numbers in a frame", of.detector, of.electrodes, of.independent)
        })
        .column("", TEXT, |(_, state, _)| *state)
        .column("singular values", whole, count(|spectrum| spectrum.singular_values.len()))
        .column("above the noise", whole, count(|spectrum| spectrum.above_noise))
        .column(format!("above that of {AVERAGED} frames' mean"), whole, count(|spectrum| spectrum.above_averaged))
        .column("coefficients told", whole, count(|spectrum| spectrum.told))
        .column("largest", PLAIN, |(.., spectrum)| Value::from(spectrum.singular_values.first().copied()))
        .column("outside", PLAIN.digits(2), |(.., spectrum)| spectrum.outside)
        .detail("noise", MILLIVOLTS, |(of, ..)| of.noise_v)
        .note(
            "coefficients told: of these presses, those with as much signal as noise or more (root mean square over presses); largest: the first \
             singular value over the noise; outside: what no image gives of a reading, over the noise: 1 is noise alone.",
        )
        .data()
        .into()
}

fn method(report: &Report) -> String {
    format!(
        "{} light presses of 0.03 sheet conductances at random places on each detector, seed {}. Readings are simulated on a finer model than the one that is \
         linearised, with the converter's noise and steps, less the mean of 32 frames before the press. Images are measured by the integral of their \
         square. The firm press has 0.3 sheet conductances; light ones are half a mean distance of electrodes from it at least.",
        report.presses, report.seed
    )
}
