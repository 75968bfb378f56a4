//! How the solver `network` does on detectors as built that it never saw: `cargo run --release --package tactomo --example network -- [DETECTORS [SEED [SOLVER...]]]`.
//!
//! Draws so many detectors (20) from the tolerances of `square-60`, from a seed (1000) on, of which training uses none. On each: scenes of every kind, of
//! whole frames, of the four grounds of `--scan four`, of four grounds and four electrodes, and of a converter with an ESP32's floor; then
//! faults that no scene explains. Prints mean position error of single contacts, share of right counts, correlation of images of five fingers
//! and of other shapes with the truth, and how often answers are flagged as a misfit.

use std::error::Error;

use tactomo::detector::Detector;
use tactomo::readings::{Range, Readings};
use tactomo::scene::Contact;
use tactomo::simulate::Fault;
use tactomo::solve::{Method, Solver};
use tactomo::study::{Experiment, Frame, Group, SceneKind, Score, Scorer, StudyError};

/// Lowest code of the ESP32's ADC1 (V).
const FLOOR_V: f64 = 0.142;
/// A firm press while the baseline is taken, and the press that is then read.
const LOADED: Contact = Contact::flat(-0.012, 0.009, 0.002, 4e-4);

/// What is left of a frame.
const VIEWS: [(&str, View); 4] = [
    ("whole", |_, _, _| true),
    ("four grounds", |n, g, _| g.is_multiple_of(n / 4 + 1)),
    ("four grounds, four electrodes", |_, g, e| [1, 7, 8, 14].contains(&g) && [2, 4, 11, 13].contains(&e)),
    ("floor of 142 mV", |_, _, _| true),
];
type View = fn(usize, usize, usize) -> bool;

const FAULTS: [&str; 6] = ["open:5", "open:0", "short:5,6", "swap:5,10", "swap:0,1", "invert:6"];

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |index: usize, default: u64| words.get(index).map_or(Ok(default), |word| word.parse::<u64>());
    let (detectors, seed) = (number(0, 20)?, number(1, 1000)?);
    let methods = match words.get(2..) {
        Some(names) if !names.is_empty() => {
            names.iter().map(|name| name.parse()).collect::<Result<Vec<Method>, _>>()?
        }
        _ => vec![Method::Network, Method::Tikhonov],
    };
    let nominal = Experiment::new(&Detector::default())?;
    let experiments = (seed..seed + detectors)
        .map(|seed| Ok((seed, nominal.as_built(seed)?)))
        .collect::<Result<Vec<_>, StudyError>>()?;
    for method in methods {
        for (index, (title, view)) in VIEWS.iter().enumerate() {
            let mut scores = Vec::new();
            for (seed, experiment) in &experiments {
                scores.extend(scenes(experiment, method, *seed, |frame| seen(frame, *view, index == 3))?);
            }
            println!("{} on {title}: {}", method.name(), line(&scores));
        }
        println!("{} flags as misfit: {}", method.name(), flagged(&experiments, method)?);
    }
    Ok(())
}

/// Every kind of scene at one place of it.
fn scenes(
    experiment: &Experiment,
    method: Method,
    seed: u64,
    seen: impl Fn(Readings) -> Readings,
) -> Result<Vec<(SceneKind, Score)>, Box<dyn Error>> {
    let mut scorer = Scorer::new(experiment);
    let mut solver = method.build(&experiment.problem)?;
    let mut scores = Vec::new();
    for kind in SceneKind::ALL {
        let touches = kind.frames(&experiment.detector, seed, 1);
        let frames = experiment.frames(&touches, seed)?.into_iter();
        let frames: Vec<Frame> = frames.map(|frame| Frame { readings: seen(frame.readings), ..frame }).collect();
        scores.extend(scorer.run(&mut *solver, &frames)?.into_iter().map(|score| (kind, score)));
    }
    Ok(scores)
}

fn seen(readings: Readings, view: View, has_floor: bool) -> Readings {
    let n = readings.electrodes();
    let floored = if has_floor {
        readings.within(&vec![Range { floor_v: FLOOR_V, ceiling_v: f64::INFINITY }; n])
    } else {
        readings
    };
    floored.hiding(|g, e| !view(n, g, e))
}

fn line(scores: &[(SceneKind, Score)]) -> String {
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let of = |is: &dyn Fn(SceneKind) -> bool, value: &dyn Fn(&Score) -> Option<f64>| {
        mean(scores.iter().filter(|(kind, _)| is(*kind)).filter_map(|(_, score)| value(score)).collect())
    };
    let is_one = |kind: SceneKind| kind.group() == Group::One;
    let right = |score: &Score| Some(f64::from(u8::from(score.missed == Some(0) && score.invented == Some(0))));
    format!(
        "one contact {:.2} mm, count right {:.2}, several {:.2} mm, count right {:.2}; correlation five fingers {:.2}, wide {:.2}, ring {:.2}, \
         line {:.2}; misfit {:.3}",
        1e3 * of(&is_one, &|score| score.position_error_m),
        of(&is_one, &right),
        1e3 * of(&|kind| kind.group() == Group::Several, &|score| score.position_error_m),
        of(&|kind| kind.group() == Group::Several, &right),
        of(&|kind| kind == SceneKind::FiveFingers, &|score| score.image.correlation),
        of(&|kind| kind == SceneKind::Wide, &|score| score.image.correlation),
        of(&|kind| kind == SceneKind::Ring, &|score| score.image.correlation),
        of(&|kind| kind == SceneKind::Line, &|score| score.image.correlation),
        of(&|_| true, &|score| Some(f64::from(u8::from(score.flags.misfit)))),
    )
}

/// How often what no scene explains is flagged.
fn flagged(experiments: &[(u64, Experiment)], method: Method) -> Result<String, Box<dyn Error>> {
    let mut shares = Vec::new();
    for fault in FAULTS {
        let fault: Fault = fault.parse()?;
        let share = share(experiments, method, |experiment, seed| experiment.with_faults(&[fault], seed))?;
        shares.push(format!("{fault} {share:.2}"));
    }
    let loaded = share(experiments, method, |experiment, _| experiment.with_baseline(&[LOADED]))?;
    shares.push(format!("baseline under load {loaded:.2}"));
    let mut random = fastrand::Rng::with_seed(1);
    let mut flags = Vec::new();
    let mut solver = method.build(&experiments[0].1.problem)?;
    for _ in 0..experiments.len() {
        flags.push(solver.solve(&Readings::from_fn(16, |_, _| random.f64()))?.flags.misfit);
    }
    shares.push(format!("noise {:.2}", flags.iter().filter(|is| **is).count() as f64 / flags.len() as f64));
    Ok(shares.join(", "))
}

/// Share of single firm and hard presses on experiments so changed that are flagged.
fn share(
    experiments: &[(u64, Experiment)],
    method: Method,
    changed: impl Fn(&Experiment, u64) -> Result<Experiment, StudyError>,
) -> Result<f64, Box<dyn Error>> {
    let mut flags = Vec::new();
    for (seed, experiment) in experiments {
        let mut solver: Box<dyn Solver> = method.build(&experiment.problem)?;
        let changed = changed(experiment, *seed)?;
        for kind in [SceneKind::Firm, SceneKind::Hard] {
            for frame in changed.frames(&kind.frames(&experiment.detector, *seed, 1), *seed)? {
                flags.push(solver.solve(&frame.readings)?.flags.misfit);
            }
        }
    }
    Ok(flags.iter().filter(|is| **is).count() as f64 / flags.len().max(1) as f64)
}
