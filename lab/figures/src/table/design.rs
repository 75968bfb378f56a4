//! Which detector: docs/design.md.

use super::figure;
use crate::figure::Figure;

/// A claim of the paper: its run, what ids call it, how the report says it, and its numbers: of the `solver` or the `sensor`, which one in the
/// sentence, and how far it may move.
type Claim = (&'static str, &'static str, &'static str, &'static [(&'static str, usize, f64)]);

const CLAIMS: &[Claim] = &[
    (
        "materials",
        "claim.several-newtons",
        "about 0.2 S/m suits touch of several newtons",
        &[("solver", 0, 1.0), ("sensor", 3, 0.1)],
    ),
    (
        "materials",
        "claim.top",
        "sensitivity rises with the conductivity of the top",
        &[("solver", 0, 0.02), ("sensor", 0, 0.02)],
    ),
    (
        "materials",
        "claim.poor-bottom",
        "the most sensitive is a conductive top (0.5 S/m) on a poor bottom (0.001 S/m)",
        &[("solver", 0, 1.0), ("solver", 1, 1.0), ("sensor", 0, 0.001), ("sensor", 1, 1.0)],
    ),
    (
        "materials",
        "claim.sharpens",
        "a low conductivity of the bottom sharpens the image",
        &[("solver", 0, 0.02), ("sensor", 0, 0.02)],
    ),
    (
        "materials",
        "claim.maximum-force",
        "the maximum force is largest for high and even conductivity",
        &[("solver", 0, 0.02)],
    ),
    (
        "materials",
        "claim.accuracy-wants",
        "accuracy wants the bottom more conductive than the top",
        &[("solver", 0, 3.0), ("sensor", 0, 3.0)],
    ),
    (
        "materials",
        "claim.accuracy-peaks",
        "accuracy peaks near 1 S/m at the bottom",
        &[("solver", 0, 1.0), ("sensor", 0, 0.01)],
    ),
    ("materials", "claim.no-condition", "no condition is best in all four", &[]),
    (
        "samples",
        "claim.order-sensitivity",
        "the simulation predicts the order of measured sensitivities",
        &[("solver", 0, 0.05), ("sensor", 0, 0.05)],
    ),
    ("samples", "claim.order-force", "... of measured maximum forces", &[("solver", 0, 0.05), ("sensor", 0, 0.05)]),
    (
        "samples",
        "claim.order-resolution",
        "... of measured spatial resolutions",
        &[("solver", 0, 0.05), ("sensor", 0, 0.05)],
    ),
    (
        "samples",
        "claim.order-accuracy",
        "... of measured position accuracies",
        &[("solver", 0, 0.05), ("sensor", 0, 0.05)],
    ),
    ("bonding", "claim.wider-dots", "wider dots lower the error of places", &[("solver", 0, 0.02)]),
    ("bonding", "claim.more-dots", "more dots lower the error of places", &[("solver", 4, 11.0), ("sensor", 4, 11.0)]),
    (
        "bonding",
        "claim.peak-at-5",
        "the error has a local peak near dots of 5 mm",
        &[("sensor", 0, 0.01), ("sensor", 3, 0.01)],
    ),
];

pub(super) fn figures() -> Vec<Figure> {
    [claims(), thickness(), electrodes()].concat()
}

fn claims() -> Vec<Figure> {
    let mut all = Vec::new();
    for (job, id, claim, numbers) in CLAIMS {
        let escaped = claim.replace('/', "%2F");
        all.push(figure(job, *id, format!("whether it holds that {claim}"), format!("claims/claim={escaped}/verdict")));
        for (of, index, spread) in *numbers {
            let says = format!("number {index} in what was found of the {of}: {claim}");
            let path = format!("claims/claim={escaped}/{of}/#{index}");
            all.push(figure(job, format!("{id}.{of}.{index}"), says, path).by(*spread));
        }
    }
    all
}

fn thickness() -> Vec<Figure> {
    let mut all = Vec::new();
    for (thickness, name) in [("0.001", "1-mm"), ("0.016", "16-mm")] {
        let of = |field: &str, says: &str| {
            let path = format!("rows/thickness_m={thickness}/{field}");
            figure("thickness", format!("thickness.{name}.{field}"), format!("{says}, {name}"), path)
        };
        all.push(of("correlation", "correlation of the readings with the thin shell's").by(0.0005));
        all.push(
            of("mean_absolute_error", "mean difference from the thin shell's readings, over the largest")
                .per_cent()
                .by(0.2),
        );
    }
    all
}

fn electrodes() -> Vec<Figure> {
    let of = |id: &str, group: &str, name: &str, field: &str, says: &str| {
        let path = format!("rows/group={group}&name={name}/{field}");
        figure("electrodes", format!("electrodes.{id}"), format!("{says}: {name}"), path).mm()
    };
    let everywhere = "standard error of a firm contact's place over the whole surface";
    let points = "two points told apart";
    vec![
        of("pitch-15.place", "pitch", "15.0 mm", "place_everywhere_m", everywhere).by(0.005),
        of("pitch-18.place", "pitch", "18.0 mm", "place_everywhere_m", everywhere).by(0.002),
        of("ring.place", "pattern", "ring of 16", "place_everywhere_m", everywhere).by(0.002),
        of("pitch-7.5.points", "pitch", "7.5 mm", "limit/two_points_m", points).by(0.1),
        of("ring.points", "pattern", "ring of 16", "limit/two_points_m", points).by(0.1),
    ]
}
