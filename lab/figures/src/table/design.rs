//! Which detector: docs/design.md.

use super::figure;
use crate::figure::Figure;

/// A claim of the paper: its run, what ids call it, how the report says it, and its numbers: as the `paper` computes it or of the `sensor`, which
/// one in the sentence, and how far it may move.
type Claim = (&'static str, &'static str, &'static str, &'static [(&'static str, usize, f64)]);

const CLAIMS: &[Claim] = &[
    (
        "materials",
        "claim.several-newtons",
        "about 0.2 S/m suits touch of several newtons",
        &[("sensor", 2, 0.0), ("sensor", 3, 0.1)],
    ),
    (
        "materials",
        "claim.top",
        "sensitivity rises with the conductivity of the top",
        &[("paper", 0, 0.02), ("paper", 1, 0.0), ("sensor", 0, 0.02)],
    ),
    (
        "materials",
        "claim.poor-bottom",
        "the most sensitive is a conductive top (0.5 S/m) on a poor bottom (0.001 S/m)",
        &[("paper", 0, 1.0), ("paper", 1, 1.0), ("sensor", 0, 0.001), ("sensor", 1, 1.0)],
    ),
    (
        "materials",
        "claim.sharpens",
        "a low conductivity of the bottom sharpens the image",
        &[
            ("paper", 1, 0.02),
            ("paper", 2, 0.0),
            ("paper", 3, 0.02),
            ("paper", 4, 0.0),
            ("sensor", 1, 0.02),
            ("sensor", 2, 1.0),
            ("sensor", 3, 0.02),
            ("sensor", 4, 1.0),
        ],
    ),
    (
        "materials",
        "claim.maximum-force",
        "the maximum force is largest for high and even conductivity",
        &[("paper", 0, 0.02)],
    ),
    (
        "materials",
        "claim.accuracy-wants",
        "accuracy wants the bottom more conductive than the top",
        &[
            ("paper", 1, 3.0),
            ("paper", 2, 0.0),
            ("paper", 3, 3.0),
            ("paper", 4, 0.0),
            ("sensor", 1, 3.0),
            ("sensor", 2, 0.0),
        ],
    ),
    (
        "materials",
        "claim.accuracy-peaks",
        "accuracy peaks near 1 S/m at the bottom",
        &[("paper", 1, 1.0), ("paper", 2, 1.0), ("sensor", 1, 0.01), ("sensor", 2, 0.01)],
    ),
    ("materials", "claim.no-condition", "no condition is best in all four", &[]),
    ("thickness", "claim.shell", "readings of thick detectors correlate strongly with those of the thin shell", &[]),
    ("thickness", "claim.thickness", "the error grows with the detector's thickness", &[]),
    (
        "samples",
        "claim.order-sensitivity",
        "the simulation predicts the order of measured sensitivities",
        &[("paper", 0, 0.05), ("paper", 1, 0.0), ("sensor", 0, 0.05), ("sensor", 1, 0.0)],
    ),
    (
        "samples",
        "claim.order-force",
        "... of measured maximum forces",
        &[("paper", 0, 0.05), ("paper", 1, 0.0), ("sensor", 0, 0.05), ("sensor", 1, 0.0), ("sensor", 2, 0.02)],
    ),
    (
        "samples",
        "claim.order-resolution",
        "... of measured spatial resolutions",
        &[("sensor", 0, 0.05), ("sensor", 1, 0.0)],
    ),
    (
        "samples",
        "claim.order-accuracy",
        "... of measured position accuracies",
        &[("paper", 0, 0.05), ("paper", 1, 0.0), ("sensor", 0, 0.05), ("sensor", 1, 0.0)],
    ),
    ("bonding", "claim.wider-dots", "wider dots lower the error of places", &[("paper", 0, 0.05), ("sensor", 0, 0.05)]),
    ("bonding", "claim.more-dots", "more dots lower the error of places", &[("paper", 4, 11.0), ("sensor", 4, 11.0)]),
    (
        "bonding",
        "claim.peak-at-5",
        "the error has a local peak near dots of 5 mm",
        &[("paper", 0, 0.01), ("paper", 3, 0.01), ("sensor", 0, 0.01), ("sensor", 3, 0.01)],
    ),
];

/// What is left open of the paper's solver: what ids call it, and how the report says pads, readings and lambda; the nearest of all if it has none.
const CHOICES: [(&str, [&str; 2], Option<&str>); 7] = [
    ("used", ["as described", "all 256 readings"], Some("conductances of nodes, sheet of 1 S")),
    ("per-area", ["as described", "all 256 readings"], Some("conductances per area (S%2Fm2)")),
    ("triangles", ["as described", "all 256 readings"], Some("conductances of triangles, sheet of 1 S")),
    ("less-mean", ["as described", "each ground less its mean"], Some("conductances of nodes, sheet of 1 S")),
    ("points", ["ideal points", "all 256 readings"], Some("conductances of nodes, sheet of 1 S")),
    (
        "sample-pads",
        ["the sample's on a sheet of 1 S", "all 256 readings"],
        Some("conductances of nodes, sheet of 1 S"),
    ),
    ("nearest", ["ideal", "each ground less its mean"], None),
];

/// Laws of contact: what ids call them, how the report does, and the form of eq. (8).
const LAWS: [(&str, &str, &str); 7] = [
    ("ideal", "ideal", "printed"),
    ("ideal-derived", "ideal", "derived"),
    ("rough-foam", "rough, on the foam", "printed"),
    ("rough-film", "rough, on a film", "printed"),
    ("mesh", "mesh, on a film", "printed"),
    ("cube-foam", "cube, on the foam", "printed"),
    ("film", "cube, on a film", "printed"),
];

pub(super) fn figures() -> Vec<Figure> {
    [claims(), choices(), laws(), thickness(), electrodes()].concat()
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

fn choices() -> Vec<Figure> {
    let middle = "PA of answering the middle";
    let mut all = vec![figure("samples", "accuracy-of-the-middle", middle, "accuracy_of_the_middle").by(0.001)];
    for (id, [pads, rows], lambda) in CHOICES {
        let choice = match lambda {
            Some(lambda) => format!("printed/pads={pads}&rows={rows}&lambda={lambda}"),
            None => format!("nearest/pads={pads}&rows={rows}"),
        };
        for (metric, field) in [("SR", "spatial_resolution"), ("PA", "position_accuracy")] {
            let says = format!(
                "{metric} of the simulated sample A, pads {pads}, {rows}, lambda of {}",
                lambda.unwrap_or("any")
            );
            all.push(
                figure("samples", format!("choices.{id}.{metric}"), says, format!("choices/{choice}/{field}"))
                    .by(0.005),
            );
        }
    }
    let own = "force at which the contact of sample A is at nine tenths of the drive";
    all.push(figure("samples", "sample-A.maximum", own, "samples/0/limit/range/1").unit("N", 1.0).share(0.01));
    all
}

fn laws() -> Vec<Figure> {
    let energy = "energy per volume at which the film of the law of contact conducts 1 S/m2";
    let mut all =
        vec![figure("explain", "law.energy", energy, "chosen/unit_energy_j_per_m3").unit("kJ/m3", 1e-3).by(0.2)];
    for (id, name, eighth) in LAWS {
        let of = |field: &str, says: &str, path: &str| {
            let says = format!("{says}: law of contact {name}, eq. (8) as {eighth}");
            let path = format!("laws/name={name}&eighth={eighth}/fitted/{path}");
            figure("explain", format!("law.{id}.{field}"), says, path)
        };
        all.push(of("sensitivity", "factor that SENS of the stacks is off by", "left/0").share(0.05));
        all.push(of("maximum", "factor that FMAX of the stacks is off by", "left/1").share(0.05));
        all.push(of("order", "rank correlation of SENS with what was measured", "order/0/0").by(0.05));
        all.push(of("order-maximum", "rank correlation of FMAX with what was measured", "order/1/0").by(0.05));
    }
    all
}

fn thickness() -> Vec<Figure> {
    let mut all = Vec::new();
    for mm in [1, 2, 4, 8, 16] {
        let of = |id: &str, field: &str, says: &str| {
            let path = format!("rows/thickness_m={}/{field}", f64::from(mm) / 1e3);
            figure("thickness", format!("thickness.{mm}-mm.{id}"), format!("{says}, {mm} mm"), path)
        };
        all.push(of("correlation", "correlation", "correlation of the readings with the thin shell's").by(0.0005));
        let says = "mean difference from the thin shell's readings, over the largest";
        all.push(of("mean_absolute_error", "mean_absolute_error", says).per_cent().by(0.2));
        for (model, says) in [("shell", "a thin shell"), ("slab", "a slab")] {
            let field = format!("solvers/solver=contacts/on_{model}_m");
            all.push(of(model, &field, &format!("error of `contacts` that inverts {says}")).mm().share(0.2));
        }
    }
    all
}

fn electrodes() -> Vec<Figure> {
    let mut all = Vec::new();
    for (id, group, name) in
        [("pitch-15", "pitch", "15.0 mm"), ("pitch-18", "pitch", "18.0 mm"), ("ring", "pattern", "ring of 16")]
    {
        for (field, says) in [("median", "in the median"), ("p90", "90 % below"), ("rms", "root mean square")] {
            let says = format!("standard error of a firm contact's place over the whole surface, {says}: {name}");
            let path = format!("rows/group={group}&name={name}/everywhere/{field}_m");
            all.push(figure("electrodes", format!("electrodes.{id}.{field}"), says, path).mm().share(0.05));
        }
    }
    for (id, group, name) in [("pitch-7.5", "pitch", "7.5 mm"), ("ring", "pattern", "ring of 16")] {
        let says = format!("two points told apart: {name}");
        let path = format!("rows/group={group}&name={name}/limit/two_points_m");
        all.push(figure("electrodes", format!("electrodes.{id}.points"), says, path).mm().by(0.1));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A claim that is put otherwise there would be found by no run.
    #[test]
    fn claims_are_put_as_the_studies_put_them() {
        let sources = [
            include_str!("../../../design/src/materials/claims.rs"),
            include_str!("../../../design/src/samples/claims.rs"),
            include_str!("../../../design/src/bonding/claims.rs"),
            include_str!("../../../design/src/thickness/mod.rs"),
        ];
        for (job, _, claim, _) in CLAIMS {
            assert!(sources.iter().any(|source| source.contains(&format!("\"{claim}\""))), "{job}: {claim}");
        }
    }
}
